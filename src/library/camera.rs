//! An oriented camera.

use crate::error::{Error, Result};
use crate::geometry::{self, Size};
use nalgebra::{Matrix3, Vector3};

/// An oriented pinhole camera without distortion, for images of one size.
///
/// Camera axes: +x right, +y down, +z forward. Pixel centres are at whole numbers, so an image reaches from −0.5 to
/// its width − 0.5. Depth is the distance along z, in scene units.
///
/// ```
/// let k = [[500.0, 0.0, 319.5], [0.0, 500.0, 239.5], [0.0, 0.0, 1.0]];
/// let ahead = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
/// let camera = semvs::Camera::new((640, 480), k, ahead, [0.0, 0.0, -2.0])?;
/// let pixel = camera.project([0.0, 0.0, 0.0]).unwrap();
/// assert_eq!((pixel.x, pixel.y, pixel.depth), (319.5, 239.5, 2.0));
/// assert_eq!(camera.unproject([319.5, 239.5], 2.0), [0.0, 0.0, 0.0]);
/// assert!(camera.project([0.0, 0.0, -3.0]).is_none(), "behind the camera");
/// # Ok::<(), semvs::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Camera(pub(super) geometry::Camera);

/// Where a point of the world is in an image.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Pixel {
    /// Column; the centre of the first one is 0.
    pub x: f64,
    /// Row; the centre of the first one is 0.
    pub y: f64,
    /// Depth, scene units.
    pub depth: f64,
}

impl Camera {
    /// A camera for images of `(width, height)` pixels: intrinsics `k` in pixels, the rotation from the world to the
    /// camera (both by rows), the centre in the world.
    ///
    /// # Errors
    /// [`Error::Invalid`]: no pixels, a focal length that is not above 0, a number that is not finite, a rotation that is none.
    pub fn new(
        (width, height): (u32, u32),
        k: [[f64; 3]; 3],
        rotation: [[f64; 3]; 3],
        center: [f64; 3],
    ) -> Result<Self> {
        /// How far the rows of a rotation may be from orthogonal unit vectors.
        const TOLERANCE: f64 = 1e-4;
        let (k, rotation) = (matrix(k), matrix(rotation));
        let wrong = |what: &str| Err(Error::invalid(format!("camera: {what}")));
        if width == 0 || height == 0 {
            return wrong("its images have no pixels; give width and height above 0");
        }
        if !k.iter().chain(center.iter()).all(|v| v.is_finite()) {
            return wrong("intrinsics and centre must be finite numbers");
        }
        if k[(0, 0)] <= 0.0 || k[(1, 1)] <= 0.0 {
            return wrong("the focal lengths k[0][0] and k[1][1] must be above 0, in pixels");
        }
        let off = (rotation * rotation.transpose() - Matrix3::identity()).amax();
        if off.is_nan() || off > TOLERANCE || rotation.determinant() < 0.0 {
            return wrong("the rows of a rotation are orthogonal unit vectors, right-handed");
        }
        Ok(Camera(geometry::Camera::new(Size::new(width, height), k, rotation, center.into())))
    }

    /// Width of the images in pixels.
    pub fn width(&self) -> u32 {
        self.0.size().width
    }

    /// Height of the images in pixels.
    pub fn height(&self) -> u32 {
        self.0.size().height
    }

    /// Intrinsics in pixels, by rows.
    pub fn k(&self) -> [[f64; 3]; 3] {
        rows(self.0.k())
    }

    /// Rotation from the world to the camera, by rows.
    pub fn rotation(&self) -> [[f64; 3]; 3] {
        rows(self.0.rotation())
    }

    /// Centre in the world, scene units.
    pub fn center(&self) -> [f64; 3] {
        (*self.0.center()).into()
    }

    /// Where a point of the world is in the image, inside its borders or not; `None` for one that is not before the camera.
    pub fn project(&self, point: [f64; 3]) -> Option<Pixel> {
        let p = self.0.cam_from_world(&Vector3::from(point));
        (p.z > 0.0).then(|| {
            let (x, y) = self.0.image_from_cam(&p);
            Pixel { x, y, depth: p.z }
        })
    }

    /// The point of the world that a pixel `[x, y]` shows at `depth`.
    pub fn unproject(&self, [x, y]: [f64; 2], depth: f64) -> [f64; 3] {
        self.0.world_from_image(x, y, depth).into()
    }
}

fn matrix(rows: [[f64; 3]; 3]) -> Matrix3<f64> {
    Matrix3::from_fn(|r, c| rows[r][c])
}

fn rows(matrix: &Matrix3<f64>) -> [[f64; 3]; 3] {
    std::array::from_fn(|r| std::array::from_fn(|c| matrix[(r, c)]))
}

#[cfg(test)]
mod tests {
    use super::*;

    const K: [[f64; 3]; 3] = [[10.0, 0.0, 3.5], [0.0, 10.0, 1.5], [0.0, 0.0, 1.0]];
    const AHEAD: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

    #[test]
    fn what_is_no_camera_is_refused_with_the_reason() {
        let mut flat = K;
        flat[1][1] = 0.0;
        let mut odd = K;
        odd[0][2] = f64::NAN;
        let mirror = [[-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let cases = [
            (Camera::new((0, 4), K, AHEAD, [0.0; 3]), "no pixels"),
            (Camera::new((8, 4), flat, AHEAD, [0.0; 3]), "focal lengths"),
            (Camera::new((8, 4), odd, AHEAD, [0.0; 3]), "finite"),
            (Camera::new((8, 4), K, AHEAD, [f64::INFINITY, 0.0, 0.0]), "finite"),
            (Camera::new((8, 4), K, mirror, [0.0; 3]), "right-handed"),
            (Camera::new((8, 4), K, [[f64::NAN; 3]; 3], [0.0; 3]), "rotation"),
        ];
        for (camera, needle) in cases {
            let error = camera.unwrap_err().to_string();
            assert!(error.contains(needle), "{needle}: {error}");
        }
    }

    #[test]
    fn what_was_given_comes_back() {
        let turned = [[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]];
        let camera = Camera::new((8, 4), K, turned, [1.0, 2.0, 3.0]).unwrap();
        assert_eq!((camera.width(), camera.height()), (8, 4));
        assert_eq!((camera.k(), camera.rotation(), camera.center()), (K, turned, [1.0, 2.0, 3.0]));
    }
}
