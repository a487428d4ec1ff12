//! Forward warp of one view's depths into another view.

use super::FilterView;
use crate::scene::Grid;

/// What a neighbour sees along the ray of a reference pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct WarpedPixel {
    /// Depth in the reference camera; 0 = the neighbour sees nothing here.
    pub(super) depth: f32,
    /// The neighbour's confidence.
    pub(super) confidence: f32,
}

impl WarpedPixel {
    pub(super) const EMPTY: WarpedPixel = WarpedPixel { depth: 0.0, confidence: 0.0 };
}

/// Writes every depth of `neighbor` to the up to four pixels of the reference around its projection. The
/// nearest depth wins; of equal ones, the last in raster order. With label maps on both sides, a pixel is not
/// written where the two labels are different classes.
pub(super) fn warp_into(
    warped: &mut Grid<WarpedPixel>,
    reference: &FilterView<'_>,
    neighbor: &FilterView<'_>,
) {
    let (from, to) = (&neighbor.estimate.camera, &reference.estimate.camera);
    let depths = &neighbor.estimate.depth;
    let labels = reference.labels.zip(neighbor.labels);
    for y in 0..depths.height() {
        for (x, &depth) in depths.row(y).iter().enumerate() {
            if depth == 0.0 {
                continue;
            }
            let i = depths.index(x, y);
            let point = to.cam_from_world(&from.world_from_image(x as f64, y as f64, f64::from(depth)));
            if point.z <= 0.0 {
                continue;
            }
            let pixel = WarpedPixel {
                depth: point.z as f32,
                confidence: neighbor.estimate.confidence.as_ref().map_or(1.0, |c| c.data()[i]),
            };
            let (u, v) = to.image_from_cam(&point);
            let (u0, u1, v0, v1) = (u.floor(), u.ceil(), v.floor(), v.ceil());
            for (u, v) in [(u0, v0), (u0, v1), (u1, v0), (u1, v1)] {
                if !(u >= 0.0 && v >= 0.0 && u < warped.width() as f64 && v < warped.height() as f64) {
                    continue;
                }
                let target = (u as usize, v as usize);
                if labels.is_some_and(|(own, other)| differ(own[target], other.data()[i])) {
                    continue;
                }
                let current = &mut warped[target];
                if current.depth == 0.0 || current.depth >= pixel.depth {
                    *current = pixel;
                }
            }
        }
    }
}

/// Whether two labels are different classes; void (0) is no class.
fn differ(a: u16, b: u16) -> bool {
    a != b && a != 0 && b != 0
}
