//! `semvs densify`.

use super::{
    agreeing_on_class, cloud_path, conclude, default_cloud, effective, is_typed, outputs, own_folder,
    resolver, spare_workspace, write_page,
};
use crate::cli::listen::Recorder;
use crate::cli::options::FilterKind;
use crate::cli::resolve::{self, Resolver};
use crate::cli::semvs_args::DensifyArgs;
use crate::error::{Error, Result};
use crate::fusion::Support;
use crate::pipeline::{self, DensifyJob, DepthMapsJob};
use crate::stereo::Quality;
use crate::store::paths::is_same_file;
use clap::ArgMatches;
use std::path::PathBuf;
use std::sync::Arc;

/// Runs the command.
pub(crate) fn densify(args: &DensifyArgs, typed: &ArgMatches, recorder: &Arc<Recorder>) -> Result<()> {
    let job = job(args, typed, &resolver(&args.shared, recorder)?)?;
    recorder.heed_interrupts();
    let report = pipeline::densify(&job, resolve::cpu()?, &recorder.progress())?;
    let mut options = effective::options_in_effect::<DensifyArgs>(typed);
    effective::resolve(&mut options, &job.input, &job.outputs, None, Some(&job.filter), &job.fusion);
    let report = conclude(report, "semvs densify", options, recorder, &job.outputs)?;
    let maps =
        (job.depth_maps_only || !job.remove_depth_maps).then(|| DepthMapsJob::Folder(job.depth_maps.clone()));
    write_page(report, &job.input, &job.outputs, maps, &recorder.progress())
}

fn job(args: &DensifyArgs, typed: &ArgMatches, resolver: &Resolver<'_>) -> Result<DensifyJob> {
    let shared = &args.shared;
    let cloud = match &args.output {
        Some(path) => cloud_path(path)?,
        None => default_cloud(&args.scene),
    };
    let scene = cloud.with_extension("mvs");
    if is_same_file(&scene, &args.scene) {
        let what =
            "--output: the scene written beside the cloud would replace the input; choose another name";
        return Err(Error::content(&cloud, what));
    }
    let outputs = outputs(&shared.labels.output, &args.page, cloud, Some(scene))?;
    spare_workspace(&args.scene, &outputs)?;
    let folder = match &shared.run.working_folder {
        Some(folder) => folder.clone(),
        None if args.scene.is_dir() => own_folder(&args.scene),
        None => PathBuf::new(),
    };
    let depth_maps_only = match shared.estimation.fusion_mode {
        0 => false,
        1 => true,
        other => {
            return Err(Error::invalid(format!(
                "--fusion-mode {other}: give 0 (everything) or 1 (depth maps)"
            )));
        }
    };
    let filter = resolver.filter(is_typed(typed, "postprocess-dmaps"), FilterKind::Unbiased)?;
    Ok(DensifyJob {
        input: resolver.scene(args.scene.clone(), folder.clone())?,
        resolution: resolver.resolution()?,
        depth_maps: if folder.as_os_str().is_empty() { PathBuf::from(".") } else { folder },
        force: shared.run.force,
        pictures: false,
        stereo: resolver.stereo(Quality::Normal, &filter)?,
        filter,
        depth_maps_only,
        remove_depth_maps: shared.fusion.remove_dmaps,
        fusion: resolver.fusion(Support::All, agreeing_on_class(typed))?,
        outputs,
    })
}
