//! Depth maps of all views: photometric estimation, then passes that make them agree, a view ahead of another where it can.

use super::filter_job::FilterJob;
use super::ingredients::Recipe;
use super::ordered_steps::OrderedSteps;
use super::prepare::Prepared;
use super::problem::stereo_problem;
use super::resume::Plan;
use super::schedule::{Schedule, Task, at_a_time};
use crate::depth_filter::{fill_gaps, remove_speckles};
use crate::error::{Error, Result};
use crate::progress::{Event, Progress, Stage};
use crate::scene::{DepthEstimate, ViewIndex};
use crate::stereo::{self, CpuLevel, SourcePlanes, StereoOptions};
use crate::store::byte_cache::ByteCache;
use crate::store::depth_store::{DepthStore, Existing};
use crate::store::memory;
use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Instant;

/// Planes of the depth map of a view after a stage.
type PlaneCache = ByteCache<(u32, ViewIndex), SourcePlanes>;

/// What estimation needs to know besides the scene.
pub(super) struct Estimation<'a> {
    pub(super) prepared: &'a Prepared,
    pub(super) store: &'a DepthStore,
    pub(super) plan: &'a Plan,
    pub(super) options: &'a StereoOptions,
    pub(super) filter: &'a FilterJob,
    /// Views that are worked on at a time.
    pub(super) at_once: usize,
    /// Bytes that the planes of sources' depth maps may take.
    pub(super) planes: usize,
    pub(super) cpu: CpuLevel,
    pub(super) progress: &'a Progress,
}

/// Which views have a depth map in the folder whose id, size and camera fit. What does not fit is said in a line.
///
/// # Errors
/// With `refuse`, a map that does not fit.
pub(super) fn fitting_maps(
    prepared: &Prepared,
    store: &DepthStore,
    refuse: bool,
    progress: &Progress,
) -> Result<BTreeSet<ViewIndex>> {
    let mut fitting = BTreeSet::new();
    for view in prepared.views() {
        match store.existing(prepared.id(view), prepared.camera(view)?) {
            Existing::Absent => {}
            Existing::Usable => drop(fitting.insert(view)),
            Existing::Unusable(why) if refuse => return Err(Error::Invalid(why)),
            Existing::Unusable(why) => progress.warn(format!("{why}; the depth map is estimated again")),
        }
    }
    Ok(fitting)
}

impl Estimation<'_> {
    /// Leaves the depth map of every view as the last geometric pass makes it, cleaned of speckles and gaps; maps that are
    /// taken as they are are refined if there are geometric passes, else only cleaned.
    ///
    /// # Errors
    /// An image cannot be read, a depth map cannot be written.
    pub(super) fn run(&self) -> Result<()> {
        let passes = self.options.geometric_iterations;
        self.require_memory(self.plan.todo(0))?;
        let todo = |stage| self.plan.todo(stage);
        let recipe = Recipe { prepared: self.prepared, options: self.options, filter: self.filter };
        let schedule = Schedule::new(passes + 1, todo, |task| self.plan.needs(recipe, task));
        let estimated = todo(0).iter().filter(|view| !self.plan.given.contains(view)).count();
        let stages = (0..=passes)
            .map(|stage| (self.stage(stage), if stage == 0 { estimated } else { todo(stage).len() }));
        let steps = OrderedSteps::start(self.progress, stages);
        let planes = ByteCache::new(self.planes);
        let work = |task: Task| {
            self.progress.check()?;
            match task {
                Task { stage: 0, view } if self.plan.given.contains(&view) => return self.clean_given(view),
                Task { stage: 0, view } => self.photometric(view)?,
                task => self.geometric(task, &planes)?,
            }
            steps.step(self.stage(task.stage));
            Ok(())
        };
        let all = || schedule.run(work, |stage| self.plan.complete(self.store, stage));
        at_a_time(self.at_once, all)
    }

    /// What listeners are told of stage `stage`.
    fn stage(&self, stage: u32) -> Stage {
        match stage.checked_sub(1) {
            None => Stage::Estimate,
            Some(pass) => {
                Stage::Geometric { pass: pass as usize, passes: self.options.geometric_iterations as usize }
            }
        }
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

    fn photometric(&self, view: ViewIndex) -> Result<()> {
        let start = Instant::now();
        let problem = stereo_problem(self.prepared, view, self.options.levels)?;
        let mut estimate = stereo::estimate(&problem, self.options, self.cpu)?;
        self.clean(&mut estimate, self.options.geometric_iterations == 0);
        let (reference, size) = (estimate.image_id, estimate.depth.size());
        self.plan.write(self.store, view, 0, estimate)?;
        self.progress.event(Event::DepthEstimated {
            reference,
            sources: problem.sources.len(),
            size: (size.width, size.height),
            elapsed: start.elapsed(),
        });
        Ok(())
    }

    /// A geometric pass over a view, which reads the maps of the stage before.
    fn geometric(&self, Task { stage, view }: Task, planes: &PlaneCache) -> Result<()> {
        let before = stage - 1;
        let problem = stereo_problem(self.prepared, view, self.options.levels)?;
        let previous = self.plan.read(self.store, view, before)?;
        let refined = |view| self.plan.is_refined(self.prepared, view);
        let sources = self.prepared.neighbors[view.index()].matching().iter();
        let planes_of = |view| {
            planes.get_or_load((before, view), || {
                let planes = SourcePlanes::new(&*self.plan.read(self.store, view, before)?);
                let bytes = planes.bytes();
                Ok((planes, bytes))
            })
        };
        let sources = sources
            .map(|source| refined(source.view).then(|| planes_of(source.view)).transpose())
            .collect::<Result<Vec<Option<Arc<SourcePlanes>>>>>()?;
        let (pass, last) = (before as usize, stage == self.options.geometric_iterations);
        let mut estimate =
            stereo::refine_geometric(&problem, &previous, &sources, pass, self.options, self.cpu)?;
        self.clean(&mut estimate, last);
        self.plan.write(self.store, view, stage, estimate)
    }

    fn clean_given(&self, view: ViewIndex) -> Result<()> {
        let mut estimate = DepthEstimate::clone(&*self.store.read(self.prepared.id(view))?);
        estimate.image_name.clone_from(&self.prepared.loaded.scene.views[view.index()].name);
        self.clean(&mut estimate, true);
        self.plan.write(self.store, view, 0, estimate)
    }

    fn clean(&self, estimate: &mut DepthEstimate, last: bool) {
        if last && self.filter.speckles {
            remove_speckles(estimate, &self.filter.options);
        }
        if last && let Some(options) = self.filter.scraps().filter(|_| self.prepared.leaves_pixels_out()) {
            remove_speckles(estimate, &options);
        }
        if last && self.filter.gaps {
            fill_gaps(estimate, &self.filter.options);
        }
    }
}
