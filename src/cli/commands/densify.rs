//! `semvs densify`.

use super::{cloud_path, conclude, default_cloud, is_typed, options_in_effect};
use crate::cli::listen::Recorder;
use crate::cli::options::FilterKind;
use crate::cli::resolve::{self, Resolver};
use crate::cli::semvs_args::DensifyArgs;
use crate::error::{Error, Result};
use crate::pipeline::{self, DensifyJob, Outputs, SceneArchive};
use crate::store::cloud::PlyLayout;
use clap::ArgMatches;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Runs the command.
pub(crate) fn densify(args: &DensifyArgs, typed: &ArgMatches, recorder: &Arc<Recorder>) -> Result<()> {
    let as_typed = |path: &Path| path.to_owned();
    let resolver = Resolver::new(&args.shared, &as_typed)?;
    let progress = recorder.progress();
    resolver.remarks.iter().for_each(|remark| progress.warn(remark.as_str()));
    let job = job(args, typed, &resolver)?;
    let mut report = pipeline::densify(&job, resolve::cpu()?, &progress)?;
    report.program = "semvs densify".to_owned();
    report.version = env!("CARGO_PKG_VERSION").to_owned();
    report.options = options_in_effect(typed);
    report.warnings = recorder.warnings();
    conclude(&report, job.outputs.report.as_deref())
}

fn job(args: &DensifyArgs, typed: &ArgMatches, resolver: &Resolver<'_>) -> Result<DensifyJob> {
    let shared = &args.shared;
    let cloud = match &args.output {
        Some(path) => cloud_path(path)?,
        None => default_cloud(&args.scene),
    };
    let scene = cloud.with_extension("mvs");
    if same_file(&scene, &args.scene) {
        let what =
            "--output: the scene written beside the cloud would replace the input; choose another name";
        return Err(Error::content(&cloud, what));
    }
    let folder = shared.run.working_folder.clone().unwrap_or_default();
    let depth_maps_only = match shared.estimation.fusion_mode {
        0 => false,
        1 => true,
        other => {
            return Err(Error::invalid(format!(
                "--fusion-mode {other}: give 0 (everything) or 1 (depth maps)"
            )));
        }
    };
    Ok(DensifyJob {
        input: resolver.scene(args.scene.clone(), folder.clone())?,
        resolution: resolver.resolution()?,
        depth_maps: if folder.as_os_str().is_empty() { PathBuf::from(".") } else { folder },
        stereo: resolver.stereo()?,
        filter: resolver.filter(is_typed(typed, "postprocess-dmaps"), FilterKind::Unbiased)?,
        depth_maps_only,
        remove_depth_maps: shared.fusion.remove_dmaps,
        fusion: resolver.fusion()?,
        outputs: Outputs {
            cloud,
            scene: Some(scene),
            archive: SceneArchive::Interface,
            layout: resolve::layout(&shared.labels.output, PlyLayout::Plain),
            split_by_class: shared.labels.output.split_by_class,
            color_by_label: shared.labels.output.color_by_label,
            report: shared.labels.output.report.clone(),
            sparse_cloud: false,
        },
    })
}

fn same_file(a: &Path, b: &Path) -> bool {
    a == b || matches!((a.canonicalize(), b.canonicalize()), (Ok(a), Ok(b)) if a == b)
}
