//! From the scene file to views that know their image, camera and neighbours.

use super::images::Images;
use super::job::{Outputs, SceneJob};
use super::masks::Masks;
use super::memory_plan::MemoryPlan;
use super::outputs::check_places;
use super::skip::Labels;
use super::sparse::{override_from_file, replace_points};
use super::tower::use_tower;
use crate::error::{Error, Result};
use crate::geometry::{Camera, Placement, local_origin};
use crate::progress::{Event, Progress, SceneSummary};
use crate::scene::{
    ImageId, NeighborOptions, Scene, Tracks, ViewIndex, ViewNeighbors, estimate_roi, select_neighbors,
    virtual_points,
};
use crate::store::import::{LoadedScene, load_scene};
use nalgebra::Vector3;
use semvs_formats::Limits;
use semvs_formats::mvs::Container;
use std::collections::BTreeSet;
use std::time::Instant;

/// A scene that is ready for depth maps.
pub(super) struct Prepared {
    pub(super) loaded: LoadedScene,
    /// Camera of every view at the size of its maps; `None`: the view takes no part.
    pub(super) cameras: Vec<Option<Camera>>,
    /// Why a calibrated view takes no part.
    pub(super) dropped: Vec<Option<String>>,
    pub(super) neighbors: Vec<ViewNeighbors>,
    /// Points in place of the sparse ones, which tell depth ranges, where the scene has none.
    pub(super) made_up: Tracks,
    pub(super) images: Images,
    pub(super) masks: Option<Masks>,
    pub(super) labels: Option<Labels>,
}

impl Prepared {
    /// Global ID of a view.
    pub(super) fn id(&self, view: ViewIndex) -> ImageId {
        self.loaded.scene.views[view.index()].id
    }

    /// Camera of a view that takes part.
    ///
    /// # Errors
    /// It does not.
    pub(super) fn camera(&self, view: ViewIndex) -> Result<&Camera> {
        self.cameras[view.index()]
            .as_ref()
            .ok_or_else(|| Error::invalid(format!("image {} takes no part", self.id(view))))
    }

    /// Whether labels or masks leave pixels without a depth.
    pub(super) fn leaves_pixels_out(&self) -> bool {
        self.masks.is_some()
            || self.labels.as_ref().is_some_and(|labels| !labels.policy().estimates_everything())
    }

    /// Views that take part, in the scene's order.
    pub(super) fn views(&self) -> impl Iterator<Item = ViewIndex> + '_ {
        (0..self.cameras.len()).filter(|&i| self.cameras[i].is_some()).map(|i| ViewIndex(i as u32))
    }

    /// Number of views that take part.
    pub(super) fn count(&self) -> usize {
        self.cameras.iter().flatten().count()
    }

    /// Views that have something to be matched with.
    pub(super) fn matched_views(&self) -> Vec<ViewIndex> {
        self.views().filter(|v| !self.neighbors[v.index()].matching().is_empty()).collect()
    }
}

/// Loads the scene, replaces what the job replaces, and finds the region of interest.
///
/// # Errors
/// Unreadable files.
pub(super) fn load(job: &SceneJob, progress: &Progress) -> Result<LoadedScene> {
    let start = Instant::now();
    let mut loaded = load_scene(&job.scene, &job.working_folder, &Limits::default(), progress)?;
    if let Some(path) = &job.pointcloud_file {
        replace_points(&mut loaded, path)?;
    }
    warn_of_coarse_coordinates(&loaded, progress);
    let scene = &mut loaded.scene;
    progress.event(Event::SceneLoaded {
        scene: SceneSummary {
            interface: matches!(loaded.container, Container::Interface { .. }),
            images: scene.views.len(),
            calibrated: scene.views.iter().filter(|v| v.calibration.is_some()).count(),
            points: scene.tracks.len(),
        },
        elapsed: start.elapsed(),
    });
    if scene.roi.is_none() {
        scene.roi = estimate_roi(scene, job.roi.estimate);
    }
    if let Some(tower) = &job.tower {
        use_tower(&mut loaded, tower, &job.neighbors, progress)?;
    }
    if let Some(path) = &job.view_neighbors_file {
        override_from_file(&mut loaded.scene, path, progress)?;
    }
    Ok(loaded)
}

/// Says when the scene is so far from the origin that 32-bit coordinates, which clouds have by default, are coarse there, or
/// that it was moved for them not to be.
fn warn_of_coarse_coordinates(loaded: &LoadedScene, progress: &Progress) {
    let place = loaded.path.display();
    let in_doubles = "--ply-doubles, .las or .laz";
    let centers = loaded.scene.views.iter().filter_map(|v| v.calibration.as_ref()).map(|c| c.center);
    let origin = local_origin(centers);
    if origin != Vector3::zeros() {
        let step = origin.amax() * f64::from(f32::EPSILON);
        let digits = (1.0 - step.log10().floor()).max(0.0) as usize;
        progress.warn(format!(
            "{place}: so far from the origin 32-bit coordinates are about {step:.digits$} apart, and clouds show stripes; \
             {in_doubles} have all digits"
        ));
    } else if let Some(moved) = Placement::undoing(&loaded.archive.transform)
        .filter(|moved| loaded.workspace.is_some() && !moved.is_identity())
    {
        let [x, y, z] = moved.offset();
        progress.warn(format!(
            "{place}: so far from the origin 32-bit coordinates are coarse; they are relative to ({x}, {y}, {z}), {in_doubles} \
             give the place itself"
        ));
    }
}

/// Checks masks and labels and that `outputs` can be written, decodes the images, and finds neighbours. `cameras` come from the images' headers; images whose
/// pixels turn out to be unusable are left out too, unless the job is strict.
///
/// # Errors
/// Fewer than two usable views, faulty labels, no way to find neighbours.
pub(super) fn prepare(
    job: &SceneJob,
    outputs: &Outputs,
    loaded: LoadedScene,
    mut cameras: Vec<Option<Camera>>,
    decode: bool,
    memory: &MemoryPlan,
    progress: &Progress,
) -> Result<Prepared> {
    let start = Instant::now();
    // What is an error if it is wrong goes before the long work.
    let labels = job.labels.as_ref().map(|l| Labels::open(l, &loaded, &cameras, progress)).transpose()?;
    let masks = job.masks.as_ref();
    let masks = masks.map(|m| Masks::find(m, &loaded, &cameras, labels.as_ref(), progress)).transpose()?;
    // The classes of the table `ids` are known only now.
    check_places(outputs, labels.as_ref().map(Labels::classes))?;
    let images = Images::new(&loaded, memory);
    let mut dropped = header_drops(&loaded, &cameras);
    if decode {
        for (view, error) in images.check(&cameras, progress) {
            if job.strict {
                return Err(error);
            }
            progress.warn(format!("{error}; view {} is left out", view.0));
            cameras[view.index()] = None;
            dropped[view.index()] = Some(error.to_string());
        }
    }
    progress.check()?;
    let usable = cameras.iter().flatten().count();
    if usable < 2 {
        let what = format!(
            "{usable} of its {} images can be used: at least two with a pose and a readable file are needed",
            cameras.len()
        );
        return Err(Error::content(&loaded.path, what));
    }
    progress.event(Event::ImagesPrepared { images: usable, elapsed: start.elapsed() });
    let (neighbors, made_up) = find_neighbors(&loaded.scene, &cameras, &job.neighbors, progress)?;
    let prepared = Prepared { loaded, cameras, dropped, neighbors, made_up, images, masks, labels };
    report_pairs(&prepared, start, progress)?;
    Ok(prepared)
}

/// The neighbours of all views and, for a scene without sparse points, the points that were made up in their place.
///
/// # Errors
/// As [`select_neighbors`].
fn find_neighbors(
    scene: &Scene,
    cameras: &[Option<Camera>],
    options: &NeighborOptions,
    progress: &Progress,
) -> Result<(Vec<ViewNeighbors>, Tracks)> {
    let made_up = if scene.tracks.is_empty() { virtual_points(cameras) } else { Tracks::default() };
    if made_up.is_empty() {
        return Ok((select_neighbors(scene, cameras, options)?, made_up));
    }
    progress.warn(
        "the scene has no sparse points; where the cameras' axes meet stands in for them to find neighbours and depths",
    );
    let standing_in = Scene { tracks: made_up, ..scene.clone() };
    let mut neighbors = select_neighbors(&standing_in, cameras, options)?;
    // No depth starts from a point that is not there.
    neighbors.iter_mut().for_each(|n| n.tracks.clear());
    Ok((neighbors, standing_in.tracks))
}

/// The neighbours of all views by the default rules: those stored with the scene, else by its sparse points; none where
/// the views cannot be compared.
///
/// # Errors
/// As [`select_neighbors`].
pub(super) fn neighbors_of(scene: &Scene, cameras: &[Option<Camera>]) -> Result<Vec<ViewNeighbors>> {
    select_neighbors(scene, cameras, &NeighborOptions::default())
}

/// Why calibrated views have no camera.
fn header_drops(loaded: &LoadedScene, cameras: &[Option<Camera>]) -> Vec<Option<String>> {
    loaded
        .scene
        .views
        .iter()
        .zip(cameras)
        .map(|(view, camera)| match (&view.calibration, camera) {
            (None, _) => Some("no pose".to_owned()),
            (Some(_), None) => Some(format!("{}: the image cannot be used", view.name)),
            _ => None,
        })
        .collect()
}

/// Names the views that get no depth map for lack of neighbours, and returns how many maps there will be, `existing`
/// ones included.
///
/// # Errors
/// With `strict`, the first such view.
pub(super) fn name_unmatched(
    prepared: &mut Prepared,
    existing: &BTreeSet<ViewIndex>,
    strict: bool,
    progress: &Progress,
) -> Result<usize> {
    let has_map =
        |v: &ViewIndex| existing.contains(v) || !prepared.neighbors[v.index()].matching().is_empty();
    let (with, without): (Vec<ViewIndex>, Vec<ViewIndex>) = prepared.views().partition(has_map);
    for &view in &without {
        let what = format!(
            "{}: no neighbour to be matched with: no image shares enough sparse points with it at a useful angle",
            prepared.images.path(view).display()
        );
        if strict {
            return Err(Error::invalid(what));
        }
        progress.warn(format!("{what}; view {} gets no depth map", view.0));
        prepared.dropped[view.index()] = Some(what);
    }
    Ok(with.len())
}

fn report_pairs(prepared: &Prepared, start: Instant, progress: &Progress) -> Result<()> {
    let matched = prepared.matched_views();
    if matched.is_empty() {
        return Err(Error::content(
            &prepared.loaded.path,
            "no image has a neighbour to be matched with: the images share too few sparse points, or all pairs see \
             them at too small an angle",
        ));
    }
    for &view in &matched {
        let sources = prepared.neighbors[view.index()].matching();
        progress.event(Event::Paired {
            reference: prepared.id(view),
            sources: sources.iter().map(|n| prepared.id(n.view)).collect(),
        });
    }
    progress.event(Event::ViewsSelected { images: matched.len(), elapsed: start.elapsed() });
    Ok(())
}
