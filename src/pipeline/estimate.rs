//! Depth maps of all views: photometric estimation, then passes that make them agree.

use super::job::FilterJob;
use super::prepare::Prepared;
use super::problem::stereo_problem;
use crate::depth_filter::{fill_gaps, remove_speckles};
use crate::error::{Error, Result};
use crate::progress::{Event, Progress, Stage};
use crate::scene::{DepthEstimate, ImageId, ViewIndex};
use crate::stereo::{self, CpuLevel, StereoOptions};
use crate::store::depth_store::{DepthStore, Existing, Lasting};
use crate::store::memory;
use rayon::prelude::*;
use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Instant;

/// What estimation needs to know besides the scene.
pub(super) struct Estimation<'a> {
    pub(super) prepared: &'a Prepared,
    pub(super) store: &'a DepthStore,
    pub(super) options: &'a StereoOptions,
    pub(super) filter: &'a FilterJob,
    pub(super) cpu: CpuLevel,
    pub(super) progress: &'a Progress,
}

/// Which views have a depth map in the folder that is used as it is.
///
/// Without geometric passes every map whose id, size and camera fit is; with them no map is, because nothing tells
/// what it was made from. What is not used is said in a line.
///
/// # Errors
/// With `strict`, a map that was to be used and does not fit.
pub(super) fn existing_maps(
    prepared: &Prepared,
    store: &DepthStore,
    use_existing: bool,
    strict: bool,
    progress: &Progress,
) -> Result<BTreeSet<ViewIndex>> {
    let mut used = BTreeSet::new();
    let mut unused = 0usize;
    for view in prepared.views() {
        match store.existing(prepared.id(view), prepared.camera(view)?) {
            Existing::Absent => {}
            Existing::Usable if use_existing => drop(used.insert(view)),
            Existing::Usable => unused += 1,
            Existing::Unusable(why) if use_existing && strict => return Err(Error::Invalid(why)),
            Existing::Unusable(why) => progress.warn(format!("{why}; the depth map is estimated again")),
        }
    }
    if unused > 0 {
        progress.info(format!(
            "{}: {unused} depth maps exist; what they were made from is not known, they are estimated again \
             (--geometric-iters 0 uses them as they are)",
            store.folder().display()
        ));
    }
    if !used.is_empty() {
        progress.info(format!(
            "{}: {} depth maps are used as they are",
            store.folder().display(),
            used.len()
        ));
    }
    Ok(used)
}

impl Estimation<'_> {
    /// Leaves the final depth map of every view in the store: estimated, refined, and cleaned of speckles and gaps.
    /// `existing` maps are not estimated again: they are refined if there are geometric passes, else only cleaned. Returns the views that have a map.
    ///
    /// # Errors
    /// An image cannot be read, a depth map cannot be written.
    pub(super) fn run(&self, existing: &BTreeSet<ViewIndex>) -> Result<Vec<ViewIndex>> {
        let todo: Vec<ViewIndex> =
            self.prepared.matched_views().into_iter().filter(|v| !existing.contains(v)).collect();
        let passes = self.options.geometric_iterations as usize;
        let last = passes == 0;
        self.require_memory(&todo)?;
        self.photometric(&todo, last)?;
        let mut views: Vec<ViewIndex> = todo.into_iter().chain(existing.iter().copied()).collect();
        views.sort_unstable();
        if passes == 0 {
            self.clean_existing(existing)?;
            return Ok(views);
        }
        let matched = |view: &ViewIndex| !self.prepared.neighbors[view.index()].matching().is_empty();
        let refined: Vec<ViewIndex> = views.iter().copied().filter(matched).collect();
        for pass in 0..passes {
            self.geometric(&refined, pass, pass + 1 == passes)?;
        }
        Ok(views)
    }

    /// Asks whether there is memory for the views that are worked on at a time: their images and planes, and no more, so
    /// that nothing is refused that might work.
    fn require_memory(&self, todo: &[ViewIndex]) -> Result<()> {
        /// Depth, normal, confidence, and one copy while they change.
        const PLANES: usize = 40;
        let bytes_of = |view: &ViewIndex| -> Result<usize> {
            let sources = self.prepared.neighbors[view.index()].matching().len();
            Ok(self.prepared.camera(*view)?.size().area() * (size_of::<f32>() * (1 + sources) + PLANES))
        };
        let mut bytes = todo.iter().map(bytes_of).collect::<Result<Vec<usize>>>()?;
        bytes.sort_unstable_by(|a, b| b.cmp(a));
        let at_a_time = bytes.iter().take(rayon::current_num_threads()).sum::<usize>();
        memory::require(at_a_time as u64, "estimating as many depth maps at a time as there are threads")
    }

    fn photometric(&self, todo: &[ViewIndex], last: bool) -> Result<()> {
        let steps = self.progress.start(Stage::Estimate, todo.len());
        for_each_view(todo, |view| {
            let start = Instant::now();
            let problem = stereo_problem(self.prepared, view)?;
            let mut estimate = stereo::estimate(&problem, self.options, self.cpu)?;
            self.clean(&mut estimate, last);
            let (reference, size) = (estimate.image_id, estimate.depth.size());
            self.store.write(estimate, self.lasting(last))?;
            self.progress.event(Event::DepthEstimated {
                reference,
                sources: problem.sources.len(),
                size: (size.width, size.height),
                elapsed: start.elapsed(),
            });
            steps.step();
            Ok(())
        })
    }

    /// One geometric pass: every view reads the maps of the pass before.
    fn geometric(&self, todo: &[ViewIndex], pass: usize, last: bool) -> Result<()> {
        let passes = self.options.geometric_iterations as usize;
        let ids: BTreeSet<ImageId> = todo.iter().map(|&v| self.prepared.id(v)).collect();
        let steps = self.progress.start(Stage::Geometric { pass, passes }, todo.len());
        replace_all(self.store, &ids, || {
            for_each_view(todo, |view| {
                let problem = stereo_problem(self.prepared, view)?;
                let previous = self.store.read(problem.reference.id)?;
                let sources = problem
                    .sources
                    .iter()
                    .map(|source| ids.contains(&source.id).then(|| self.store.read(source.id)).transpose())
                    .collect::<Result<Vec<Option<Arc<DepthEstimate>>>>>()?;
                let mut estimate =
                    stereo::refine_geometric(&problem, &previous, &sources, pass, self.options, self.cpu)?;
                self.clean(&mut estimate, last);
                self.store.write_pending(estimate, self.lasting(last))?;
                steps.step();
                Ok(())
            })
        })
    }

    fn clean_existing(&self, existing: &BTreeSet<ViewIndex>) -> Result<()> {
        if !(self.filter.speckles || self.filter.gaps) {
            return Ok(());
        }
        let views: Vec<ViewIndex> = existing.iter().copied().collect();
        for_each_view(&views, |view| {
            let before = self.store.read(self.prepared.id(view))?;
            let mut estimate = DepthEstimate::clone(&before);
            estimate.image_name.clone_from(&self.prepared.loaded.scene.views[view.index()].name);
            self.clean(&mut estimate, true);
            if estimate.depth != before.depth {
                self.store.write(estimate, self.lasting(true))?;
            }
            Ok(())
        })
    }

    /// What the maps of a pass are: results after the `last` one, unless the filter across views follows.
    fn lasting(&self, last: bool) -> Lasting {
        if last && self.filter.across.is_none() { Lasting::Result } else { Lasting::Passing }
    }

    fn clean(&self, estimate: &mut DepthEstimate, last: bool) {
        if last && self.filter.speckles {
            remove_speckles(estimate, &self.filter.options);
        }
        if last && self.filter.gaps {
            fill_gaps(estimate, &self.filter.options);
        }
    }
}

/// Works on every view, as many at a time as the pool has threads.
pub(super) fn for_each_view(
    views: &[ViewIndex],
    work: impl Fn(ViewIndex) -> Result<()> + Sync + Send,
) -> Result<()> {
    views.par_iter().with_max_len(1).try_for_each(|&view| work(view))
}

/// Lets `write_pending` write a pending map of every one of `ids`, then puts them in place; when it fails, the maps
/// stay what they were.
pub(super) fn replace_all(
    store: &DepthStore,
    ids: &BTreeSet<ImageId>,
    write_pending: impl FnOnce() -> Result<()>,
) -> Result<()> {
    if let Err(error) = write_pending() {
        ids.iter().for_each(|&id| store.discard_pending(id));
        return Err(error);
    }
    ids.iter().try_for_each(|&id| store.publish(id))
}
