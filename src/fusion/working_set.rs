//! The maps in memory: loaded before the step that needs them, dropped after their last use or when memory
//! is short.

use super::participant::ViewPixels;
use super::plan::FusionPlan;
use super::state::PixelStates;
use super::{FusionInput, FusionMaps, FusionOptions, FusionView, MapSource, Support};
use crate::error::{Error, Result};
use crate::scene::ViewIndex;
use rayon::prelude::*;

/// Largest number of pixels of a map: correspondences are stored in 30 bits.
const MAX_PIXELS: usize = 1 << 30;

/// Maps by view, and the state of their pixels, which outlives them.
pub(super) struct WorkingSet<'a> {
    views: &'a [FusionView],
    plan: &'a FusionPlan,
    source: &'a dyn MapSource,
    memory: u64,
    support: Support,
    maps: Vec<Option<ViewPixels>>,
    states: Vec<Option<PixelStates>>,
    /// Free pixels that were invalidated before their view's own step.
    invalidated: Vec<u64>,
}

/// A view's maps on their way into the set.
pub(super) type Loaded = (ViewIndex, Result<ViewPixels>);

impl<'a> WorkingSet<'a> {
    /// An empty set that keeps maps of up to `options.map_memory` bytes beyond those of a step.
    pub(super) fn new(input: &FusionInput<'a>, plan: &'a FusionPlan, options: &FusionOptions) -> Self {
        let views = input.views;
        WorkingSet {
            views,
            plan,
            source: input.source,
            memory: options.map_memory,
            support: options.support,
            maps: views.iter().map(|_| None).collect(),
            states: vec![None; views.len()],
            invalidated: vec![0; views.len()],
        }
    }

    /// Makes the maps of all views of `step` available.
    pub(super) fn prepare(&mut self, step: usize) -> Result<()> {
        let missing = self.missing(step);
        self.make_room(step, self.expected_bytes(&missing));
        let loaded = self.load_all(&missing);
        self.insert(loaded)
    }

    /// Loads what `step` will need beyond what is there, as far as it fits without dropping anything.
    pub(super) fn load_ahead(&self, step: usize) -> Vec<Loaded> {
        let missing = if step < self.plan.steps.len() { self.missing(step) } else { Vec::new() };
        match self.resident_bytes() + self.expected_bytes(&missing) <= self.memory {
            true => self.load_all(&missing),
            false => Vec::new(),
        }
    }

    /// Takes loaded maps into the set.
    pub(super) fn insert(&mut self, loaded: Vec<Loaded>) -> Result<()> {
        for (view, maps) in loaded {
            let maps = maps?;
            let states = &mut self.states[view.index()];
            if states.is_none() {
                let depths = maps.pixels.iter().map(|pixel| pixel.depth);
                *states = Some(PixelStates::with_depth(depths, self.support));
            }
            self.maps[view.index()] = Some(maps);
        }
        Ok(())
    }

    fn missing(&self, step: usize) -> Vec<ViewIndex> {
        self.plan.steps[step].views().filter(|v| self.maps[v.index()].is_none()).collect()
    }

    fn load_all(&self, views: &[ViewIndex]) -> Vec<Loaded> {
        views.par_iter().with_max_len(1).map(|&view| (view, self.load(view))).collect()
    }

    fn load(&self, view: ViewIndex) -> Result<ViewPixels> {
        let maps = load_checked(self.views, self.plan, self.source, view)?;
        Ok(ViewPixels::new(maps, self.plan.normals))
    }

    /// Drops what no step after `step` needs.
    pub(super) fn finish(&mut self, step: usize) {
        for view in self.plan.steps[step].views() {
            if self.plan.next_use(view, step + 1).is_none() {
                self.maps[view.index()] = None;
                self.states[view.index()] = None;
            }
        }
    }

    /// The maps of a view that the current step needs.
    pub(super) fn maps(&self, view: ViewIndex) -> Result<&ViewPixels> {
        self.maps[view.index()]
            .as_ref()
            .ok_or_else(|| Error::invalid(format!("view {} takes part in fusion without its maps", view.0)))
    }

    /// Takes the pixel state of a view out of the set; [`WorkingSet::restore`] it before the step ends.
    pub(super) fn take_states(&mut self, view: ViewIndex) -> PixelStates {
        self.states[view.index()].take().unwrap_or_default()
    }

    pub(super) fn restore(&mut self, view: ViewIndex, states: PixelStates) {
        self.states[view.index()] = Some(states);
    }

    pub(super) fn add_invalidated(&mut self, view: ViewIndex, pixels: u64) {
        self.invalidated[view.index()] += pixels;
    }

    /// Pixels of `view` invalidated so far.
    pub(super) fn invalidated(&self, view: ViewIndex) -> u64 {
        self.invalidated[view.index()]
    }

    /// An upper bound of what loading `views` takes.
    fn expected_bytes(&self, views: &[ViewIndex]) -> u64 {
        views.iter().map(|v| self.views[v.index()].maps.map_or(0, |info| info.size.area() as u64 * 27)).sum()
    }

    fn resident_bytes(&self) -> u64 {
        self.maps.iter().flatten().map(ViewPixels::bytes).sum()
    }

    /// Drops maps that `step` does not need until `expected` more bytes fit; those needed last go first.
    fn make_room(&mut self, step: usize, expected: u64) {
        let mut resident = self.resident_bytes();
        while resident + expected > self.memory {
            let unneeded = (0..self.maps.len()).filter(|&v| self.maps[v].is_some()).filter_map(|v| {
                let next = self.plan.next_use(ViewIndex(v as u32), step)?;
                (next > step).then_some((next, v))
            });
            let Some((_, view)) = unneeded.max() else { return };
            resident -= self.maps[view].take().map_or(0, |maps| maps.bytes());
        }
    }
}

/// The maps of `view`, which must be those that were announced.
///
/// # Errors
/// They cannot be read, have several sizes, are too large or not as announced.
pub(super) fn load_checked(
    views: &[FusionView],
    plan: &FusionPlan,
    source: &dyn MapSource,
    view: ViewIndex,
) -> Result<FusionMaps> {
    let maps = source.load(view)?;
    maps.check(view)?;
    let announced = views[view.index()].maps;
    if announced
        .is_none_or(|info| info.size != maps.size() || (plan.normals && maps.estimate.normal.is_none()))
    {
        return Err(Error::invalid(format!(
            "view {} ({}): the depth map changed while it was being fused; run again when nothing else \
             writes to the folder",
            view.0, maps.estimate.image_name
        )));
    }
    if maps.size().area() >= MAX_PIXELS {
        return Err(Error::invalid(format!(
            "view {} ({}): a depth map of {} is too large to fuse; estimate at a lower resolution",
            view.0,
            maps.estimate.image_name,
            maps.size()
        )));
    }
    Ok(maps)
}
