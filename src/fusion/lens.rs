//! A camera in the form that fusion's inner loops want: plain numbers, nothing recomputed.

use crate::geometry::Camera;

/// The same arithmetic in the same order as [`Camera`], without matrices.
#[derive(Clone, Debug)]
pub(super) struct Lens {
    focal: [f64; 2],
    principal: [f64; 2],
    /// Rows of the rotation world-from-camera.
    world_from_cam: [[f64; 3]; 3],
    center: [f64; 3],
    /// Rows of the projection matrix.
    pub(super) projection: [[f64; 4]; 3],
}

impl Lens {
    pub(super) fn new(camera: &Camera) -> Self {
        let (fx, fy, cx, cy) = camera.intrinsics();
        let (r, p) = (camera.rotation(), camera.projection());
        Lens {
            focal: [fx, fy],
            principal: [cx, cy],
            world_from_cam: std::array::from_fn(|i| std::array::from_fn(|j| r[(j, i)])),
            center: (*camera.center()).into(),
            projection: std::array::from_fn(|i| std::array::from_fn(|j| p[(i, j)])),
        }
    }

    /// World point of pixel `(x, y)` at `depth`.
    #[inline]
    pub(super) fn world_point(&self, x: u32, y: u32, depth: f32) -> [f64; 3] {
        let z = f64::from(depth);
        let cam = [
            (f64::from(x) - self.principal[0]) * z / self.focal[0],
            (f64::from(y) - self.principal[1]) * z / self.focal[1],
            z,
        ];
        std::array::from_fn(|i| self.rotated(i, cam) + self.center[i])
    }

    /// World direction of a direction in the camera frame.
    #[inline]
    pub(super) fn world_direction(&self, v: [f32; 3]) -> [f32; 3] {
        let v = v.map(f64::from);
        std::array::from_fn(|i| self.rotated(i, v) as f32)
    }

    #[inline]
    fn rotated(&self, i: usize, v: [f64; 3]) -> f64 {
        let r = &self.world_from_cam[i];
        r[0] * v[0] + r[1] * v[1] + r[2] * v[2]
    }

    /// Depth of a world point.
    #[inline]
    pub(super) fn depth_of(&self, point: [f32; 3]) -> f64 {
        let p = &self.projection[2];
        let [x, y, z] = point.map(f64::from);
        p[0] * x + p[1] * y + p[2] * z + p[3]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::synthetic::camera;

    #[test]
    fn a_lens_computes_what_its_camera_computes() {
        let camera = camera(64, 48, [0.3, -0.2, 0.1], 0.37);
        let lens = Lens::new(&camera);
        for (x, y, depth) in [(0, 0, 1.5_f32), (63, 47, 7.25), (20, 31, 123.4)] {
            let expected = camera.world_from_image(f64::from(x), f64::from(y), f64::from(depth));
            let point = lens.world_point(x, y, depth);
            assert_eq!(point, [expected.x, expected.y, expected.z]);
            let rounded = point.map(|v| v as f32);
            assert_eq!(lens.depth_of(rounded), camera.depth_of(rounded));
            let direction = camera.world_from_cam_direction([0.1, 0.2, -0.9]);
            assert_eq!(
                lens.world_direction([0.1, 0.2, -0.9]),
                [direction.x as f32, direction.y as f32, direction.z as f32]
            );
        }
    }
}
