//! Small analytic scenes with exact depths for unit tests.

use super::{DepthEstimate, Grid, ImageId};
use crate::geometry::{Camera, Size};
use nalgebra::{Matrix3, Vector3};

/// A world plane: unit normal facing the cameras (at negative z), and its offset `normal · X = offset`.
#[derive(Clone, Copy)]
pub(crate) struct Plane {
    pub(crate) normal: Vector3<f64>,
    pub(crate) offset: f64,
}

impl Plane {
    /// The plane with depth `z0` on the z axis and slopes `dz/dx`, `dz/dy`.
    pub(crate) fn slanted(z0: f64, slope_x: f64, slope_y: f64) -> Self {
        let n = Vector3::new(slope_x, slope_y, -1.0);
        let len = n.norm();
        Plane { normal: n / len, offset: -z0 / len }
    }
}

/// A camera of `width` × `height` pixels at `center`, turned by `yaw` radians about its y axis.
pub(crate) fn camera(width: u32, height: u32, center: [f64; 3], yaw: f64) -> Camera {
    let focal = f64::from(width);
    let k = Matrix3::new(
        focal,
        0.0,
        (f64::from(width) - 1.0) / 2.0,
        0.0,
        focal,
        (f64::from(height) - 1.0) / 2.0,
        0.0,
        0.0,
        1.0,
    );
    let (s, c) = yaw.sin_cos();
    let rotation = Matrix3::new(c, 0.0, -s, 0.0, 1.0, 0.0, s, 0.0, c);
    Camera::new(Size::new(width, height), k, rotation, Vector3::from(center))
}

/// The exact depth map of `plane` seen by `camera`, with normals and confidence 0.9.
pub(crate) fn view_of_plane(id: u32, camera: Camera, plane: Plane) -> DepthEstimate {
    let size = camera.size();
    let mut depth = Grid::filled(size, 0.0_f32);
    let n = camera.rotation() * plane.normal;
    let distance = plane.offset - plane.normal.dot(camera.center());
    for y in 0..depth.height() {
        for x in 0..depth.width() {
            let ray = camera.cam_from_image(x as f64, y as f64, 1.0);
            let z = distance / n.dot(&ray);
            depth[(x, y)] = if z > 0.0 { z as f32 } else { 0.0 };
        }
    }
    DepthEstimate {
        image_id: ImageId(id),
        image_name: format!("{id}.jpg"),
        source_ids: Vec::new(),
        camera,
        depth_range: (0.01, 1e6),
        depth,
        normal: Some(Grid::filled(size, [n.x as f32, n.y as f32, n.z as f32])),
        confidence: Some(Grid::filled(size, 0.9)),
    }
}

/// `count` cameras in a row, `step` apart along x and turned slightly inwards, before `plane`.
pub(crate) fn row_of_views(
    count: u32,
    width: u32,
    height: u32,
    step: f64,
    plane: Plane,
) -> Vec<DepthEstimate> {
    (0..count)
        .map(|i| {
            let offset = f64::from(i) - (f64::from(count) - 1.0) / 2.0;
            let center = [offset * step, 0.02 * offset, 0.0];
            view_of_plane(i, camera(width, height, center, -0.02 * offset), plane)
        })
        .collect()
}

/// An estimate with given depths, frontal normals and confidence 0.9.
pub(crate) fn estimate_of_depths(
    width: u32,
    height: u32,
    depth_at: impl Fn(usize, usize) -> f32,
) -> DepthEstimate {
    let plane = Plane::slanted(1.0, 0.0, 0.0);
    let mut estimate = view_of_plane(0, camera(width, height, [0.0; 3], 0.0), plane);
    for y in 0..height as usize {
        for x in 0..width as usize {
            estimate.depth[(x, y)] = depth_at(x, y);
        }
    }
    estimate
}
