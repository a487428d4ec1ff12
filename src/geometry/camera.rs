//! The pinhole camera and the size of the image that its intrinsics refer to.

use nalgebra::{Matrix3, Matrix3x4, Vector3};

/// Width and height of a raster in pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Size {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

impl Size {
    /// A size of `width` columns and `height` rows.
    pub const fn new(width: u32, height: u32) -> Self {
        Size { width, height }
    }

    /// Number of pixels.
    pub const fn area(self) -> usize {
        self.width as usize * self.height as usize
    }

    /// The longer side.
    pub const fn longest(self) -> u32 {
        if self.width > self.height { self.width } else { self.height }
    }
}

impl std::fmt::Display for Size {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}×{}", self.width, self.height)
    }
}

/// An oriented pinhole camera at one image size.
///
/// Camera axes: +x right, +y down, +z forward. Pixel centres are at integer coordinates, so the image
/// spans `[-0.5, width - 0.5]`; rasters are row-major with the top row first. Depth is always the z
/// coordinate in the camera frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    size: Size,
    k: Matrix3<f64>,
    rotation: Matrix3<f64>,
    center: Vector3<f64>,
    projection: Matrix3x4<f64>,
}

impl Camera {
    /// The same camera, its centre moved by `offset`, scene units.
    pub fn moved(&self, offset: &Vector3<f64>) -> Camera {
        Camera::new(self.size(), *self.k(), *self.rotation(), self.center() + offset)
    }

    /// A camera with intrinsics `k` in pixels of `size`, rotation camera-from-world and centre in the world.
    pub fn new(size: Size, k: Matrix3<f64>, rotation: Matrix3<f64>, center: Vector3<f64>) -> Self {
        let kr = k * rotation;
        let t = kr * -center;
        let projection = Matrix3x4::from_columns(&[
            kr.column(0).into_owned(),
            kr.column(1).into_owned(),
            kr.column(2).into_owned(),
            t,
        ]);
        Camera { size, k, rotation, center, projection }
    }

    /// The image size that the intrinsics refer to.
    pub fn size(&self) -> Size {
        self.size
    }

    /// Intrinsics in pixels.
    pub fn k(&self) -> &Matrix3<f64> {
        &self.k
    }

    /// Focal lengths and principal point `(fx, fy, cx, cy)` in pixels.
    pub fn intrinsics(&self) -> (f64, f64, f64, f64) {
        (self.k[(0, 0)], self.k[(1, 1)], self.k[(0, 2)], self.k[(1, 2)])
    }

    /// Rotation, camera from world.
    pub fn rotation(&self) -> &Matrix3<f64> {
        &self.rotation
    }

    /// Centre in the world.
    pub fn center(&self) -> &Vector3<f64> {
        &self.center
    }

    /// `K R [I | -C]`.
    pub fn projection(&self) -> &Matrix3x4<f64> {
        &self.projection
    }

    /// The same pose with intrinsics scaled per axis to `size`: `c' = (c + 0.5)·a − 0.5`, `f' = a·f`.
    pub fn scaled_per_axis(&self, size: Size) -> Self {
        let ax = f64::from(size.width) / f64::from(self.size.width);
        let ay = f64::from(size.height) / f64::from(self.size.height);
        let mut k = self.k;
        k[(0, 0)] *= ax;
        k[(0, 1)] *= ax;
        k[(0, 2)] = (k[(0, 2)] + 0.5) * ax - 0.5;
        k[(1, 1)] *= ay;
        k[(1, 2)] = (k[(1, 2)] + 0.5) * ay - 0.5;
        Camera::new(size, k, self.rotation, self.center)
    }

    /// Homogeneous image point of a world point: sums in f64 in the order x, y, z, 1, rounded to f32.
    /// The third component is the depth.
    pub fn project_f32(&self, point_in_world: [f32; 3]) -> [f32; 3] {
        let [x, y, z] = point_in_world.map(f64::from);
        let p = &self.projection;
        std::array::from_fn(|i| (p[(i, 0)] * x + p[(i, 1)] * y + p[(i, 2)] * z + p[(i, 3)]) as f32)
    }

    /// Depth of a world point (third row of the projection, f64).
    pub fn depth_of(&self, point_in_world: [f32; 3]) -> f64 {
        let [x, y, z] = point_in_world.map(f64::from);
        let p = &self.projection;
        p[(2, 0)] * x + p[(2, 1)] * y + p[(2, 2)] * z + p[(2, 3)]
    }

    /// `R (X − C)`.
    pub fn cam_from_world(&self, point_in_world: &Vector3<f64>) -> Vector3<f64> {
        self.rotation * (point_in_world - self.center)
    }

    /// Pixel of a point in the camera frame (z must not be 0).
    pub fn image_from_cam(&self, p: &Vector3<f64>) -> (f64, f64) {
        let (fx, fy, cx, cy) = self.intrinsics();
        (cx + fx * (p.x / p.z), cy + fy * (p.y / p.z))
    }

    /// Point in the camera frame of pixel `(x, y)` at depth `z`. Skew is ignored, as OpenMVS does.
    pub fn cam_from_image(&self, x: f64, y: f64, z: f64) -> Vector3<f64> {
        let (fx, fy, cx, cy) = self.intrinsics();
        Vector3::new((x - cx) * z / fx, (y - cy) * z / fy, z)
    }

    /// Point in the world of pixel `(x, y)` at depth `z`.
    pub fn world_from_image(&self, x: f64, y: f64, z: f64) -> Vector3<f64> {
        self.rotation.transpose() * self.cam_from_image(x, y, z) + self.center
    }

    /// World direction of a camera-frame direction.
    pub fn world_from_cam_direction(&self, v: [f32; 3]) -> Vector3<f64> {
        self.rotation.transpose() * Vector3::new(f64::from(v[0]), f64::from(v[1]), f64::from(v[2]))
    }
}

/// Intrinsics divided by the longer side of `size`: `c' = (c + 0.5) / M − 0.5`, `f' = f / M`.
pub fn normalized_k(k: &Matrix3<f64>, size: Size) -> Matrix3<f64> {
    let s = 1.0 / f64::from(size.longest());
    let mut n = *k;
    n[(0, 0)] *= s;
    n[(0, 1)] *= s;
    n[(1, 1)] *= s;
    n[(0, 2)] = (n[(0, 2)] + 0.5) * s - 0.5;
    n[(1, 2)] = (n[(1, 2)] + 0.5) * s - 0.5;
    n
}
