//! Which views to match a view with: scores from shared sparse points.

use super::neighbor_scores::{ScoreContext, score_view};
use super::pairing::{PairingOptions, choose_pairs};
use super::{Neighbor, Scene, ViewIndex};
use crate::error::{Error, Result};
use crate::geometry::Camera;
use rayon::prelude::*;

/// What a sparse point outside the region of interest counts in view selection.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum OutsideRoi {
    /// As much as any other.
    Count,
    /// 0.7 times as much.
    #[default]
    Discount,
    /// Nothing.
    Drop,
}

/// Options of view selection. The defaults are OpenMVS's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NeighborOptions {
    /// Most neighbours to match with; 0 = all retained ones; 1 = the one of the choice described at
    /// [`PairingOptions`]. Default 5.
    pub number_views: usize,
    /// A view with fewer neighbours is not estimated (lowered to the number of calibrated views − 1). Default 2.
    pub min_views: usize,
    /// Most neighbours retained for filtering and fusion. Default 12.
    pub max_views: usize,
    /// A sparse point initialises depths if at least this many views see it, and never with fewer than 2. Default 2.
    pub min_views_trust_point: usize,
    /// Weight of points outside the region of interest. Default [`OutsideRoi::Discount`].
    pub outside_roi: OutsideRoi,
    /// A neighbour that scores less is not matched. Default 2.
    pub min_score: f32,
    /// A neighbour that scores less than this share of the best one's is not matched. Default 0.03.
    pub min_score_ratio: f32,
    /// Smallest share of the image covered by shared points, 0..1. Default 0.05.
    pub min_area: f32,
    /// Smallest mean triangulation angle in degrees. Default 3.
    pub min_angle_deg: f32,
    /// Triangulation angle in degrees that counts most. Default 12.
    pub best_angle_deg: f32,
    /// Mean triangulation angles are below this, in degrees. Default 65.
    pub max_angle_deg: f32,
    /// The choice of one neighbour per view, if only one is wanted.
    pub pairing: PairingOptions,
}

impl Default for NeighborOptions {
    fn default() -> Self {
        NeighborOptions {
            number_views: 5,
            min_views: 2,
            max_views: 12,
            min_views_trust_point: 2,
            outside_roi: OutsideRoi::Discount,
            min_score: 2.0,
            min_score_ratio: 0.03,
            min_area: 0.05,
            min_angle_deg: 3.0,
            best_angle_deg: 12.0,
            max_angle_deg: 65.0,
            pairing: PairingOptions::default(),
        }
    }
}

impl NeighborOptions {
    /// Checks the ranges.
    ///
    /// # Errors
    /// [`Error::Invalid`] naming the first bad option.
    pub fn check(&self) -> Result<()> {
        let degrees = |v: f32| (0.0..=180.0).contains(&v);
        let rules = [
            (self.max_views > 0, "max-views is 0: at least one neighbour is needed"),
            (
                self.best_angle_deg > 0.0 && degrees(self.best_angle_deg),
                "optim-angle must be in (0, 180] degrees",
            ),
            (degrees(self.min_angle_deg), "min-angle must be in [0, 180] degrees"),
            (degrees(self.max_angle_deg), "max-angle must be in [0, 180] degrees"),
            ((0.0..=1.0).contains(&self.min_area), "min-area must be in [0, 1]"),
            (self.min_score.is_finite(), "view-min-score must be a number"),
            (self.min_score_ratio.is_finite(), "view-min-score-ratio must be a number"),
        ];
        match rules.iter().find(|(holds, _)| !holds) {
            Some((_, rule)) => Err(Error::invalid(*rule)),
            None => self.pairing.check(),
        }
    }
}

/// The neighbours of one view, and the sparse points that initialise it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ViewNeighbors {
    /// Every scored neighbour, best first: what a densified scene stores, and what orders fusion.
    pub all: Vec<Neighbor>,
    /// The neighbours of filtering and fusion, best first; empty if the view is not processed.
    pub retained: Vec<Neighbor>,
    /// How many of the first `retained` to match with; 0 = no depth map is estimated.
    pub matching_count: usize,
    /// Positions in [`Scene::tracks`] of the points that this view sees and that initialise its depths, ascending.
    pub tracks: Vec<u32>,
    /// Mean depth of the sparse points seen, 0 = unknown.
    pub avg_depth: f32,
}

impl ViewNeighbors {
    /// The neighbours to match with, best first.
    pub fn matching(&self) -> &[Neighbor] {
        &self.retained[..self.matching_count]
    }
}

/// Selects the neighbours of every view, in parallel; the result does not depend on the number of threads.
///
/// `cameras` has one entry per view, at working resolution; views without a camera get no neighbours and are nobody's.
/// Views that came with neighbour scores keep their list; their tracks are collected all the same.
///
/// # Errors
/// [`Error::Invalid`] if an option is out of range, or no view has stored neighbours and there are no sparse points
/// to find them from.
pub fn select_neighbors(
    scene: &Scene,
    cameras: &[Option<Camera>],
    options: &NeighborOptions,
) -> Result<Vec<ViewNeighbors>> {
    options.check()?;
    let has_lists = scene.views.iter().zip(cameras).any(|(v, c)| c.is_some() && !v.neighbors.is_empty());
    if scene.tracks.is_empty() && !has_lists {
        return Err(Error::invalid(
            "no sparse points: neighbour views cannot be found; give a scene with its sparse cloud, or the neighbours \
             of each view with --view-neighbors-file",
        ));
    }
    let context = ScoreContext::new(scene, cameras, options);
    let views = (0..scene.views.len()).into_par_iter();
    let selected = views.map_init(|| context.scratch(), |scratch, i| select_for_view(&context, i, scratch));
    let mut selected: Vec<ViewNeighbors> = selected.collect();
    if options.number_views == 1 {
        choose_pairs(&mut selected, &options.pairing);
    }
    Ok(selected)
}

/// Replaces the neighbours of views by given ones, best first, with the scores that OpenMVS gives such entries: no
/// points, scale 1, angle 15°, area 0.5, score 3. Views that are not in `lists` keep theirs.
///
/// # Errors
/// [`Error::Invalid`] if a list names a view that is not in the scene.
pub fn override_neighbors(scene: &mut Scene, lists: &[(ViewIndex, Vec<ViewIndex>)]) -> Result<()> {
    let count = scene.views.len();
    for (view, others) in lists {
        if let Some(bad) = std::iter::once(view).chain(others).find(|v| v.index() >= count) {
            let what =
                format!("view neighbours: image {} is not in the scene, which has {count} images", bad.0);
            return Err(Error::invalid(what));
        }
        let mut neighbors: Vec<Neighbor> = Vec::with_capacity(others.len());
        for &other in others {
            if other != *view && neighbors.iter().all(|n| n.view != other) {
                let angle = 15.0_f32.to_radians();
                neighbors.push(Neighbor { view: other, points: 0, scale: 1.0, angle, area: 0.5, score: 3.0 });
            }
        }
        scene.views[view.index()].neighbors = neighbors;
    }
    Ok(())
}

fn select_for_view(
    context: &ScoreContext<'_>,
    index: usize,
    scratch: &mut super::neighbor_scores::Scratch,
) -> ViewNeighbors {
    let Some(scored) = score_view(context, index, scratch) else { return ViewNeighbors::default() };
    let view = &context.scene.views[index];
    let options = context.options;
    let stored = !view.neighbors.is_empty();
    let (all, avg_depth) = if stored {
        (view.neighbors.clone(), if view.avg_depth > 0.0 { view.avg_depth } else { scored.avg_depth })
    } else {
        (scored.neighbors, scored.avg_depth)
    };
    let usable = |n: &Neighbor| n.view.index() != index && context.camera(n.view).is_some();
    let mut retained: Vec<Neighbor> = all.iter().copied().filter(usable).collect();
    /// A view with fewer points that initialise it is not estimated.
    const MIN_TRACKS: usize = 4;
    let min_views = options.min_views.min(context.calibrated.saturating_sub(1));
    if !stored && (scored.tracks.len() < MIN_TRACKS || retained.len() < min_views) {
        retained.clear();
    }
    retain_neighbors(&mut retained, options);
    let matching_count = count_matching(&retained, options);
    ViewNeighbors { all, retained, matching_count, tracks: scored.tracks, avg_depth }
}

/// Drops poor neighbours from the worst on while more than enough are left, then all beyond the maximum.
fn retain_neighbors(neighbors: &mut Vec<Neighbor>, options: &NeighborOptions) {
    /// Neighbours are never dropped for their quality below this number.
    const ENOUGH: usize = 4;
    /// Mean footprint ratios that matching copes with.
    const SCALES: std::ops::Range<f32> = 0.2..3.2;
    let enough = ENOUGH.max(options.max_views * 3 / 4);
    let angles = options.min_angle_deg.to_radians()..options.max_angle_deg.to_radians();
    for i in (0..neighbors.len()).rev() {
        if neighbors.len() <= enough {
            break;
        }
        let n = &neighbors[i];
        if n.area < options.min_area || !SCALES.contains(&n.scale) || !angles.contains(&n.angle) {
            neighbors.remove(i);
        }
    }
    neighbors.truncate(options.max_views);
}

/// How many of the best neighbours score enough to be matched.
fn count_matching(retained: &[Neighbor], options: &NeighborOptions) -> usize {
    let Some(best) = retained.first() else { return 0 };
    let min_score = (best.score * options.min_score_ratio).max(options.min_score);
    let wanted = if options.number_views == 0 { retained.len() } else { options.number_views };
    retained.iter().take(wanted).take_while(|n| n.score >= min_score).count()
}

#[cfg(test)]
mod tests;
