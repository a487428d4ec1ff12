//! The box that is split, and its parts.

use super::chunks::Sample;
use crate::geometry::Roi;
use nalgebra::{Matrix3, SymmetricEigen, Vector3};

/// How much larger than its samples a box that is made from them is: they stand for the pixels around them.
const MARGIN: f64 = 1.05;

/// A part of a box: per axis the lower and the upper end in shares of the whole, 0..1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Part {
    pub(super) low: [f64; 3],
    pub(super) high: [f64; 3],
}

impl Part {
    pub(super) const WHOLE: Part = Part { low: [0.0; 3], high: [1.0; 3] };

    pub(super) fn middle(&self, axis: usize) -> f64 {
        (self.low[axis] + self.high[axis]) / 2.0
    }

    /// The smallest part that holds both.
    pub(super) fn union(&self, other: &Part) -> Part {
        Part {
            low: std::array::from_fn(|i| self.low[i].min(other.low[i])),
            high: std::array::from_fn(|i| self.high[i].max(other.high[i])),
        }
    }

    /// The box that it is of `whole`, or of `roi` cut to it.
    pub(super) fn of(&self, whole: &Roi) -> Roi {
        let share = |i: usize, s: f64| whole.half_extent[i] * (2.0 * s - 1.0);
        let low = Vector3::from_fn(|i, _| share(i, self.low[i]));
        let high = Vector3::from_fn(|i, _| share(i, self.high[i]));
        Roi {
            rotation: whole.rotation,
            center: whole.center + whole.rotation.transpose() * ((low + high) / 2.0),
            half_extent: (high - low) / 2.0,
        }
    }
}

/// Where a point lies in `whole`, in shares of its size.
pub(super) fn share_of(point: [f32; 3], whole: &Roi) -> [f64; 3] {
    let local = whole.rotation * (Vector3::from(point.map(f64::from)) - whole.center);
    std::array::from_fn(|i| 0.5 + 0.5 * local[i] / whole.half_extent[i])
}

/// A box around `samples` along their principal axes, its thinnest side doubled. `None` if they have no extent.
pub(super) fn around(samples: &[Sample]) -> Option<Roi> {
    let point = |s: &Sample| Vector3::from(s.position.map(f64::from));
    let mean = samples.iter().map(point).sum::<Vector3<f64>>() / samples.len().max(1) as f64;
    let scatter: Matrix3<f64> = samples.iter().map(point).map(|p| (p - mean) * (p - mean).transpose()).sum();
    let eigen = SymmetricEigen::try_new(scatter, f64::EPSILON, 1000)?;
    let mut axes: Vec<usize> = (0..3).collect();
    axes.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
    // The axes in a fixed sense, so that they make a rotation.
    let x = fixed_sense(eigen.eigenvectors.column(axes[0]).into_owned());
    let y = fixed_sense(eigen.eigenvectors.column(axes[1]).into_owned());
    let rotation = Matrix3::from_rows(&[x.transpose(), y.transpose(), x.cross(&y).transpose()]);
    let first = rotation * point(samples.first()?);
    let (mut low, mut high) = (first, first);
    for sample in samples {
        let local = rotation * point(sample);
        (low, high) = (low.inf(&local), high.sup(&local));
    }
    let mut half_extent = (high - low) / 2.0 * MARGIN;
    let thinnest = half_extent.imin();
    half_extent[thinnest] *= 2.0;
    let least = half_extent.max() * 1e-6;
    half_extent = half_extent.map(|e| e.max(least));
    let center = rotation.transpose() * ((low + high) / 2.0);
    half_extent.iter().all(|&e| e > 0.0 && e.is_finite()).then_some(Roi { rotation, center, half_extent })
}

fn fixed_sense(v: Vector3<f64>) -> Vector3<f64> {
    if v[v.iamax()] < 0.0 { -v } else { v }
}
