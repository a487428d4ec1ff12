//! The cross-view filter of OpenMVS, in its two variants: adjust (default) and strict.

use super::warp::{Seen, Warped};
use super::{DepthFilterOptions, FilterView};
use crate::geometry::{Camera, is_similar_depth};
use crate::scene::{DepthEstimate, Grid};

/// Neighbours that take part: the first of the retained list that have a depth map.
pub const MAX_NEIGHBORS: usize = 8;

/// Similarity of depths in the adjust variant, in units of the depth difference threshold.
const ADJUST_FACTOR: f32 = 1.2;
/// Similarity of a warped depth at the pixel in the strict variant.
const STRICT_FACTOR: f32 = 0.8;
/// Similarity of warped depths around the pixel in the strict variant.
const STRICT_AROUND_FACTOR: f32 = 1.2;
/// Share of warped depths at the pixel that must be similar, percent.
const STRICT_SHARE: u32 = 75;
/// Share of warped depths around the pixel that must be similar, percent.
const STRICT_AROUND_SHARE: u32 = 65;

/// Filters `reference` by its `neighbors`, best first (those after the eighth take no part), and returns the
/// new estimate; all inputs are unfiltered maps.
///
/// Every neighbour is warped forward into the reference view. In the adjust variant a depth survives when at
/// least `min_views_filter_adjust` neighbours agree with it and their confidences outweigh those of the
/// neighbours that contradict it, as occluders or by seeing through it; it becomes the confidence-weighted mean
/// of the agreeing depths, and its confidence the difference of the two sums, which may exceed 1. The strict
/// variant keeps depths and confidences as they are. Normals are never touched.
///
/// `calibrated_views` is the number of calibrated views in the scene; with fewer neighbours than required views
/// the map stays as it is. A map without confidence counts as confidence 1 everywhere.
pub fn filter_consistency(
    reference: &FilterView<'_>,
    neighbors: &[FilterView<'_>],
    calibrated_views: usize,
    options: &DepthFilterOptions,
) -> DepthEstimate {
    let neighbors = &neighbors[..neighbors.len().min(MAX_NEIGHBORS)];
    let others = u32::try_from(calibrated_views.saturating_sub(1)).unwrap_or(u32::MAX);
    let min_views = options.min_views_filter.min(others);
    let min_adjust = options.min_views_filter_adjust.min(others);
    let available = neighbors.len() as u32;
    if available < min_views || available < min_adjust {
        return reference.estimate.clone();
    }
    if options.filter_adjust {
        adjust(reference, neighbors, min_views, min_adjust, options.depth_diff_threshold)
    } else {
        strict(reference, neighbors, min_views, options.depth_diff_threshold)
    }
}

/// What the neighbours have said about a pixel so far.
#[derive(Clone, Copy, Default)]
struct Verdict {
    /// Sum of depth × confidence over the reference and the agreeing neighbours.
    weighted_depth: f32,
    /// Sum of their confidences.
    support: f32,
    /// Sum of the confidences of the neighbours that contradict.
    contradiction: f32,
    agreeing: u8,
    contradicting: u8,
    discarded: bool,
}

fn adjust(
    reference: &FilterView<'_>,
    neighbors: &[FilterView<'_>],
    min_views: u32,
    min_adjust: u32,
    threshold: f32,
) -> DepthEstimate {
    let estimate = reference.estimate;
    let max_diff = threshold * ADJUST_FACTOR;
    let mut verdicts: Vec<Verdict> = (0..estimate.depth.data().len())
        .map(|i| {
            let confidence = estimate.confidence.as_ref().map_or(1.0, |c| c.data()[i]);
            Verdict {
                weighted_depth: estimate.depth.data()[i] * confidence,
                support: confidence,
                ..Verdict::default()
            }
        })
        .collect();
    let mut warped = Warped::new(estimate.depth.size());
    for (k, neighbor) in neighbors.iter().enumerate().rev() {
        warped.fill(reference, neighbor);
        let confidences = neighbor.estimate.confidence.as_ref().map(|map| map.data());
        let rows = verdicts.chunks_mut(estimate.depth.width().max(1));
        for (y, verdicts) in rows.enumerate() {
            let pixels = verdicts.iter_mut().zip(estimate.depth.row(y)).zip(warped.row(y));
            for (x, ((verdict, &depth), seen)) in pixels.enumerate() {
                if depth == 0.0 || verdict.discarded {
                    continue;
                }
                let Some(Seen { depth: seen_depth, pixel }) = seen else {
                    let judged = u32::from(verdict.agreeing) + u32::from(verdict.contradicting);
                    verdict.discarded = judged + (k as u32) < min_views;
                    continue;
                };
                let confidence = confidences.map_or(1.0, |c| c[pixel]);
                if is_similar_depth(depth, seen_depth, max_diff) {
                    verdict.weighted_depth += seen_depth * confidence;
                    verdict.support += confidence;
                    verdict.agreeing += 1;
                } else {
                    verdict.contradicting += 1;
                    verdict.contradiction += if depth > seen_depth {
                        confidence
                    } else {
                        seen_through(&estimate.camera, neighbor.estimate, x, y, depth).unwrap_or(confidence)
                    };
                }
            }
        }
    }
    conclude(estimate, &verdicts, min_adjust)
}

/// The neighbour's own confidence where it looks through the reference's surface; `None` outside its image or
/// where that confidence is 0.
fn seen_through(camera: &Camera, neighbor: &DepthEstimate, x: usize, y: usize, depth: f32) -> Option<f32> {
    let point = camera.world_from_image(x as f64, y as f64, f64::from(depth));
    let (u, v) = neighbor.camera.image_from_cam(&neighbor.camera.cam_from_world(&point));
    let (u, v) = ((u + 0.5).floor(), (v + 0.5).floor());
    let inside =
        u >= 0.0 && v >= 0.0 && u < neighbor.depth.width() as f64 && v < neighbor.depth.height() as f64;
    if !inside {
        return None;
    }
    let confidence = neighbor.confidence.as_ref().map_or(1.0, |c| c[(u as usize, v as usize)]);
    (confidence > 0.0).then_some(confidence)
}

fn conclude(estimate: &DepthEstimate, verdicts: &[Verdict], min_adjust: u32) -> DepthEstimate {
    let (min_depth, max_depth) = estimate.depth_range;
    let mut depth = Grid::filled(estimate.depth.size(), 0.0);
    let mut confidence = Grid::filled(estimate.depth.size(), 0.0);
    for (i, verdict) in verdicts.iter().enumerate() {
        if estimate.depth.data()[i] == 0.0
            || verdict.discarded
            || u32::from(verdict.agreeing) < min_adjust
            || verdict.support <= verdict.contradiction
        {
            continue;
        }
        let mean = verdict.weighted_depth / verdict.support;
        if mean >= min_depth && mean < max_depth {
            depth.data_mut()[i] = mean;
            confidence.data_mut()[i] = verdict.support - verdict.contradiction;
        }
    }
    with_maps(estimate, depth, confidence)
}

fn with_maps(estimate: &DepthEstimate, depth: Grid<f32>, confidence: Grid<f32>) -> DepthEstimate {
    DepthEstimate {
        image_id: estimate.image_id,
        image_name: estimate.image_name.clone(),
        source_ids: estimate.source_ids.clone(),
        camera: estimate.camera.clone(),
        depth_range: estimate.depth_range,
        depth,
        normal: estimate.normal.clone(),
        confidence: Some(confidence),
    }
}

/// Counts of warped depths at a pixel and around it, and of those similar to its depth.
#[derive(Clone, Copy, Default)]
struct Tally {
    seen: u8,
    similar: u8,
    seen_around: u8,
    similar_around: u8,
}

fn strict(
    reference: &FilterView<'_>,
    neighbors: &[FilterView<'_>],
    min_views: u32,
    threshold: f32,
) -> DepthEstimate {
    let estimate = reference.estimate;
    let (max_diff, max_diff_around) = (threshold * STRICT_FACTOR, threshold * STRICT_AROUND_FACTOR);
    let mut tallies = vec![Tally::default(); estimate.depth.data().len()];
    let mut warped = Warped::new(estimate.depth.size());
    for neighbor in neighbors {
        warped.fill(reference, neighbor);
        for y in 0..estimate.depth.height() {
            for x in 0..estimate.depth.width() {
                let depth = estimate.depth[(x, y)];
                if depth == 0.0 {
                    continue;
                }
                let tally = &mut tallies[estimate.depth.index(x, y)];
                if let Some(here) = warped.get(x, y) {
                    tally.seen += 1;
                    tally.similar += u8::from(is_similar_depth(depth, here.depth, max_diff));
                }
                let around = [(x.wrapping_sub(1), y), (x + 1, y), (x, y.wrapping_sub(1)), (x, y + 1)];
                for near in around.iter().filter_map(|&(x, y)| warped.get(x, y)) {
                    tally.seen_around += 1;
                    tally.similar_around += u8::from(is_similar_depth(depth, near.depth, max_diff_around));
                }
            }
        }
    }
    let mut depth = estimate.depth.clone();
    let mut confidence =
        estimate.confidence.clone().unwrap_or_else(|| Grid::filled(estimate.depth.size(), 1.0));
    for (i, tally) in tallies.iter().enumerate() {
        let [seen, similar, seen_around, similar_around] =
            [tally.seen, tally.similar, tally.seen_around, tally.similar_around].map(u32::from);
        let kept = similar >= min_views
            && similar * 100 >= STRICT_SHARE * seen
            && similar_around >= 2 * min_views
            && similar_around * 100 >= STRICT_AROUND_SHARE * seen_around;
        if !kept {
            depth.data_mut()[i] = 0.0;
            confidence.data_mut()[i] = 0.0;
        }
    }
    with_maps(estimate, depth, confidence)
}

#[cfg(test)]
#[path = "consistency_tests.rs"]
mod tests;
