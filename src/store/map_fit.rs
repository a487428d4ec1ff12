//! Whether a depth map is of a given image, size and camera.

use super::depth_map::camera_of;
use crate::geometry::Camera;
use crate::scene::ImageId;
use nalgebra::{Matrix3, Vector3};
use semvs_formats::dmap::DepthMapHeader;
use semvs_formats::mvs::NO_ID;

/// Largest difference of focal length and principal point in pixels of the map. Programs scale intrinsics in `f32`
/// here and there; another calibration differs by more.
const K_TOLERANCE: f64 = 0.02;
/// Largest difference of an element of the rotation: a thousandth of a pixel at the border of an ordinary image.
const ROTATION_TOLERANCE: f64 = 1e-6;
/// Largest difference of a coordinate of the centre, relative to the larger of 1 and the coordinate: what is left of
/// a centre after a decimal text format.
const CENTER_TOLERANCE: f64 = 1e-7;

/// In what a depth map is not the one wanted.
pub(super) fn difference(header: &DepthMapHeader, id: ImageId, camera: &Camera) -> Option<String> {
    let size = camera.size();
    let found = header.ids.first().copied().unwrap_or(NO_ID);
    if found != id.0 {
        return Some(format!("it is the depth map of image {}", ImageId(found)));
    }
    if (header.width, header.height) != (size.width, size.height) {
        return Some(format!("it has {}×{} pixels instead of {size}", header.width, header.height));
    }
    let stored = camera_of(header);
    let k = (stored.k() - camera.k()).abs();
    if [(0, 0), (1, 1), (0, 2), (1, 2)].iter().any(|&at| k[at] > K_TOLERANCE) {
        return Some("its camera has other intrinsics than the scene's".to_owned());
    }
    let rotation: Matrix3<f64> = (stored.rotation() - camera.rotation()).abs();
    if rotation.max() > ROTATION_TOLERANCE {
        return Some("its camera has another rotation than the scene's".to_owned());
    }
    let apart: Vector3<f64> = (stored.center() - camera.center()).abs();
    let moved = apart.iter().zip(camera.center()).any(|(&d, &c)| d > CENTER_TOLERANCE * c.abs().max(1.0));
    moved.then(|| "its camera stands elsewhere than the scene's".to_owned())
}
