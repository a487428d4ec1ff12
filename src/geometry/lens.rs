//! A camera in the form that inner loops want: plain numbers, nothing recomputed.

use super::Camera;

/// The same arithmetic in the same order as [`Camera`], without matrices.
#[derive(Clone, Debug)]
pub(crate) struct Lens {
    focal: [f64; 2],
    principal: [f64; 2],
    /// Rows of the rotation camera-from-world.
    cam_from_world: [[f64; 3]; 3],
    /// Rows of the rotation world-from-camera.
    world_from_cam: [[f64; 3]; 3],
    center: [f64; 3],
    /// Rows of the projection matrix.
    pub(crate) projection: [[f64; 4]; 3],
}

impl Lens {
    pub(crate) fn new(camera: &Camera) -> Self {
        let (fx, fy, cx, cy) = camera.intrinsics();
        let (r, p) = (camera.rotation(), camera.projection());
        Lens {
            focal: [fx, fy],
            principal: [cx, cy],
            cam_from_world: std::array::from_fn(|i| std::array::from_fn(|j| r[(i, j)])),
            world_from_cam: std::array::from_fn(|i| std::array::from_fn(|j| r[(j, i)])),
            center: (*camera.center()).into(),
            projection: std::array::from_fn(|i| std::array::from_fn(|j| p[(i, j)])),
        }
    }

    /// World point of pixel `(x, y)` at `depth`.
    #[inline]
    pub(crate) fn world_point(&self, x: u32, y: u32, depth: f32) -> [f64; 3] {
        let z = f64::from(depth);
        let cam = [
            (f64::from(x) - self.principal[0]) * z / self.focal[0],
            (f64::from(y) - self.principal[1]) * z / self.focal[1],
            z,
        ];
        std::array::from_fn(|i| dot(&self.world_from_cam[i], cam) + self.center[i])
    }

    /// World direction of a direction in the camera frame.
    #[inline]
    pub(crate) fn world_direction(&self, v: [f32; 3]) -> [f32; 3] {
        let v = v.map(f64::from);
        std::array::from_fn(|i| dot(&self.world_from_cam[i], v) as f32)
    }

    /// Point in the camera frame of a world point.
    #[inline]
    pub(crate) fn cam_point(&self, point: [f64; 3]) -> [f64; 3] {
        let offset = std::array::from_fn(|i| point[i] - self.center[i]);
        std::array::from_fn(|i| dot(&self.cam_from_world[i], offset))
    }

    /// Pixel of a point in the camera frame (z must not be 0).
    #[inline]
    pub(crate) fn pixel(&self, cam: [f64; 3]) -> [f64; 2] {
        std::array::from_fn(|i| self.principal[i] + self.focal[i] * (cam[i] / cam[2]))
    }

    /// Depth of a world point.
    #[inline]
    pub(crate) fn depth_of(&self, point: [f32; 3]) -> f64 {
        let p = &self.projection[2];
        let [x, y, z] = point.map(f64::from);
        p[0] * x + p[1] * y + p[2] * z + p[3]
    }
}

#[inline]
fn dot(a: &[f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
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
            let cam = camera.cam_from_world(&expected);
            assert_eq!(lens.cam_point(point), [cam.x, cam.y, cam.z]);
            let pixel = camera.image_from_cam(&cam);
            assert_eq!(lens.pixel(lens.cam_point(point)), [pixel.0, pixel.1]);
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
