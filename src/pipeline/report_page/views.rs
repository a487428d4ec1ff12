//! The views of a page: their pictures, their cameras, and how well they match.

use super::super::page_parts::{map_address, picture_size};
use super::super::prepare::neighbors_of;
use super::class_check::{self, SmallView};
use super::cloud::ViewerCloud;
use crate::error::{Error, Result};
use crate::geometry::{Camera, Size};
use crate::progress::{Progress, Stage};
use crate::report::{
    BARS, PageCamera, PageCloud, PageView, RunReport, ViewReport, add_to, confidence_picture, data_address,
    depth_picture, depth_scale, label_picture, marked_picture, normal_picture,
};
use crate::scene::{DepthEstimate, Neighbor, ResolutionOptions, View, ViewIndex, resize_nearest};
use crate::store::depth_store::DepthStore;
use crate::store::drawing::{jpeg_bytes, png_bytes};
use crate::store::images::load_working_color;
use crate::store::import::LoadedScene;
use crate::store::labels::LabelStore;
use nalgebra::Vector3;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Quality of photographs.
const QUALITY: u8 = 70;
/// Pixels of all pictures of one kind together: with more views they are smaller, so that pages of any number stay small.
const MOST_PIXELS: f64 = 7.5e6;
/// Depths of a view that the common scale is taken from.
const SCALE_SAMPLE: usize = 2048;
/// Neighbours of a view that are drawn.
const MOST_NEIGHBORS: usize = 12;
/// Cameras further from the cloud than this times its span are in another frame.
const FAR: f64 = 1000.0;

/// What the views are looked at with.
pub(super) struct ViewLooks<'a> {
    pub(super) loaded: &'a LoadedScene,
    pub(super) maps: Option<&'a DepthStore>,
    pub(super) labels: Option<&'a LabelStore>,
    pub(super) run: &'a RunReport,
}

/// All views of a page.
pub(super) struct SeenViews {
    pub(super) views: Vec<PageView>,
    /// Depths by confidence.
    pub(super) confidence: [u64; BARS],
}

/// One view.
struct Seen {
    page: PageView,
    /// What is kept of it, at the size of its picture.
    small: Option<SmallView>,
    estimate: Option<Arc<DepthEstimate>>,
    /// What could not be shown.
    problems: Vec<String>,
}

impl ViewLooks<'_> {
    /// All views; every depth map is held against `cloud`. What cannot be read is said and left out.
    ///
    /// # Errors
    /// None but a request to stop.
    pub(super) fn all(
        &self,
        mut cloud: Option<&mut ViewerCloud>,
        say: &mut dyn FnMut(String),
        progress: &Progress,
    ) -> Result<SeenViews> {
        let count = self.loaded.scene.views.len();
        let steps = progress.start(Stage::DrawViews, count);
        let (mut views, mut small) = (Vec::with_capacity(count), Vec::with_capacity(count));
        let (mut sample, mut confidence) = (Vec::new(), [0; BARS]);
        let all: Vec<usize> = (0..count).collect();
        for some in all.chunks(rayon::current_num_threads().max(1)) {
            progress.check()?;
            let seen: Vec<Seen> = some.par_iter().map(|&i| self.look(ViewIndex(i as u32), count)).collect();
            for mut seen in seen {
                seen.problems.drain(..).for_each(&mut *say);
                if let Some(map) = &seen.estimate {
                    gather(map, &mut sample, &mut confidence);
                    cloud.iter_mut().for_each(|cloud| cloud.meet(map));
                }
                views.push(seen.page);
                small.push(seen.small);
                steps.step();
            }
        }
        let scale = depth_scale(&mut sample);
        let marks = match self.labels.is_some() && class_check::is_wanted(self.run) {
            true => class_check::against_their_class(&views, &small, self.run),
            false => vec![None; count],
        };
        views.par_iter_mut().zip(small).zip(marks).try_for_each(|((view, small), marks)| {
            view.depth_scale = [scale.0, scale.1];
            let Some(small) = small else { return Ok(()) };
            view.layers.depth = Some(map_address(&depth_picture(&small.depth, scale))?);
            if let Some(marks) = marks {
                view.removed = Some(class_check::share(&marks, &small.depth));
                let picture = marked_picture(&marks, small.photograph.as_ref());
                view.layers.removed = Some(map_address(&picture)?);
            }
            Ok::<(), Error>(())
        })?;
        Ok(SeenViews { views, confidence })
    }

    fn look(&self, index: ViewIndex, count: usize) -> Seen {
        let view = &self.loaded.scene.views[index.index()];
        let mut seen = Seen { page: self.row(index), small: None, estimate: None, problems: Vec::new() };
        if let Some(maps) = self.maps
            && matches!(maps.header(view.id), Ok(Some(_)) | Err(_))
        {
            match maps.read(view.id) {
                Ok(map) => seen.estimate = Some(map),
                Err(error) => seen.problems.push(format!("{error}; its depths are not shown")),
            }
        }
        if let Err(error) = self.draw(index, count, &mut seen) {
            seen.problems.push(error.to_string());
        }
        seen
    }

    /// What is known of a view without its pictures.
    fn row(&self, index: ViewIndex) -> PageView {
        let view = &self.loaded.scene.views[index.index()];
        let known = self.run.views.iter().find(|row| row.id == view.id.0);
        let no_pose = view.calibration.is_none().then(|| "no pose".to_owned());
        let row = known.cloned().unwrap_or_else(|| ViewReport { dropped: no_pose, ..ViewReport::default() });
        PageView {
            index: index.0,
            id: view.id.0,
            image: view.name.clone(),
            width: row.width,
            height: row.height,
            sources: row.sources,
            coverage: row.coverage,
            mean_confidence: row.mean_confidence,
            dropped: row.dropped,
            ..PageView::default()
        }
    }

    fn draw(&self, index: ViewIndex, count: usize, seen: &mut Seen) -> Result<()> {
        let path = self.loaded.image_path(index);
        if let Some(map) = seen.estimate.clone() {
            self.draw_maps(&map, count, seen)?;
        }
        let longest = picture_size(Size::new(1 << 15, 1 << 15), count, MOST_PIXELS).longest();
        let size_of_map =
            seen.estimate.as_ref().map(|map| picture_size(map.depth.size(), count, MOST_PIXELS));
        let at = size_of_map.map_or(longest, |size| size.longest());
        let resolution = ResolutionOptions { level: 0, max: at, ..ResolutionOptions::default() };
        let mut size = size_of_map;
        match load_working_color(&path, &resolution) {
            Ok(image) => {
                size = size.or(Some(image.size()));
                seen.page.layers.image = Some(data_address("image/jpeg", &jpeg_bytes(&image, QUALITY)?));
                seen.small.iter_mut().for_each(|small| small.photograph = Some(image.clone()));
            }
            Err(error) if seen.page.dropped.is_none() => {
                seen.problems.push(format!("{error}; the photograph is not shown"));
            }
            Err(_) => {}
        }
        if let Some((labels, size)) = self.labels.zip(size)
            && labels.file(index).is_some()
        {
            let full = seen.estimate.as_ref().map_or(size, |map| map.depth.size());
            let map = resize_nearest(&*labels.load(index, full)?, size);
            let picture = label_picture(&map, labels.table());
            seen.page.layers.labels = Some(data_address("image/png", &png_bytes(&picture)?));
            seen.small.iter_mut().for_each(|small| small.labels = Some(map.clone()));
        }
        Ok(())
    }

    fn draw_maps(&self, map: &DepthEstimate, count: usize, seen: &mut Seen) -> Result<()> {
        let size = picture_size(map.depth.size(), count, MOST_PIXELS);
        let page = &mut seen.page;
        let depth = resize_nearest(&map.depth, size);
        if let Some(normals) = &map.normal {
            page.layers.normal = Some(map_address(&normal_picture(&resize_nearest(normals, size), &depth))?);
        }
        if let Some(confidence) = &map.confidence {
            let picture = confidence_picture(&resize_nearest(confidence, size), &depth);
            page.layers.confidence = Some(map_address(&picture)?);
        }
        let valid = map.depth.data().iter().filter(|d| **d > 0.0).count();
        (page.width, page.height) = (map.depth.size().width, map.depth.size().height);
        page.coverage = valid as f64 / map.depth.size().area().max(1) as f64;
        if let Some(confidence) = map.confidence.as_ref().filter(|_| valid > 0) {
            let sum: f64 = confidence.data().iter().map(|c| f64::from(*c)).sum();
            page.mean_confidence = Some(sum / valid as f64);
        }
        if page.sources.is_empty() {
            page.sources = map.source_ids.iter().map(|id| id.0).collect();
        }
        let origin = self.loaded.scene.views.iter().find_map(|view| view.calibration.as_ref());
        let origin = origin.map_or_else(Vector3::zeros, |calibration| calibration.center);
        seen.small = Some(SmallView::new(map, depth, &origin));
        Ok(())
    }
}

/// Adds depths to the sample of the scale, and all confidences to the histogram.
fn gather(map: &DepthEstimate, sample: &mut Vec<f32>, confidence: &mut [u64; BARS]) {
    let depths = map.depth.data();
    let step = depths.len().div_ceil(SCALE_SAMPLE).max(1);
    sample.extend(depths.iter().step_by(step).filter(|d| **d > 0.0 && d.is_finite()));
    let confidences = map.confidence.iter().flat_map(|c| c.data());
    for (c, _) in confidences.zip(depths).filter(|(_, d)| **d > 0.0) {
        add_to(confidence, f64::from(*c));
    }
}

/// The pairs of views that the scene names as neighbours, or that its sparse points make such, by global ids, each once with
/// its best score.
pub(super) fn edges(loaded: &LoadedScene) -> Vec<(u32, u32, f32)> {
    let views = &loaded.scene.views;
    let stored: Vec<&[Neighbor]> = views.iter().map(|view| view.neighbors.as_slice()).collect();
    if stored.iter().any(|neighbors| !neighbors.is_empty()) || loaded.scene.tracks.is_empty() {
        return pairs(views, &stored);
    }
    let camera = |view: &View| {
        let calibration = view.calibration.as_ref()?;
        Some(calibration.camera_at(calibration.size?))
    };
    let cameras: Vec<Option<Camera>> = views.iter().map(camera).collect();
    match neighbors_of(&loaded.scene, &cameras) {
        Ok(found) => pairs(views, &found.iter().map(|n| n.retained.as_slice()).collect::<Vec<_>>()),
        // The page has no graph then.
        Err(_) => Vec::new(),
    }
}

fn pairs(views: &[View], neighbors: &[&[Neighbor]]) -> Vec<(u32, u32, f32)> {
    let mut best: BTreeMap<(u32, u32), f32> = BTreeMap::new();
    for (view, neighbors) in views.iter().zip(neighbors) {
        for neighbor in neighbors.iter().take(MOST_NEIGHBORS) {
            let Some(other) = views.get(neighbor.view.index()) else { continue };
            let pair = (view.id.0.min(other.id.0), view.id.0.max(other.id.0));
            let score = best.entry(pair).or_insert(neighbor.score);
            *score = score.max(neighbor.score);
        }
    }
    best.into_iter().map(|((a, b), score)| (a, b, score)).filter(|edge| edge.2.is_finite()).collect()
}

/// Gives the views their cameras relative to `corner`, unless all are far from the cloud.
pub(super) fn place_cameras(
    views: &mut [PageView],
    loaded: &LoadedScene,
    corner: [f64; 3],
    cloud: Option<&PageCloud>,
) {
    for (view, of_scene) in views.iter_mut().zip(&loaded.scene.views) {
        let Some(calibration) = &of_scene.calibration else { continue };
        let of_map = (view.width > 0).then(|| Size::new(view.width, view.height));
        let size = of_map.or(calibration.size).unwrap_or(Size::new(4, 3));
        view.camera = Some(page_camera(&calibration.camera_at(size), corner));
    }
    let far = |camera: &PageCamera, cloud: &PageCloud| {
        let squared: f64 = (0..3).map(|k| (camera.center[k] - cloud.center[k]).powi(2)).sum();
        squared.sqrt() > FAR * cloud.span.max(f64::MIN_POSITIVE)
    };
    if let Some(cloud) = cloud.filter(|cloud| cloud.count > 0)
        && views.iter().filter_map(|view| view.camera.as_ref()).all(|camera| far(camera, cloud))
    {
        views.iter_mut().for_each(|view| view.camera = None);
    }
}

fn page_camera(camera: &Camera, corner: [f64; 3]) -> PageCamera {
    let (width, height) = (f64::from(camera.size().width), f64::from(camera.size().height));
    let to_world = camera.rotation().transpose();
    let row = |i: usize| std::array::from_fn(|k| camera.rotation()[(i, k)]);
    let corners = [(-0.5, -0.5), (width - 0.5, -0.5), (width - 0.5, height - 0.5), (-0.5, height - 0.5)];
    PageCamera {
        center: std::array::from_fn(|k| camera.center()[k] - corner[k]),
        axis: row(2),
        down: row(1),
        corners: corners.map(|(x, y)| (to_world * camera.cam_from_image(x, y, 1.0)).into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Matrix3;

    #[test]
    fn a_camera_looks_along_its_axis_through_its_corners() {
        let k = Matrix3::new(50.0, 0.0, 49.5, 0.0, 50.0, 24.5, 0.0, 0.0, 1.0);
        // Looks along the world's +x, its columns go down along -z.
        let rotation = Matrix3::new(0.0, -1.0, 0.0, 0.0, 0.0, -1.0, 1.0, 0.0, 0.0);
        let camera = Camera::new(Size::new(100, 50), k, rotation, Vector3::new(1.0, 2.0, 3.0));
        let page = page_camera(&camera, [1.0, 1.0, 1.0]);
        assert_eq!((page.center, page.axis, page.down), ([0.0, 1.0, 2.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]));
        assert_eq!(page.corners[0], [1.0, 1.0, 0.5], "left is +y, up is +z");
        assert_eq!(page.corners[2], [1.0, -1.0, -0.5]);
    }
}
