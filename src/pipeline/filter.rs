//! The filter across views: every depth is held against the maps of the neighbours.

use super::filter_job::AcrossViews;
use super::prepare::Prepared;
use super::resume::Plan;
use super::schedule::for_each_view;
use crate::depth_filter::{
    DepthFilterOptions, FilterView, MAX_NEIGHBORS, filter_consistency, filter_unbiased,
};
use crate::error::Result;
use crate::progress::{Event, Progress, Stage};
use crate::scene::{DepthEstimate, DepthMap, LabelMap, ViewIndex};
use crate::store::depth_store::DepthStore;
use std::sync::Arc;
use std::time::Instant;

/// The neighbours whose maps those of `view` are held against, best first; `views` are all that have maps.
pub(super) fn neighbors_of_filter(
    prepared: &Prepared,
    view: ViewIndex,
    across: &AcrossViews,
    views: &[ViewIndex],
) -> Vec<ViewIndex> {
    let most = match across {
        AcrossViews::OpenMvs => MAX_NEIGHBORS,
        AcrossViews::Unbiased(options) => options.max_neighbors as usize,
    };
    let retained = prepared.neighbors[view.index()].retained.iter().map(|n| n.view);
    retained.filter(|n| views.binary_search(n).is_ok()).take(most).collect()
}

/// The last stage of `plan`: filters the maps that the one before has left.
///
/// # Errors
/// A map cannot be read or written.
pub(super) fn filter_across_views(
    prepared: &Prepared,
    store: &DepthStore,
    plan: &Plan,
    (stage, at_once): (u32, usize),
    across: &AcrossViews,
    options: &DepthFilterOptions,
    progress: &Progress,
) -> Result<()> {
    let todo = plan.todo(stage);
    if !todo.is_empty() {
        let steps = progress.start(Stage::Filter, todo.len());
        for_each_view(todo, at_once, progress, |view| {
            let start = Instant::now();
            let before = |view| plan.read(store, view, stage - 1);
            let reference = before(view)?;
            let neighbors = neighbors_of_filter(prepared, view, across, &plan.views)
                .into_iter()
                .map(|n| Ok((n, before(n)?)))
                .collect::<Result<Vec<(ViewIndex, Arc<DepthEstimate>)>>>()?;
            let views: Vec<ViewIndex> = std::iter::once(view).chain(neighbors.iter().map(|n| n.0)).collect();
            let labels = labels_of(prepared, &views, &reference)?;
            let filter_view =
                |i: usize, estimate| FilterView { estimate, labels: labels.get(i).map(|l| &**l) };
            let against: Vec<FilterView<'_>> =
                neighbors.iter().enumerate().map(|(i, n)| filter_view(i + 1, &n.1)).collect();
            let own = filter_view(0, &reference);
            let mut filtered = match across {
                AcrossViews::OpenMvs => filter_consistency(&own, &against, prepared.count(), options),
                AcrossViews::Unbiased(options) => filter_unbiased(&own, &against, options),
            };
            filtered.image_name.clone_from(&prepared.loaded.scene.views[view.index()].name);
            let (before, after) = (valid_depths(&reference.depth), valid_depths(&filtered.depth));
            plan.write(store, view, stage, filtered)?;
            progress.event(Event::DepthFiltered {
                reference: prepared.id(view),
                sources: against.len(),
                discarded: before.saturating_sub(after),
                processed: before,
                elapsed: start.elapsed(),
            });
            steps.step();
            Ok(())
        })?;
    }
    plan.complete(store, stage);
    Ok(())
}

/// The labels of `views` where the filter heeds them, borders void as the check wants them; else none.
///
/// # Errors
/// As [`super::skip::Labels::maps`].
fn labels_of(
    prepared: &Prepared,
    views: &[ViewIndex],
    estimate: &DepthEstimate,
) -> Result<Vec<Arc<LabelMap>>> {
    let Some(labels) = prepared.labels.as_ref().filter(|labels| labels.rules().filter) else {
        return Ok(Vec::new());
    };
    let of = |&view: &ViewIndex| {
        let size = prepared.camera(view).map_or(estimate.depth.size(), |camera| camera.size());
        let (map, checked) = labels.maps(view, size)?;
        Ok(checked.unwrap_or(map))
    };
    views.iter().map(of).collect()
}

/// Number of pixels with a depth.
pub(super) fn valid_depths(depth: &DepthMap) -> usize {
    depth.data().iter().filter(|&&d| d > 0.0).count()
}
