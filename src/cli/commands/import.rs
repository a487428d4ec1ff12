//! `semvs import`.

use super::archive_kind;
use crate::cli::exchange_args::ImportArgs;
use crate::error::{Error, Result};
use crate::pipeline::{self, ImportDepthsJob, ImportSceneJob};
use crate::progress::Progress;
use crate::store::colmap::Pass;
use semvs_formats::mvs::{Container, NEWEST_VERSION};

/// Runs the command.
pub(crate) fn import(args: &ImportArgs, progress: &Progress) -> Result<()> {
    let report = match &args.scene {
        Some(scene) => {
            let job = ImportDepthsJob {
                depths: args.input.clone(),
                scene: scene.clone(),
                working_folder: args.working_folder.clone().unwrap_or_default(),
                output: args.output.clone(),
                depth_scale: args.depth_scale,
                normals: args.normals,
            };
            pipeline::import_depths(&job, progress)?
        }
        None => {
            if !args.output.extension().is_some_and(|e| e.eq_ignore_ascii_case("mvs")) {
                let what = "--output: scenes are written as .mvs; end the name so (for a folder of depths give --scene)";
                return Err(Error::content(&args.output, what));
            }
            let job = ImportSceneJob {
                workspace: args.input.clone(),
                images: args.image_path.clone(),
                scene: args.output.clone(),
                container: archive_kind(args.archive)
                    .unwrap_or(Container::Interface { version: NEWEST_VERSION }),
                maps: args.maps.map(Pass::from),
                fused: args.fused,
            };
            pipeline::import_scene(&job, progress)?
        }
    };
    crate::cli::print(&super::with_maps_in_one_row(&report).summary());
    Ok(())
}
