//! What the programs remember of what is said.

use crate::progress::{Event, Listener, Progress, Stage};
use std::sync::{Arc, Mutex, PoisonError};

/// Passes everything on to `inner` and remembers the warnings.
pub(crate) struct Recorder {
    inner: Arc<dyn Listener>,
    warnings: Mutex<Vec<String>>,
}

impl Recorder {
    /// A recorder before `inner`.
    pub(crate) fn before(inner: Arc<dyn Listener>) -> Arc<Self> {
        Arc::new(Recorder { inner, warnings: Mutex::default() })
    }

    /// The handle for work that reports here.
    pub(crate) fn progress(self: &Arc<Self>) -> Progress {
        Progress::new(Arc::clone(self) as Arc<dyn Listener>)
    }

    /// The warnings so far, sorted: threads give them in any order.
    pub(crate) fn warnings(&self) -> Vec<String> {
        let mut warnings = self.warnings.lock().unwrap_or_else(PoisonError::into_inner).clone();
        warnings.sort();
        warnings
    }
}

impl Listener for Recorder {
    fn event(&self, event: &Event) {
        if let Event::Warning(text) = event {
            let mut warnings = self.warnings.lock().unwrap_or_else(PoisonError::into_inner);
            if warnings.contains(text) {
                return;
            }
            warnings.push(text.clone());
        }
        self.inner.event(event);
    }

    fn steps(&self, stage: Stage, done: usize, total: usize) {
        self.inner.steps(stage, done, total);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Nobody;

    impl Listener for Nobody {
        fn event(&self, _: &Event) {}
        fn steps(&self, _: Stage, _: usize, _: usize) {}
    }

    #[test]
    fn warnings_are_remembered_once_and_sorted() {
        let recorder = Arc::new(Recorder { inner: Arc::new(Nobody), warnings: Mutex::default() });
        let progress = recorder.progress();
        progress.warn("b");
        progress.warn("a");
        progress.warn("b");
        progress.info("c");
        assert_eq!(recorder.warnings(), ["a", "b"]);
    }
}
