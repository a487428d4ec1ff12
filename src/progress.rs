//! What running work tells whoever started it. Nothing here prints, opens a file or reads a clock.

use crate::error::{Error, Result};
use crate::scene::ImageId;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

/// A long stage whose steps are counted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Images are decoded and scaled; one step per image.
    PrepareImages,
    /// Label maps are read and checked; one step per view.
    CheckLabels,
    /// Photometric estimation; one step per view.
    Estimate,
    /// A geometric-consistency pass; one step per view.
    Geometric {
        /// Number of the pass, from 0.
        pass: usize,
        /// How many passes the run has.
        passes: usize,
    },
    /// Speckles, gaps and the filter across views; one step per view.
    Filter,
    /// Fusion of depth maps that agree; one step per view.
    Fuse,
    /// Plain merge of all depths; one step per view.
    Merge,
    /// Label maps are made from a cloud; one step per view.
    RenderLabels,
    /// Pictures of a view's maps are drawn; one step per view.
    DrawViews,
}

impl std::fmt::Display for Stage {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Stage::PrepareImages => "Preparing images",
            Stage::CheckLabels => "Checking label maps",
            Stage::Estimate => "Estimating depth maps",
            Stage::Geometric { pass, passes } => {
                return write!(f, "Geometric pass {} of {passes}", pass + 1);
            }
            Stage::Filter => "Filtering depth maps",
            Stage::Fuse => "Fusing depth maps",
            Stage::Merge => "Merging depth maps",
            Stage::RenderLabels => "Rendering label maps",
            Stage::DrawViews => "Drawing pictures",
        })
    }
}

/// What a scene file holds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SceneSummary {
    /// Whether it is an interface archive; else it is a project archive.
    pub interface: bool,
    /// Images.
    pub images: usize,
    /// Images with a pose.
    pub calibrated: usize,
    /// Points, sparse or dense.
    pub points: usize,
}

/// What a run will take, by a model; the programs say it, and nothing depends on it.
#[derive(Clone, Debug, PartialEq)]
pub struct Forecast {
    /// Depth maps to make.
    pub maps: usize,
    /// Columns and rows of the largest.
    pub size: (u32, u32),
    /// Whether all have this size.
    pub is_one_size: bool,
    /// Source views of each, on the mean.
    pub sources: usize,
    /// Threads at work.
    pub threads: usize,
    /// Time of every stage that is to come, in order.
    pub stages: Vec<(Stage, Duration)>,
    /// Most memory that the run is to take, bytes.
    pub memory: u64,
}

/// Something that happened.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Event {
    /// Something is wrong but the work goes on.
    Warning(String),
    /// Worth knowing once.
    Info(String),
    /// Of interest to who looks closely.
    Detail(String),
    /// The scene was read.
    SceneLoaded {
        /// What is in it.
        scene: SceneSummary,
        /// Time it took.
        elapsed: Duration,
    },
    /// All images are decoded and scaled.
    ImagesPrepared {
        /// Usable images.
        images: usize,
        /// Time it took.
        elapsed: Duration,
    },
    /// Every view knows its source views.
    ViewsSelected {
        /// Views that have at least one source view.
        images: usize,
        /// Time since the preparation of the images began.
        elapsed: Duration,
    },
    /// What is to be done is known, and nothing of it is done.
    Planned(Forecast),
    /// The source views of one reference view.
    Paired {
        /// The reference view.
        reference: ImageId,
        /// Its source views, best first.
        sources: Vec<ImageId>,
    },
    /// One depth map was estimated.
    DepthEstimated {
        /// The reference view.
        reference: ImageId,
        /// Number of source views.
        sources: usize,
        /// Columns and rows of the map.
        size: (u32, u32),
        /// Time it took.
        elapsed: Duration,
    },
    /// One depth map passed the filter across views.
    DepthFiltered {
        /// The reference view.
        reference: ImageId,
        /// Number of other maps it was held against.
        sources: usize,
        /// Depths removed.
        discarded: usize,
        /// Depths looked at.
        processed: usize,
        /// Time it took.
        elapsed: Duration,
    },
    /// All depth maps are fused.
    Fused {
        /// Depth maps that took part.
        maps: usize,
        /// Depths they held.
        depths: u64,
        /// Points made of them.
        points: u64,
        /// Time it took.
        elapsed: Duration,
    },
    /// Only depth maps were wanted and they are done.
    DepthMapsCompleted {
        /// Number of depth maps.
        maps: usize,
        /// Sparse points of the scene.
        sparse_points: usize,
        /// Time since the run began.
        elapsed: Duration,
    },
    /// The dense cloud is complete.
    Densified {
        /// Points in it.
        points: u64,
        /// Time since the run began.
        elapsed: Duration,
    },
    /// A point cloud is on disk.
    CloudSaved {
        /// The file.
        path: std::path::PathBuf,
        /// Points in it.
        points: u64,
        /// Time it took.
        elapsed: Duration,
    },
    /// A scene is on disk.
    SceneSaved {
        /// The file.
        path: std::path::PathBuf,
        /// What is in it.
        scene: SceneSummary,
        /// Time it took.
        elapsed: Duration,
    },
}

/// Receives events and stage counts, from any thread.
pub trait Listener: Send + Sync {
    /// Something happened.
    fn event(&self, event: &Event);
    /// `done` of `total` steps of `stage` are finished; 0 when it starts, `total` when it ends.
    fn steps(&self, stage: Stage, done: usize, total: usize);
    /// Whether the work is to stop as soon as what is in hand is complete.
    fn wants_stop(&self) -> bool {
        false
    }
}

/// Handle by which work reports; cheap to clone.
#[derive(Clone)]
pub struct Progress {
    listener: Arc<dyn Listener>,
}

impl Progress {
    /// Reports to `listener`.
    pub fn new(listener: Arc<dyn Listener>) -> Self {
        Progress { listener }
    }

    /// Reports to nobody.
    pub fn silent() -> Self {
        Progress { listener: Arc::new(Silent) }
    }

    /// Whether to go on.
    ///
    /// # Errors
    /// [`Error::Interrupted`] if whoever listens wants the work to stop.
    pub fn check(&self) -> Result<()> {
        if self.listener.wants_stop() { Err(Error::Interrupted) } else { Ok(()) }
    }

    /// Passes `event` on.
    pub fn event(&self, event: Event) {
        self.listener.event(&event);
    }

    /// Something is wrong but the work goes on.
    pub fn warn(&self, text: impl Into<String>) {
        self.event(Event::Warning(text.into()));
    }

    /// Worth knowing once.
    pub fn info(&self, text: impl Into<String>) {
        self.event(Event::Info(text.into()));
    }

    /// Of interest to who looks closely.
    pub fn detail(&self, text: impl Into<String>) {
        self.event(Event::Detail(text.into()));
    }

    /// Starts counting the `total` steps of `stage`.
    pub fn start(&self, stage: Stage, total: usize) -> Steps {
        self.listener.steps(stage, 0, total);
        Steps { listener: Arc::clone(&self.listener), stage, total, done: AtomicUsize::new(0) }
    }
}

impl Default for Progress {
    fn default() -> Self {
        Progress::silent()
    }
}

impl std::fmt::Debug for Progress {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Progress")
    }
}

/// Counts the steps of one stage; may be shared between threads.
pub struct Steps {
    listener: Arc<dyn Listener>,
    stage: Stage,
    total: usize,
    done: AtomicUsize,
}

impl Steps {
    /// One more step is done.
    pub fn step(&self) {
        let done = self.done.fetch_add(1, Ordering::Relaxed) + 1;
        self.listener.steps(self.stage, done.min(self.total), self.total);
    }
}

impl std::fmt::Debug for Steps {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Steps({:?}, {} of {})", self.stage, self.done.load(Ordering::Relaxed), self.total)
    }
}

struct Silent;

impl Listener for Silent {
    fn event(&self, _: &Event) {}
    fn steps(&self, _: Stage, _: usize, _: usize) {}
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Mutex;

    #[derive(Default)]
    struct Recorder(Mutex<Vec<(usize, usize)>>, Mutex<Vec<Event>>);

    impl Listener for Recorder {
        fn event(&self, event: &Event) {
            self.1.lock().unwrap().push(event.clone());
        }
        fn steps(&self, _: Stage, done: usize, total: usize) {
            self.0.lock().unwrap().push((done, total));
        }
    }

    #[test]
    fn steps_count_up_and_never_pass_the_total() {
        let recorder = Arc::new(Recorder::default());
        let progress = Progress::new(recorder.clone());
        let steps = progress.start(Stage::Fuse, 2);
        for _ in 0..3 {
            steps.step();
        }
        progress.warn("w");
        assert_eq!(*recorder.0.lock().unwrap(), [(0, 2), (1, 2), (2, 2), (2, 2)]);
        assert_eq!(*recorder.1.lock().unwrap(), [Event::Warning("w".into())]);
    }
}
