//! Which points stand in the way of others that are seen well.

use super::blocks::{Beam, Blocks};
use super::directions::Directions;
use crate::geometry::Camera;
use nalgebra::Vector3;
use rayon::prelude::*;
use std::sync::atomic::{AtomicI64, Ordering};

/// How far beyond a point, relative to its distance, others behind it count.
const REACH: f64 = 1.02;
/// Points whose distances differ by less than this share are at the same surface.
const SAME_SURFACE: f64 = 0.01;

/// A cloud's points and the views that see each.
#[derive(Clone, Copy, Debug)]
pub struct PointViews<'a> {
    /// World positions, finite.
    pub positions: &'a [[f32; 3]],
    /// `offsets[i]..offsets[i + 1]` is point `i`'s part of `views`; one entry more than points.
    pub offsets: &'a [u64],
    /// Positions of views in the scene.
    pub views: &'a [u32],
}

impl PointViews<'_> {
    /// The views of point `i`.
    pub(super) fn of(&self, i: usize) -> &[u32] {
        &self.views[self.offsets[i] as usize..self.offsets[i + 1] as usize]
    }

    /// How many views see point `i`.
    fn count(&self, i: usize) -> i64 {
        (self.offsets[i + 1] - self.offsets[i]) as i64
    }

    /// The points that each of `count` views sees.
    fn by_view(&self, count: usize) -> Vec<Vec<u32>> {
        let mut seen = vec![Vec::new(); count];
        for i in 0..self.positions.len() {
            for &view in self.of(i) {
                if let Some(seen) = seen.get_mut(view as usize) {
                    seen.push(i as u32);
                }
            }
        }
        seen
    }
}

/// The visibility of every point: for each point X and each view that sees it, all points Y within about a pixel of the
/// line of sight gain the number of their own views if they are behind X (up to 1.02 of its distance), and lose the
/// number of X's views if they are before it. Points within 1 % of X's distance count as the same surface.
///
/// `cameras` has one entry per view, at the size whose pixel is meant; views without one do not count. The result does
/// not depend on the order of points or threads.
pub fn point_visibility(cloud: PointViews<'_>, cameras: &[Option<Camera>]) -> Vec<i64> {
    let sums: Vec<AtomicI64> = cloud.positions.iter().map(|_| AtomicI64::new(0)).collect();
    if !sums.is_empty() {
        let blocks = Blocks::new(cloud.positions);
        let seen = cloud.by_view(cameras.len());
        for (camera, seen) in cameras.iter().zip(&seen) {
            if let (Some(camera), false) = (camera, seen.is_empty()) {
                Eye::new(cloud, camera).count(&blocks, seen, &sums);
            }
        }
    }
    sums.into_iter().map(AtomicI64::into_inner).collect()
}

/// A camera that looks at the cloud.
struct Eye<'a> {
    cloud: PointViews<'a>,
    center: Vector3<f64>,
    /// Half the angle of a line of sight's cone, radians.
    half_angle: f64,
    sin2: f64,
}

impl<'a> Eye<'a> {
    fn new(cloud: PointViews<'a>, camera: &Camera) -> Self {
        let width = f64::from(camera.size().width.max(1));
        let field_of_view = 2.0 * (width / (2.0 * camera.intrinsics().0)).atan();
        let half_angle = (field_of_view / width).abs();
        let sin2 = half_angle.sin() * half_angle.sin();
        Eye { cloud, center: *camera.center(), half_angle, sin2 }
    }

    fn ray(&self, point: u32) -> Vector3<f64> {
        Vector3::from(self.cloud.positions[point as usize].map(f64::from)) - self.center
    }

    /// Adds what the points in `seen` and their lines of sight say of all points.
    fn count(&self, blocks: &Blocks, seen: &[u32], sums: &[AtomicI64]) {
        let beam = self.beam(seen);
        let near = blocks.near(&beam).filter_map(|point| {
            let ray = self.ray(point);
            let distance = ray.norm();
            (distance > 0.0 && distance <= beam.reach).then(|| (point, ray / distance))
        });
        let directions = Directions::new(near, self.half_angle);
        seen.par_iter().with_min_len(256).for_each(|&x| {
            let ray = self.ray(x);
            let distance = ray.norm();
            if distance > 0.0 {
                directions.around(&(ray / distance), |y| {
                    if let Some(gain) = self.gain(x, &ray, distance, y) {
                        sums[y as usize].fetch_add(gain, Ordering::Relaxed);
                    }
                });
            }
        });
    }

    /// What the line of sight to `x` adds to `y`; `None` if it says nothing.
    fn gain(&self, x: u32, to_x: &Vector3<f64>, distance_x: f64, y: u32) -> Option<i64> {
        let to_y = self.ray(y);
        let along = to_x.dot(&to_y);
        let within = along > 0.0
            && to_x.cross(&to_y).norm_squared() <= self.sin2 * to_x.norm_squared() * to_y.norm_squared();
        if !within || along > REACH * distance_x * distance_x {
            return None;
        }
        let distance_y = to_y.norm();
        if (distance_x - distance_y).abs() / distance_x < SAME_SURFACE {
            return None;
        }
        let behind = distance_y > distance_x;
        Some(if behind { self.cloud.count(y as usize) } else { -self.cloud.count(x as usize) })
    }

    /// What holds all lines of sight to `seen`.
    fn beam(&self, seen: &[u32]) -> Beam {
        let mut sum = Vector3::zeros();
        let mut farthest = 0.0f64;
        for &point in seen {
            let ray = self.ray(point);
            let distance = ray.norm();
            farthest = farthest.max(distance);
            if distance > 0.0 {
                sum += ray / distance;
            }
        }
        // A cone's rim is a little farther from its tip than its base.
        let reach = farthest * REACH / self.half_angle.cos().max(0.1);
        let Some(axis) = sum.try_normalize(1e-9) else {
            let half_angle = std::f64::consts::PI;
            return Beam { apex: self.center, axis: Vector3::z(), half_angle, reach };
        };
        let least = seen.iter().map(|&p| self.ray(p)).filter(|r| r.norm() > 0.0);
        let least = least.map(|ray| ray.dot(&axis) / ray.norm()).fold(1.0, f64::min);
        let half_angle = least.clamp(-1.0, 1.0).acos() + self.half_angle;
        Beam { apex: self.center, axis, half_angle, reach }
    }
}

/// The order that remains of `values` when, from the last to the first, every one at or below `limit` is removed by
/// moving the then last one into its place.
pub fn swap_removed(values: &[i64], limit: i64) -> Vec<u32> {
    let mut order: Vec<u32> = (0..values.len() as u32).collect();
    for i in (0..order.len()).rev() {
        if values[i] <= limit {
            order.swap_remove(i);
        }
    }
    order
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::synthetic;

    struct Wall {
        positions: Vec<[f32; 3]>,
        offsets: Vec<u64>,
        views: Vec<u32>,
        cameras: Vec<Option<Camera>>,
    }

    /// A cloud of a wall with holes in front and stray points, seen by three cameras.
    fn wall() -> Wall {
        let mut state = 7u32;
        let mut random = move || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / (1 << 24) as f32
        };
        let (mut positions, mut offsets, mut views) = (Vec::new(), vec![0u64], Vec::new());
        for i in 0..900 {
            let depth = if i % 9 == 0 { 3.0 + 4.0 * random() } else { 5.0 + 0.3 * random() };
            positions.push([(random() - 0.5) * 4.0, (random() - 0.5) * 3.0, depth]);
            let first = (i % 3) as u32;
            views.push(first);
            if i % 9 != 0 {
                views.push((first + 1) % 3);
            }
            offsets.push(views.len() as u64);
        }
        let cameras = (0..3).map(|i| {
            Some(synthetic::camera(80, 60, [f64::from(i) - 1.0, 0.0, 0.0], 0.05 * (f64::from(i) - 1.0)))
        });
        Wall { positions, offsets, views, cameras: cameras.collect() }
    }

    /// The definition, pair by pair.
    fn by_brute_force(cloud: PointViews<'_>, cameras: &[Option<Camera>]) -> Vec<i64> {
        let mut sums = vec![0i64; cloud.positions.len()];
        let point = |i: usize| Vector3::from(cloud.positions[i].map(f64::from));
        for x in 0..cloud.positions.len() {
            for &view in cloud.of(x) {
                let Some(camera) = &cameras[view as usize] else { continue };
                let (width, fx) = (f64::from(camera.size().width), camera.k()[(0, 0)]);
                let half_angle = 2.0 * (width / (2.0 * fx)).atan() / width;
                let to_x = point(x) - camera.center();
                for y in (0..cloud.positions.len()).filter(|&y| y != x) {
                    let to_y = point(y) - camera.center();
                    let (dx, dy) = (to_x.norm(), to_y.norm());
                    let along = to_x.dot(&to_y) / dx;
                    if (along / dy).clamp(-1.0, 1.0).acos() > half_angle || along > 1.02 * dx {
                        continue;
                    }
                    if (dx - dy).abs() / dx < 0.01 {
                        continue;
                    }
                    sums[y] += if dy > dx { cloud.of(y).len() as i64 } else { -(cloud.of(x).len() as i64) };
                }
            }
        }
        sums
    }

    #[test]
    fn sums_are_those_of_all_pairs() {
        let Wall { positions, offsets, views, mut cameras } = wall();
        for without in [None, Some(1)] {
            if let Some(view) = without {
                cameras[view] = None;
            }
            let cloud = PointViews { positions: &positions, offsets: &offsets, views: &views };
            let expected = by_brute_force(cloud, &cameras);
            assert!(expected.iter().any(|&v| v < -2) && expected.iter().any(|&v| v > 0), "{expected:?}");
            assert_eq!(point_visibility(cloud, &cameras), expected);
        }
    }

    #[test]
    fn the_order_of_points_does_not_matter() {
        let Wall { positions, offsets, views, cameras } = wall();
        let cloud = PointViews { positions: &positions, offsets: &offsets, views: &views };
        let straight = point_visibility(cloud, &cameras);
        let (mut turned, mut turned_offsets, mut turned_views) = (Vec::new(), vec![0u64], Vec::new());
        for i in (0..positions.len()).rev() {
            turned.push(positions[i]);
            turned_views.extend_from_slice(cloud.of(i));
            turned_offsets.push(turned_views.len() as u64);
        }
        let cloud = PointViews { positions: &turned, offsets: &turned_offsets, views: &turned_views };
        let mut back = point_visibility(cloud, &cameras);
        back.reverse();
        assert_eq!(back, straight);
    }

    #[test]
    fn a_point_before_a_wall_is_seen_through() {
        let cameras = vec![Some(synthetic::camera(80, 60, [0.0; 3], 0.0))];
        // A stray point, and two points behind it that two entries see; the last is just beyond the first of them.
        let positions = [[0.0, 0.0, 2.0], [0.0, 0.0, 4.0], [0.0, 0.0, 4.06]];
        let (offsets, views) = ([0, 1, 3, 4], [0, 0, 0, 0]);
        let cloud = PointViews { positions: &positions, offsets: &offsets, views: &views };
        // Before the wall: -2 for each of the two views of the second, -1 for the third. Behind the second by 1.5 %: +1
        // for each of its views, and the second loses 1 to the third.
        assert_eq!(point_visibility(cloud, &cameras), [-5, -1, 2]);
        assert_eq!(swap_removed(&[-5, -1, 2], -2), [2, 1]);
    }

    #[test]
    fn removal_moves_the_last_point_into_the_hole() {
        assert_eq!(swap_removed(&[0, -9, 5, -20, 7], -9), [0, 4, 2]);
        assert_eq!(swap_removed(&[], 0), [0u32; 0]);
        assert_eq!(swap_removed(&[-1, -1], 0), [0u32; 0]);
    }

    #[test]
    fn an_empty_cloud_has_no_visibility() {
        let cloud = PointViews { positions: &[], offsets: &[0], views: &[] };
        assert!(point_visibility(cloud, &[]).is_empty());
    }
}
