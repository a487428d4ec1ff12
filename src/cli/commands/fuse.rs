//! `semvs fuse`.

use super::{cloud_path, conclude, default_cloud, is_typed, options_in_effect};
use crate::cli::listen::Recorder;
use crate::cli::resolve::{self, Resolver};
use crate::cli::semvs_args::FuseArgs;
use crate::error::Result;
use crate::pipeline::{self, FuseJob, Outputs, SceneArchive};
use crate::store::cloud::PlyLayout;
use clap::ArgMatches;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Runs the command.
pub(crate) fn fuse(args: &FuseArgs, typed: &ArgMatches, recorder: &Arc<Recorder>) -> Result<()> {
    let as_typed = |path: &Path| path.to_owned();
    let resolver = Resolver::new(&args.shared, &as_typed)?;
    let progress = recorder.progress();
    resolver.remarks.iter().for_each(|remark| progress.warn(remark.as_str()));
    let job = job(args, typed, &resolver)?;
    let mut report = pipeline::fuse(&job, &progress)?;
    report.program = "semvs fuse".to_owned();
    report.version = env!("CARGO_PKG_VERSION").to_owned();
    report.options = options_in_effect(typed);
    report.warnings = recorder.warnings();
    conclude(&report, job.outputs.report.as_deref())
}

fn job(args: &FuseArgs, typed: &ArgMatches, resolver: &Resolver<'_>) -> Result<FuseJob> {
    let shared = &args.shared;
    let folder = shared.run.working_folder.clone().unwrap_or_default();
    let size_is_typed = ["resolution-level", "max-resolution", "min-resolution"];
    let depth_maps = match &args.depth_maps {
        Some(folder) => folder.clone(),
        None if folder.as_os_str().is_empty() => PathBuf::from("."),
        None => folder.clone(),
    };
    Ok(FuseJob {
        input: resolver.scene(args.scene.clone(), folder)?,
        resolution: size_is_typed
            .iter()
            .any(|option| is_typed(typed, option))
            .then(|| resolver.resolution())
            .transpose()?,
        depth_maps,
        fusion: resolver.fusion()?,
        outputs: Outputs {
            cloud: args.output.as_deref().map_or_else(|| Ok(default_cloud(&args.scene)), cloud_path)?,
            scene: None,
            archive: SceneArchive::Interface,
            layout: resolve::layout(&shared.labels.output, PlyLayout::Plain),
            split_by_class: shared.labels.output.split_by_class,
            color_by_label: shared.labels.output.color_by_label,
            report: shared.labels.output.report.clone(),
            sparse_cloud: false,
        },
    })
}
