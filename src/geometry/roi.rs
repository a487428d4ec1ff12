//! The oriented box of interest.

use crate::error::{Error, Result};
use nalgebra::{Matrix3, Vector3};

/// Oriented box: world points inside are kept.
#[derive(Clone, Debug, PartialEq)]
pub struct Roi {
    /// Rows are the box axes in the world.
    pub rotation: Matrix3<f64>,
    /// Box centre in the world.
    pub center: Vector3<f64>,
    /// Half sizes along the axes, all > 0.
    pub half_extent: Vector3<f64>,
}

impl Roi {
    /// The axis-aligned box from corner `min` to corner `max`, each side lengthened by the share `margin` of its size
    /// (half of it at either end). Single precision, as boxes are stored. `None` if it has no volume.
    pub fn axis_aligned(min: [f32; 3], max: [f32; 3], margin: f32) -> Option<Self> {
        let mut center = Vector3::zeros();
        let mut half_extent = Vector3::zeros();
        for i in 0..3 {
            let grow = (max[i] - min[i]) * margin * 0.5;
            let (low, high) = (min[i] - grow, max[i] + grow);
            center[i] = f64::from((high + low) * 0.5);
            half_extent[i] = f64::from((high - low) * 0.5);
        }
        let roi = Roi { rotation: Matrix3::identity(), center, half_extent };
        roi.half_extent.iter().all(|&e| e > 0.0 && e.is_finite()).then_some(roi)
    }

    /// Whether a world point is inside, faces included: `|R (X − centre)| <= half extents` in single precision.
    pub fn contains(&self, point: [f32; 3]) -> bool {
        let d: [f32; 3] = std::array::from_fn(|i| point[i] - self.center[i] as f32);
        (0..3).all(|i| {
            let r = |j: usize| self.rotation[(i, j)] as f32;
            (r(0) * d[0] + r(1) * d[1] + r(2) * d[2]).abs() <= self.half_extent[i] as f32
        })
    }

    /// The box with its half extents multiplied by `border` if that is > 0, lengthened by `|border|` if it is < 0, as
    /// it is if 0.
    ///
    /// # Errors
    /// [`Error::Invalid`] if `border` is not finite.
    pub fn with_border(&self, border: f32) -> Result<Self> {
        if !border.is_finite() {
            return Err(Error::invalid(format!("roi-border {border}: give a factor > 0, or a length < 0")));
        }
        let mut roi = self.clone();
        for extent in roi.half_extent.iter_mut() {
            let single = *extent as f32;
            *extent = f64::from(match border {
                b if b > 0.0 => single * b,
                b => single - b,
            });
        }
        Ok(roi)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn turned() -> Roi {
        // Box axes: x along world y, y along world -x.
        Roi {
            rotation: Matrix3::new(0.0, 1.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 1.0),
            center: Vector3::new(10.0, 20.0, 30.0),
            half_extent: Vector3::new(1.0, 2.0, 3.0),
        }
    }

    #[test]
    fn containment_is_inclusive_and_turns_with_the_box() {
        let roi = turned();
        for inside in [[10.0, 20.0, 30.0], [12.0, 20.0, 30.0], [10.0, 21.0, 30.0], [8.0, 19.0, 33.0]] {
            assert!(roi.contains(inside), "{inside:?}");
        }
        for outside in [[12.01, 20.0, 30.0], [10.0, 21.01, 30.0], [10.0, 20.0, 26.9], [f32::NAN, 20.0, 30.0]]
        {
            assert!(!roi.contains(outside), "{outside:?}");
        }
    }

    #[test]
    fn positive_borders_multiply_and_negative_ones_add() {
        let roi = turned();
        assert_eq!(roi.with_border(1.5).unwrap().half_extent, Vector3::new(1.5, 3.0, 4.5));
        assert_eq!(roi.with_border(-0.5).unwrap().half_extent, Vector3::new(1.5, 2.5, 3.5));
        assert_eq!(roi.with_border(0.0).unwrap(), roi);
        assert!(roi.with_border(f32::NAN).is_err());
    }

    #[test]
    fn boxes_around_points_get_a_margin() {
        let roi = Roi::axis_aligned([0.0, -1.0, 5.0], [10.0, 1.0, 9.0], 0.1).unwrap();
        assert_eq!(roi.center, Vector3::new(5.0, 0.0, 7.0));
        for (got, want) in roi.half_extent.iter().zip([5.5, 1.1, 2.2]) {
            assert!((got - want).abs() < 1e-6, "{got} is not {want}");
        }
        assert_eq!(Roi::axis_aligned([0.0; 3], [1.0, 0.0, 1.0], 0.1), None);
    }
}
