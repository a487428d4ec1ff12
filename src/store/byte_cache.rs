//! Values that were loaded lately, within a budget of bytes.

use crate::error::Result;
use std::collections::HashMap;
use std::hash::Hash;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// A thread-safe cache that drops what was used least recently once the sum of the sizes exceeds the budget.
///
/// A value larger than the budget is handed out but not kept. Handed-out values live as long as their `Arc`.
#[derive(Debug)]
pub(crate) struct ByteCache<K, V> {
    state: Mutex<State<K, V>>,
}

#[derive(Debug)]
struct State<K, V> {
    budget: usize,
    entries: HashMap<K, Entry<V>>,
    bytes: usize,
    clock: u64,
}

#[derive(Debug)]
struct Entry<V> {
    value: Arc<V>,
    bytes: usize,
    used: u64,
}

impl<K: Hash + Eq + Copy, V> ByteCache<K, V> {
    /// An empty cache that keeps up to `budget` bytes.
    pub(crate) fn new(budget: usize) -> Self {
        let state = State { budget, entries: HashMap::new(), bytes: 0, clock: 0 };
        ByteCache { state: Mutex::new(state) }
    }

    /// The value of `key`: the kept one, else what `load` returns with its size in bytes.
    ///
    /// Loading holds no lock: two threads that miss the same key both load it.
    pub(crate) fn get_or_load(&self, key: K, load: impl FnOnce() -> Result<(V, usize)>) -> Result<Arc<V>> {
        if let Some(value) = self.get(key) {
            return Ok(value);
        }
        let (value, bytes) = load()?;
        let value = Arc::new(value);
        self.insert(key, value.clone(), bytes);
        Ok(value)
    }

    /// The kept value of `key`.
    pub(crate) fn get(&self, key: K) -> Option<Arc<V>> {
        let mut state = self.lock();
        state.clock += 1;
        let now = state.clock;
        let entry = state.entries.get_mut(&key)?;
        entry.used = now;
        Some(entry.value.clone())
    }

    /// Keeps a value, replacing an earlier one of the same key.
    pub(crate) fn insert(&self, key: K, value: Arc<V>, bytes: usize) {
        let mut state = self.lock();
        state.remove(&key);
        if bytes > state.budget {
            return;
        }
        state.clock += 1;
        let used = state.clock;
        state.bytes += bytes;
        state.entries.insert(key, Entry { value, bytes, used });
        state.shrink();
    }

    /// From now on keeps up to `budget` bytes.
    pub(crate) fn set_budget(&self, budget: usize) {
        let mut state = self.lock();
        state.budget = budget;
        state.shrink();
    }

    /// Keeps the value of `key` no longer; returns it.
    pub(crate) fn remove(&self, key: K) -> Option<Arc<V>> {
        self.lock().remove(&key)
    }

    /// A thread that panicked while it held the lock left consistent counters: every change above is completed
    /// before anything that could panic.
    fn lock(&self) -> MutexGuard<'_, State<K, V>> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl<K: Hash + Eq + Copy, V> State<K, V> {
    /// Drops what was used least recently until the rest is within the budget.
    fn shrink(&mut self) {
        while self.bytes > self.budget {
            let Some(oldest) = self.entries.iter().min_by_key(|(_, e)| e.used).map(|(k, _)| *k) else {
                break;
            };
            self.remove(&oldest);
        }
    }

    fn remove(&mut self, key: &K) -> Option<Arc<V>> {
        let entry = self.entries.remove(key)?;
        self.bytes -= entry.bytes;
        Some(entry.value)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn load(cache: &ByteCache<u32, u32>, key: u32, bytes: usize) -> bool {
        let mut loaded = false;
        let value = cache.get_or_load(key, || {
            loaded = true;
            Ok((key * 10, bytes))
        });
        assert_eq!(*value.unwrap(), key * 10);
        loaded
    }

    #[test]
    fn keeps_what_was_used_last_within_the_budget() {
        let cache = ByteCache::new(30);
        assert!(load(&cache, 1, 10) && load(&cache, 2, 10) && load(&cache, 3, 10));
        assert!(!load(&cache, 1, 10));
        assert!(load(&cache, 4, 10));
        assert!(!load(&cache, 1, 10) && !load(&cache, 3, 10) && !load(&cache, 4, 10));
        assert!(load(&cache, 2, 10));
    }

    #[test]
    fn a_smaller_budget_drops_what_was_used_first() {
        let cache = ByteCache::new(30);
        assert!(load(&cache, 1, 10) && load(&cache, 2, 10) && load(&cache, 3, 10));
        cache.set_budget(20);
        assert!(!load(&cache, 2, 10) && !load(&cache, 3, 10) && load(&cache, 1, 10));
        cache.set_budget(0);
        assert!(load(&cache, 1, 10) && load(&cache, 1, 10));
    }

    #[test]
    fn hands_out_but_does_not_keep_what_is_too_large() {
        let cache = ByteCache::new(30);
        assert!(load(&cache, 1, 10));
        assert!(load(&cache, 2, 31) && load(&cache, 2, 31));
        assert!(!load(&cache, 1, 10));
    }

    #[test]
    fn replacing_a_value_replaces_its_size() {
        let cache = ByteCache::new(30);
        for _ in 0..10 {
            cache.insert(1, Arc::new(10), 20);
        }
        assert!(load(&cache, 2, 10));
        assert!(!load(&cache, 1, 20));
    }

    #[test]
    fn a_failed_load_keeps_nothing() {
        let cache: ByteCache<u32, u32> = ByteCache::new(30);
        let failed = cache.get_or_load(1, || Err(crate::error::Error::invalid("no")));
        assert!(failed.is_err() && cache.get(1).is_none());
    }
}
