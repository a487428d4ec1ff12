//! Colour of a finished point from the view that sees it from nearest.

use super::participant::Participant;

const WHITE: [u8; 3] = [255; 3];

/// Colour of `point` in the view of smallest depth, the first of equal ones; white outside the image or within a
/// pixel of its border.
///
/// As in OpenMVS every product of the bilinear sum is cut to a whole number, which darkens by up to 3 levels.
pub(super) fn nearest_view_color(point: [f32; 3], views: &[&Participant<'_>]) -> [u8; 3] {
    let mut nearest: Option<(f32, &Participant<'_>)> = None;
    for view in views {
        let depth = view.lens.depth_of(point) as f32;
        if nearest.is_none_or(|(least, _)| depth < least) {
            nearest = Some((depth, view));
        }
    }
    nearest.map_or(WHITE, |(_, view)| bilinear(point, view))
}

fn bilinear(point: [f32; 3], view: &Participant<'_>) -> [u8; 3] {
    let p = &view.lens.projection;
    let [x, y, z] = point.map(f64::from);
    let [qx, qy, qz] = [0, 1, 2].map(|i| (p[i][0] * x + p[i][1] * y + p[i][2] * z + p[i][3]) as f32);
    let inverse = 1.0 / qz;
    let (u, v) = (qx * inverse, qy * inverse);
    let (right, bottom) = (view.width as f32 - 2.0, view.height as f32 - 2.0);
    let Some(image) = view.color.filter(|_| u >= 1.0 && v >= 1.0 && u <= right && v <= bottom) else {
        return WHITE;
    };
    let (left, top) = (u as usize, v as usize);
    let (fx, fy) = (u - left as f32, v - top as f32);
    let (gx, gy) = (1.0 - fx, 1.0 - fy);
    let width = view.width as usize;
    std::array::from_fn(|channel| {
        let times = |value: u8, factor: f32| (f32::from(value) * factor) as u8;
        let texel = |dx: usize, dy: usize| image[(top + dy) * width + left + dx][channel];
        let upper = times(texel(0, 0), gx).saturating_add(times(texel(1, 0), fx));
        let lower = times(texel(0, 1), gx).saturating_add(times(texel(1, 1), fx));
        times(upper, gy).saturating_add(times(lower, fy))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fusion::FusionMaps;
    use crate::fusion::participant::ViewPixels;
    use crate::scene::synthetic::{Plane, camera, view_of_plane};
    use crate::scene::{Grid, ViewIndex};
    use std::sync::Arc;

    /// A view of 16 × 16 pixels and focal length 16 at `z` on the optical axis, black but for four pixels.
    fn maps(z: f64, four: [u8; 4]) -> ViewPixels {
        let estimate = view_of_plane(0, camera(16, 16, [0.0, 0.0, z], 0.0), Plane::slanted(10.0, 0.0, 0.0));
        let mut color = Grid::filled(estimate.depth.size(), [0; 3]);
        for (pixel, value) in [(2, 1), (3, 1), (2, 2), (3, 2)].into_iter().zip(four) {
            color[pixel] = [value, 0, value];
        }
        let maps = FusionMaps { color: Some(Arc::new(color)), ..FusionMaps::new(Arc::new(estimate)) };
        ViewPixels::new(maps, true)
    }

    /// The point at depth 16 of the view at the origin whose image is at `(u, v)`.
    fn point(u: f32, v: f32) -> [f32; 3] {
        [u - 7.5, v - 7.5, 16.0]
    }

    #[test]
    fn every_product_is_cut_to_a_whole_number() {
        let maps = maps(0.0, [100, 201, 50, 77]);
        let view = Participant::new(ViewIndex(0), &maps);
        let color = |u, v| nearest_view_color(point(u, v), &[&view]);
        // 100 · 0.75 + 201 · 0.25 = 75 + 50, 50 · 0.75 + 77 · 0.25 = 37 + 19, (125 + 56) · 0.5 = 62 + 28.
        assert_eq!(color(2.25, 1.5), [90, 0, 90]);
        assert_eq!(color(2.0, 1.0), [100, 0, 100]);
        assert_eq!(color(3.0, 2.0), [77, 0, 77]);
    }

    #[test]
    fn near_the_border_points_are_white() {
        let maps = maps(0.0, [0; 4]);
        let view = Participant::new(ViewIndex(0), &maps);
        let is_white = |u, v| nearest_view_color(point(u, v), &[&view]) == WHITE;
        assert!(!is_white(1.0, 1.0) && !is_white(14.0, 14.0));
        assert!(
            is_white(0.9375, 5.0)
                && is_white(5.0, 0.9375)
                && is_white(14.0625, 5.0)
                && is_white(5.0, 14.0625)
        );
        assert_eq!(nearest_view_color(point(5.0, 5.0), &[]), WHITE);
    }

    #[test]
    fn the_view_of_smallest_depth_is_asked_and_of_equal_ones_the_first() {
        let (far, near, twin) = (maps(0.0, [10; 4]), maps(8.0, [20; 4]), maps(0.0, [30; 4]));
        let [far, near, twin] = [&far, &near, &twin].map(|m| Participant::new(ViewIndex(0), m));
        // On the way to the second camera the point's image moves: (-5 / 8 · 16 + 7.5) = -2.5 is outside.
        assert_eq!(nearest_view_color(point(2.5, 1.5), &[&far, &near]), WHITE);
        assert_eq!(nearest_view_color(point(2.5, 1.5), &[&far, &twin])[0], 10);
        assert_eq!(nearest_view_color(point(2.5, 1.5), &[&twin, &far])[0], 30);
    }
}
