//! Depth maps that exist to a cloud.

use super::densify::write_results;
use super::fusing::{fuse_maps, possible};
use super::inputs::{Classes, check_inputs, named_files};
use super::job::{DepthMapsJob, FuseJob};
use super::memory_plan::MemoryPlan;
use super::outputs::{check_places, check_report};
use super::prepare::{load, prepare};
use super::record::{Clock, view_rows, with_threads};
use crate::error::{Error, Result};
use crate::fusion::AttributeSource;
use crate::geometry::{Camera, Size};
use crate::progress::{Event, Progress};
use crate::report::RunReport;
use crate::scene::{PointSource, ResolutionOptions, View, ViewIndex};
use crate::store::cameras::{camera_of_map, cameras_at_image_size, working_cameras};
use crate::store::colmap::{ColmapMaps, Pass};
use crate::store::depth_store::{DepthStore, Existing};
use crate::store::import::LoadedScene;
use crate::store::work_folder::{FolderLock, sweep};
use semvs_formats::Limits;
use std::collections::BTreeSet;

/// Runs `job`. Depth maps are only read. The report lacks what only the program knows.
///
/// # Errors
/// A depth map does not belong to the scene, there is none, or an output cannot be written.
pub fn fuse(job: &FuseJob, progress: &Progress) -> Result<RunReport> {
    with_threads(job.input.max_threads, || run(job, progress))
}

fn run(job: &FuseJob, progress: &Progress) -> Result<RunReport> {
    let mut clock = Clock::start();
    job.check()?;
    if let DepthMapsJob::Folder(folder) = &job.depth_maps
        && !folder.is_dir()
    {
        return Err(Error::content(folder, "no such folder of depth maps (--depth-maps)"));
    }
    if let DepthMapsJob::Folder(folder) = &job.depth_maps {
        FolderLock::check_free(folder)?;
    }
    sweep(job.outputs.folder());
    let classes = check_inputs(&job.input)?;
    check_report(&job.outputs, &named_files(&job.input))?;
    check_places(&job.outputs, classes.as_ref().map(Classes::parts))?;
    let mut loaded = load(&job.input, progress)?;
    loaded.make_local();
    let store = open_maps(&job.depth_maps, &loaded)?;
    let cameras = match &job.resolution {
        Some(resolution) => working_cameras(&loaded, resolution, job.input.strict, progress)?,
        None => map_cameras(&loaded, &store, job.input.strict, progress)?,
    };
    let mapped = maps_of_the_scene(&loaded, &cameras, &store, job.input.strict, progress)?;
    clock.stage("load");
    let decode = job.fusion.estimate_colors != AttributeSource::None;
    let memory = MemoryPlan::of(&job.input, &cameras, false)?;
    let prepared = prepare(&job.input, &job.outputs, loaded, cameras, decode, &memory, progress)?;
    prepared.images.finish_matching();
    let mapped: Vec<ViewIndex> =
        mapped.into_iter().filter(|v| prepared.cameras[v.index()].is_some()).collect();
    let fusion = possible(&job.fusion, prepared.count(), mapped.len(), progress)?;
    clock.stage("prepare");

    let mut report = RunReport { scene: job.input.scene.display().to_string(), ..RunReport::default() };
    let folder = job.outputs.folder();
    let fused = fuse_maps(&prepared, &store, &mapped, &fusion, &job.input.roi, folder, &memory, progress)?;
    clock.stage("fuse");
    progress.event(Event::Densified { points: fused.cloud.len(), elapsed: clock.elapsed() });
    write_results(&job.outputs, &prepared, &fused, &fusion, progress, &mut report)?;
    let reused: BTreeSet<ViewIndex> = mapped.iter().copied().collect();
    report.views = view_rows(&prepared, &store, &mapped, &reused)?;
    clock.stage("write");
    clock.finish(&mut report);
    Ok(report)
}

/// The depth maps of a job; fusion keeps what it needs itself.
pub(super) fn open_maps(maps: &DepthMapsJob, loaded: &LoadedScene) -> Result<DepthStore> {
    match (maps, &loaded.workspace) {
        (DepthMapsJob::Folder(folder), _) => {
            let store = DepthStore::new(folder, loaded.search.clone(), 0, Limits::default());
            Ok(store.with_origin(loaded.origin))
        }
        (DepthMapsJob::Colmap(pass), Some(workspace)) => {
            let passes = pass.map_or_else(|| Pass::ALL.to_vec(), |pass| vec![pass]);
            let mut found = passes.iter().map(|&pass| ColmapMaps::new(workspace, pass, &loaded.scene));
            match found.find(ColmapMaps::any) {
                Some(maps) => Ok(DepthStore::colmap(maps, loaded.search.clone())),
                None => {
                    let names = passes.iter().map(|pass| pass.name()).collect::<Vec<_>>().join(" or ");
                    let what = format!(
                        "no {names} depth map in stereo/depth_maps: run `colmap patch_match_stereo`, or `semvs densify` on \
                         this folder, or say where the maps are (--depth-maps)"
                    );
                    Err(Error::content(&workspace.root, what))
                }
            }
        }
        (DepthMapsJob::Colmap(_), None) => {
            Err(Error::content(&loaded.path, "--maps needs a COLMAP workspace in place of the scene"))
        }
    }
}

/// The cameras at the sizes of the depth maps; views without a map get the reduction of the first map.
fn map_cameras(
    loaded: &LoadedScene,
    store: &DepthStore,
    strict: bool,
    progress: &Progress,
) -> Result<Vec<Option<Camera>>> {
    let full_size = cameras_at_image_size(loaded, strict, progress)?;
    let mut sizes: Vec<Option<Size>> = Vec::with_capacity(full_size.len());
    let mut reduction = None;
    for (view, camera) in loaded.scene.views.iter().zip(&full_size) {
        let header = if camera.is_some() { store.header(view.id)? } else { None };
        let size = header.map(|h| Size::new(h.width, h.height));
        if let (Some(size), Some(camera)) = (size, camera) {
            reduction.get_or_insert((size.longest(), camera.size().longest()));
        }
        sizes.push(size);
    }
    let Some((small, large)) = reduction else { return Err(no_maps(store)) };
    let camera_of = |view: &View, full: &Camera, of_map: Option<Size>| {
        if let Some(size) = of_map.filter(|_| store.is_colmap()) {
            return Some(full.scaled_per_axis(size));
        }
        if let Some((size, calibration)) = of_map.zip(view.calibration.as_ref()) {
            // A map of another shape than its image is found to be unusable by its size.
            let fitting = camera_of_map(calibration, full.size(), size);
            return Some(fitting.unwrap_or_else(|| full.clone()));
        }
        let longest = (u64::from(full.size().longest()) * u64::from(small) / u64::from(large)) as u32;
        let at = ResolutionOptions { level: 0, max: longest.max(1), ..ResolutionOptions::default() };
        view.calibration.as_ref().map(|c| c.camera_at(at.working_size(full.size())))
    };
    let views = loaded.scene.views.iter().zip(&full_size).zip(sizes);
    Ok(views.map(|((view, full), size)| full.as_ref().and_then(|full| camera_of(view, full, size))).collect())
}

/// The views whose depth maps are in the folder; every one found must belong to the scene. Views without a map are
/// named, or an error in a strict run.
fn maps_of_the_scene(
    loaded: &LoadedScene,
    cameras: &[Option<Camera>],
    store: &DepthStore,
    strict: bool,
    progress: &Progress,
) -> Result<Vec<ViewIndex>> {
    let mut found = Vec::new();
    let mut missing = Vec::new();
    for (i, (view, camera)) in loaded.scene.views.iter().zip(cameras).enumerate() {
        let Some(camera) = camera else { continue };
        match store.existing(view.id, camera) {
            Existing::Absent => missing.push(store.name(view.id)),
            Existing::Usable => found.push(ViewIndex(i as u32)),
            Existing::Unusable(why) => {
                return Err(Error::invalid(format!(
                    "{why}; give the scene and the options that it was made with, or remove it"
                )));
            }
        }
    }
    if found.is_empty() {
        return Err(no_maps(store));
    }
    if !missing.is_empty() {
        let what =
            format!("{} of the scene's depth maps are not here: {}", missing.len(), missing.join(", "));
        if strict {
            return Err(Error::content(store.folder(), what));
        }
        progress.warn(format!("{}: {what}; their views are left out", store.folder().display()));
    }
    Ok(found)
}

fn no_maps(store: &DepthStore) -> Error {
    let names = match store.is_colmap() {
        true => "IMAGE.geometric.bin or IMAGE.photometric.bin",
        false => "depthNNNN.dmap by the images' IDs",
    };
    Error::content(
        store.folder(),
        format!("no depth map of the scene's images is here; they are named {names}"),
    )
}
