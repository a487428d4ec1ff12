//! What the programs remember of what is said.

use super::interrupt;
use crate::progress::{Event, Listener, Progress, Stage};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// Passes everything on to `inner` and remembers the warnings.
pub(crate) struct Recorder {
    inner: Arc<dyn Listener>,
    warnings: Mutex<Vec<String>>,
    stop: Arc<AtomicBool>,
}

impl Recorder {
    /// A recorder before `inner`.
    pub(crate) fn before(inner: Arc<dyn Listener>) -> Arc<Self> {
        Arc::new(Recorder { inner, warnings: Mutex::default(), stop: Arc::default() })
    }

    /// The handle for work that reports here.
    pub(crate) fn progress(self: &Arc<Self>) -> Progress {
        Progress::new(Arc::clone(self) as Arc<dyn Listener>)
    }

    /// From now on Ctrl-C asks the work to stop instead of ending the process; only for work that heeds it.
    pub(crate) fn heed_interrupts(&self) {
        interrupt::ask_to_stop(&self.stop);
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

    fn wants_stop(&self) -> bool {
        self.stop.load(Ordering::SeqCst)
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
        let recorder = Recorder::before(Arc::new(Nobody));
        let progress = recorder.progress();
        progress.warn("b");
        progress.warn("a");
        progress.warn("b");
        progress.info("c");
        assert_eq!(recorder.warnings(), ["a", "b"]);
    }
}
