//! Forward warp of one view's depths into another view.

use super::FilterView;
use crate::geometry::Lens;
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
    let (from, to) = (Lens::new(&neighbor.estimate.camera), Lens::new(&reference.estimate.camera));
    let depths = &neighbor.estimate.depth;
    let labels = reference.labels.zip(neighbor.labels);
    let (width, height) = (warped.width() as i32, warped.height() as i32);
    let mut points: Vec<Projected> = Vec::with_capacity(depths.width());
    for y in 0..depths.height() {
        points.clear();
        points.extend(depths.row(y).iter().enumerate().map(|(x, &depth)| {
            let point = to.cam_point(from.world_point(x as u32, y as u32, depth));
            let [u, v] = to.pixel(point);
            Projected {
                u,
                v,
                depth: if depth == 0.0 { 0.0 } else { point[2] as f32 },
                in_front: point[2] > 0.0,
            }
        }));
        for (x, point) in points.iter().enumerate() {
            let inside =
                point.u > -1.0 && point.v > -1.0 && point.u < f64::from(width) && point.v < f64::from(height);
            if point.depth == 0.0 || !point.in_front || !inside {
                continue;
            }
            let i = depths.index(x, y);
            let pixel = WarpedPixel {
                depth: point.depth,
                confidence: neighbor.estimate.confidence.as_ref().map_or(1.0, |c| c.data()[i]),
            };
            let ((left, right), (top, bottom)) = (floor_and_ceil(point.u), floor_and_ceil(point.v));
            for (u, v) in [(left, top), (left, bottom), (right, top), (right, bottom)] {
                if u < 0 || v < 0 || u >= width || v >= height {
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

/// A pixel of the neighbour in the reference view.
#[derive(Clone, Copy)]
struct Projected {
    u: f64,
    v: f64,
    /// 0 = the neighbour has no depth.
    depth: f32,
    in_front: bool,
}

/// The whole numbers around `value`, which is above −1 and small.
#[inline]
fn floor_and_ceil(value: f64) -> (i32, i32) {
    let truncated = value as i32;
    let floor = truncated - i32::from(f64::from(truncated) > value);
    (floor, floor + i32::from(f64::from(floor) < value))
}

/// Whether two labels are different classes; void (0) is no class.
fn differ(a: u16, b: u16) -> bool {
    a != b && a != 0 && b != 0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_numbers_around_a_value() {
        for value in [-0.999, -0.5, -0.0, 0.0, 0.25, 1.0, 7.999, 4096.5] {
            let expected = (f64::floor(value) as i32, f64::ceil(value) as i32);
            assert_eq!(floor_and_ceil(value), expected, "{value}");
        }
    }
}
