//! Depth maps in memory: those that were read or made lately, and those that have no file yet.

use crate::scene::{DepthEstimate, ImageId};
use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Which of a view's two maps.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Slot {
    /// The one that readers get.
    Current,
    /// The one that will take its place.
    Pending,
}

/// Depth maps within a budget of bytes; may be used by many threads at once.
#[derive(Debug)]
pub(super) struct HeldMaps {
    budget: usize,
    state: Mutex<State>,
}

#[derive(Debug, Default)]
struct State {
    maps: HashMap<(ImageId, Slot), Held>,
    bytes: usize,
    clock: u64,
}

#[derive(Debug)]
struct Held {
    estimate: Arc<DepthEstimate>,
    bytes: usize,
    used: u64,
    /// Whether a file holds the same; else it must not be dropped.
    has_file: bool,
}

impl HeldMaps {
    pub(super) fn new(budget: usize) -> Self {
        HeldMaps { budget, state: Mutex::default() }
    }

    /// The current map of a view, if it is held.
    pub(super) fn get(&self, id: ImageId) -> Option<Arc<DepthEstimate>> {
        let mut state = self.lock();
        state.clock += 1;
        let now = state.clock;
        let held = state.maps.get_mut(&(id, Slot::Current))?;
        held.used = now;
        Some(Arc::clone(&held.estimate))
    }

    /// The current map of a view, which is held no longer if there is a file of it.
    pub(super) fn take(&self, id: ImageId) -> Option<Arc<DepthEstimate>> {
        let mut state = self.lock();
        let held = state.maps.get(&(id, Slot::Current))?;
        let estimate = Arc::clone(&held.estimate);
        if held.has_file {
            state.remove(id, Slot::Current);
        }
        Some(estimate)
    }

    /// Holds a map in place of the one in `slot` if it fits; returns whether it does.
    pub(super) fn hold(&self, slot: Slot, estimate: &Arc<DepthEstimate>, has_file: bool) -> bool {
        let (id, bytes) = (estimate.image_id, bytes_of(estimate));
        let mut state = self.lock();
        state.remove(id, slot);
        if state.bytes + bytes > self.budget {
            return false;
        }
        state.clock += 1;
        let held = Held { estimate: Arc::clone(estimate), bytes, used: state.clock, has_file };
        state.bytes += bytes;
        state.maps.insert((id, slot), held);
        true
    }

    /// Holds a map that was read from its file, in place of those with a file that were used least recently.
    pub(super) fn hold_read(&self, estimate: &Arc<DepthEstimate>) {
        let bytes = bytes_of(estimate);
        let mut state = self.lock();
        while state.bytes + bytes > self.budget {
            let unneeded =
                state.maps.iter().filter(|((_, slot), held)| *slot == Slot::Current && held.has_file);
            let Some((&(id, slot), _)) = unneeded.min_by_key(|(_, held)| held.used) else { return };
            state.remove(id, slot);
        }
        drop(state);
        self.hold(Slot::Current, estimate, true);
    }

    /// Makes the pending map of a view the current one; returns whether there is a file of it, `None` if it is not held.
    pub(super) fn publish(&self, id: ImageId) -> Option<bool> {
        let mut state = self.lock();
        state.remove(id, Slot::Current);
        let held = state.maps.remove(&(id, Slot::Pending))?;
        let has_file = held.has_file;
        state.maps.insert((id, Slot::Current), held);
        Some(has_file)
    }

    /// Forgets a map.
    pub(super) fn remove(&self, id: ImageId, slot: Slot) {
        self.lock().remove(id, slot);
    }

    /// A thread that panicked while it held the lock left consistent counters: every change is completed before
    /// anything that could panic.
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl State {
    fn remove(&mut self, id: ImageId, slot: Slot) {
        if let Some(held) = self.maps.remove(&(id, slot)) {
            self.bytes -= held.bytes;
        }
    }
}

/// Bytes that an estimate takes in memory, but for small change.
fn bytes_of(estimate: &DepthEstimate) -> usize {
    let normal = estimate.normal.as_ref().map_or(0, |map| size_of_val(map.data()));
    let confidence = estimate.confidence.as_ref().map_or(0, |map| size_of_val(map.data()));
    size_of_val(estimate.depth.data()) + normal + confidence
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::synthetic::estimate_of_depths;

    /// A map of 16 pixels, 20 bytes each.
    const MAP: usize = 320;

    fn map(id: u32, depth: f32) -> Arc<DepthEstimate> {
        Arc::new(DepthEstimate { image_id: ImageId(id), ..estimate_of_depths(4, 4, |_, _| depth) })
    }

    fn depth(maps: &HeldMaps, id: u32) -> Option<f32> {
        maps.get(ImageId(id)).map(|map| map.depth[(0, 0)])
    }

    #[test]
    fn what_was_read_makes_room_and_what_has_no_file_stays() {
        let maps = HeldMaps::new(3 * MAP);
        assert!(maps.hold(Slot::Current, &map(1, 1.0), false));
        maps.hold_read(&map(2, 2.0));
        maps.hold_read(&map(3, 3.0));
        assert_eq!(depth(&maps, 2), Some(2.0));
        maps.hold_read(&map(4, 4.0));
        assert_eq!([1, 2, 3, 4].map(|id| depth(&maps, id).is_some()), [true, true, false, true]);
        assert!(!maps.hold(Slot::Pending, &map(1, 5.0), false), "nothing is dropped for it");
        assert_eq!(depth(&maps, 1), Some(1.0));
    }

    #[test]
    fn a_pending_map_takes_the_place_of_the_current_one() {
        let maps = HeldMaps::new(2 * MAP);
        assert!(
            maps.hold(Slot::Current, &map(1, 1.0), false) && maps.hold(Slot::Pending, &map(1, 2.0), true)
        );
        assert_eq!(depth(&maps, 1), Some(1.0));
        assert_eq!(maps.publish(ImageId(1)), Some(true));
        assert_eq!(depth(&maps, 1), Some(2.0));
        assert_eq!(maps.publish(ImageId(1)), None, "there is none: what was current is no more");
        assert_eq!(depth(&maps, 1), None);
        assert!(
            maps.hold(Slot::Current, &map(2, 1.0), true) && maps.hold(Slot::Current, &map(3, 1.0), false)
        );
        assert!(maps.take(ImageId(2)).is_some() && maps.take(ImageId(3)).is_some());
        assert_eq!([2, 3].map(|id| depth(&maps, id).is_some()), [false, true]);
        maps.remove(ImageId(3), Slot::Current);
        assert_eq!(maps.lock().bytes, 0);
    }

    #[test]
    fn a_budget_of_nothing_holds_nothing() {
        let maps = HeldMaps::new(0);
        assert!(!maps.hold(Slot::Current, &map(1, 1.0), false));
        maps.hold_read(&map(2, 1.0));
        assert_eq!([1, 2].map(|id| depth(&maps, id).is_some()), [false, false]);
    }
}
