//! One neighbour for every view, chosen for all views together.

use super::neighbors::ViewNeighbors;
use super::trws::{LabelGraph, Stop};
use super::{Neighbor, ViewIndex};
use crate::error::{Error, Result};
use std::collections::BTreeSet;

/// Options of the choice that `number_views = 1` asks for. The defaults are OpenMVS's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PairingOptions {
    /// Weight of what two views' choices cost together against what each costs by itself, >= 0. Default 0.3.
    pub pairwise: f32,
    /// The search ends when no message changes by this much. Default 0.001.
    pub eps: f32,
    /// Most iterations of the search. Default 80.
    pub max_iterations: usize,
}

impl Default for PairingOptions {
    fn default() -> Self {
        PairingOptions { pairwise: 0.3, eps: 0.001, max_iterations: 80 }
    }
}

impl PairingOptions {
    /// Checks the ranges.
    ///
    /// # Errors
    /// [`Error::Invalid`] naming the bad option.
    pub fn check(&self) -> Result<()> {
        let number = |value: f32| value.is_finite() && value >= 0.0;
        match (number(self.pairwise), number(self.eps)) {
            (true, true) => Ok(()),
            (false, _) => Err(Error::invalid("pairwise-mul must be a number >= 0")),
            (_, false) => Err(Error::invalid("optimizer-eps must be a number >= 0")),
        }
    }
}

/// What no neighbour costs, as a multiple of the worst neighbour.
const NONE_UNARY: f64 = 6.0;
/// What no neighbour costs beside each related view.
const NONE_PAIRWISE: f64 = 8.0;
/// What it costs two views to choose each other: they would see nothing that the other one does not.
const MUTUAL_PAIRWISE: f64 = 24.0;
/// Smallest area and score that are divided by.
const TINY: f32 = 1e-3;

/// Leaves every view one neighbour to be matched with, or none. A neighbour costs the less the better it scores; two
/// related views pay for each choice that covers less of the image than their own overlap, and most for choosing each
/// other. The chosen neighbour comes first among the retained ones.
pub(super) fn choose_pairs(views: &mut [ViewNeighbors], options: &PairingOptions) {
    let graph = PairGraph::new(views, f64::from(options.pairwise));
    let stop = Stop { eps: f64::from(options.eps), max_iterations: options.max_iterations };
    let start = vec![0; graph.views.len()];
    let labels = graph.labels.solve(start, stop);
    let chosen: Vec<(usize, usize)> = graph.views.iter().map(|v| v.index()).zip(labels).collect();
    for (view, label) in chosen {
        let neighbors = &mut views[view];
        let none = label >= neighbors.retained.len();
        neighbors.matching_count = usize::from(!none);
        if !none {
            neighbors.retained[..=label].rotate_right(1);
        }
    }
}

/// The choices of all views that have neighbours.
struct PairGraph {
    labels: LabelGraph,
    /// The view of every node.
    views: Vec<ViewIndex>,
}

impl PairGraph {
    fn new(all: &[ViewNeighbors], pairwise: f64) -> Self {
        let mut graph = PairGraph { labels: LabelGraph::default(), views: Vec::new() };
        let mut node_of = vec![None; all.len()];
        for (i, view) in all.iter().enumerate().filter(|(_, v)| !v.retained.is_empty()) {
            node_of[i] = Some(graph.labels.add_node(unary(&view.retained)));
            graph.views.push(ViewIndex(i as u32));
        }
        let mut related = BTreeSet::new();
        for &view in &graph.views {
            for other in &all[view.index()].retained {
                related.insert((view.min(other.view), view.max(other.view)));
            }
        }
        for (a, b) in related {
            let (Some(node_a), Some(node_b)) = (node_of[a.index()], node_of[b.index()]) else { continue };
            let (list_a, list_b) = (&all[a.index()].retained, &all[b.index()].retained);
            let Some(area) = area_of(list_a, b).or_else(|| area_of(list_b, a)) else { continue };
            let side = |list: &[Neighbor], label: usize| match list.get(label) {
                Some(neighbor) => f64::from(area) / f64::from(neighbor.area.max(TINY)),
                None => NONE_PAIRWISE,
            };
            let chooses =
                |list: &[Neighbor], label: usize, view| list.get(label).is_some_and(|n| n.view == view);
            graph.labels.add_edge(node_a, node_b, |i, j| {
                let mutual = chooses(list_a, i, b) && chooses(list_b, j, a);
                pairwise * if mutual { MUTUAL_PAIRWISE } else { side(list_a, i) + side(list_b, j) }
            });
        }
        graph
    }
}

/// The cost of every neighbour by itself, and of none.
fn unary(neighbors: &[Neighbor]) -> Vec<f64> {
    let score = |n: &Neighbor| f64::from(n.score.max(TINY));
    let mean = neighbors.iter().map(score).sum::<f64>() / neighbors.len() as f64;
    let mut costs: Vec<f64> = neighbors.iter().map(|n| mean / score(n)).collect();
    costs.push(costs.last().map_or(0.0, |last| NONE_UNARY * last));
    costs
}

/// Share of the image that overlaps with `view`.
fn area_of(neighbors: &[Neighbor], view: ViewIndex) -> Option<f32> {
    neighbors.iter().find(|n| n.view == view).map(|n| n.area)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn neighbors(list: &[(u32, f32, f32)]) -> ViewNeighbors {
        let neighbor = |&(view, score, area): &(u32, f32, f32)| Neighbor {
            view: ViewIndex(view),
            points: 100,
            scale: 1.0,
            angle: 0.2,
            area,
            score,
        };
        let retained: Vec<Neighbor> = list.iter().map(neighbor).collect();
        ViewNeighbors {
            all: retained.clone(),
            matching_count: retained.len(),
            retained,
            ..Default::default()
        }
    }

    fn chosen(views: &[ViewNeighbors]) -> Vec<Option<u32>> {
        views.iter().map(|v| v.matching().first().map(|n| n.view.0)).collect()
    }

    #[test]
    fn views_do_not_choose_each_other() {
        // Each of a pair scores best for the other, a third and a fourth nearly as well.
        let mut views = [
            neighbors(&[(1, 10.0, 0.6), (2, 9.0, 0.6)]),
            neighbors(&[(0, 10.0, 0.6), (2, 9.0, 0.6)]),
            neighbors(&[(0, 10.0, 0.6), (1, 9.0, 0.6)]),
            ViewNeighbors::default(),
        ];
        choose_pairs(&mut views, &PairingOptions::default());
        let pairs = chosen(&views);
        assert_eq!(pairs[3], None);
        for (view, other) in pairs.iter().take(3).enumerate() {
            let other = other.unwrap();
            assert_ne!(pairs[other as usize], Some(view as u32), "{pairs:?}");
        }
        for view in &views[..3] {
            assert_eq!((view.matching_count, view.retained.len()), (1, 2));
        }
    }

    #[test]
    fn without_pairwise_costs_everyone_takes_the_best() {
        let mut views = [
            neighbors(&[(1, 10.0, 0.6)]),
            neighbors(&[(0, 4.0, 0.2), (2, 3.0, 0.9)]),
            neighbors(&[(1, 9.0, 0.6)]),
        ];
        let options = PairingOptions { pairwise: 0.0, ..Default::default() };
        choose_pairs(&mut views, &options);
        assert_eq!(chosen(&views), [Some(1), Some(0), Some(1)]);
    }

    #[test]
    fn the_choice_is_the_best_of_all_on_a_small_scene_and_never_worse_than_the_best_neighbours() {
        let mut state = 3u64;
        let mut random = move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f32 / (1u64 << 24) as f32
        };
        let mut optimal = 0;
        for _ in 0..60 {
            let mut views: Vec<ViewNeighbors> = (0..6u32)
                .map(|i| {
                    let mut list: Vec<(u32, f32, f32)> = (0..6)
                        .filter(|&j| j != i)
                        .map(|j| (j, 3.0 + 40.0 * random(), 0.1 + 0.8 * random()))
                        .collect();
                    list.sort_by(|a, b| b.1.total_cmp(&a.1));
                    list.truncate(3);
                    neighbors(&list)
                })
                .collect();
            let graph = PairGraph::new(&views, 0.3);
            let best = (0..4096usize)
                .map(|code| (0..6).map(|i| code >> (2 * i) & 3).collect::<Vec<usize>>())
                .map(|labels| graph.labels.energy(&labels))
                .fold(f64::INFINITY, f64::min);
            let before = views.clone();
            choose_pairs(&mut views, &PairingOptions::default());
            let label = |i: usize| match views[i].matching().first() {
                Some(n) => before[i].retained.iter().position(|r| r.view == n.view).unwrap(),
                None => before[i].retained.len(),
            };
            let energy = graph.labels.energy(&(0..6).map(label).collect::<Vec<_>>());
            assert!(energy <= graph.labels.energy(&[0; 6]) + 1e-9);
            assert!(energy <= best * 1.1 + 1e-9, "{energy} {best}");
            optimal += usize::from(energy < best + 1e-6);
        }
        assert!(optimal > 40, "{optimal} of 60");
    }
}
