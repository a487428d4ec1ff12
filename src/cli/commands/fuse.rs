//! `semvs fuse`.

use super::{
    agreeing_on_class, cloud_path, conclude, default_cloud, effective, is_typed, outputs, resolver,
    spare_workspace, write_page,
};
use crate::cli::listen::Recorder;
use crate::cli::resolve::Resolver;
use crate::cli::semvs_args::FuseArgs;
use crate::error::Result;
use crate::fusion::Support;
use crate::pipeline::{self, DepthMapsJob, FuseJob};
use crate::store::colmap::Pass;
use clap::ArgMatches;
use std::path::PathBuf;
use std::sync::Arc;

/// Runs the command.
pub(crate) fn fuse(args: &FuseArgs, typed: &ArgMatches, recorder: &Arc<Recorder>) -> Result<()> {
    let job = job(args, typed, &resolver(&args.shared, recorder)?)?;
    recorder.heed_interrupts();
    let report = pipeline::fuse(&job, &recorder.progress())?;
    let mut options = effective::options_in_effect::<FuseArgs>(typed);
    let folder = match &job.depth_maps {
        DepthMapsJob::Folder(folder) => Some(folder.as_path()),
        DepthMapsJob::Colmap(_) => None,
    };
    effective::resolve(&mut options, &job.input, &job.outputs, folder, None, &job.fusion);
    let report = conclude(report, "semvs fuse", options, recorder, &job.outputs)?;
    write_page(report, &job.input, &job.outputs, Some(job.depth_maps), &recorder.progress())
}

fn job(args: &FuseArgs, typed: &ArgMatches, resolver: &Resolver<'_>) -> Result<FuseJob> {
    let shared = &args.shared;
    let folder = shared.run.working_folder.clone().unwrap_or_default();
    let size_is_typed = ["resolution-level", "max-resolution", "min-resolution"];
    let cloud = args.output.as_deref().map_or_else(|| Ok(default_cloud(&args.scene)), cloud_path)?;
    let outputs = outputs(&shared.labels.output, &args.page, cloud, None)?;
    spare_workspace(&args.scene, &outputs)?;
    Ok(FuseJob {
        input: resolver.scene(args.scene.clone(), folder)?,
        resolution: size_is_typed
            .iter()
            .any(|option| is_typed(typed, option))
            .then(|| resolver.resolution())
            .transpose()?,
        depth_maps: depth_maps(args),
        fusion: resolver.fusion(Support::All, agreeing_on_class(typed))?,
        outputs,
    })
}

fn depth_maps(args: &FuseArgs) -> DepthMapsJob {
    let pass = args.maps.map(Pass::from);
    match (&args.depth_maps, &args.shared.run.working_folder) {
        (Some(folder), _) => DepthMapsJob::Folder(folder.clone()),
        (None, _) if pass.is_some() => DepthMapsJob::Colmap(pass),
        (None, Some(folder)) if !folder.as_os_str().is_empty() => DepthMapsJob::Folder(folder.clone()),
        (None, _) if args.scene.is_dir() => DepthMapsJob::Colmap(None),
        (None, _) => DepthMapsJob::Folder(PathBuf::from(".")),
    }
}
