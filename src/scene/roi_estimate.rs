//! A region of interest from where the cameras stand and look.

use super::{Scene, ViewIndex};
use crate::geometry::Roi;
use nalgebra::Vector3;

/// When to estimate a region of interest for a scene without one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum RoiEstimation {
    /// Never.
    Off,
    /// Always.
    Always,
    /// If the cameras surround what they look at, as in the scan of an object.
    #[default]
    ObjectScan,
}

/// Fewer cameras give no region.
const MIN_VIEWS: usize = 3;

/// A camera's place and the depth it sees a point at.
struct Viewer {
    center: Vector3<f64>,
    forward: Vector3<f64>,
}

impl Viewer {
    fn depth_of(&self, point: &Vector3<f64>) -> f64 {
        self.forward.dot(point) - self.forward.dot(&self.center)
    }
}

/// The axis-aligned box, with a margin of 10 %, of the sparse points that some camera sees nearer than twice the
/// distance of the farthest camera from the scene's centre. `None` if `mode` or the camera layout says so, there are
/// fewer than three cameras, or no point has views.
///
/// The centre lies ahead of the cameras' median position, along their mean viewing direction, the farther the more
/// they look the same way.
pub fn estimate_roi(scene: &Scene, mode: RoiEstimation) -> Option<Roi> {
    let viewers: Vec<Option<Viewer>> =
        scene.views.iter().map(|v| v.calibration.as_ref().map(viewer)).collect();
    let all: Vec<&Viewer> = viewers.iter().flatten().collect();
    if mode == RoiEstimation::Off || all.len() < MIN_VIEWS {
        return None;
    }
    let center = scene_center(&all, mode)?;
    let distances = all.iter().map(|v| (v.center - center).norm() as f32);
    let reach = f64::from(2.0 * distances.fold(0.0, f32::max));
    let near = |point: &Vector3<f64>, views: &[ViewIndex]| {
        views.iter().filter_map(|v| viewers[v.index()].as_ref()).any(|v| v.depth_of(point) < reach)
    };
    let (mut min, mut max) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    for (point, views) in scene.tracks.iter() {
        if near(&Vector3::from(point.map(f64::from)), views) {
            for i in 0..3 {
                min[i] = min[i].min(point[i]);
                max[i] = max[i].max(point[i]);
            }
        }
    }
    /// Share of its size that each side of the box grows.
    const MARGIN: f32 = 0.1;
    Roi::axis_aligned(min, max, MARGIN)
}

fn viewer(calibration: &super::Calibration) -> Viewer {
    Viewer { center: calibration.center, forward: calibration.rotation.row(2).transpose() }
}

/// The centre of what the cameras look at; `None` if it is to be an object scan and the layout is none.
fn scene_center(viewers: &[&Viewer], mode: RoiEstimation) -> Option<Vector3<f64>> {
    /// Mean viewing directions longer than this come from cameras that look the same way.
    const BALANCED: f32 = std::f32::consts::FRAC_1_SQRT_2;
    let median_center = Vector3::from([0, 1, 2].map(|i| {
        let mut values: Vec<f32> = viewers.iter().map(|v| v.center[i] as f32).collect();
        f64::from(median(&mut values))
    }));
    let sum: Vector3<f64> = viewers.iter().map(|v| v.forward).sum();
    let mean = sum / viewers.len() as f64;
    let length = mean.norm() as f32;
    if mode == RoiEstimation::ObjectScan && length > BALANCED {
        return None;
    }
    let direction = if length >= 1e-7 { mean / f64::from(length) } else { mean };
    let mut spread: Vec<f32> = viewers.iter().map(|v| (v.center - median_center).norm() as f32).collect();
    let ahead = length.min(0.999).asin().tan() * median(&mut spread);
    let center = median_center + direction * f64::from(ahead);
    let all_ahead = viewers.iter().all(|v| v.depth_of(&center) > 0.0);
    (mode == RoiEstimation::Always || all_ahead).then_some(center)
}

/// Median of at least one value; the mean of the two middle ones if their number is even.
fn median(values: &mut [f32]) -> f32 {
    values.sort_unstable_by(f32::total_cmp);
    let middle = values.len() / 2;
    if values.len() % 2 == 1 { values[middle] } else { (values[middle - 1] + values[middle]) / 2.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Calibration, ImageId, Tracks, View};
    use nalgebra::Matrix3;

    /// A view at `center` that looks along `forward` (z component 0, unit length).
    fn view(center: [f64; 3], forward: [f64; 2]) -> View {
        let rotation =
            Matrix3::new(-forward[1], forward[0], 0.0, 0.0, 0.0, -1.0, forward[0], forward[1], 0.0);
        let calibration = Calibration {
            normalized_k: Matrix3::identity(),
            rotation,
            center: Vector3::from(center),
            size: None,
        };
        View {
            name: String::new(),
            mask: None,
            id: ImageId(0),
            calibration: Some(calibration),
            neighbors: Vec::new(),
            avg_depth: 0.0,
        }
    }

    /// Eight cameras around the origin, looking at it, and points of a cube of side 2, with one far outlier.
    fn ring() -> Scene {
        let views = (0..8).map(|i| {
            let (s, c) = (f64::from(i) * std::f64::consts::FRAC_PI_4).sin_cos();
            view([5.0 * c, 5.0 * s, 0.0], [-c, -s])
        });
        let mut tracks = Tracks::default();
        for corner in 0..8 {
            let point = [0, 1, 2].map(|i| if corner >> i & 1 == 0 { -1.0 } else { 1.0 });
            tracks.push(point, [ViewIndex(corner), ViewIndex((corner + 1) % 8)]);
        }
        tracks.push([-100.0, 0.0, 0.0], [ViewIndex(0), ViewIndex(1)]);
        Scene { views: views.collect(), tracks, roi: None }
    }

    #[test]
    fn an_object_scan_gets_the_box_of_its_near_points() {
        let expected = Roi::axis_aligned([-1.0; 3], [1.0; 3], 0.1).unwrap();
        assert_eq!(estimate_roi(&ring(), RoiEstimation::ObjectScan), Some(expected));
        assert_eq!(estimate_roi(&ring(), RoiEstimation::Off), None);
    }

    #[test]
    fn cameras_that_look_the_same_way_are_no_object_scan() {
        let mut scene = ring();
        scene.views = (0..8).map(|i| view([-5.0, f64::from(i) - 3.5, 0.0], [1.0, 0.0])).collect();
        assert_eq!(estimate_roi(&scene, RoiEstimation::ObjectScan), None);
        assert!(estimate_roi(&scene, RoiEstimation::Always).is_some());
    }

    #[test]
    fn cameras_that_look_outwards_are_no_object_scan() {
        let mut scene = ring();
        scene.views = (0..8)
            .map(|i| {
                let (s, c) = (f64::from(i) * std::f64::consts::FRAC_PI_4).sin_cos();
                view([5.0 * c, 5.0 * s, 0.0], [c, s])
            })
            .collect();
        assert_eq!(estimate_roi(&scene, RoiEstimation::ObjectScan), None);
    }

    #[test]
    fn too_few_cameras_or_points_give_none() {
        let mut scene = ring();
        scene.tracks = Tracks::default();
        assert_eq!(estimate_roi(&scene, RoiEstimation::Always), None);
        scene.tracks.push([0.0, 1.0, 2.0], []);
        scene.tracks.push([3.0, 4.0, 5.0], []);
        assert_eq!(estimate_roi(&scene, RoiEstimation::Always), None);
        let mut scene = ring();
        scene.views[2..].iter_mut().for_each(|v| v.calibration = None);
        assert_eq!(estimate_roi(&scene, RoiEstimation::Always), None);
    }

    #[test]
    fn medians_of_even_counts_are_means() {
        assert_eq!(median(&mut [3.0, 1.0, 2.0]), 2.0);
        assert_eq!(median(&mut [4.0, 1.0, 3.0, 2.0]), 2.5);
    }
}
