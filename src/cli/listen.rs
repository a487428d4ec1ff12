//! Everything that is said comes through one listener: progress, and what the library logs by `tracing`.

use crate::progress::{Event, Listener, Progress, Stage};
use std::fmt::Write;
use std::sync::{Arc, Mutex, PoisonError};
use tracing::field::{Field, Visit};
use tracing_subscriber::layer::{Context, Layer, SubscriberExt};

/// Passes everything on to `inner` and remembers the warnings.
pub(crate) struct Recorder {
    inner: Arc<dyn Listener>,
    warnings: Mutex<Vec<String>>,
}

impl Recorder {
    /// A recorder before `inner`, which also hears what the library logs from now on.
    pub(crate) fn start(inner: Arc<dyn Listener>) -> Arc<Self> {
        let recorder = Arc::new(Recorder { inner, warnings: Mutex::default() });
        let subscriber = tracing_subscriber::registry().with(Forward(Arc::clone(&recorder)));
        // Fails only when a log was started before, which then goes on.
        let _ = tracing::subscriber::set_global_default(subscriber);
        recorder
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

/// Turns log records of this library into events.
struct Forward(Arc<Recorder>);

impl<S: tracing::Subscriber> Layer<S> for Forward {
    fn on_event(&self, record: &tracing::Event<'_>, _: Context<'_, S>) {
        if !record.metadata().target().starts_with("semvs") {
            return;
        }
        let mut message = Message(String::new());
        record.record(&mut message);
        let Message(text) = message;
        self.0.event(&match *record.metadata().level() {
            tracing::Level::ERROR | tracing::Level::WARN => Event::Warning(text),
            tracing::Level::INFO => Event::Info(text),
            _ => Event::Detail(text),
        });
    }
}

struct Message(String);

impl Visit for Message {
    fn record_debug(&mut self, field: &Field, value: &dyn std::fmt::Debug) {
        if field.name() == "message" {
            let _ = write!(self.0, "{value:?}");
        }
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
