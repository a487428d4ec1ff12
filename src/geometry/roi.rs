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
