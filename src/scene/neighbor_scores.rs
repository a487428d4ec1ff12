//! The score of every other view as a neighbour of one view.

use super::neighbors::{NeighborOptions, OutsideRoi};
use super::{Neighbor, Scene, ViewIndex};
use crate::geometry::Camera;
use nalgebra::Vector3;

/// A neighbour shares at least this many points.
const MIN_SHARED_POINTS: u32 = 3;
/// The image is divided into `GRID`×`GRID` cells to measure the area that shared points cover.
const GRID: usize = 16;

/// What the scores of all views are computed from.
pub(super) struct ScoreContext<'a> {
    pub(super) scene: &'a Scene,
    cameras: &'a [Option<Camera>],
    pub(super) options: &'a NeighborOptions,
    /// Number of views with a camera.
    pub(super) calibrated: usize,
    /// `seen[offsets[v]..offsets[v + 1]]` are the points that view `v` sees, ascending.
    offsets: Vec<usize>,
    seen: Vec<u32>,
    /// Weight of every point, `None` if all count the same.
    roi_weights: Option<Vec<f32>>,
    angle_weight: AngleWeight,
    min_trust: usize,
}

/// Sums per other view, reused from view to view.
pub(super) struct Scratch {
    sums: Vec<Sums>,
    /// Views with a sum, in the order in which they came up.
    touched: Vec<u32>,
}

#[derive(Clone, Copy, Default)]
struct Sums {
    points: u32,
    score: f32,
    scale: f32,
    angle: f32,
    cells: [u64; GRID * GRID / 64],
}

/// The neighbours of one view, all of them, and the points that initialise it.
pub(super) struct ScoredView {
    pub(super) neighbors: Vec<Neighbor>,
    pub(super) tracks: Vec<u32>,
    pub(super) avg_depth: f32,
}

/// Weight of a triangulation angle: a bell around the best angle, steeper below it.
struct AngleWeight {
    best: f32,
    below: f32,
    above: f32,
}

impl AngleWeight {
    fn new(best_angle_deg: f32) -> Self {
        let best = best_angle_deg.to_radians();
        let falloff = |share: f32| -1.0 / (2.0 * (share * best) * (share * best));
        AngleWeight { best, below: falloff(0.38), above: falloff(0.7) }
    }

    fn of(&self, angle: f32) -> f32 {
        /// No angle counts less.
        const MIN: f32 = 0.1;
        let d = angle - self.best;
        (d * d * if angle < self.best { self.below } else { self.above }).exp().max(MIN)
    }
}

/// Weight of a ratio of footprints, reference : neighbour: full if the neighbour sees the point up to 1.6 times finer.
fn scale_weight(ratio: f32) -> f32 {
    const FINER: f32 = 1.6;
    if ratio > FINER {
        (FINER / ratio) * (FINER / ratio)
    } else if ratio >= 1.0 {
        1.0
    } else {
        ratio * ratio
    }
}

impl<'a> ScoreContext<'a> {
    pub(super) fn new(scene: &'a Scene, cameras: &'a [Option<Camera>], options: &'a NeighborOptions) -> Self {
        let calibrated = cameras.iter().flatten().count();
        let (offsets, seen) = points_by_view(scene);
        let roi_weights = match (options.outside_roi, &scene.roi) {
            (OutsideRoi::Count, _) | (_, None) => None,
            (outside, Some(roi)) => {
                let outside = if outside == OutsideRoi::Drop { 0.0 } else { 0.7 };
                let weight = |i: usize| if roi.contains(scene.tracks.point(i)) { 1.0 } else { outside };
                Some((0..scene.tracks.len()).map(weight).collect())
            }
        };
        ScoreContext {
            scene,
            cameras,
            options,
            calibrated,
            offsets,
            seen,
            roi_weights,
            angle_weight: AngleWeight::new(options.best_angle_deg),
            min_trust: options.min_views_trust_point.max(2).min(calibrated),
        }
    }

    pub(super) fn scratch(&self) -> Scratch {
        Scratch { sums: vec![Sums::default(); self.scene.views.len()], touched: Vec::new() }
    }

    pub(super) fn camera(&self, view: ViewIndex) -> Option<&'a Camera> {
        self.cameras.get(view.index())?.as_ref()
    }

    /// Weight of a point; 0 = it does not count.
    fn weight(&self, point: u32) -> f32 {
        self.roi_weights.as_ref().map_or(1.0, |w| w[point as usize])
    }

    /// The other views that see a point and have a camera; one that observed it twice comes twice.
    fn others(&self, point: u32, index: usize) -> impl Iterator<Item = (u32, &'a Camera)> {
        let views = self.scene.tracks.visibility(point as usize).iter();
        views.filter(move |v| v.index() != index).filter_map(|&v| Some((v.0, self.camera(v)?)))
    }
}

/// For each view the points that it sees, once each and ascending.
fn points_by_view(scene: &Scene) -> (Vec<usize>, Vec<u32>) {
    let distinct = |i: usize| {
        let views = scene.tracks.visibility(i);
        views.iter().enumerate().filter(|&(k, v)| k == 0 || views[k - 1] != *v).map(|(_, v)| v.index())
    };
    let mut offsets = vec![0usize; scene.views.len() + 1];
    for i in 0..scene.tracks.len() {
        distinct(i).for_each(|v| offsets[v + 1] += 1);
    }
    for v in 0..scene.views.len() {
        offsets[v + 1] += offsets[v];
    }
    let mut next = offsets.clone();
    let mut seen = vec![0; offsets[scene.views.len()]];
    for i in 0..scene.tracks.len() {
        for v in distinct(i) {
            seen[next[v]] = i as u32;
            next[v] += 1;
        }
    }
    (offsets, seen)
}

/// Scores every other view as a neighbour of view `index`; `None` if that view has no camera.
pub(super) fn score_view(
    context: &ScoreContext<'_>,
    index: usize,
    scratch: &mut Scratch,
) -> Option<ScoredView> {
    let camera = context.cameras.get(index)?.as_ref()?;
    let (tracks, avg_depth) = add_scores(context, index, camera, scratch);
    add_areas(context, index, camera, &tracks, scratch);
    scratch.touched.sort_unstable();
    let mut neighbors = Vec::with_capacity(scratch.touched.len());
    for &other in &scratch.touched {
        let sums = std::mem::take(&mut scratch.sums[other as usize]);
        let cells: u32 = sums.cells.iter().map(|c| c.count_ones()).sum();
        if sums.points < MIN_SHARED_POINTS || cells == 0 {
            continue;
        }
        /// No area counts less.
        const MIN_AREA: f32 = 0.01;
        let area = cells as f32 / (GRID * GRID) as f32;
        let points = sums.points as f32;
        neighbors.push(Neighbor {
            view: ViewIndex(other),
            points: sums.points,
            scale: sums.scale / points,
            angle: sums.angle / points,
            area,
            score: sums.score * area.max(MIN_AREA),
        });
    }
    scratch.touched.clear();
    neighbors.sort_by(|a, b| b.score.total_cmp(&a.score));
    Some(ScoredView { neighbors, tracks, avg_depth })
}

/// Sums angle and scale weights over the points that view `index` sees. Returns the points that initialise it and
/// the mean depth.
fn add_scores(
    context: &ScoreContext<'_>,
    index: usize,
    camera: &Camera,
    scratch: &mut Scratch,
) -> (Vec<u32>, f32) {
    /// With fewer points the sum of depths is not divided (as OpenMVS).
    const MIN_POINTS_FOR_MEAN: u32 = 4;
    let seen = &context.seen[context.offsets[index]..context.offsets[index + 1]];
    let mut tracks = Vec::with_capacity(seen.len());
    let (mut depth_sum, mut depth_count) = (0.0f32, 0u32);
    for &i in seen {
        let weight = context.weight(i);
        let point = context.scene.tracks.point(i as usize);
        let depth = camera.depth_of(point);
        if weight == 0.0 || depth as f32 <= 0.0 {
            continue;
        }
        if context.scene.tracks.visibility(i as usize).len() >= context.min_trust {
            tracks.push(i);
        }
        depth_sum += depth as f32;
        depth_count += 1;
        let footprint = (camera.k()[(0, 0)] / depth) as f32;
        let ray = ray_to(camera, point);
        for (other, other_camera) in context.others(i, index) {
            let angle = angle_between(ray, ray_to(other_camera, point));
            let other_footprint = (other_camera.k()[(0, 0)] / other_camera.depth_of(point)) as f32;
            let ratio = footprint / other_footprint;
            let sums = &mut scratch.sums[other as usize];
            if sums.points == 0 {
                scratch.touched.push(other);
            }
            sums.points += 1;
            sums.score += context.angle_weight.of(angle) * scale_weight(ratio) * weight;
            sums.scale += ratio;
            sums.angle += angle;
        }
    }
    let mean = if depth_count >= MIN_POINTS_FOR_MEAN { depth_sum / depth_count as f32 } else { depth_sum };
    (tracks, mean)
}

/// Marks the cells of the image of view `index` that hold a point inside both images.
fn add_areas(
    context: &ScoreContext<'_>,
    index: usize,
    camera: &Camera,
    tracks: &[u32],
    scratch: &mut Scratch,
) {
    let size = camera.size();
    for &i in tracks {
        let point = context.scene.tracks.point(i as usize);
        let Some((x, y)) = pixel_inside(camera, point) else { continue };
        let cell = |v: f32, extent: u32| ((v / extent as f32) * GRID as f32) as usize;
        let bit = cell(y, size.height).min(GRID - 1) * GRID + cell(x, size.width).min(GRID - 1);
        for (other, other_camera) in context.others(i, index) {
            if pixel_inside(other_camera, point).is_some() {
                scratch.sums[other as usize].cells[bit / 64] |= 1 << (bit % 64);
            }
        }
    }
}

/// Pixel of a world point if it is in `[0, width) × [0, height)`.
fn pixel_inside(camera: &Camera, point: [f32; 3]) -> Option<(f32, f32)> {
    let [x, y, z] = camera.project_f32(point);
    let inverse = 1.0 / z;
    let (x, y) = (x * inverse, y * inverse);
    let size = camera.size();
    ((0.0..size.width as f32).contains(&x) && (0.0..size.height as f32).contains(&y)).then_some((x, y))
}

/// From a world point to the camera centre.
fn ray_to(camera: &Camera, point: [f32; 3]) -> Vector3<f32> {
    (camera.center() - Vector3::from(point.map(f64::from))).map(|v| v as f32)
}

/// Angle between two directions in radians.
fn angle_between(a: Vector3<f32>, b: Vector3<f32>) -> f32 {
    let cos = a.dot(&b) / (a.dot(&a) * b.dot(&b)).sqrt();
    cos.clamp(-1.0, 1.0).acos()
}
