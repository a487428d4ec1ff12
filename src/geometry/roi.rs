//! The oriented box of interest.

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
    /// Whether a world point is inside or on the border, in single precision.
    pub fn contains(&self, point_in_world: [f32; 3]) -> bool {
        let offset: [f32; 3] = std::array::from_fn(|i| point_in_world[i] - self.center[i] as f32);
        (0..3).all(|axis| {
            let r = |i: usize| self.rotation[(axis, i)] as f32;
            let along = r(0) * offset[0] + r(1) * offset[1] + r(2) * offset[2];
            along.abs() <= self.half_extent[axis] as f32
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turned_box_holds_its_border_and_nothing_beyond() {
        // A quarter turn about z: the first box axis is world y.
        let roi = Roi {
            rotation: Matrix3::new(0.0, 1.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 1.0),
            center: Vector3::new(10.0, 20.0, 30.0),
            half_extent: Vector3::new(3.0, 1.0, 0.5),
        };
        assert!(roi.contains([11.0, 23.0, 30.5]));
        assert!(!roi.contains([11.001, 23.0, 30.5]));
        assert!(!roi.contains([11.0, 23.001, 30.5]));
        assert!(!roi.contains([9.0, 17.0, 29.499]));
    }
}
