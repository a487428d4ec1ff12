//! Colour of a finished point from the view that sees it from nearest.

use super::correspond::Participant;

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
