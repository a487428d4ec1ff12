//! One opinion from many label maps: what all views that see the surface of a pixel say about its class.
//!
//! Segmentations err near borders and now and then in blobs, each photograph on its own. A surface that is seen by many
//! views has as many opinions about its class, and their vote is right far more often than any of them.

use super::ClassId;
use crate::geometry::{Camera, Lens};
use crate::scene::{DepthMap, Grid, LabelMap};
use rayon::prelude::*;

/// Whose votes count for how much.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ConsensusOptions {
    /// Largest relative difference, > 0, between the depth of a point in another view and the depth of that view's pixel
    /// for both to be the same surface. Default 0.01.
    pub max_depth_diff: f32,
    /// Distance from a class border in depth-map pixels, up to 255, from which a pixel has a whole vote; nearer ones have
    /// less in proportion. Default 4.
    pub border: u8,
    /// Vote, 0..1, of a pixel without depth, which may see something in front of the surface. Default 0.2: pixels of classes
    /// that are not estimated have no depth, and would not be heard where one view alone mistakes them for others.
    pub without_depth: f32,
}

impl Default for ConsensusOptions {
    fn default() -> Self {
        ConsensusOptions { max_depth_diff: 0.01, border: 4, without_depth: 0.2 }
    }
}

/// A view whose labels are heard.
#[derive(Clone, Copy, Debug)]
pub struct Witness<'a> {
    /// Camera at the size of the maps.
    pub camera: &'a Camera,
    /// Depth of every pixel.
    pub depth: &'a DepthMap,
    /// Class of every pixel.
    pub labels: &'a LabelMap,
    /// Distance of every pixel to the nearest class border, see [`border_distance`].
    pub border_distance: &'a Grid<u8>,
}

/// What became of the labels of a view.
#[derive(Clone, Debug, PartialEq)]
pub struct Consensus {
    /// The class voted for; the view's own label where there is no depth.
    pub labels: LabelMap,
    /// How certain that class is, 0..1: see [`label_consensus`]. 0 where there is no depth or no class.
    pub confidence: Grid<f32>,
}

/// Evidence of a whole vote: it makes its class `e` times as likely against any other. Measured on rendered façades, so
/// that of the points with confidence `c` a share near `c` is right.
const EVIDENCE_PER_VOTE: f32 = 1.0;

/// The vote of `reference` and all `others` on the class of every pixel of `reference` that has a depth.
///
/// A view has a vote on a point if its pixel there measures the same depth; void has no vote. Ties go to the pixel's own label, then to the smaller id. With `v` the votes of a class, its confidence
/// is `exp(v) / (1 + Σ exp(v'))` over all classes voted for: the posterior of independent votes, the 1 standing for a
/// class that nobody named. A single view is believed at 0.73, four that agree at 0.98, four against two at 0.87.
///
/// The outcome depends on the order of `others` only in the last digits of the sums.
pub fn label_consensus(
    reference: &Witness<'_>,
    others: &[Witness<'_>],
    options: &ConsensusOptions,
) -> Consensus {
    let size = reference.depth.size();
    let own = Observer::new(reference, options);
    let observers: Vec<Observer<'_>> = others.iter().map(|other| Observer::new(other, options)).collect();
    let mut labels = reference.labels.clone();
    let mut confidence = Grid::filled(size, 0.0f32);
    let width = reference.depth.width().max(1);
    let rows = labels.data_mut().par_chunks_mut(width).zip(confidence.data_mut().par_chunks_mut(width));
    rows.enumerate().for_each(|(y, (labels, confidences))| {
        let mut ballot = Ballot::default();
        let depths = reference.depth.row(y);
        for (x, (label, confidence)) in labels.iter_mut().zip(confidences).enumerate() {
            if depths[x] <= 0.0 {
                continue;
            }
            ballot.0.clear();
            ballot.add(*label, own.weight(reference.depth.index(x, y)));
            let point = own.lens.world_point(x as u32, y as u32, depths[x]).map(|v| v as f32);
            for observer in &observers {
                observer.vote(point, options, &mut ballot);
            }
            if let Some((winner, certainty)) = ballot.outcome(*label) {
                (*label, *confidence) = (winner, certainty);
            }
        }
    });
    Consensus { labels, confidence }
}

/// A witness with what is needed to look points up in it.
struct Observer<'a> {
    view: Witness<'a>,
    lens: Lens,
    weights: Vec<f32>,
}

impl<'a> Observer<'a> {
    fn new(view: &Witness<'a>, options: &ConsensusOptions) -> Self {
        let whole = f32::from(options.border.max(1));
        let weights = (0..=u8::MAX).map(|d| (f32::from(d) / whole).min(1.0)).collect();
        Observer { view: *view, lens: Lens::new(view.camera), weights }
    }

    /// Vote of a pixel that measures the surface.
    #[inline]
    fn weight(&self, pixel: usize) -> f32 {
        self.weights[usize::from(self.view.border_distance.data()[pixel])]
    }

    #[inline]
    fn vote(&self, point: [f32; 3], options: &ConsensusOptions, ballot: &mut Ballot) {
        let [x, y, z] = point.map(f64::from);
        let p = &self.lens.projection;
        let [u, v, depth] = [0, 1, 2].map(|i| (p[i][0] * x + p[i][1] * y + p[i][2] * z + p[i][3]) as f32);
        let (u, v) = (u / depth + 0.5, v / depth + 0.5);
        let depths = self.view.depth;
        let inside = (depth > 0.0)
            & (u >= 0.0)
            & (v >= 0.0)
            & (u < depths.width() as f32)
            & (v < depths.height() as f32);
        if !inside {
            return;
        }
        let pixel = depths.index(u as usize, v as usize);
        let seen = depths.data()[pixel];
        let share = if seen <= 0.0 {
            options.without_depth
        } else if (seen - depth).abs() < options.max_depth_diff * depth {
            1.0
        } else {
            return;
        };
        ballot.add(self.view.labels.data()[pixel], share * self.weight(pixel));
    }
}

/// Votes by class.
#[derive(Default)]
struct Ballot(Vec<(u16, f32)>);

impl Ballot {
    fn add(&mut self, label: u16, weight: f32) {
        if ClassId(label).is_void() || weight <= 0.0 {
            return;
        }
        match self.0.iter_mut().find(|(id, _)| *id == label) {
            Some((_, sum)) => *sum += weight,
            None => self.0.push((label, weight)),
        }
    }

    /// The winner and its confidence.
    fn outcome(&self, own: u16) -> Option<(u16, f32)> {
        let rank = |id: u16| (id != own, id);
        let better = |a: (u16, f32), b: (u16, f32)| {
            if b.1 > a.1 || (b.1 == a.1 && rank(b.0) < rank(a.0)) { b } else { a }
        };
        let (winner, most) = self.0.iter().copied().reduce(better)?;
        let odds = |votes: f32| (EVIDENCE_PER_VOTE * (votes - most)).exp();
        let total: f32 = odds(0.0) + self.0.iter().map(|(_, votes)| odds(*votes)).sum::<f32>();
        Some((winner, 1.0 / total))
    }
}

/// Distance of every pixel to the nearest pixel of another id, the larger of columns and rows, at most `most`: 1 on both
/// sides of a border. Void is an id like any other.
pub fn border_distance(labels: &LabelMap, most: u8) -> Grid<u8> {
    let (width, height) = (labels.width(), labels.height());
    let mut out = Grid::filled(labels.size(), most);
    if labels.size().area() == 0 {
        return out;
    }
    let ids = labels.data();
    let distances = out.data_mut();
    // Two sweeps over the eight pixels around suffice for this metric (Rosenfeld and Pfaltz 1966).
    let mut visit = |x: usize, y: usize, around: [(isize, isize); 4]| {
        let i = y * width + x;
        for (dx, dy) in around {
            let (nx, ny) = (x.wrapping_add_signed(dx), y.wrapping_add_signed(dy));
            if nx < width && ny < height {
                let n = ny * width + nx;
                let through = if ids[n] == ids[i] { distances[n].saturating_add(1) } else { 1 };
                distances[i] = distances[i].min(through);
            }
        }
    };
    for y in 0..height {
        (0..width).for_each(|x| visit(x, y, [(-1, 0), (-1, -1), (0, -1), (1, -1)]));
    }
    for y in (0..height).rev() {
        (0..width).rev().for_each(|x| visit(x, y, [(1, 0), (1, 1), (0, 1), (-1, 1)]));
    }
    out
}

#[cfg(test)]
#[path = "consensus_tests.rs"]
mod tests;
