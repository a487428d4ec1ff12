//! Which views start points in which order, which others they read, and when maps are needed.

use super::order::by_decreasing_score;
use super::{FusionMaps, FusionOptions};
use crate::geometry::Size;
use crate::scene::ViewIndex;

/// What is known of a view's maps before they are loaded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MapInfo {
    /// Size of the maps.
    pub size: Size,
    /// Whether there are normals.
    pub normals: bool,
}

impl MapInfo {
    /// What `maps` will be announced as.
    pub fn of(maps: &FusionMaps) -> Self {
        MapInfo { size: maps.size(), normals: maps.estimate.normal.is_some() }
    }
}

/// A view of the scene as fusion sees it; one per view of the scene, in the scene's order.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct FusionView {
    /// The depth map, if the view has one.
    pub maps: Option<MapInfo>,
    /// Views that a point started in this one is compared with, best first: the retained neighbours.
    pub neighbors: Vec<ViewIndex>,
    /// Length of the scene's full neighbour list; decides the order of views.
    pub neighbor_count: usize,
}

/// The steps of a fusion: one per view that starts points.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct FusionPlan {
    pub(super) steps: Vec<PlanStep>,
    /// Steps in which each view's maps are needed, ascending; by view.
    uses: Vec<Vec<u32>>,
    /// Whether all maps have normals.
    pub(super) normals: bool,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct PlanStep {
    pub(super) view: ViewIndex,
    /// Neighbours that have maps, best first.
    pub(super) neighbors: Vec<ViewIndex>,
}

impl FusionPlan {
    pub(super) fn new(views: &[FusionView], options: &FusionOptions) -> Self {
        let has_maps = |v: usize| views.get(v).is_some_and(|view| view.maps.is_some());
        let steps: Vec<PlanStep> = if options.number_views_fuse < 2 {
            (0..views.len())
                .filter(|&v| has_maps(v))
                .map(|v| PlanStep { view: ViewIndex(v as u32), neighbors: Vec::new() })
                .collect()
        } else {
            let scores: Vec<usize> =
                (0..views.len()).map(|v| if has_maps(v) { views[v].neighbor_count } else { 0 }).collect();
            by_decreasing_score(&scores)
                .into_iter()
                .map(|v| PlanStep { view: ViewIndex(v as u32), neighbors: usable_neighbors(views, v) })
                .collect()
        };
        let mut uses = vec![Vec::new(); views.len()];
        for (i, step) in steps.iter().enumerate() {
            for view in step.views() {
                uses[view.index()].push(i as u32);
            }
        }
        let normals = views.iter().filter_map(|view| view.maps).all(|maps| maps.normals);
        FusionPlan { steps, uses, normals }
    }

    /// The first step from `step` on that needs `view`.
    pub(super) fn next_use(&self, view: ViewIndex, step: usize) -> Option<usize> {
        let uses = &self.uses[view.index()];
        uses.get(uses.partition_point(|&s| (s as usize) < step)).map(|&s| s as usize)
    }
}

impl PlanStep {
    /// All views whose maps the step needs, its own first.
    pub(super) fn views(&self) -> impl Iterator<Item = ViewIndex> + '_ {
        std::iter::once(self.view).chain(self.neighbors.iter().copied())
    }
}

/// The neighbours of view `v` that have maps, each once, itself left out.
fn usable_neighbors(views: &[FusionView], v: usize) -> Vec<ViewIndex> {
    let mut usable: Vec<ViewIndex> = Vec::with_capacity(views[v].neighbors.len());
    for &other in &views[v].neighbors {
        let has_maps = views.get(other.index()).is_some_and(|view| view.maps.is_some());
        if has_maps && other.index() != v && !usable.contains(&other) {
            usable.push(other);
        }
    }
    usable
}

#[cfg(test)]
mod tests {
    use super::*;

    fn view(neighbors: &[u32], neighbor_count: usize, has_maps: bool) -> FusionView {
        FusionView {
            maps: has_maps.then_some(MapInfo { size: Size::new(4, 3), normals: true }),
            neighbors: neighbors.iter().map(|&v| ViewIndex(v)).collect(),
            neighbor_count,
        }
    }

    #[test]
    fn views_come_by_neighbour_count_and_know_their_next_use() {
        let views =
            [view(&[1, 2], 2, true), view(&[0, 2, 3, 1], 3, true), view(&[1], 2, false), view(&[1], 1, true)];
        let plan = FusionPlan::new(&views, &FusionOptions::default());
        let order: Vec<u32> = plan.steps.iter().map(|s| s.view.0).collect();
        assert_eq!(order, [1, 0, 3]);
        assert_eq!(plan.steps[0].neighbors, [ViewIndex(0), ViewIndex(3)], "no maps, no part; nor itself");
        assert_eq!(plan.next_use(ViewIndex(3), 0), Some(0));
        assert_eq!(plan.next_use(ViewIndex(3), 1), Some(2));
        assert_eq!(plan.next_use(ViewIndex(0), 2), None);
        assert_eq!(plan.next_use(ViewIndex(2), 0), None);
    }

    #[test]
    fn one_view_is_enough_for_a_plain_merge_in_index_order() {
        let views = [view(&[], 0, true), view(&[0], 1, true), view(&[0], 9, false)];
        let options = FusionOptions { number_views_fuse: 1, ..Default::default() };
        let order: Vec<u32> = FusionPlan::new(&views, &options).steps.iter().map(|s| s.view.0).collect();
        assert_eq!(order, [0, 1]);
        let order: Vec<u32> =
            FusionPlan::new(&views, &FusionOptions::default()).steps.iter().map(|s| s.view.0).collect();
        assert_eq!(order, [1], "a view without neighbours starts no point");
    }
}
