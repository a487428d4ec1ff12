//! The cross-view filter that judges depths without changing them.
//!
//! The adjust filter of OpenMVS averages a depth with those of neighbours that were warped to whole pixels, which
//! pulls slanted surfaces away from where they are. Here neighbours only vote, and each is read where the point really
//! falls: its depth there is that of the plane through its nearest pixel.

use super::FilterView;
use super::witness::{RowScratch, Witness};
use crate::error::{Error, Result};
use crate::scene::{DepthEstimate, Grid};
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
    /// Confidences (0..1) of a depth and of those that confirm it must add up to this, and to as much again for every
    /// neighbour that contradicts it; mirror images behind windows and clouds in the sky are seen by many views, but by
    /// none well. 0 asks for nothing. Default 0.035.
    pub min_evidence: f32,
    /// Confidence (0..1) that a depth must have itself, whoever confirms it. Default 0.0003: a matching cost of 0.64.
    pub min_confidence: f32,
}

impl Default for UnbiasedFilterOptions {
    fn default() -> Self {
        UnbiasedFilterOptions {
            max_depth_diff: 0.01,
            min_confirming: 1,
            contradictions_per_confirmation: 0.5,
            max_neighbors: 8,
            min_evidence: 0.035,
            min_confidence: 0.0003,
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
        if !(self.min_evidence >= 0.0 && self.min_evidence.is_finite()) {
            return Err(Error::invalid(format!(
                "the unbiased filter's least evidence is {}: give a sum of confidences, such as 0.035",
                self.min_evidence
            )));
        }
        if !(0.0..=1.0).contains(&self.min_confidence) {
            return Err(Error::invalid(format!(
                "the unbiased filter's least confidence is {}: give 0 to 1, such as 0.0003",
                self.min_confidence
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
/// contradict, and those of too little evidence. Depths, confidences and normals that stay are not changed; the others become 0, normals excepted.
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
    let (votes, evidence) = survey(reference, used, options.max_depth_diff);
    let required = options.min_confirming.min(used.len() as u32);
    let own = reference.estimate.confidence.as_ref().map(|map| map.data());
    for (i, (votes, &evidence)) in votes.data().iter().zip(evidence.data()).enumerate() {
        let confirming = u32::from(votes.confirming);
        let outvoted = f32::from(votes.contradicting)
            > options.contradictions_per_confirmation * f32::from(votes.confirming);
        let asked = options.min_evidence * (1.0 + f32::from(votes.contradicting));
        let doubtful = own.is_some_and(|own| own[i] < options.min_confidence || evidence < asked);
        if confirming < required || outvoted || doubtful {
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
    survey(reference, neighbors, max_depth_diff).0
}

/// The votes, and the sums of the confidences of every depth and of those that confirm it; views without confidences
/// add nothing.
fn survey(
    reference: &FilterView<'_>,
    neighbors: &[FilterView<'_>],
    max_depth_diff: f32,
) -> (Grid<Votes>, Grid<f32>) {
    let estimate = reference.estimate;
    let size = estimate.depth.size();
    let mut votes = Grid::filled(size, Votes::default());
    let mut evidence = estimate.confidence.clone().unwrap_or_else(|| Grid::filled(size, 0.0));
    let witnesses: Vec<Witness<'_>> = neighbors.iter().map(|n| Witness::new(&estimate.camera, *n)).collect();
    let width = estimate.depth.width().max(1);
    let rows = votes.data_mut().par_chunks_mut(width).zip(evidence.data_mut().par_chunks_mut(width));
    rows.enumerate().for_each_init(RowScratch::default, |scratch, (y, (votes, evidence))| {
        let labels = reference.labels.map(|labels| labels.row(y));
        for witness in &witnesses {
            let found = scratch.compare(witness, y, estimate.depth.row(y), labels);
            let differences = found.differences.iter().zip(found.confidences);
            for ((votes, evidence), (&difference, &confidence)) in
                votes.iter_mut().zip(evidence.iter_mut()).zip(differences)
            {
                let confirms = difference.abs() < max_depth_diff;
                votes.confirming += u8::from(confirms);
                votes.occluding += u8::from(difference <= -max_depth_diff);
                votes.contradicting += u8::from(difference >= max_depth_diff);
                *evidence += if confirms { confidence } else { 0.0 };
            }
        }
    });
    (votes, evidence)
}

#[cfg(test)]
#[path = "unbiased_tests.rs"]
mod tests;
