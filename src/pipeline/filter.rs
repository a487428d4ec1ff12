//! The filter across views: every depth is held against the maps of the neighbours.

use super::estimate::{for_each_view, replace_all};
use super::job::AcrossViews;
use super::prepare::Prepared;
use crate::depth_filter::{
    DepthFilterOptions, FilterView, MAX_NEIGHBORS, filter_consistency, filter_unbiased,
};
use crate::error::Result;
use crate::progress::{Event, Progress, Stage};
use crate::scene::{DepthEstimate, DepthMap, ImageId, LabelMap, ViewIndex};
use crate::store::depth_store::{DepthStore, Lasting};
use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Instant;

/// Replaces the maps of `views` by filtered ones; all read the maps as they were.
///
/// # Errors
/// A map cannot be read or written.
pub(super) fn filter_across_views(
    prepared: &Prepared,
    store: &DepthStore,
    views: &[ViewIndex],
    across: &AcrossViews,
    options: &DepthFilterOptions,
    progress: &Progress,
) -> Result<()> {
    let most = match across {
        AcrossViews::OpenMvs => MAX_NEIGHBORS,
        AcrossViews::Unbiased(options) => options.max_neighbors as usize,
    };
    let ids: BTreeSet<ImageId> = views.iter().map(|&v| prepared.id(v)).collect();
    let steps = progress.start(Stage::Filter, views.len());
    replace_all(store, &ids, || {
        for_each_view(views, |view| {
            let start = Instant::now();
            let reference = store.read(prepared.id(view))?;
            let neighbors = prepared.neighbors[view.index()]
                .retained
                .iter()
                .map(|n| n.view)
                .filter(|&n| ids.contains(&prepared.id(n)))
                .take(most)
                .map(|n| Ok((n, store.read(prepared.id(n))?)))
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
            store.write_pending(filtered, Lasting::Result)?;
            progress.event(Event::DepthFiltered {
                reference: prepared.id(view),
                sources: against.len(),
                discarded: before.saturating_sub(after),
                processed: before,
                elapsed: start.elapsed(),
            });
            steps.step();
            Ok(())
        })
    })
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
