//! Everything from the scene to the dense cloud, in order.

use super::diagnostics::{leave_pictures, leave_project};
use super::estimate::{Estimation, existing_maps};
use super::filter::filter_across_views;
use super::fusing::{Fused, fuse_maps, possible};
use super::inputs::{Classes, check_inputs, named_files};
use super::job::{DensifyJob, SceneJob};
use super::outputs::{
    check_depth_maps, check_places, check_report, class_rows, cloud_rows, placement, write_cloud, write_scene,
};
use super::prepare::{Prepared, load, name_unmatched, pixels_in_hand, prepare};
use super::record::{Clock, view_rows, with_threads};
use super::skip::Labels;
use crate::error::{Error, Result};
use crate::fusion::{AttributeSource, FusionOptions, WithNormals, WithSmoothLabels};
use crate::geometry::{Camera, Size};
use crate::progress::{Event, Progress};
use crate::report::{OutputReport, RunReport};
use crate::scene::{PointSource, ViewIndex};
use crate::stereo::CpuLevel;
use crate::store::atomic::create_folder;
use crate::store::cameras::working_cameras;
use crate::store::cloud::PlyLayout;
use crate::store::depth_store::{DepthStore, Existing};
use crate::store::import::LoadedScene;
use crate::store::stored_cloud::StoredCloud;
use nalgebra::Vector3;
use semvs_formats::Limits;
use std::path::Path;

/// Least memory for depth maps between the passes.
const MIN_MAP_MEMORY: usize = 176 << 20;
/// Most memory for depth maps between the passes.
const MAX_MAP_MEMORY: usize = 4 << 30;
/// Bytes per pixel of a depth map in memory.
const MAP_BYTES: usize = 20;

/// Runs `job`: depth maps of all views into their folder, then the cloud and its companions. The report lacks what
/// only the program knows: its name, its options, the warnings.
///
/// # Errors
/// Anything that keeps a result from being right; then files of earlier runs are as they were.
pub fn densify(job: &DensifyJob, cpu: CpuLevel, progress: &Progress) -> Result<RunReport> {
    with_threads(job.input.max_threads, || run(job, cpu, progress))
}

fn run(job: &DensifyJob, cpu: CpuLevel, progress: &Progress) -> Result<RunReport> {
    let mut clock = Clock::start();
    job.check()?;
    let classes = check_inputs(&job.input)?;
    check_report(&job.outputs, &named_files(&job.input))?;
    check_places(&job.outputs, classes.as_ref().map(Classes::parts))?;
    create_folder(&job.depth_maps)?;
    let loaded = load(&job.input, progress)?;
    let mut cameras = working_cameras(&loaded, &job.resolution, job.input.strict, progress)?;
    if job.only_fuses() {
        take_sizes_of_maps(&loaded, &mut cameras, &job.depth_maps, progress);
    }
    check_depth_maps(&loaded, &cameras, &job.depth_maps)?;
    clock.stage("load");
    let mut prepared = prepare(&job.input, &job.outputs, loaded, cameras, true, progress)?;
    let store = store(&job.input, &prepared, &job.depth_maps);
    clock.stage("prepare");

    let use_existing = job.stereo.geometric_iterations == 0 || job.input.like_openmvs;
    let existing = existing_maps(&prepared, &store, use_existing, job.input.strict, progress)?;
    let maps = name_unmatched(&mut prepared, &existing, job.input.strict, progress)?;
    let fusion = match job.depth_maps_only {
        true => job.fusion,
        false => possible(&job.fusion, prepared.count(), maps, progress)?,
    };
    progress.detail(format!("depth maps are estimated with the {} kernels", cpu.name()));
    let estimation = Estimation {
        prepared: &prepared,
        store: &store,
        options: &job.stereo,
        filter: &job.filter,
        cpu,
        progress,
    };
    let mapped = estimation.run(&existing)?;
    let pictures = |stage: &str| match job.pictures {
        true => leave_pictures(&prepared, &store, &mapped, stage),
        false => Ok(()),
    };
    pictures("")?;
    clock.stage("estimate");
    if let Some(across) = &job.filter.across {
        filter_across_views(&prepared, &store, &mapped, across, &job.filter.options, progress)?;
        pictures(".filtered")?;
        clock.stage("filter");
    }
    let mut report = RunReport {
        scene: job.input.scene.display().to_string(),
        cpu_level: Some(cpu.name().to_owned()),
        ..RunReport::default()
    };
    if job.depth_maps_only {
        finish_depth_maps(job, &prepared, &mapped, &clock, progress, &mut report)?;
    } else {
        finish_cloud(job, &fusion, &prepared, &store, &mapped, &mut clock, progress, &mut report)?;
    }
    if job.pictures {
        leave_project(&prepared, &job.outputs.cloud)?;
    }
    report.views = view_rows(&prepared, &store, &mapped, &existing)?;
    depth_map_rows(&prepared, &store, &mapped, &mut report);
    // Whoever wants depth maps alone keeps them.
    if job.remove_depth_maps && !job.depth_maps_only {
        mapped.iter().try_for_each(|&view| store.delete(prepared.id(view)))?;
        report.outputs.retain(|output| output.content != DEPTH_MAP);
    }
    clock.stage("write");
    clock.finish(&mut report);
    Ok(report)
}

/// Gives the views whose depth map is of another size than the options say, but of this scene, a camera of that size:
/// whoever only fuses means the maps that are there.
fn take_sizes_of_maps(
    loaded: &LoadedScene,
    cameras: &mut [Option<Camera>],
    folder: &Path,
    progress: &Progress,
) {
    let store = DepthStore::new(folder, loaded.search.clone(), 0, Limits::default());
    let mut other = 0usize;
    for (view, camera) in loaded.scene.views.iter().zip(cameras) {
        let (Some(camera), Some(calibration)) = (camera, &view.calibration) else { continue };
        let Ok(Some(header)) = store.header(view.id) else { continue };
        let of_map = calibration.camera_at(Size::new(header.width, header.height));
        let is_other = of_map.size() != camera.size();
        if is_other && matches!(store.existing(view.id, &of_map), Existing::Usable) {
            *camera = of_map;
            other += 1;
        }
    }
    if other > 0 {
        progress.info(format!(
            "{}: {other} depth maps are of another size than the options about resolution say; they are fused at their size",
            folder.display()
        ));
    }
}

/// What a report says of a depth map that was written.
pub const DEPTH_MAP: &str = "depth map";

fn depth_map_rows(prepared: &Prepared, store: &DepthStore, mapped: &[ViewIndex], report: &mut RunReport) {
    report.outputs.extend(mapped.iter().map(|&view| OutputReport {
        path: store.path(prepared.id(view)).display().to_string(),
        content: DEPTH_MAP.to_owned(),
        points: None,
    }));
}

/// The store of a job's depth maps, with memory for what the threads work on at a time.
fn store(job: &SceneJob, prepared: &Prepared, folder: &Path) -> DepthStore {
    let memory = (pixels_in_hand(job, &prepared.cameras) * MAP_BYTES).clamp(MIN_MAP_MEMORY, MAX_MAP_MEMORY);
    DepthStore::new(folder, prepared.loaded.search.clone(), memory, Limits::default())
}

fn finish_depth_maps(
    job: &DensifyJob,
    prepared: &Prepared,
    mapped: &[ViewIndex],
    clock: &Clock,
    progress: &Progress,
    report: &mut RunReport,
) -> Result<()> {
    let sparse = StoredCloud::new(&prepared.loaded.archive.points);
    progress.event(Event::DepthMapsCompleted {
        maps: mapped.len(),
        sparse_points: prepared.loaded.scene.tracks.len(),
        elapsed: clock.elapsed(),
    });
    if job.outputs.sparse_cloud && !sparse.is_empty() {
        let mut outputs = job.outputs.without_labels();
        if outputs.layout == PlyLayout::Odm || !sparse.layout().views {
            // Sparse points need not have what it takes.
            outputs.layout = PlyLayout::OpenMvsProject;
        }
        let place = placement(&outputs, &prepared.loaded.archive, progress);
        let written = write_cloud(&outputs, &sparse, None, place, progress)?;
        report.outputs.extend(cloud_rows(&written, None));
    }
    write_scene(&job.outputs, prepared, &sparse, progress)?;
    report.outputs.extend(job.outputs.scene_row());
    Ok(())
}

#[allow(clippy::too_many_arguments, reason = "what a run has at its end")]
fn finish_cloud(
    job: &DensifyJob,
    fusion: &FusionOptions,
    prepared: &Prepared,
    store: &DepthStore,
    mapped: &[ViewIndex],
    clock: &mut Clock,
    progress: &Progress,
    report: &mut RunReport,
) -> Result<()> {
    let folder = job.outputs.folder();
    let fused = fuse_maps(prepared, store, mapped, fusion, &job.input.roi, folder, progress)?;
    clock.stage("fuse");
    progress.event(Event::Densified { points: fused.cloud.len(), elapsed: clock.elapsed() });
    write_results(&job.outputs, prepared, &fused, fusion, progress, report)
}

/// Writes cloud and scene, and enters them in the report.
pub(super) fn write_results(
    outputs: &super::Outputs,
    prepared: &Prepared,
    fused: &Fused,
    options: &FusionOptions,
    progress: &Progress,
    report: &mut RunReport,
) -> Result<()> {
    if fused.cloud.is_empty() && !outputs.allow_empty {
        return Err(Error::invalid(format!(
            "no point is seen alike by {} views, and nothing is written: are the images and poses right?{}",
            options.number_views_fuse,
            if options.number_views_fuse > 2 { " --number-views-fuse 2 asks for less" } else { "" }
        )));
    }
    let labels = prepared.labels.as_ref();
    let centers: Vec<Vector3<f64>> = prepared
        .loaded
        .scene
        .views
        .iter()
        .map(|v| v.calibration.as_ref().map_or_else(Vector3::zeros, |c| c.center))
        .collect();
    let after_fusion = options.estimate_normals == AttributeSource::AfterFusion;
    let with_normals = after_fusion.then(|| WithNormals::estimate(&fused.cloud, &centers)).transpose()?;
    let cloud: &dyn PointSource = match &with_normals {
        Some(cloud) => cloud,
        None => &fused.cloud,
    };
    let smooth = labels.map_or(0, |labels| labels.rules().smooth) as usize;
    let smoothed = (smooth > 0).then(|| WithSmoothLabels::vote(cloud, smooth)).transpose()?;
    let cloud: &dyn PointSource = match &smoothed {
        Some(smoothed) => smoothed,
        None => cloud,
    };
    let place = placement(outputs, &prepared.loaded.archive, progress);
    let written = write_cloud(outputs, cloud, labels, place, progress)?;
    report.points = fused.cloud.len();
    report.outputs.extend(cloud_rows(&written, labels.map(Labels::table)));
    if let Some(labels) = labels {
        report.classes = class_rows(&fused.summary, &written, labels);
    }
    write_scene(outputs, prepared, cloud, progress)?;
    report.outputs.extend(outputs.scene_row());
    Ok(())
}
