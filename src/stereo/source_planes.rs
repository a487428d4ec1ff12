//! The depth map of a source view as it is compared with: planes of inverse depth, made once for all views that do.

use super::plane::{InversePlane, Pinhole};
use crate::geometry::{Camera, Size};
use crate::scene::DepthEstimate;
use std::sync::Arc;

/// Confidence from which on an estimate is proposed to other views.
const SURE: f32 = 0.05;

/// The depth map of a source view as a plane of inverse depth per pixel.
#[derive(Clone, Debug)]
pub struct SourcePlanes {
    pub(crate) size: Size,
    /// Camera at that size.
    pub(crate) camera: Camera,
    /// Two words a pixel: the bits of its inverse depth (0 = none; the lowest bit says whether it is trusted), and the upper halves of the bits of its change
    /// per column (low half) and per row (high half).
    pub(crate) planes: Arc<[u32]>,
}

impl SourcePlanes {
    /// The planes of `map`; without normals they face the camera.
    pub fn new(map: &DepthEstimate) -> Self {
        let (fx, fy, cx, cy) = map.camera.intrinsics();
        let pinhole = Pinhole { fx: fx as f32, fy: fy as f32, cx: cx as f32, cy: cy as f32 };
        let width = map.depth.width();
        let mut planes = vec![0; 2 * map.depth.size().area()];
        let unknown = vec![[0.0, 0.0, -1.0]; width];
        for (y, out) in planes.chunks_exact_mut(2 * width.max(1)).enumerate() {
            let normals = map.normal.as_ref().map_or(&unknown[..], |n| n.row(y));
            let pixels = map.depth.row(y).iter().zip(normals);
            for ((x, (&depth, &normal)), out) in (0i32..).zip(pixels).zip(out.chunks_exact_mut(2)) {
                let p = pinhole.plane(x as f32, y as f32, depth, normal);
                let known = u32::from(depth > 0.0).wrapping_neg();
                let sure = map.confidence.as_ref().is_none_or(|c| c[(x as usize, y)] >= SURE);
                out[0] = (p.w.to_bits() & !1 | u32::from(sure)) & known;
                out[1] = (upper_half(p.wx) | upper_half(p.wy) << 16) & known;
            }
        }
        SourcePlanes { size: map.depth.size(), camera: map.camera.clone(), planes: planes.into() }
    }

    /// The plane of a pixel, anchored there, if the map has one that is good enough to propose to others.
    pub(crate) fn trusted(&self, x: usize, y: usize) -> Option<InversePlane> {
        let at = 2 * (y * self.size.width as usize + x);
        let (w, slopes) = (self.planes[at], self.planes[at + 1]);
        (w & 1 != 0).then(|| InversePlane {
            w: f32::from_bits(w),
            wx: f32::from_bits(slopes << 16),
            wy: f32::from_bits(slopes & 0xffff_0000),
        })
    }

    /// Bytes that they take in memory.
    pub fn bytes(&self) -> usize {
        size_of_val(&*self.planes)
    }
}

/// The upper half of a float's bits, rounded: eight significant bits.
fn upper_half(v: f32) -> u32 {
    v.to_bits().wrapping_add(0x8000) >> 16
}
