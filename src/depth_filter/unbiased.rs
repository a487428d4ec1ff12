//! The cross-view filter that judges depths without changing them.
//!
//! The adjust filter of OpenMVS averages a depth with those of neighbours that were warped to whole pixels, which
//! pulls slanted surfaces away from where they are. Here neighbours only vote, and each is read where the point really
//! falls: its depth there is that of the plane through its nearest pixel.

use super::FilterView;
use crate::error::{Error, Result};
use crate::geometry::Camera;
use crate::scene::{DepthEstimate, Grid};
use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

/// When a depth is believed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UnbiasedFilterOptions {
    /// Largest relative difference, > 0, between a depth and what a neighbour measures there for the neighbour to
    /// confirm it. Default 0.01.
    pub max_depth_diff: f32,
    /// Neighbours that must confirm a depth; lowered to the number of neighbours. Default 1.
    pub min_confirming: u32,
    /// Contradicting neighbours (those that see through the point) that one confirming neighbour makes up for.
    /// Default 0.5.
    pub contradictions_per_confirmation: f32,
    /// Neighbours that take part, best first, at most 255. Default 8.
    pub max_neighbors: u32,
}

impl Default for UnbiasedFilterOptions {
    fn default() -> Self {
        UnbiasedFilterOptions {
            max_depth_diff: 0.01,
            min_confirming: 1,
            contradictions_per_confirmation: 0.5,
            max_neighbors: 8,
        }
    }
}

impl UnbiasedFilterOptions {
    /// Refuses values that would judge every depth alike.
    ///
    /// # Errors
    /// [`Error::Invalid`] naming the option.
    pub fn check(&self) -> Result<()> {
        if !(self.max_depth_diff > 0.0 && self.max_depth_diff < 1.0) {
            return Err(Error::invalid(format!(
                "the unbiased filter's largest depth difference is {}: give a value between 0 and 1, such as 0.01",
                self.max_depth_diff
            )));
        }
        if !(1..=255).contains(&self.max_neighbors) || self.contradictions_per_confirmation.is_nan() {
            return Err(Error::invalid(
                "the unbiased filter needs 1 to 255 neighbours and a number of contradictions",
            ));
        }
        Ok(())
    }
}

/// What the neighbours say about a depth.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Votes {
    /// Neighbours that measure the same surface there.
    pub confirming: u8,
    /// Neighbours that measure something nearer there: the point may be hidden from them.
    pub occluding: u8,
    /// Neighbours that measure something farther there: they see through the point.
    pub contradicting: u8,
}

/// Removes the depths of `reference` that its `neighbors` (best first, unfiltered maps) do not confirm or mostly
/// contradict. Depths, confidences and normals that stay are not changed; the others become 0, normals excepted.
/// Without any neighbour the map stays as it is.
pub fn filter_unbiased(
    reference: &FilterView<'_>,
    neighbors: &[FilterView<'_>],
    options: &UnbiasedFilterOptions,
) -> DepthEstimate {
    let mut filtered = reference.estimate.clone();
    let used = &neighbors[..neighbors.len().min(options.max_neighbors as usize)];
    if used.is_empty() {
        return filtered;
    }
    let votes = count_votes(reference, used, options.max_depth_diff);
    let required = options.min_confirming.min(used.len() as u32);
    for (i, votes) in votes.data().iter().enumerate() {
        let confirming = u32::from(votes.confirming);
        let outvoted = f32::from(votes.contradicting)
            > options.contradictions_per_confirmation * f32::from(votes.confirming);
        if confirming < required || outvoted {
            filtered.depth.data_mut()[i] = 0.0;
            if let Some(confidence) = &mut filtered.confidence {
                confidence.data_mut()[i] = 0.0;
            }
        }
    }
    filtered
}

/// Counts for every depth of `reference` what each of `neighbors` (at most 255) says about it.
pub fn count_votes(
    reference: &FilterView<'_>,
    neighbors: &[FilterView<'_>],
    max_depth_diff: f32,
) -> Grid<Votes> {
    let estimate = reference.estimate;
    let mut votes = Grid::filled(estimate.depth.size(), Votes::default());
    let witnesses: Vec<Witness<'_>> = neighbors.iter().map(|n| Witness::new(&estimate.camera, *n)).collect();
    let width = estimate.depth.width().max(1);
    votes.data_mut().par_chunks_mut(width).enumerate().for_each(|(y, row)| {
        let labels = reference.labels.map(|labels| labels.row(y));
        for witness in &witnesses {
            let start = witness.row_start(y as f32);
            for (x, (votes, &depth)) in row.iter_mut().zip(estimate.depth.row(y)).enumerate() {
                if depth > 0.0 {
                    let label = labels.map_or(0, |l| l[x]);
                    let difference = witness.relative_difference(start, x as f32, depth, label);
                    votes.confirming += u8::from(difference.abs() < max_depth_diff);
                    votes.occluding += u8::from(difference <= -max_depth_diff);
                    votes.contradicting += u8::from(difference >= max_depth_diff);
                }
            }
        }
    });
    votes
}

/// A neighbour with what is needed to look up points of the reference in it, in single precision.
struct Witness<'a> {
    view: FilterView<'a>,
    /// Homogeneous neighbour pixel per reference pixel, at depth 1: `K' R' Rᵀ K⁻¹`, by columns.
    columns: [[f32; 3]; 3],
    /// Homogeneous neighbour pixel of the reference's centre.
    offset: [f32; 3],
    /// Focal lengths and principal point.
    intrinsics: [f32; 4],
}

/// Most that the plane through a pixel may change the depth within that pixel, as a ratio; beyond, the normal is not
/// believed.
const MAX_PLANE_CORRECTION: f32 = 1.05;

impl<'a> Witness<'a> {
    fn new(reference: &Camera, view: FilterView<'a>) -> Self {
        let camera = &view.estimate.camera;
        let (fx, fy, cx, cy) = reference.intrinsics();
        let ray_from_pixel = Matrix3::new(1.0 / fx, 0.0, -cx / fx, 0.0, 1.0 / fy, -cy / fy, 0.0, 0.0, 1.0);
        let (nfx, nfy, ncx, ncy) = camera.intrinsics();
        let k = Matrix3::new(nfx, 0.0, ncx, 0.0, nfy, ncy, 0.0, 0.0, 1.0);
        let map = k * camera.rotation() * reference.rotation().transpose() * ray_from_pixel;
        let offset: Vector3<f64> = k * camera.cam_from_world(reference.center());
        Witness {
            view,
            columns: std::array::from_fn(|c| std::array::from_fn(|r| map[(r, c)] as f32)),
            offset: std::array::from_fn(|r| offset[r] as f32),
            intrinsics: [nfx, nfy, ncx, ncy].map(|v| v as f32),
        }
    }

    /// Homogeneous neighbour pixel of reference pixel `(0, y)` at depth 1.
    fn row_start(&self, y: f32) -> [f32; 3] {
        std::array::from_fn(|r| self.columns[1][r] * y + self.columns[2][r])
    }

    /// How much farther the neighbour's surface is than the reference's point, relative to the point's depth in the
    /// neighbour; NaN if the neighbour has nothing to say.
    #[inline]
    fn relative_difference(&self, row_start: [f32; 3], x: f32, depth: f32, label: u16) -> f32 {
        let [qx, qy, z] = [0, 1, 2].map(|r| (row_start[r] + self.columns[0][r] * x) * depth + self.offset[r]);
        let depths = &self.view.estimate.depth;
        let inverse = 1.0 / z;
        let (u, v) = (qx * inverse, qy * inverse);
        let (left, top) = (u + 0.5, v + 0.5);
        let inside = z > 0.0
            && left >= 0.0
            && top >= 0.0
            && left < depths.width() as f32
            && top < depths.height() as f32;
        if !inside {
            return f32::NAN;
        }
        let (px, py) = (left as usize, top as usize);
        let pixel = depths.index(px, py);
        let seen = depths.data()[pixel];
        if seen <= 0.0 {
            return f32::NAN;
        }
        if let Some(labels) = self.view.labels.filter(|_| label != 0) {
            let other = labels.data()[pixel];
            if other != 0 && other != label {
                return f32::NAN;
            }
        }
        let seen = seen * self.plane_correction(pixel, px as f32, py as f32, u, v);
        (seen - z) * inverse
    }

    /// Depth at `(u, v)` of the plane through pixel `(px, py)`, relative to the depth of that pixel.
    #[inline]
    fn plane_correction(&self, pixel: usize, px: f32, py: f32, u: f32, v: f32) -> f32 {
        let Some(normals) = &self.view.estimate.normal else { return 1.0 };
        let n = normals.data()[pixel];
        let [fx, fy, cx, cy] = self.intrinsics;
        let along = |x: f32, y: f32| n[0] * (x - cx) / fx + n[1] * (y - cy) / fy + n[2];
        let ratio = along(px, py) / along(u, v);
        if (1.0 / MAX_PLANE_CORRECTION..MAX_PLANE_CORRECTION).contains(&ratio) { ratio } else { 1.0 }
    }
}

#[cfg(test)]
#[path = "unbiased_tests.rs"]
mod tests;
