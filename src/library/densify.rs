//! Everything from the scene to the cloud, as the program does it.

use crate::error::{Error, Result};
use crate::fusion::FusionOptions;
use crate::pipeline::{
    self, DensifyJob, FilterJob, LabelJob, Outputs, RoiJob, SceneJob, TowerJob, TowerWork,
};
use crate::progress::{Event, Listener, Progress, Stage};
use crate::report::RunReport;
use crate::scene::{NeighborOptions, ResolutionOptions, RoiEstimation};
use crate::semantics::{ClassRules, Consistency};
use crate::stereo::{CpuLevel, Quality, StereoOptions};
use crate::store::cloud::CloudFormat;
use crate::store::labels::{LabelSources, MissingLabels};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

/// `semvs densify` as a function: the same steps, defaults, files and bytes. Every setter takes the job and gives it back. See
/// the [crate's page](crate#everything-at-once).
///
/// Like the program it goes on where a run with the same input and options was stopped.
#[derive(Clone)]
pub struct Densify {
    scene: PathBuf,
    output: Option<PathBuf>,
    depth_maps: PathBuf,
    resolution: ResolutionOptions,
    number_views: usize,
    quality: Quality,
    min_views: Option<u32>,
    labels: LabelSources,
    rules: ClassRules,
    strict: bool,
    max_threads: usize,
    max_memory: Option<u64>,
    observer: Option<Arc<Observer>>,
}

type Observer = dyn Fn(Step<'_>) -> bool + Send + Sync;

/// How far a run is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Step<'a> {
    /// What is being done, in words.
    pub stage: &'a str,
    /// Steps of it that are done.
    pub done: usize,
    /// All its steps.
    pub total: usize,
}

/// What a run has made.
#[derive(Clone, Debug)]
pub struct Summary {
    report: RunReport,
}

impl Densify {
    /// A run over an `.mvs` file or COLMAP's undistorted workspace, which is a folder.
    pub fn new(scene: impl Into<PathBuf>) -> Self {
        Densify {
            scene: scene.into(),
            output: None,
            depth_maps: PathBuf::from("."),
            resolution: ResolutionOptions::default(),
            number_views: NeighborOptions::default().number_views,
            quality: Quality::Normal,
            min_views: None,
            labels: LabelSources::default(),
            rules: ClassRules::default(),
            strict: false,
            max_threads: 0,
            max_memory: None,
            observer: None,
        }
    }

    /// The cloud, a `.ply`, `.las` or `.laz` file; the scene with its neighbours goes beside it. Must be given.
    pub fn output(mut self, cloud: impl Into<PathBuf>) -> Self {
        self.output = Some(cloud.into());
        self
    }

    /// Folder of the depth maps, and the first place where photographs are looked for. Default: the current folder.
    pub fn depth_maps(mut self, folder: impl Into<PathBuf>) -> Self {
        self.depth_maps = folder.into();
        self
    }

    /// How many times the photographs are halved, the longest side in pixels below which they are not, and the longest side
    /// that they may have. Default: 1, 640, 2560.
    pub fn resolution(mut self, level: u32, min: u32, max: u32) -> Self {
        self.resolution = ResolutionOptions { level, min, max };
        self
    }

    /// Photographs that each is matched with; 0: all good ones. Default: 5.
    pub fn number_views(mut self, views: usize) -> Self {
        self.number_views = views;
        self
    }

    /// How much is tried for every depth. Default: [`Quality::Normal`].
    pub fn quality(mut self, quality: Quality) -> Self {
        self.quality = quality;
        self
    }

    /// Fewest photographs that must agree on a point. Default: 3, or 2 where they must agree on its class, too.
    pub fn min_views(mut self, views: u32) -> Self {
        self.min_views = Some(views);
        self
    }

    /// Folder of the label maps; labels take part then.
    pub fn label_folder(mut self, folder: impl Into<PathBuf>) -> Self {
        self.labels.label_path = Some(folder.into());
        self
    }

    /// What label maps mean, as for [`ClassTable::named`](crate::ClassTable::named). Default: plain numbers.
    pub fn class_table(mut self, name: impl Into<String>) -> Self {
        self.labels.class_table = Some(name.into());
        self
    }

    /// Takes photographs without label map as unlabelled instead of stopping.
    pub fn allow_missing_labels(mut self) -> Self {
        self.labels.missing = MissingLabels::Void;
        self
    }

    /// The only classes that points may have, by name or number. Default: all that the table keeps.
    pub fn keep_classes<S: Into<String>>(mut self, names: impl IntoIterator<Item = S>) -> Self {
        self.rules.classes = names.into_iter().map(Into::into).collect();
        self
    }

    /// Classes that no point may have, by name or number; they are not even estimated.
    pub fn exclude_classes<S: Into<String>>(mut self, names: impl IntoIterator<Item = S>) -> Self {
        self.rules.exclude = names.into_iter().map(Into::into).collect();
        self
    }

    /// How labels restrict which pixels become one point. Default: [`Consistency::Support`].
    pub fn consistency(mut self, consistency: Consistency) -> Self {
        self.rules.consistency = consistency;
        self
    }

    /// Stops when a photograph cannot be used, instead of going on without it.
    pub fn strict(mut self) -> Self {
        self.strict = true;
        self
    }

    /// Threads; 0: all that the machine has. Results do not depend on it. Default: 0.
    pub fn threads(mut self, threads: usize) -> Self {
        self.max_threads = threads;
        self
    }

    /// Most memory that may be used, bytes. Default: 70 % of what the machine has.
    pub fn max_memory(mut self, bytes: u64) -> Self {
        self.max_memory = Some(bytes);
        self
    }

    /// Calls `observer` after every step, from any thread; when it answers `false` the run stops with
    /// [`Error::Interrupted`] as soon as what is in hand is complete.
    pub fn observe(mut self, observer: impl Fn(Step<'_>) -> bool + Send + Sync + 'static) -> Self {
        self.observer = Some(Arc::new(observer));
        self
    }

    /// Does it.
    ///
    /// # Errors
    /// Anything that keeps a result from being right; then files of earlier runs are as they were.
    pub fn run(&self) -> Result<Summary> {
        let job = self.job()?;
        let listener = Arc::new(Ears { observer: self.observer.clone(), ..Ears::default() });
        let mut report = pipeline::densify(&job, CpuLevel::detect(), &Progress::new(listener.clone()))?;
        report.program = "semvs::Densify".to_owned();
        report.version = crate::report::VERSION.to_owned();
        report.warnings = listener.warnings();
        Ok(Summary { report })
    }

    fn job(&self) -> Result<DensifyJob> {
        let Some(cloud) = &self.output else {
            return Err(Error::invalid("no place for the cloud: give Densify::output"));
        };
        if CloudFormat::named(cloud).is_none() {
            return Err(Error::content(cloud, "clouds are written as .ply, .las or .laz; end the name so"));
        }
        let labels = self.labels();
        let compared = labels.as_ref().is_some_and(|labels| labels.rules.consistency != Consistency::Off);
        let fewest = if compared { 2 } else { FusionOptions::default().number_views_fuse };
        Ok(DensifyJob {
            input: self.input(labels),
            resolution: self.resolution,
            depth_maps: self.depth_maps.clone(),
            force: false,
            pictures: false,
            stereo: StereoOptions::of(self.quality),
            filter: FilterJob::unbiased(),
            depth_maps_only: false,
            remove_depth_maps: false,
            fusion: FusionOptions {
                number_views_fuse: self.min_views.unwrap_or(fewest),
                ..FusionOptions::supporting()
            },
            outputs: Outputs { scene: Some(cloud.with_extension("mvs")), ..Outputs::of(cloud.clone()) },
        })
    }

    fn labels(&self) -> Option<LabelJob> {
        let asked = self.labels.label_path.is_some() || self.labels.class_table.is_some();
        asked.then(|| LabelJob { sources: self.labels.clone(), rules: self.rules.clone() })
    }

    fn input(&self, labels: Option<LabelJob>) -> SceneJob {
        let tower = TowerJob {
            work: TowerWork::NeighborsAndAppend,
            unchecked: false,
            any_direction: false,
            cloud: self.depth_maps.join("tower.ply"),
        };
        SceneJob {
            scene: self.scene.clone(),
            working_folder: self.depth_maps.clone(),
            pointcloud_file: None,
            view_neighbors_file: None,
            neighbors: NeighborOptions { number_views: self.number_views, ..NeighborOptions::default() },
            roi: RoiJob { estimate: RoiEstimation::ObjectScan, border: 0.0, crop: true },
            tower: Some(tower),
            masks: None,
            labels,
            strict: self.strict,
            like_openmvs: false,
            max_threads: self.max_threads,
            max_memory: self.max_memory,
        }
    }
}

impl std::fmt::Debug for Densify {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Densify")
            .field("scene", &self.scene)
            .field("output", &self.output)
            .finish_non_exhaustive()
    }
}

impl Summary {
    /// Points in the cloud.
    pub fn points(&self) -> u64 {
        self.report.points
    }

    /// The files that were written, the cloud first.
    pub fn files(&self) -> impl Iterator<Item = &Path> {
        self.report.outputs.iter().map(|output| Path::new(&output.path))
    }

    /// What was wrong and did not stop the run, one line each.
    pub fn warnings(&self) -> &[String] {
        &self.report.warnings
    }

    /// Everything that was counted and timed, as `--report` of the program writes it.
    pub fn to_json(&self) -> String {
        self.report.to_json().unwrap_or_default()
    }
}

/// Hears what a run says.
#[derive(Default)]
struct Ears {
    observer: Option<Arc<Observer>>,
    warnings: Mutex<Vec<String>>,
    stop: std::sync::atomic::AtomicBool,
}

impl Ears {
    /// The warnings, sorted: threads give them in any order.
    fn warnings(&self) -> Vec<String> {
        let mut warnings = self.warnings.lock().unwrap_or_else(PoisonError::into_inner).clone();
        warnings.sort();
        warnings.dedup();
        warnings
    }
}

impl Listener for Ears {
    fn event(&self, event: &Event) {
        if let Event::Warning(text) = event {
            self.warnings.lock().unwrap_or_else(PoisonError::into_inner).push(text.clone());
        }
    }

    fn steps(&self, stage: Stage, done: usize, total: usize) {
        if let Some(observer) = &self.observer
            && !observer(Step { stage: &stage.to_string(), done, total })
        {
            self.stop.store(true, std::sync::atomic::Ordering::SeqCst);
        }
    }

    fn wants_stop(&self) -> bool {
        self.stop.load(std::sync::atomic::Ordering::SeqCst)
    }
}
