//! Points made up where a scene has none: on the images' rays, at depths around those where the viewing axes meet.

use super::tower_points::hashed;
use super::{Tracks, ViewIndex};
use crate::geometry::Camera;
use nalgebra::Vector3;
use std::collections::BTreeSet;
use std::ops::Range;

/// Points per side of an image and pair.
const CELLS: u32 = 16;
/// Depths as parts of the depth where the axes meet.
const DEPTHS: Range<f64> = 0.3..1.3;
/// A view is paired with so many of those whose cameras are nearest.
const PARTNERS: usize = 24;
/// Square of the sine of one degree: axes at a smaller angle meet nowhere that can be told.
const MIN_SINE_SQUARED: f64 = 3e-4;

/// For every pair of views near each other whose axes meet in front of both, points on a grid of 16 × 16 rays of either
/// image, at hashed depths of 0.3 to 1.3 times that of the axes' meeting, as far as the other image sees them too. The same
/// points in every run; none if no axes meet.
pub fn virtual_points(cameras: &[Option<Camera>]) -> Tracks {
    let mut tracks = Tracks::default();
    for (a, b) in pairs(cameras) {
        let (Some(first), Some(second)) = (&cameras[a], &cameras[b]) else { continue };
        let Some((depth_a, depth_b)) = meeting(first, second) else { continue };
        let views = [ViewIndex(a as u32), ViewIndex(b as u32)];
        let seed = (a * cameras.len() + b) as u64;
        grid(first, depth_a, second, views, seed, &mut tracks);
        grid(second, depth_b, first, views, !seed, &mut tracks);
    }
    tracks
}

/// Pairs of views, the lower first, in order.
fn pairs(cameras: &[Option<Camera>]) -> BTreeSet<(usize, usize)> {
    let used: Vec<(usize, &Camera)> =
        cameras.iter().enumerate().filter_map(|(i, camera)| Some((i, camera.as_ref()?))).collect();
    let mut pairs = BTreeSet::new();
    for &(i, camera) in &used {
        let mut others: Vec<(f64, usize)> = used
            .iter()
            .filter(|(j, _)| *j != i)
            .map(|(j, other)| ((other.center() - camera.center()).norm_squared(), *j))
            .collect();
        others.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        pairs.extend(others.iter().take(PARTNERS).map(|&(_, j)| (i.min(j), i.max(j))));
    }
    pairs
}

/// Depths along both viewing axes at which these are nearest to each other; `None` if that is not in front of both.
fn meeting(a: &Camera, b: &Camera) -> Option<(f64, f64)> {
    let axis = |camera: &Camera| -> Vector3<f64> { camera.rotation().row(2).transpose() };
    let (p, q) = (axis(a), axis(b));
    let between = b.center() - a.center();
    let cosine = p.dot(&q);
    let sine_squared = 1.0 - cosine * cosine;
    if sine_squared < MIN_SINE_SQUARED {
        return None;
    }
    let (along_a, along_b) = (p.dot(&between), q.dot(&between));
    let depths = ((along_a - cosine * along_b) / sine_squared, (cosine * along_a - along_b) / sine_squared);
    (depths.0 > 0.0 && depths.1 > 0.0).then_some(depths)
}

/// Adds the points on the rays of `camera` that `other` sees.
fn grid(camera: &Camera, depth: f64, other: &Camera, views: [ViewIndex; 2], seed: u64, tracks: &mut Tracks) {
    let (size, seen) = (camera.size(), other.size());
    let pixel = |cell: u32, side: u32| (f64::from(cell) + 0.5) / f64::from(CELLS) * f64::from(side) - 0.5;
    for cell in 0..CELLS * CELLS {
        let share =
            f64::from(hashed(seed.wrapping_mul(u64::from(CELLS * CELLS)).wrapping_add(u64::from(cell))));
        let depth = depth * (DEPTHS.start + share * (DEPTHS.end - DEPTHS.start));
        let (x, y) = (pixel(cell % CELLS, size.width), pixel(cell / CELLS, size.height));
        let point: [f32; 3] = camera.world_from_image(x, y, depth).map(|v| v as f32).into();
        let [u, v, z] = other.project_f32(point);
        let inside = |coordinate: f32, side: u32| (0.0..side as f32).contains(&(coordinate / z));
        if z > 0.0 && inside(u, seen.width) && inside(v, seen.height) {
            tracks.push(point, views);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::synthetic::camera;

    #[test]
    fn points_lie_around_the_place_that_both_look_at() {
        // Axes that meet 10 units in front of the first camera.
        let yaw = 0.2_f64;
        let cameras = [
            Some(camera(200, 100, [0.0; 3], 0.0)),
            None,
            Some(camera(200, 100, [10.0 * yaw.tan(), 0.0, 0.0], -yaw)),
        ];
        let (near, far) = meeting(cameras[0].as_ref().unwrap(), cameras[2].as_ref().unwrap()).unwrap();
        assert!((near - 10.0).abs() < 1e-9 && (far - 10.0 / yaw.cos()).abs() < 1e-9, "{near} {far}");
    }

    #[test]
    fn made_up_points_are_seen_by_both_and_always_the_same() {
        let cameras: Vec<Option<Camera>> = [-0.2, 0.2]
            .iter()
            .flat_map(|&yaw| [-2.0, 2.0].map(|x| Some(camera(200, 100, [x, 0.0, 0.0], yaw))))
            .collect();
        let tracks = virtual_points(&cameras);
        assert!(tracks.len() > 100);
        for (point, views) in tracks.iter() {
            assert_eq!(views.len(), 2);
            let seen = |v: &ViewIndex| cameras[v.index()].as_ref().unwrap().depth_of(point) > 0.0;
            assert!(views.iter().all(seen));
        }
        assert_eq!(tracks, virtual_points(&cameras));
    }

    #[test]
    fn parallel_axes_meet_nowhere() {
        let cameras = [-1.0, 1.0].map(|x| Some(camera(200, 100, [x, 0.0, 0.0], 0.0)));
        assert!(virtual_points(&cameras).is_empty());
    }
}
