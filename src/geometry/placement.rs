//! Where the coordinates of a scene are in the world outside.

use nalgebra::{Matrix3, Matrix4, Vector3};

/// A way from the scene's coordinates to those of the files that are written: world = matrix · scene + offset.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// Rotation and scale; `None` = as in the scene.
    matrix: Option<Matrix3<f64>>,
    offset: Vector3<f64>,
}

impl Default for Placement {
    fn default() -> Self {
        Placement { matrix: None, offset: Vector3::zeros() }
    }
}

impl Placement {
    /// A shift by `offset`, scene units.
    pub fn shift(offset: [f64; 3]) -> Self {
        Placement { matrix: None, offset: offset.into() }
    }

    /// The way back of `relative_from_absolute`, a row-major 4×4 similarity; `None` for anything else.
    pub fn undoing(relative_from_absolute: &[f64; 16]) -> Option<Self> {
        /// How far a similarity may be from one, relative to its scale.
        const TOLERANCE: f64 = 1e-6;
        let whole = Matrix4::from_row_slice(relative_from_absolute);
        if whole.iter().any(|v| !v.is_finite()) || whole.row(3) != Matrix4::identity().row(3) {
            return None;
        }
        let linear: Matrix3<f64> = whole.fixed_view::<3, 3>(0, 0).into();
        let scale = linear.determinant().cbrt();
        let unscaled = linear / scale;
        let is_similarity =
            scale > 0.0 && (unscaled.transpose() * unscaled - Matrix3::identity()).amax() < TOLERANCE;
        if !is_similarity {
            return None;
        }
        let shift: Vector3<f64> = whole.fixed_view::<3, 1>(0, 3).into();
        if linear == Matrix3::identity() {
            return Some(Placement { matrix: None, offset: Vector3::zeros() - shift });
        }
        let back = unscaled.transpose() / scale;
        Some(Placement { matrix: Some(back), offset: Vector3::zeros() - back * shift })
    }

    /// This after a shift by `offset` within the scene.
    pub fn after_shift(self, offset: [f64; 3]) -> Self {
        let moved = Vector3::from(offset);
        Placement { offset: self.offset + self.matrix.map_or(moved, |m| m * moved), ..self }
    }

    /// Whether points stay where they are.
    pub fn is_identity(&self) -> bool {
        *self == Placement::default()
    }

    /// Where the scene's origin goes.
    pub fn offset(&self) -> [f64; 3] {
        self.offset.into()
    }

    /// Whether it does more than shift.
    pub fn turns(&self) -> bool {
        self.matrix.is_some()
    }

    /// Where a point goes.
    #[inline]
    pub fn place(&self, point: [f32; 3]) -> [f64; 3] {
        let point = Vector3::from(point.map(f64::from));
        (self.matrix.map_or(point, |m| m * point) + self.offset).into()
    }

    /// The direction of a unit vector after the move.
    #[inline]
    pub fn turn(&self, direction: [f32; 3]) -> [f32; 3] {
        let Some(matrix) = self.matrix else { return direction };
        let turned = matrix * Vector3::from(direction.map(f64::from));
        turned.try_normalize(0.0).map_or(direction, |unit| [unit.x as f32, unit.y as f32, unit.z as f32])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 90° about z, twice the size, shifted.
    const SIMILARITY: [f64; 16] =
        [0.0, -2.0, 0.0, 10.0, 2.0, 0.0, 0.0, 20.0, 0.0, 0.0, 2.0, 30.0, 0.0, 0.0, 0.0, 1.0];

    #[test]
    fn a_similarity_is_undone() {
        let placement = Placement::undoing(&SIMILARITY).unwrap();
        // Absolute (1, 2, 3) is relative (−2·2 + 10, 2·1 + 20, 2·3 + 30).
        let there = placement.place([6.0, 22.0, 36.0]);
        let error = (Vector3::from(there) - Vector3::new(1.0, 2.0, 3.0)).amax();
        assert!(error < 1e-12 && placement.turns(), "{there:?}");
        assert_eq!(placement.turn([0.0, 1.0, 0.0]), [1.0, 0.0, 0.0]);
        let moved = placement.after_shift([6.0, 22.0, 36.0]).place([0.0; 3]);
        assert!((Vector3::from(moved) - Vector3::new(1.0, 2.0, 3.0)).amax() < 1e-12);
    }

    #[test]
    fn a_translation_keeps_every_digit() {
        let mut matrix = [0.0; 16];
        (0..4).for_each(|i| matrix[5 * i] = 1.0);
        assert!(Placement::undoing(&matrix).unwrap().is_identity());
        (matrix[3], matrix[7], matrix[11]) = (-500_000.0, -5_200_000.0, -100.0);
        let placement = Placement::undoing(&matrix).unwrap();
        assert_eq!(placement, Placement::shift([500_000.0, 5_200_000.0, 100.0]));
        assert_eq!(placement.place([0.25, 0.5, 1.0]), [500_000.25, 5_200_000.5, 101.0]);
        assert_eq!(placement.turn([0.6, 0.8, 0.0]), [0.6, 0.8, 0.0]);
    }

    #[test]
    fn anything_else_is_not_taken() {
        for (i, value) in [(0, 3.0), (15, 2.0), (3, f64::NAN), (10, -2.0), (12, 1.0)] {
            let mut matrix = SIMILARITY;
            matrix[i] = value;
            assert_eq!(Placement::undoing(&matrix), None, "{i}");
        }
        assert_eq!(Placement::undoing(&[0.0; 16]), None);
    }
}
