//! What the sparse points say about one view before it is estimated: its depth range, first depths and normals.

use super::{DepthMap, Grid, NormalMap, Tracks};
use crate::geometry::Camera;
use nalgebra::Vector3;
use spade::{DelaunayTriangulation, HasPosition, Point2, Triangulation};
use std::collections::HashMap;

/// The depth range of a view without sparse points.
pub const DEFAULT_DEPTH_RANGE: (f32, f32) = (0.1, 100.0);

/// A sparse point seen by one view.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SparsePoint {
    /// Column in the image, pixels; may be outside.
    pub x: f32,
    /// Row in the image, pixels; may be outside.
    pub y: f32,
    /// Depth along the optical axis, > 0.
    pub depth: f32,
    /// Unit surface normal in the camera frame, facing the camera, if one could be derived.
    pub normal: Option<[f32; 3]>,
}

/// The start of a view's estimation.
#[derive(Clone, Debug, PartialEq)]
pub struct SparseInit {
    /// The sparse points that the view sees, in the order of its list.
    pub points: Vec<SparsePoint>,
    /// Every depth of the view lies in `[min, max)`: the depths of the points with 10 % to spare, or
    /// [`DEFAULT_DEPTH_RANGE`].
    pub range: (f32, f32),
}

impl SparseInit {
    /// Projects the points with the given positions in `tracks` into `camera` and derives normals from their Delaunay
    /// triangulation in the image. Points that are not in front of the camera are left out.
    pub fn new(tracks: &Tracks, list: &[u32], camera: &Camera) -> Self {
        let (mut min, mut max) = (f32::INFINITY, 0.0f32);
        let mut points = Vec::with_capacity(list.len());
        for &i in list {
            let [x, y, z] = camera.project_f32(tracks.point(i as usize));
            let (x, y) = (x / z, y / z);
            if !(z > 0.0 && z.is_finite() && x.is_finite() && y.is_finite()) {
                continue;
            }
            (min, max) = (min.min(z), max.max(z));
            points.push(SparsePoint { x, y, depth: z, normal: None });
        }
        if points.is_empty() {
            return SparseInit { points, range: DEFAULT_DEPTH_RANGE };
        }
        add_normals(&mut points, camera);
        SparseInit { points, range: (min * 0.9, max * 1.1) }
    }

    /// Depths and normals of the points at the four pixels around each, 0 elsewhere; of points that share a pixel the
    /// last one counts.
    pub fn splat(&self, camera: &Camera) -> (DepthMap, NormalMap) {
        let size = camera.size();
        let mut depth = Grid::filled(size, 0.0);
        let mut normal = Grid::filled(size, [0.0; 3]);
        for point in &self.points {
            let (x, y) = (point.x.floor() as i64, point.y.floor() as i64);
            for (px, py) in [(x, y), (x, y + 1), (x + 1, y), (x + 1, y + 1)] {
                let inside =
                    (0..i64::from(size.width)).contains(&px) && (0..i64::from(size.height)).contains(&py);
                if inside {
                    let at = (px as usize, py as usize);
                    depth[at] = point.depth;
                    normal[at] = point.normal.unwrap_or_default();
                }
            }
        }
        (depth, normal)
    }
}

/// A corner of the triangulation: where the point projects to, and which point owns it.
struct Corner {
    position: Point2<f64>,
    point: usize,
}

impl HasPosition for Corner {
    type Scalar = f64;
    fn position(&self) -> Point2<f64> {
        self.position
    }
}

/// Gives every point the mean normal of its triangles, weighted by their area. Of points with the same projection only
/// the last one gets a normal; without any triangle nobody does.
fn add_normals(points: &mut [SparsePoint], camera: &Camera) {
    let mut owners: HashMap<[u64; 2], usize> = HashMap::with_capacity(points.len());
    for (i, p) in points.iter().enumerate() {
        owners.insert(position_of(p).map(f64::to_bits), i);
    }
    let corners: Vec<Corner> = points
        .iter()
        .enumerate()
        .filter(|(i, p)| owners[&position_of(p).map(f64::to_bits)] == *i)
        .map(|(i, p)| {
            let [x, y] = position_of(p);
            Corner { position: Point2::new(x, y), point: i }
        })
        .collect();
    let Ok(triangulation) = DelaunayTriangulation::<Corner>::bulk_load_stable(corners) else { return };
    let in_camera: Vec<Vector3<f64>> = points
        .iter()
        .map(|p| camera.cam_from_image(p.x.into(), p.y.into(), p.depth.into()).map(|v| f64::from(v as f32)))
        .collect();
    let mut sums = vec![Vector3::<f64>::zeros(); points.len()];
    for face in triangulation.inner_faces() {
        let corners = face.vertices().map(|v| v.data().point);
        let [a, b, c] = corners.map(|i| in_camera[i]);
        let cross = (b - a).cross(&(c - a));
        for i in corners {
            sums[i] += cross;
        }
    }
    for ((point, sum), ray) in points.iter_mut().zip(&sums).zip(&in_camera) {
        let length = sum.norm();
        if length > 0.0 && length.is_finite() {
            let towards = if sum.dot(ray) > 0.0 { -1.0 } else { 1.0 };
            point.normal = Some((sum * (towards / length)).map(|v| v as f32).into());
        }
    }
}

/// Where the point lies in the triangulation: 0 stands for positions too close to it to be told apart.
fn position_of(point: &SparsePoint) -> [f64; 2] {
    [point.x, point.y].map(|v| if v.abs() < f32::MIN_POSITIVE { 0.0 } else { f64::from(v) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Size;
    use crate::scene::synthetic;

    /// A camera at the origin, and tracks on the plane z = 10 + x / 2 at the given pixels.
    fn plane(pixels: &[(f64, f64)]) -> (Camera, Tracks, Vec<u32>) {
        let camera = synthetic::camera(200, 100, [0.0; 3], 0.0);
        let mut tracks = Tracks::default();
        for &(x, y) in pixels {
            let ray = camera.cam_from_image(x, y, 1.0);
            let z = 10.0 / (1.0 - 0.5 * ray.x);
            tracks.push((ray * z).map(|v| v as f32).into(), []);
        }
        (camera, tracks, (0..pixels.len() as u32).collect())
    }

    fn grid() -> Vec<(f64, f64)> {
        (0..6)
            .flat_map(|y| (0..9).map(move |x| (10.3 + 20.0 * f64::from(x), 7.6 + 15.0 * f64::from(y))))
            .collect()
    }

    #[test]
    fn points_on_a_plane_get_its_normal_and_the_range_has_a_margin() {
        let (camera, tracks, list) = plane(&grid());
        let init = SparseInit::new(&tracks, &list, &camera);
        assert_eq!(init.points.len(), 54);
        let expected = Vector3::new(0.5, 0.0, -1.0).normalize().map(|v| v as f32);
        for (point, (x, y)) in init.points.iter().zip(grid()) {
            assert!((f64::from(point.x) - x).abs() < 1e-3 && (f64::from(point.y) - y).abs() < 1e-3);
            let normal = Vector3::from(point.normal.unwrap());
            assert!((normal - expected).norm() < 1e-4, "{normal} is not {expected}");
        }
        let depths: Vec<f32> = init.points.iter().map(|p| p.depth).collect();
        let min = depths.iter().copied().fold(f32::INFINITY, f32::min);
        let max = depths.iter().copied().fold(0.0, f32::max);
        assert_eq!(init.range, (min * 0.9, max * 1.1));
    }

    #[test]
    fn of_equal_projections_the_last_owns_the_corner() {
        let mut pixels = grid();
        pixels.extend_from_slice(&grid()[..1]);
        let (camera, tracks, list) = plane(&pixels);
        let init = SparseInit::new(&tracks, &list, &camera);
        assert_eq!(init.points[0].normal, None);
        assert!(init.points[54].normal.is_some());
    }

    #[test]
    fn too_few_points_have_no_normals_and_none_at_all_the_default_range() {
        let (camera, tracks, list) = plane(&[(20.0, 30.0), (90.0, 40.0)]);
        let init = SparseInit::new(&tracks, &list, &camera);
        assert!(init.points.iter().all(|p| p.normal.is_none()));
        let none = SparseInit::new(&tracks, &[], &camera);
        assert_eq!((none.points.len(), none.range), (0, DEFAULT_DEPTH_RANGE));
    }

    #[test]
    fn points_behind_the_camera_do_not_count() {
        let (camera, mut tracks, mut list) = plane(&grid());
        let without = SparseInit::new(&tracks, &list, &camera);
        tracks.push([0.0, 0.0, -3.0], []);
        tracks.push([1.0, 0.0, 0.0], []);
        list.extend([54, 55]);
        assert_eq!(SparseInit::new(&tracks, &list, &camera), without);
    }

    #[test]
    fn splats_fill_the_four_pixels_around_each_point() {
        let camera = Camera::new(
            Size::new(3, 2),
            nalgebra::Matrix3::identity(),
            nalgebra::Matrix3::identity(),
            Vector3::zeros(),
        );
        let point = |x, y, depth| SparsePoint { x, y, depth, normal: None };
        let points = vec![point(0.5, 0.5, 1.0), point(1.2, -0.5, 2.0), point(-9.0, 1.0, 3.0)];
        let (depth, normal) = SparseInit { points, range: (1.0, 2.0) }.splat(&camera);
        assert_eq!(depth.data(), &[1.0, 2.0, 2.0, 1.0, 1.0, 0.0]);
        assert!(normal.data().iter().all(|n| *n == [0.0; 3]));
    }
}
