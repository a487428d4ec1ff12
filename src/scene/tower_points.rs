//! Points on the surface of a tower that the cameras climb, where sparse points are few.

use super::{Scene, Tracks, ViewIndex};
use crate::geometry::Camera;
use nalgebra::Vector3;
use rayon::prelude::*;
use std::f32::consts::TAU;

/// Circles per unit of height, and points per unit along a circle: the scene is taken to be in metres, z upwards.
const DENSITY: f32 = 10.0;
/// Fewest points of a circle.
const MIN_ON_CIRCLE: usize = 10;
/// How far the tower is taken to reach below the lowest camera.
const BELOW: f32 = 5.0;
/// Smallest radius of the tower.
const MIN_RADIUS: f32 = 0.2;
/// Sparse points farther out than this part of the cameras' distance are not the tower's.
const NEAR: f32 = 0.8;
/// Circles on either side that the radius is averaged over.
const SMOOTH: usize = 2;
/// A tower of more points than this is not in metres.
const MAX_POINTS: f32 = 1e7;
/// Seed of the angles at which circles start.
const SEED: u64 = 0x7077_6572;

/// Points of a tower.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TowerPoints {
    /// Positions, and the views that see each from outside, at least two.
    pub tracks: Tracks,
    /// Unit normals, outwards.
    pub normals: Vec<[f32; 3]>,
}

/// A point and the views that see it from outside.
struct TowerPoint {
    position: [f32; 3],
    normal: [f32; 3],
    views: Vec<ViewIndex>,
}

/// Makes points on circles about the vertical through the middle of the cameras, from 5 units below the lowest camera (or
/// the lowest sparse point) up to the highest camera or point. A circle's radius is that of the sparse points at its
/// height, else a third of the cameras' distance less one unit. Points that fewer than two views see from outside are left
/// out. `None` if there are no cameras or the scene cannot be in metres.
///
/// The angle at which a circle starts depends on its number alone.
pub fn tower_points(scene: &Scene) -> Option<TowerPoints> {
    let cameras: Vec<Option<Camera>> = scene
        .views
        .iter()
        .map(|view| view.calibration.as_ref().and_then(|c| Some(c.camera_at(c.size?))))
        .collect();
    let axis = Axis::new(scene, &cameras)?;
    let radii = axis.radii(scene);
    let total: f32 = radii.iter().map(|r| r * TAU * DENSITY).sum();
    if radii.is_empty() || !total.is_finite() || total > MAX_POINTS {
        return None;
    }
    let circles: Vec<Vec<TowerPoint>> = radii
        .par_iter()
        .enumerate()
        .map(|(i, &radius)| {
            let count = MIN_ON_CIRCLE.max((radius * TAU * DENSITY).round() as usize);
            let start = TAU * start_of(i as u64);
            let z = axis.low + (i as f32 + 0.5) / DENSITY;
            let point = |k: usize| {
                let (s, c) = (start + TAU * k as f32 / count as f32).sin_cos();
                let position = [axis.center[0] + radius * c, axis.center[1] + radius * s, z];
                let normal = [c, s, 0.0];
                let views = seen_from_outside(position, normal, &cameras);
                (views.len() >= 2).then_some(TowerPoint { position, normal, views })
            };
            (0..count).filter_map(point).collect()
        })
        .collect();
    let mut points = TowerPoints::default();
    for point in circles.into_iter().flatten() {
        points.tracks.push(point.position, point.views);
        points.normals.push(point.normal);
    }
    Some(points)
}

/// A number in 0..1 that depends on `i` alone (SplitMix64, Steele 2014).
fn start_of(i: u64) -> f32 {
    hashed(i + SEED)
}

/// A number in [0, 1) that looks random and depends on `i` alone.
pub(super) fn hashed(i: u64) -> f32 {
    let mut z = i.wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ z >> 31) >> 40) as f32 / (1u64 << 24) as f32
}

/// The views in whose image a point lies and that look at its outer side.
fn seen_from_outside(point: [f32; 3], normal: [f32; 3], cameras: &[Option<Camera>]) -> Vec<ViewIndex> {
    let sees = |camera: &Camera| {
        let [x, y, z] = camera.project_f32(point);
        let size = camera.size();
        let inside = |v: f32, length: u32| (0.0..length as f32).contains(&(v / z));
        let to_camera = camera.center() - Vector3::from(point.map(f64::from));
        let faces = to_camera.dot(&Vector3::from(normal.map(f64::from))) > 0.0;
        z > 0.0 && faces && inside(x, size.width) && inside(y, size.height)
    };
    let views = cameras.iter().enumerate().filter(|(_, camera)| camera.as_ref().is_some_and(sees));
    views.map(|(i, _)| ViewIndex(i as u32)).collect()
}

/// Where the tower stands.
struct Axis {
    center: [f32; 2],
    low: f32,
    high: f32,
    lowest_camera: f32,
    /// Radius where there are no points.
    radius: f32,
    /// Distance of the cameras.
    reach: f32,
}

impl Axis {
    fn new(scene: &Scene, cameras: &[Option<Camera>]) -> Option<Self> {
        let centers: Vec<Vector3<f64>> = cameras.iter().flatten().map(|c| *c.center()).collect();
        if centers.is_empty() {
            return None;
        }
        let mean = centers.iter().sum::<Vector3<f64>>() / centers.len() as f64;
        let center = [mean.x as f32, mean.y as f32];
        let mut distances: Vec<f32> =
            centers.iter().map(|c| (c.x as f32 - center[0]).hypot(c.y as f32 - center[1])).collect();
        distances.sort_unstable_by(f32::total_cmp);
        let heights = || centers.iter().map(|c| c.z as f32);
        let lowest_camera = heights().fold(f32::MAX, f32::min);
        let highest_camera = heights().fold(f32::MIN, f32::max);
        let is_inside = |p: &[f32; 3]| scene.roi.as_ref().is_none_or(|roi| roi.contains(*p));
        let points = || scene.tracks.iter().map(|(p, _)| p).filter(is_inside).map(|p| p[2]);
        let radius = (distances[distances.len() / 2] - 1.0) / 3.0;
        Some(Axis {
            center,
            low: points().fold(lowest_camera - BELOW, f32::min),
            high: points().fold(highest_camera, f32::max),
            lowest_camera,
            radius: radius.max(MIN_RADIUS),
            reach: mean_between(&distances, 0.85, 0.95),
        })
    }

    /// The radius of every circle, from below.
    fn radii(&self, scene: &Scene) -> Vec<f32> {
        let count = ((self.high - self.low) * DENSITY).round().clamp(0.0, MAX_POINTS) as usize;
        let mut slices: Vec<Vec<f32>> = vec![Vec::new(); count];
        for (point, _) in scene.tracks.iter() {
            let distance = (point[0] - self.center[0]).hypot(point[1] - self.center[1]);
            let slice = ((point[2] - self.low) * DENSITY).floor();
            let is_near = distance < NEAR * self.reach && slice >= 0.0;
            if let Some(slice) = slices.get_mut(slice as usize).filter(|_| is_near) {
                slice.push(distance);
            }
        }
        let is_above = |i: usize| self.low + (i as f32 + 0.5) / DENSITY >= self.lowest_camera;
        let radii: Vec<f32> = slices
            .iter_mut()
            .enumerate()
            .map(|(i, distances)| {
                distances.sort_unstable_by(f32::total_cmp);
                let known = is_above(i) && distances.len() > 2;
                if known { mean_between(distances, 0.5, 0.95).max(MIN_RADIUS) } else { self.radius }
            })
            .collect();
        let smooth = |i: usize| {
            let around = &radii[i.saturating_sub(SMOOTH)..(i + SMOOTH + 1).min(count)];
            if is_above(i) { around.iter().sum::<f32>() / around.len() as f32 } else { radii[i] }
        };
        (0..count).map(smooth).collect()
    }
}

/// Mean of sorted values from one share of their number to another.
fn mean_between(sorted: &[f32], from: f32, to: f32) -> f32 {
    let count = sorted.len() as f32;
    let last = ((count * to).ceil() as usize).clamp(1, sorted.len());
    let first = ((count * from).floor() as usize).min(last - 1);
    let some = &sorted[first..last];
    some.iter().sum::<f32>() / some.len() as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Size;
    use crate::scene::{Calibration, ImageId, View, looks_like_tower};
    use nalgebra::Matrix3;

    /// 72 cameras climbing around a tower of radius 2 that stands at (50, 20), and points on it.
    fn scene() -> Scene {
        let mut scene = Scene::default();
        for i in 0..72u32 {
            let angle = f64::from(i) * std::f64::consts::TAU / 12.0;
            let height = f64::from(i) * 0.6;
            let outward = Vector3::new(angle.cos(), angle.sin(), 0.0);
            let center = Vector3::new(50.0, 20.0, height) + outward * 8.0;
            let (forward, down) = (-outward, Vector3::new(0.0, 0.0, -1.0));
            let right = down.cross(&forward);
            let rotation = Matrix3::from_rows(&[right.transpose(), down.transpose(), forward.transpose()]);
            let normalized_k = Matrix3::new(0.9, 0.0, 0.0, 0.0, 0.9, 0.0, 0.0, 0.0, 1.0);
            scene.views.push(View {
                name: format!("{i}.jpg"),
                mask: None,
                id: ImageId(i),
                calibration: Some(Calibration {
                    normalized_k,
                    rotation,
                    center,
                    size: Some(Size::new(640, 480)),
                }),
                neighbors: Vec::new(),
                avg_depth: 0.0,
            });
        }
        for i in 0..4000 {
            let angle = i as f32 * 2.4;
            let point = [50.0 + 2.0 * angle.cos(), 20.0 + 2.0 * angle.sin(), i as f32 * 0.011];
            scene.tracks.push(point, [ViewIndex(0), ViewIndex(1)]);
        }
        // The ground around, far beyond the tower.
        (0..100).for_each(|i| scene.tracks.push([50.0 + i as f32, 60.0, 2.0], [ViewIndex(0), ViewIndex(1)]));
        scene
    }

    #[test]
    fn points_lie_on_the_tower_and_are_seen_from_outside() {
        let scene = scene();
        assert!(looks_like_tower(&scene, false));
        let points = tower_points(&scene).unwrap();
        assert!(points.tracks.len() > 10_000 && points.normals.len() == points.tracks.len());
        let mut on_the_tower = 0;
        for (i, (p, views)) in points.tracks.iter().enumerate() {
            assert!(views.len() >= 2 && views.is_sorted());
            let out = [p[0] - 50.0, p[1] - 20.0];
            let radius = out[0].hypot(out[1]);
            on_the_tower += usize::from((radius - 2.0).abs() < 0.05);
            for view in views {
                let center = scene.views[view.index()].calibration.as_ref().unwrap().center;
                let to_camera = [center.x as f32 - p[0], center.y as f32 - p[1]];
                assert!(to_camera[0] * points.normals[i][0] + to_camera[1] * points.normals[i][1] > 0.0);
            }
        }
        let share = on_the_tower as f64 / points.tracks.len() as f64;
        assert!(share > 0.95, "{share}");
        assert_eq!(tower_points(&scene).unwrap(), points, "the same every time");
    }

    #[test]
    fn without_points_the_radius_is_a_third_of_the_cameras_distance() {
        let mut scene = scene();
        scene.tracks = Tracks::default();
        let points = tower_points(&scene).unwrap();
        let (p, _) = points.tracks.iter().next().unwrap();
        assert!(((p[0] - 50.0).hypot(p[1] - 20.0) - 7.0 / 3.0).abs() < 0.01, "{p:?}");
        let heights = || points.tracks.iter().map(|(p, _)| p[2]);
        assert!(heights().fold(f32::MAX, f32::min) >= -BELOW && heights().fold(0.0, f32::max) < 42.7);
    }

    #[test]
    fn scenes_that_cannot_be_in_metres_get_none() {
        let mut scene = scene();
        scene.tracks = Tracks::default();
        for view in &mut scene.views {
            view.calibration.as_mut().unwrap().center *= 1e5;
        }
        assert_eq!(tower_points(&scene), None);
        assert_eq!(tower_points(&Scene::default()), None);
    }

    #[test]
    fn percentiles_of_few_values() {
        assert_eq!(mean_between(&[5.0], 0.85, 0.95), 5.0);
        assert_eq!(mean_between(&[1.0, 2.0, 3.0, 4.0], 0.5, 0.95), 3.5);
    }
}
