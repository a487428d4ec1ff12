//! `semvs fuse`.

use super::{cloud_path, conclude, default_cloud, is_typed, outputs, resolver};
use crate::cli::listen::Recorder;
use crate::cli::resolve::Resolver;
use crate::cli::semvs_args::FuseArgs;
use crate::error::Result;
use crate::pipeline::{self, FuseJob};
use clap::ArgMatches;
use std::path::PathBuf;
use std::sync::Arc;

/// Runs the command.
pub(crate) fn fuse(args: &FuseArgs, typed: &ArgMatches, recorder: &Arc<Recorder>) -> Result<()> {
    let job = job(args, typed, &resolver(&args.shared, recorder)?)?;
    let report = pipeline::fuse(&job, &recorder.progress())?;
    conclude(report, "semvs fuse", typed, recorder, job.outputs.report.as_deref())
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
    let cloud = args.output.as_deref().map_or_else(|| Ok(default_cloud(&args.scene)), cloud_path)?;
    Ok(FuseJob {
        input: resolver.scene(args.scene.clone(), folder)?,
        resolution: size_is_typed
            .iter()
            .any(|option| is_typed(typed, option))
            .then(|| resolver.resolution())
            .transpose()?,
        depth_maps,
        fusion: resolver.fusion()?,
        outputs: outputs(&shared.labels.output, cloud, None),
    })
}
