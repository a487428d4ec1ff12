//! Hypotheses as planes of inverse depth over the pixel grid.

/// A local plane: inverse depth at a pixel and its change per pixel. Exact under perspective, because the
/// inverse depth of a plane is affine in pixel coordinates.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct InversePlane {
    /// Inverse depth at the anchor pixel.
    pub(crate) w: f32,
    /// Change of inverse depth per column.
    pub(crate) wx: f32,
    /// Change of inverse depth per row.
    pub(crate) wy: f32,
}

impl InversePlane {
    /// The same plane anchored `dx` columns and `dy` rows further on.
    #[inline]
    pub(crate) fn moved(self, dx: f32, dy: f32) -> Self {
        InversePlane { w: self.w + self.wx * dx + self.wy * dy, ..self }
    }
}

/// Focal lengths and principal point in pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Pinhole {
    pub(crate) fx: f32,
    pub(crate) fy: f32,
    pub(crate) cx: f32,
    pub(crate) cy: f32,
}

impl Pinhole {
    /// The plane vector `m` with `m · ray = w` for the ray of every pixel, `|m|` = 1 / distance of the plane.
    #[inline]
    pub(crate) fn plane_vector(&self, p: InversePlane, x: f32, y: f32) -> [f32; 3] {
        [p.wx * self.fx, p.wy * self.fy, p.w - p.wx * (x - self.cx) - p.wy * (y - self.cy)]
    }

    /// Unit normal facing the camera of the plane anchored at pixel `(x, y)`.
    #[inline]
    pub(crate) fn normal(&self, p: InversePlane, x: f32, y: f32) -> [f32; 3] {
        let m = self.plane_vector(p, x, y).map(f64::from);
        let length = (m[0] * m[0] + m[1] * m[1] + m[2] * m[2]).sqrt();
        let r = -1.0 / length.max(f64::MIN_POSITIVE);
        m.map(|v| (v * r) as f32)
    }

    /// The plane through depth `depth` at pixel `(x, y)` with unit normal `n`. A normal that is zero or does not
    /// face the camera gives a plane parallel to the image.
    pub(crate) fn plane(&self, x: f32, y: f32, depth: f32, n: [f32; 3]) -> InversePlane {
        let w = 1.0 / depth;
        let ray = [(x - self.cx) / self.fx, (y - self.cy) / self.fy, 1.0];
        let d = n[0] * ray[0] + n[1] * ray[1] + n[2] * ray[2];
        if d >= -0.05 {
            return InversePlane { w, wx: 0.0, wy: 0.0 };
        }
        let s = w / d;
        InversePlane { w, wx: n[0] * s / self.fx, wy: n[1] * s / self.fy }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CAM: Pinhole = Pinhole { fx: 500.0, fy: 480.0, cx: 310.0, cy: 240.0 };

    #[test]
    fn normal_and_plane_are_inverse() {
        let n = [0.36f32, -0.48, -0.8];
        let p = CAM.plane(100.0, 50.0, 3.0, n);
        let back = CAM.normal(p, 100.0, 50.0);
        for i in 0..3 {
            assert!((back[i] - n[i]).abs() < 1e-5, "{back:?}");
        }
    }

    #[test]
    fn moved_plane_is_the_same_plane() {
        // plane z = 4 + 0.5 x in the camera frame
        let depth = |x: f32| 4.0 / (1.0 - 0.5 * (x - CAM.cx) / CAM.fx);
        let len = (1.0f32 + 0.25).sqrt();
        let p = CAM.plane(200.0, 100.0, depth(200.0), [0.5 / len, 0.0, -1.0 / len]);
        let q = p.moved(150.0, 30.0);
        assert!((1.0 / q.w - depth(350.0)).abs() < 1e-4, "{} {}", 1.0 / q.w, depth(350.0));
    }
}
