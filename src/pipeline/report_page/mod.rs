//! The page of a run: pictures of its depth maps, its cloud, what it counted and timed.

mod class_check;
mod cloud;
mod views;

use super::fuse::open_maps;
use super::job::DepthMapsJob;
use super::labels_check::requests_of;
use super::record::with_threads;
use crate::error::{Error, Result};
use crate::progress::Progress;
use crate::report::{
    BARS, ClassRow, PageView, ReportPage, RunReport, add_to, build, fill_shares, with_commit,
};
use crate::semantics::ClassTable;
use crate::store::atomic::{check_writable, write_file};
use crate::store::cloud::CloudFormat;
use crate::store::import::{LoadedScene, load_scene};
use crate::store::labels::{LabelSources, LabelStore, MissingLabels, UnknownLabel};
use crate::store::run_folder::{RunFolder, short_text};
use cloud::ViewerCloud;
use semvs_formats::Limits;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use views::ViewLooks;

/// `report`, and `--report-html` of runs.
#[derive(Clone, Debug)]
pub struct ReportPageJob {
    /// The page to write.
    pub output: PathBuf,
    /// The scene.
    pub scene: PathBuf,
    /// First place of images named by the scene.
    pub working_folder: PathBuf,
    /// The cloud, if there is one.
    pub cloud: Option<PathBuf>,
    /// The depth maps, if there are some.
    pub depth_maps: Option<DepthMapsJob>,
    /// Label maps, if they are to be shown.
    pub labels: Option<LabelSources>,
    /// What the run said of itself, if it is known.
    pub run: Option<RunReport>,
    /// Most points of the viewer.
    pub points: usize,
    /// Threads; 0 = all of the machine.
    pub max_threads: usize,
}

/// Most points of the viewer unless more are asked for.
pub const DEFAULT_POINTS: usize = 500_000;
/// Most points of the viewer that can be asked for.
pub const MOST_POINTS: usize = 2_000_000;

/// A page that was written.
#[derive(Clone, Debug, PartialEq)]
pub struct WrittenPage {
    /// The file.
    pub path: PathBuf,
    /// Its size.
    pub bytes: usize,
    /// Points in it.
    pub points: usize,
    /// Views in it.
    pub views: usize,
}

impl ReportPageJob {
    /// What a run has left in `folder`; `scene`, `cloud` and `depth_maps` where they are not to be looked for.
    ///
    /// # Errors
    /// As [`RunFolder::look`].
    pub fn of_folder(
        folder: &Path,
        scene: Option<&Path>,
        cloud: Option<&Path>,
        depth_maps: Option<&Path>,
    ) -> Result<Self> {
        let found = RunFolder::look(folder, scene, cloud, depth_maps.is_some())?;
        let run = summary_of(&found.summaries, found.cloud.as_deref(), &found.scene)?;
        let own_maps = found.depth_maps.then(|| folder.to_owned());
        let depth_maps = depth_maps.map(Path::to_owned).or(own_maps);
        Ok(ReportPageJob {
            output: folder.join("report.html"),
            working_folder: PathBuf::new(),
            scene: found.scene,
            cloud: found.cloud,
            depth_maps: depth_maps.map(DepthMapsJob::Folder),
            labels: run.as_ref().and_then(label_sources),
            run,
            points: DEFAULT_POINTS,
            max_threads: 0,
        })
    }
}

/// Largest summary of a run.
const MOST_SUMMARY: u64 = 64 << 20;

/// The summary of the run that wrote `cloud`, or else `scene`.
fn summary_of(files: &[PathBuf], cloud: Option<&Path>, scene: &Path) -> Result<Option<RunReport>> {
    let wanted = cloud.unwrap_or(scene).file_name();
    for path in files {
        let Some(text) = short_text(path, MOST_SUMMARY)? else { continue };
        let Ok(run) = serde_json::from_str::<RunReport>(&text) else { continue };
        let wrote = |path: &str| Path::new(path).file_name() == wanted;
        if !run.program.is_empty() && run.outputs.iter().any(|output| wrote(&output.path)) {
            return Ok(Some(run));
        }
    }
    Ok(None)
}

/// The label maps of a run, if they are still where they were.
fn label_sources(run: &RunReport) -> Option<LabelSources> {
    let text = |name: &str| run.options.get(name).and_then(|value| value.as_str()).map(str::to_owned);
    let (label_path, class_table) = (text("label-path").map(PathBuf::from), text("class-table"));
    let is_there = label_path.as_ref().is_none_or(|folder| folder.is_dir());
    let any = label_path.is_some() || class_table.is_some();
    (any && is_there).then(|| LabelSources { label_path, class_table, ..LabelSources::default() })
}

/// Writes the page.
///
/// # Errors
/// The scene, the cloud or a place cannot be read or written. What else cannot be shown is warned of and left out.
pub fn report_page(job: &ReportPageJob, progress: &Progress) -> Result<WrittenPage> {
    with_threads(job.max_threads, || run(job, progress))
}

fn run(job: &ReportPageJob, progress: &Progress) -> Result<WrittenPage> {
    if !(1..=MOST_POINTS).contains(&job.points) {
        let what = format!("--points {}: give 1 to {MOST_POINTS}", job.points);
        return Err(Error::invalid(what));
    }
    check_writable(&job.output)?;
    let loaded = load_scene(&job.scene, &job.working_folder, &Limits::default(), progress)?;
    let mut warnings = job.run.as_ref().map(|run| run.warnings.clone()).unwrap_or_default();
    let mut say = |what: String| {
        progress.warn(what.as_str());
        warnings.push(what);
    };
    let maps = match job.depth_maps.as_ref().map(|maps| open_maps(maps, &loaded)).transpose() {
        Ok(maps) => maps,
        Err(error) => {
            say(format!("{error}; no depth maps are shown"));
            None
        }
    };
    let labels = open_labels(job, &loaded).unwrap_or_else(|error| {
        say(format!("{error}; no label maps are shown"));
        None
    });
    let run = job.run.clone().unwrap_or_default();
    let table = labels.as_ref().map(|labels| labels.table().clone());
    let mut cloud = match job.cloud.as_deref() {
        Some(path) if CloudFormat::of(path) != CloudFormat::Ply => {
            say(format!("{}: the 3D view takes PLY clouds only", path.display()));
            None
        }
        Some(path) => Some(ViewerCloud::read(path, job.points, table.as_ref(), &run.classes)?),
        None => None,
    };
    let looks = ViewLooks { loaded: &loaded, maps: maps.as_ref(), labels: labels.as_ref(), run: &run };
    let seen = looks.all(cloud.as_mut(), &mut say, progress)?;
    let corner = cloud.as_ref().map_or_else(|| first_center(&loaded), ViewerCloud::corner);
    let shown = cloud.map(|cloud| cloud.finished());
    let (cloud, points, classes) = match shown {
        Some((cloud, points, classes)) => (Some(cloud), points, classes),
        None => (None, Vec::new(), BTreeMap::new()),
    };
    let mut page = ReportPage {
        title: title(job),
        points: if run.points > 0 { run.points } else { classes.values().sum() },
        classes: classes_of(&run, table.as_ref(), &classes),
        warnings,
        edges: views::edges(&loaded),
        coverage_histogram: coverage(&seen.views),
        confidence_histogram: seen.confidence,
        views: seen.views,
        cloud,
        scene: if run.scene.is_empty() { job.scene.display().to_string() } else { run.scene },
        program: run.program,
        version: match run.version.is_empty() {
            true => build(),
            false => with_commit(&run.version, run.commit.as_deref()),
        },
        cpu_level: run.cpu_level,
        seconds: run.seconds,
        cpu_seconds: run.cpu_seconds,
        peak_memory: run.peak_memory_bytes,
        options: run.options,
        stages: run.stages,
        outputs: run.outputs.into_iter().filter(|output| output.content != super::DEPTH_MAP).collect(),
        ..ReportPage::default()
    };
    views::place_cameras(&mut page.views, &loaded, corner, page.cloud.as_ref());
    let text = page.render(&points).map_err(|e| Error::content(&job.output, format!("no JSON: {e}")))?;
    write_file(&job.output, text.as_bytes())?;
    Ok(WrittenPage {
        path: job.output.clone(),
        bytes: text.len(),
        points: page.cloud.map_or(0, |cloud| cloud.count),
        views: page.views.len(),
    })
}

/// The label maps that can be used; `None` without any.
fn open_labels(job: &ReportPageJob, loaded: &LoadedScene) -> Result<Option<LabelStore>> {
    let Some(sources) = &job.labels else { return Ok(None) };
    let sources =
        LabelSources { missing: MissingLabels::Void, unknown: UnknownLabel::Void, ..sources.clone() };
    LabelStore::open(&sources, &requests_of(loaded), Limits::default(), &Progress::silent()).map(Some)
}

fn first_center(loaded: &LoadedScene) -> [f64; 3] {
    let mut centers = loaded.scene.views.iter().filter_map(|view| view.calibration.as_ref());
    centers.next().map_or([0.0; 3], |calibration| calibration.center.into())
}

/// The headline: the name of the cloud, else of the scene.
fn title(job: &ReportPageJob) -> String {
    let path = job.cloud.as_ref().unwrap_or(&job.scene);
    path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

/// The classes that occur: as the run counted them, else by the points of the cloud.
fn classes_of(run: &RunReport, table: Option<&ClassTable>, points: &BTreeMap<u16, u64>) -> Vec<ClassRow> {
    if !run.classes.is_empty() {
        let rows = run.classes.iter().filter(|row| row.points + row.pixels > 0);
        return rows.cloned().collect();
    }
    let named = table.filter(|_| points.keys().any(|&id| id != 0));
    let Some(table) = named else { return Vec::new() };
    let class = |(&id, &points): (&u16, &u64)| {
        let id = crate::semantics::ClassId(id);
        let (name, color) = (table.class_name(id).into_owned(), table.color(id));
        ClassRow { id: id.0, name, color, points, kept: true, ..ClassRow::default() }
    };
    let mut rows: Vec<ClassRow> = points.iter().map(class).collect();
    fill_shares(&mut rows);
    rows
}

fn coverage(views: &[PageView]) -> [u64; BARS] {
    let mut bars = [0; BARS];
    views.iter().filter(|view| view.width > 0).for_each(|view| add_to(&mut bars, view.coverage));
    bars
}
