//! Normals from the shape of a depth map, for maps that come without.

use crate::geometry::Camera;
use crate::geometry::is_similar_depth;
use crate::scene::{DepthMap, Grid, NormalMap};

/// Relative depth difference up to which a pixel is on the same surface as its neighbour.
const SAME_SURFACE: f32 = 0.03;
/// Neighbours needed for a normal.
const MIN_NEIGHBORS: u32 = 3;

/// Unit normals, camera frame, facing the camera, from the least-squares gradient of the depth over the 3×3 pixels
/// around each; zero where fewer than three of the neighbours are on the same surface.
pub fn normals_from_depth(depth: &DepthMap, camera: &Camera) -> NormalMap {
    let mut normals = Grid::filled(depth.size(), [0.0; 3]);
    for y in 0..depth.height() {
        for x in 0..depth.width() {
            if let Some(gradient) = gradient(depth, x, y) {
                normals[(x, y)] = normal(camera, x as f64, y as f64, f64::from(depth[(x, y)]), gradient);
            }
        }
    }
    normals
}

/// Change of the depth per pixel to the right and downwards.
fn gradient(depth: &DepthMap, x: usize, y: usize) -> Option<[f64; 2]> {
    let centre = depth[(x, y)];
    let (mut xx, mut xy, mut yy, mut xd, mut yd, mut count) = (0.0, 0.0, 0.0, 0.0, 0.0, 0);
    for (dx, dy) in [(-1, -1), (0, -1), (1, -1), (-1, 0), (1, 0), (-1, 1), (0, 1), (1, 1)] {
        let near = x.checked_add_signed(dx).zip(y.checked_add_signed(dy)).and_then(|(x, y)| depth.get(x, y));
        let Some(&near) = near.filter(|&&d| d > 0.0 && is_similar_depth(centre, d, SAME_SURFACE)) else {
            continue;
        };
        let (dx, dy, dd) = (dx as f64, dy as f64, f64::from(near) - f64::from(centre));
        xx += dx * dx;
        xy += dx * dy;
        yy += dy * dy;
        xd += dx * dd;
        yd += dy * dd;
        count += 1;
    }
    let determinant = xx * yy - xy * xy;
    (count >= MIN_NEIGHBORS && determinant > 0.0)
        .then(|| [(yy * xd - xy * yd) / determinant, (xx * yd - xy * xd) / determinant])
}

/// Normal of the surface through pixel `(x, y)` at depth `d` whose depth has the given gradient.
fn normal(camera: &Camera, x: f64, y: f64, d: f64, [gx, gy]: [f64; 2]) -> [f32; 3] {
    let (fx, fy, cx, cy) = camera.intrinsics();
    let n = [fx * gx, fy * gy, (cx - x) * gx + (cy - y) * gy - d];
    let length = n.iter().map(|v| v * v).sum::<f64>().sqrt();
    n.map(|v| (v / length) as f32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::synthetic::{Plane, camera, view_of_plane};

    /// Cosine of the error that the depth's curvature in pixels causes on the slanted test plane.
    const MIN_COS: f32 = 0.9999;

    #[test]
    fn normals_of_a_plane_are_the_planes() {
        let view = view_of_plane(0, camera(64, 48, [0.1, 0.2, 0.0], 0.1), Plane::slanted(6.0, 0.5, -0.3));
        let normals = normals_from_depth(&view.depth, &view.camera);
        for (a, b) in normals.data().iter().zip(view.normal.as_ref().unwrap().data()) {
            let cos = a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
            assert!(cos > MIN_COS, "{a:?} {b:?}");
        }
    }

    #[test]
    fn pixels_without_enough_of_their_surface_get_none() {
        let mut view = view_of_plane(0, camera(8, 8, [0.0; 3], 0.0), Plane::slanted(6.0, 0.0, 0.0));
        for (i, d) in view.depth.data_mut().iter_mut().enumerate() {
            *d = match i % 8 {
                0..=3 => 6.0,
                4 => 9.0,
                _ => 0.0,
            };
        }
        view.depth[(4, 1)] = 0.0;
        let normals = normals_from_depth(&view.depth, &view.camera);
        assert_eq!(normals[(3, 4)], [0.0, 0.0, -1.0], "the step to 9.0 is left out");
        assert_eq!(normals[(4, 0)], [0.0; 3], "alone");
        assert_eq!(normals[(4, 5)], [0.0; 3], "a line of pixels is no surface");
        assert_eq!(normals[(6, 4)], [0.0; 3]);
    }
}
