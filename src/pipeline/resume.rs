//! What of a run is there already, and what is to be made.

use super::ingredients::{Ingredients, Recipe, ingredients};
use super::memory_plan::MAP_BYTES;
use super::prepare::Prepared;
use super::schedule::Task;
use crate::error::{Error, Result};
use crate::progress::Progress;
use crate::scene::{DepthEstimate, ImageId, ViewIndex};
use crate::store::depth_store::{DepthStore, MapStage};
use crate::store::digest::Digest;
use crate::store::map_journal::{MapJournal, Mark};
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// What is done with depth maps that are there before a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Reuse {
    /// None is used, whatever it was made from.
    Nothing,
    /// Those that were made from exactly what this run would make them from.
    Same,
    /// These if all are such; else all that fit the scene are taken as they are.
    SameOrFitting,
    /// All that fit the scene are taken as they are.
    Fitting,
}

/// The stages of a run, and for each the views of which it makes a map.
#[derive(Debug)]
pub(super) struct Plan {
    journal: MapJournal,
    /// Views that will have a map, ascending.
    pub(super) views: Vec<ViewIndex>,
    /// Those whose map is taken as it is.
    pub(super) given: BTreeSet<ViewIndex>,
    /// Those whose final map was there.
    finished: BTreeSet<ViewIndex>,
    /// Those of which an unfinished run has left something.
    begun: BTreeSet<ViewIndex>,
    /// By stage.
    todo: Vec<Vec<ViewIndex>>,
    /// Parallel to `views`.
    ids: Vec<ImageId>,
    ingredients: Vec<Ingredients>,
    /// Where the maps are after every stage, parallel to `views`.
    places: Vec<Vec<MapStage>>,
}

impl Plan {
    /// Decides which maps are to be made. `present` are the views whose file in the folder fits the scene.
    ///
    /// # Errors
    /// An image or a depth map cannot be read.
    pub(super) fn make(
        recipe: Recipe<'_>,
        store: &DepthStore,
        present: &BTreeSet<ViewIndex>,
        reuse: Reuse,
        progress: &Progress,
    ) -> Result<Self> {
        let journal = MapJournal::open(store.folder())?;
        let matched: BTreeSet<ViewIndex> = recipe.prepared.matched_views().into_iter().collect();
        let mut plan = Plan {
            journal,
            views: matched.iter().copied().collect(),
            given: BTreeSet::new(),
            finished: BTreeSet::new(),
            begun: BTreeSet::new(),
            todo: vec![Vec::new(); recipe.last() as usize + 1],
            ids: Vec::new(),
            ingredients: Vec::new(),
            places: Vec::new(),
        };
        let untouched = recipe.last() == 0 && !recipe.cleans();
        let fitting = match reuse {
            Reuse::Nothing | Reuse::Same => false,
            Reuse::Fitting => true,
            // Maps that nobody touches need no origin.
            Reuse::SameOrFitting if untouched => true,
            Reuse::SameOrFitting => {
                plan.set_ingredients(recipe, &BTreeMap::new())?;
                !present.iter().all(|view| plan.is_there(store, *view, recipe.last()).is_some())
            }
        };
        if fitting {
            plan.given.clone_from(present);
            plan.views = matched.union(present).copied().collect();
            plan.take_as_given(recipe, store, untouched)?;
        } else {
            if plan.ingredients.is_empty() {
                plan.set_ingredients(recipe, &BTreeMap::new())?;
            }
            plan.find_work(recipe, store, reuse == Reuse::Nothing);
        }
        plan.tell(recipe, store, present, reuse, progress)?;
        Ok(plan)
    }

    /// Lays out a run that takes maps as they are. `untouched`: it will leave them so.
    fn take_as_given(&mut self, recipe: Recipe<'_>, store: &DepthStore, untouched: bool) -> Result<()> {
        if untouched {
            // Digests of maps whose bytes do not matter.
            let none = Digest::of(|_| ());
            self.set_ingredients(recipe, &self.given.iter().map(|&view| (view, none)).collect())?;
            self.find_work(recipe, store, false);
            return Ok(());
        }
        let contents = self.contents(recipe, store)?;
        let mut given = contents.clone();
        for (view, content) in &mut given {
            // What a run that did not come to its end has replaced counts as it was before.
            let id = recipe.prepared.id(*view);
            if let (Some(_), Some(before)) = (self.journal.of_content(id, *content), self.journal.given(id)) {
                *content = before;
            }
        }
        self.set_ingredients(recipe, &given)?;
        let read = self.find_work(recipe, store, false);
        if read.iter().any(|view| contents.get(view) != given.get(view)) {
            // This run needs what is no more; it is another one than that.
            given = contents;
            self.set_ingredients(recipe, &given)?;
            self.find_work(recipe, store, false);
        }
        for (&view, &content) in given.iter().filter(|(view, _)| !self.finished.contains(view)) {
            store.rely_on(recipe.prepared.id(view), MapStage::Final, content);
        }
        let by_id = given.iter().map(|(&view, &content)| (recipe.prepared.id(view).0, content));
        self.journal.begin(by_id.collect())
    }

    fn set_ingredients(&mut self, recipe: Recipe<'_>, given: &BTreeMap<ViewIndex, Digest>) -> Result<()> {
        self.ids = self.views.iter().map(|&view| recipe.prepared.id(view)).collect();
        self.ingredients = ingredients(recipe, &self.views, given)?;
        let places = |&view: &ViewIndex| {
            let mut place = MapStage::Final;
            let mut after = |stage| {
                if recipe.makes(view, stage, given.contains_key(&view)) {
                    place = MapStage::Pass(stage);
                }
                place
            };
            (0..=recipe.last()).map(&mut after).collect()
        };
        self.places = self.views.iter().map(places).collect();
        (self.finished, self.begun) = Default::default();
        self.todo = vec![Vec::new(); recipe.last() as usize + 1];
        Ok(())
    }

    /// The bytes of the maps that are taken as they are.
    fn contents(&self, recipe: Recipe<'_>, store: &DepthStore) -> Result<BTreeMap<ViewIndex, Digest>> {
        let content = |&view: &ViewIndex| Ok((view, Digest::of_file(&store.path(recipe.prepared.id(view)))?));
        self.given.iter().collect::<Vec<_>>().into_par_iter().map(content).collect()
    }

    /// Where the map of `view` after `stage` is, if it is there and whole.
    fn is_there(&self, store: &DepthStore, view: ViewIndex, stage: u32) -> Option<MapStage> {
        let at = self.at(view)?;
        let id = self.ids[at];
        let mark = self.journal.made_from(id, self.ingredients[at].keys[stage as usize])?;
        let is_last = stage as usize + 1 == self.todo.len();
        let places = [is_last.then_some(MapStage::Final), Some(MapStage::Pass(stage))];
        let found = places.into_iter().flatten().find(|&place| {
            Digest::of_file(&store.stage_path(id, place)).is_ok_and(|content| content == mark.content)
        })?;
        store.rely_on(id, found, mark.content);
        Some(found)
    }

    /// Goes from the last stage to the first: what is not there is made, from what must be there or be made then. `anew`:
    /// nothing counts as there. Returns the views whose given map is read.
    fn find_work(&mut self, recipe: Recipe<'_>, store: &DepthStore, anew: bool) -> BTreeSet<ViewIndex> {
        let mut needed: BTreeSet<ViewIndex> = self.views.iter().copied().collect();
        for stage in (0..=recipe.last()).rev() {
            let makes = |view: &ViewIndex| recipe.makes(*view, stage, self.given.contains(view));
            let (made, kept): (Vec<ViewIndex>, Vec<ViewIndex>) = needed.iter().copied().partition(makes);
            let found: Vec<(ViewIndex, Option<MapStage>)> = made
                .into_par_iter()
                .map(|view| (view, if anew { None } else { self.is_there(store, view, stage) }))
                .collect();
            needed = kept.into_iter().collect();
            for (view, place) in found {
                let Some(at) = self.at(view) else { continue };
                match place {
                    Some(place) => self.places[at][stage as usize] = place,
                    None => {
                        self.todo[stage as usize].push(view);
                        needed.extend(recipe.inputs(view, stage, &self.views));
                    }
                }
                match place {
                    Some(MapStage::Final) => drop(self.finished.insert(view)),
                    Some(MapStage::Pass(_)) => drop(self.begun.insert(view)),
                    None => {}
                }
            }
        }
        needed.retain(|view| self.given.contains(view) && !self.finished.contains(view));
        needed
    }

    /// Says what is used, what is not, and why.
    fn tell(
        &self,
        recipe: Recipe<'_>,
        store: &DepthStore,
        present: &BTreeSet<ViewIndex>,
        reuse: Reuse,
        progress: &Progress,
    ) -> Result<()> {
        let folder = store.folder().display();
        if !self.given.is_empty() {
            progress.info(format!("{folder}: {} depth maps are used as they are", self.given.len()));
        }
        let finished = self.finished.difference(&self.given).count();
        if finished > 0 {
            progress.info(format!("{folder}: {finished} depth maps are up to date and are not made again"));
        }
        if !self.begun.is_empty() {
            let (begun, all) = (self.begun.len(), self.views.len());
            progress.info(format!(
                "{folder}: an unfinished run is resumed, which left {begun} of {all} depth maps"
            ));
        }
        let mut reasons: BTreeMap<String, usize> = BTreeMap::new();
        for &view in present.iter().filter(|view| !self.given.contains(view) && !self.finished.contains(view))
        {
            let reason = match reuse {
                Reuse::Nothing => "they are not wanted (--force)".to_owned(),
                _ => self.reason(recipe, store, view)?,
            };
            *reasons.entry(reason).or_default() += 1;
        }
        for (reason, count) in reasons {
            progress.info(format!("{folder}: {count} depth maps exist; {reason}, they are estimated again"));
        }
        Ok(())
    }

    /// Why the map of `view` that is there is not the one that is wanted.
    fn reason(&self, recipe: Recipe<'_>, store: &DepthStore, view: ViewIndex) -> Result<String> {
        let id = recipe.prepared.id(view);
        let content = Digest::of_file(&store.path(id))?;
        let (Some(mark), Some(at)) = (self.journal.of_content(id, content), self.at(view)) else {
            return Ok("what they were made from is not known (--geometric-iters 0 uses them as they are)"
                .to_owned());
        };
        let (wanted, found) = (&self.ingredients[at].from, &mark.from);
        let names: BTreeSet<&String> = wanted.keys().chain(found.keys()).collect();
        let other: Vec<&str> = names
            .into_iter()
            .filter(|name| wanted.get(*name) != found.get(*name))
            .map(String::as_str)
            .collect();
        Ok(match other.is_empty() {
            true => "the maps of neighbours that they were made from have changed".to_owned(),
            false => format!("made with other values of: {}", other.join(", ")),
        })
    }

    /// Whether geometric passes read and make maps of `view`.
    pub(super) fn is_refined(&self, prepared: &Prepared, view: ViewIndex) -> bool {
        self.at(view).is_some() && !prepared.neighbors[view.index()].matching().is_empty()
    }

    fn at(&self, view: ViewIndex) -> Option<usize> {
        self.views.binary_search(&view).ok()
    }

    /// What makes the maps that `task` reads, where they are not there.
    pub(super) fn needs(&self, recipe: Recipe<'_>, task: Task) -> Vec<Task> {
        let Some(before) = task.stage.checked_sub(1) else { return Vec::new() };
        let made_by = |view: ViewIndex| match self.places[self.at(view)?][before as usize] {
            MapStage::Pass(stage) => Some(Task { stage, view }),
            MapStage::Final => None,
        };
        recipe.inputs(task.view, task.stage, &self.views).into_iter().filter_map(made_by).collect()
    }

    /// Views of which `stage` makes a map, ascending.
    pub(super) fn todo(&self, stage: u32) -> &[ViewIndex] {
        &self.todo[stage as usize]
    }

    /// Whether anything is made.
    pub(super) fn has_work(&self) -> bool {
        self.todo.iter().any(|views| !views.is_empty())
    }

    /// Bytes that the maps to be made take on the disk: those of two stages, as one is made from the other, and one for every
    /// thread that goes on to the stage after them while their last maps are in hand.
    pub(super) fn disk_bytes(&self, prepared: &Prepared) -> u64 {
        let bytes_of = |view: &ViewIndex| match &prepared.cameras[view.index()] {
            Some(camera) => camera.size().area() as u64 * MAP_BYTES,
            None => 0,
        };
        let stages: Vec<u64> = self.todo.iter().map(|views| views.iter().map(bytes_of).sum()).collect();
        let pairs = stages.windows(2).map(|pair| pair[0] + pair[1]);
        let two = pairs.chain(stages.first().copied()).max().unwrap_or(0);
        let largest = self.views.iter().map(bytes_of).max().unwrap_or(0);
        (two + largest * rayon::current_num_threads() as u64).min(stages.iter().sum())
    }

    /// Views whose maps were there.
    pub(super) fn reused(&self) -> BTreeSet<ViewIndex> {
        self.given.union(&self.finished).copied().collect()
    }

    /// The map of `view` after `stage`.
    ///
    /// # Errors
    /// As [`DepthStore::read_stage`].
    pub(super) fn read(&self, store: &DepthStore, view: ViewIndex, stage: u32) -> Result<Arc<DepthEstimate>> {
        match self.at(view) {
            Some(at) => store.read_stage(self.ids[at], self.places[at][stage as usize]),
            None => Err(Error::invalid(format!("view {} has no depth map", view.0))),
        }
    }

    /// Makes `estimate` the map of `view` after `stage`.
    ///
    /// # Errors
    /// It cannot be written.
    pub(super) fn write(
        &self,
        store: &DepthStore,
        view: ViewIndex,
        stage: u32,
        estimate: DepthEstimate,
    ) -> Result<()> {
        let Some(at) = self.at(view) else { return Ok(()) };
        let is_last = stage as usize + 1 == self.todo.len();
        let content = store.write_stage(estimate, MapStage::Pass(stage), is_last)?;
        let Ingredients { from, keys } = &self.ingredients[at];
        let (image, key) = (self.ids[at].0, keys[stage as usize]);
        self.journal.enter(Mark { image, key, content, from: from.clone() })
    }

    /// `stage` is complete: what those before it have left is needed no more.
    pub(super) fn complete(&self, store: &DepthStore, stage: u32) {
        for &id in self.ids.iter().filter(|_| stage > 0) {
            store.discard(id, stage - 1);
        }
    }

    /// Makes the maps of the last stage the results.
    ///
    /// # Errors
    /// One cannot be renamed.
    pub(super) fn publish(&self, store: &DepthStore) -> Result<()> {
        let mut published = false;
        for (&id, places) in self.ids.iter().zip(&self.places) {
            if let Some(&MapStage::Pass(pass)) = places.last() {
                store.publish(id, pass)?;
                published = true;
            }
        }
        if published {
            store.sync();
        }
        store.discard_passes(&self.ids);
        Ok(())
    }

    /// The run has come to its end, and the maps of `gone` were deleted.
    ///
    /// # Errors
    /// The journal cannot be written.
    pub(super) fn finish(&self, gone: &[ImageId]) -> Result<()> {
        let keys = self.ingredients.iter().filter_map(|ingredients| ingredients.keys.last().copied());
        let results: Vec<(ImageId, Digest)> = self.ids.iter().copied().zip(keys).collect();
        self.journal.finish(&results, gone)
    }
}
