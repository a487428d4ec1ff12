//! `semvs export`.

use super::archive_kind;
use crate::cli::exchange_args::{ExportArgs, ExportKind, Plane};
use crate::error::{Error, Result};
use crate::pipeline::{self, ExportColmapJob, ExportRastersJob, ExportSceneJob, Planes, SceneExport};
use crate::progress::Progress;
use crate::report::RunReport;
use crate::store::rasters::RasterFormat;
use semvs_formats::colmap::Encoding;
use std::path::PathBuf;

/// Runs the command.
pub(crate) fn export(args: &ExportArgs, progress: &Progress) -> Result<()> {
    refuse_idle_options(args)?;
    let report = match args.to {
        ExportKind::Mvs => export_scene(args, SceneExport::Archive(archive_kind(args.archive)), progress),
        ExportKind::Roi => export_scene(args, SceneExport::Roi, progress),
        ExportKind::Neighbors => export_scene(args, SceneExport::Neighbors, progress),
        ExportKind::Colmap => export_colmap(args, progress),
        ExportKind::Pfm => export_rasters(args, RasterFormat::Pfm, progress),
        ExportKind::Npy => export_rasters(args, RasterFormat::Npy, progress),
        ExportKind::Png => export_rasters(args, RasterFormat::Png, progress),
    }?;
    crate::cli::print(&report.summary());
    Ok(())
}

/// Refuses options that would have no effect on what is written.
fn refuse_idle_options(args: &ExportArgs) -> Result<()> {
    let is_colmap = args.to == ExportKind::Colmap;
    let has_archive = args.archive.mvs_version.is_some() || args.archive.archive_type.is_some();
    let idle = [
        (has_archive && args.to != ExportKind::Mvs, "--mvs-version and --archive-type go with --to mvs"),
        (args.text && !is_colmap, "--text goes with --to colmap"),
        (args.depth_maps.is_some() && !is_colmap, "--depth-maps goes with --to colmap"),
        (args.pointcloud_file.is_some() && !is_colmap, "--pointcloud-file goes with --to colmap"),
        (args.copy_images && !is_colmap, "--copy-images goes with --to colmap"),
    ];
    idle.iter().find(|(is_idle, _)| *is_idle).map_or(Ok(()), |(_, what)| Err(Error::invalid(*what)))
}

/// The one scene that is given.
fn scene(args: &ExportArgs) -> Result<PathBuf> {
    match args.inputs.as_slice() {
        [scene] => Ok(scene.clone()),
        _ => Err(Error::invalid("give one scene; --to pfm, npy and png take many depth maps")),
    }
}

fn export_scene(args: &ExportArgs, kind: SceneExport, progress: &Progress) -> Result<RunReport> {
    let job = ExportSceneJob {
        scene: scene(args)?,
        working_folder: args.working_folder.clone().unwrap_or_default(),
        output: args.output.clone(),
        kind,
    };
    pipeline::export_scene(&job, progress)
}

fn export_colmap(args: &ExportArgs, progress: &Progress) -> Result<RunReport> {
    let job = ExportColmapJob {
        scene: scene(args)?,
        working_folder: args.working_folder.clone().unwrap_or_default(),
        output: args.output.clone(),
        encoding: if args.text { Encoding::Text } else { Encoding::Binary },
        depth_maps: args.depth_maps.clone(),
        cloud: args.pointcloud_file.clone(),
        copy_images: args.copy_images,
    };
    pipeline::export_colmap(&job, progress)
}

fn export_rasters(args: &ExportArgs, format: RasterFormat, progress: &Progress) -> Result<RunReport> {
    let job = ExportRastersJob {
        depth_maps: args.inputs.clone(),
        output: args.output.clone(),
        format,
        planes: Planes {
            depth: args.planes.contains(&Plane::Depth),
            normal: args.planes.contains(&Plane::Normal),
            confidence: args.planes.contains(&Plane::Confidence),
        },
        depth_scale: args.depth_scale,
    };
    pipeline::export_rasters(&job, progress)
}
