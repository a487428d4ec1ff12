//! Everything from the scene to the dense cloud, in order.

use super::diagnostics::{leave_pictures, leave_project};
use super::estimate::{Estimation, fitting_maps};
use super::filter::filter_across_views;
use super::forecast::forecast;
use super::fusing::{Fused, fuse_maps, possible};
use super::ingredients::Recipe;
use super::inputs::{Classes, check_inputs, named_files};
use super::job::DensifyJob;
use super::memory_plan::MemoryPlan;
use super::outputs::{
    check_depth_maps, check_places, check_report, class_rows, cloud_rows, placement, write_cloud, write_scene,
};
use super::prepare::{Prepared, load, name_unmatched, prepare};
use super::record::{Clock, view_rows, with_threads};
use super::resume::{Plan, Reuse};
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
use crate::store::space;
use crate::store::stored_cloud::StoredCloud;
use crate::store::work_folder::{FolderLock, sweep};
use nalgebra::Vector3;
use semvs_formats::Limits;
use std::collections::BTreeSet;
use std::path::Path;

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
    let mut lock = enter_folder(job, progress)?;
    let mut loaded = load(&job.input, progress)?;
    loaded.make_local();
    let mut cameras = working_cameras(&loaded, &job.resolution, job.input.strict, progress)?;
    if job.only_fuses() {
        take_sizes_of_maps(&loaded, &mut cameras, &job.depth_maps, progress);
    }
    check_depth_maps(&loaded, &cameras, &job.depth_maps)?;
    clock.stage("load");
    let memory = MemoryPlan::of(&job.input, &cameras, !job.only_fuses())?;
    let mut prepared = prepare(&job.input, &job.outputs, loaded, cameras, true, &memory, progress)?;
    let LoadedScene { search, origin, .. } = &prepared.loaded;
    let store = DepthStore::new(&job.depth_maps, search.clone(), memory.maps, Limits::default());
    let store = store.with_origin(*origin);
    clock.stage("prepare");

    let reuse = reuse(job);
    let refuse = job.input.strict && matches!(reuse, Reuse::Fitting | Reuse::SameOrFitting);
    let fitting = fitting_maps(&prepared, &store, refuse, progress)?;
    let plan = {
        let recipe = Recipe { prepared: &prepared, options: &job.stereo, filter: &job.filter };
        Plan::make(recipe, &store, &fitting, reuse, progress)?
    };
    if lock.is_none() && plan.has_work() {
        lock = Some(FolderLock::take(&job.depth_maps)?);
    }
    space::require(&job.depth_maps, plan.disk_bytes(&prepared), "the depth maps that are to be made")?;
    let maps = name_unmatched(&mut prepared, &plan.given, job.input.strict, progress)?;
    let fusion = match job.depth_maps_only {
        true => job.fusion,
        false => possible(&job.fusion, prepared.count(), maps, progress)?,
    };
    if let Some(forecast) = forecast(job, &prepared, &plan, &memory, cpu)? {
        progress.event(Event::Planned(forecast));
    }
    let mapped = make_maps(job, &prepared, &store, &plan, &memory, cpu, &mut clock, progress)?;
    let mut report = RunReport {
        scene: job.input.scene.display().to_string(),
        cpu_level: Some(cpu.name().to_owned()),
        ..RunReport::default()
    };
    if job.depth_maps_only {
        finish_depth_maps(job, &prepared, mapped, &clock, progress, &mut report)?;
    } else {
        finish_cloud(job, &fusion, &prepared, &store, mapped, &memory, &mut clock, progress, &mut report)?;
    }
    if job.pictures {
        leave_project(&prepared, &job.outputs.cloud)?;
    }
    report.views = view_rows(&prepared, &store, mapped, &plan.reused())?;
    depth_map_rows(&prepared, &store, mapped, &mut report);
    // Whoever wants depth maps alone keeps them.
    let mut gone = Vec::new();
    if job.remove_depth_maps && !job.depth_maps_only {
        gone.extend(mapped.iter().map(|&view| prepared.id(view)));
        gone.iter().try_for_each(|&id| store.delete(id))?;
        report.outputs.retain(|output| output.content != DEPTH_MAP);
    }
    if lock.is_some() {
        plan.finish(&gone)?;
    }
    clock.stage("write");
    clock.finish(&mut report);
    Ok(report)
}

/// Clears what runs that were killed have left in the folders of a job, and takes that of the depth maps for it alone; a
/// job that, as a rule, only reads them needs it only when it turns out to write some.
fn enter_folder(job: &DensifyJob, progress: &Progress) -> Result<Option<FolderLock>> {
    let lock = match job.only_fuses() {
        true => FolderLock::check_free(&job.depth_maps).map(|()| None)?,
        false => Some(FolderLock::take(&job.depth_maps)?),
    };
    let folders: BTreeSet<&Path> = [job.depth_maps.as_path(), job.outputs.folder()].into();
    let swept: usize = folders.into_iter().map(sweep).sum();
    if swept > 0 {
        progress.info(format!("{swept} temporary files of a run that was killed are deleted"));
    }
    Ok(lock)
}

/// What the job does with depth maps that are there.
fn reuse(job: &DensifyJob) -> Reuse {
    match (job.input.like_openmvs, job.stereo.geometric_iterations) {
        _ if job.force => Reuse::Nothing,
        (true, _) => Reuse::Fitting,
        // Pictures show all stages.
        (false, 0) if job.pictures => Reuse::Fitting,
        (false, 0) => Reuse::SameOrFitting,
        (false, _) if job.pictures => Reuse::Nothing,
        (false, _) => Reuse::Same,
    }
}

/// Makes what `plan` lacks; returns the views that have a depth map then.
#[allow(clippy::too_many_arguments, reason = "what a run has by then")]
fn make_maps<'a>(
    job: &DensifyJob,
    prepared: &Prepared,
    store: &DepthStore,
    plan: &'a Plan,
    memory: &MemoryPlan,
    cpu: CpuLevel,
    clock: &mut Clock,
    progress: &Progress,
) -> Result<&'a [ViewIndex]> {
    progress.detail(format!("depth maps are estimated with the {} kernels", cpu.name()));
    let DensifyJob { stereo: options, filter, .. } = job;
    let passes = options.geometric_iterations;
    let pictures = |after: u32, stage: &str| match job.pictures {
        true => leave_pictures(prepared, store, plan, after, stage),
        false => Ok(()),
    };
    let (at_once, planes) = (memory.views_at_once, memory.planes);
    Estimation { prepared, store, plan, options, filter, at_once, planes, cpu, progress }.run()?;
    prepared.images.finish_matching();
    store.hold(memory.filtered);
    pictures(passes, "")?;
    clock.stage("estimate");
    if let Some(across) = &filter.across {
        let stage = passes + 1;
        filter_across_views(prepared, store, plan, (stage, at_once), across, &filter.options, progress)?;
        pictures(stage, ".filtered")?;
        clock.stage("filter");
    }
    plan.publish(store)?;
    Ok(&plan.views)
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
    let store = store.with_origin(loaded.origin);
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
    memory: &MemoryPlan,
    clock: &mut Clock,
    progress: &Progress,
    report: &mut RunReport,
) -> Result<()> {
    let folder = job.outputs.folder();
    let fused = fuse_maps(prepared, store, mapped, fusion, &job.input.roi, folder, memory, progress)?;
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
    let place = place.after_shift(prepared.loaded.origin.into());
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
