//! What is wrong with the label maps of a scene, and which of them are at odds with the others.

use super::prepare::neighbors_of;
use super::record::with_threads;
use crate::error::{Error, Result};
use crate::geometry::Camera;
use crate::progress::Progress;
use crate::report::{CheckedView, ClassName, LabelCheck};
use crate::scene::{DepthEstimate, Grid, LabelMap, ViewIndex};
use crate::semantics::{ClassId, ConsensusOptions, Witness, border_distance, label_consensus};
use crate::store::byte_cache::ByteCache;
use crate::store::cameras::cameras_at_image_size;
use crate::store::depth_store::DepthStore;
use crate::store::images::image_size;
use crate::store::import::{LoadedScene, load_scene};
use crate::store::labels::{
    LabelFinding, LabelRequest, LabelSources, LabelStore, MissingLabels, UnknownLabel, survey_labels,
};
use rayon::prelude::*;
use semvs_formats::Limits;
use std::path::PathBuf;
use std::sync::Arc;

/// `labels check`.
#[derive(Clone, Debug)]
pub struct CheckLabelsJob {
    /// The scene.
    pub scene: PathBuf,
    /// First place of images named by the scene.
    pub working_folder: PathBuf,
    /// Where label maps and classes come from.
    pub sources: LabelSources,
    /// Folder of depth maps; `None`: the working folder, if it has any.
    pub depth_maps: Option<PathBuf>,
    /// Threads; 0 = all of the machine.
    pub max_threads: usize,
}

/// Runs `job`.
///
/// # Errors
/// The scene, the class table or the folder of label maps cannot be used. Faulty label maps are findings, no errors.
pub fn check_labels(job: &CheckLabelsJob, progress: &Progress) -> Result<LabelCheck> {
    with_threads(job.max_threads, || run(job, progress))
}

fn run(job: &CheckLabelsJob, progress: &Progress) -> Result<LabelCheck> {
    if let Some(folder) = job.depth_maps.as_ref().filter(|folder| !folder.is_dir()) {
        return Err(Error::content(folder, "no such folder of depth maps (--depth-maps)"));
    }
    let loaded = load_scene(&job.scene, &job.working_folder, &Limits::default(), progress)?;
    let requests = requests_of(&loaded);
    let (table, findings) = survey_labels(&job.sources, &requests, Limits::default())?;
    let mut views: Vec<CheckedView> =
        findings.iter().map(|found| checked_view(job, &loaded, found)).collect();
    let faults = views.iter().filter(|view| view.fault.is_some()).count();
    let usable: Vec<LabelRequest> = requests
        .into_iter()
        .zip(&views)
        .filter(|(_, v)| v.fault.is_none() && v.file.is_some())
        .map(|r| r.0)
        .collect();
    let compared_by = compare(job, &loaded, &usable, &findings, &mut views, progress)?;
    let void = ClassName { id: 0, name: table.class_name(ClassId::VOID).into_owned() };
    let classes = table.classes().iter().map(|class| ClassName { id: class.id.0, name: class.name.clone() });
    let classes = std::iter::once(void).chain(classes).collect();
    Ok(LabelCheck { table: table.name().to_owned(), classes, compared_by, views, faults })
}

/// What is asked of the label maps of the views that have a pose.
pub(super) fn requests_of(loaded: &LoadedScene) -> Vec<LabelRequest> {
    let views = loaded.scene.views.iter().enumerate().filter(|(_, view)| view.calibration.is_some());
    views
        .map(|(i, view)| {
            let view_index = ViewIndex(i as u32);
            let image = loaded.image_path(view_index);
            let mask = view.mask.as_deref().map(|name| loaded.search.find(name));
            let size = image_size(&image).ok();
            LabelRequest { view: view_index, image, mask, size }
        })
        .collect()
}

fn checked_view(job: &CheckLabelsJob, loaded: &LoadedScene, found: &LabelFinding) -> CheckedView {
    let mut view = CheckedView {
        image: loaded.scene.views[found.view.index()].name.clone(),
        file: found.file.as_ref().map(|path| path.display().to_string()),
        ..CheckedView::default()
    };
    match &found.counts {
        Err(error) => view.fault = Some(error.to_string()),
        Ok(_) if found.file.is_none() => {
            view.fault = (job.sources.missing == MissingLabels::Refuse).then(|| "no label map".to_owned());
        }
        Ok(counts) => {
            let all = counts.values().sum::<u64>().max(1) as f64;
            view.shares = counts.iter().map(|(id, &count)| (id.0, count as f64 / all)).collect();
        }
    }
    view
}

/// Enters what every view of `usable` says against the others, and returns what they are compared by.
fn compare(
    job: &CheckLabelsJob,
    loaded: &LoadedScene,
    usable: &[LabelRequest],
    findings: &[LabelFinding],
    views: &mut [CheckedView],
    progress: &Progress,
) -> Result<&'static str> {
    if usable.is_empty() {
        return Ok("nothing");
    }
    let sources =
        LabelSources { missing: MissingLabels::Void, unknown: UnknownLabel::Void, ..job.sources.clone() };
    let labels = LabelStore::open(&sources, usable, Limits::default(), &Progress::silent())?;
    let folder = job.depth_maps.clone().unwrap_or_else(|| job.working_folder.clone());
    let store = DepthStore::new(&folder, loaded.search.clone(), 0, Limits::default());
    let id = |view: ViewIndex| loaded.scene.views[view.index()].id;
    let mapped: Vec<ViewIndex> = usable
        .iter()
        .map(|request| request.view)
        .filter(|&view| matches!(store.header(id(view)), Ok(Some(_))))
        .collect();
    let (by, outcomes) = if mapped.len() >= 2 {
        let against = Against { loaded, labels: &labels, store: &store, surfaces: ByteCache::new(MEMORY) };
        ("depth maps", against.disagreements(&mapped, progress)?)
    } else if job.depth_maps.is_some() {
        return Err(Error::content(&folder, "fewer than two depth maps of labelled images are here"));
    } else if loaded.scene.tracks.is_empty() {
        return Ok("nothing");
    } else {
        ("sparse points", by_sparse_points(loaded, &labels, usable, progress)?)
    };
    for (view, Outcome { compared, other }) in outcomes {
        let row = findings.iter().position(|found| found.view == view);
        if let Some(row) = row.and_then(|row| views.get_mut(row)) {
            row.compared = compared;
            row.disagreement = (compared > 0).then(|| other as f64 / compared as f64);
        }
    }
    Ok(by)
}

/// Pixels or points that a view and others label, and those to which the others give another class.
#[derive(Clone, Copy, Debug, Default)]
struct Outcome {
    compared: u64,
    other: u64,
}

/// Bytes of maps that are kept for the next view.
const MEMORY: usize = 256 << 20;
/// Bytes per pixel of what is kept.
const BYTES_PER_PIXEL: usize = 23;

/// What views are held against by their depth maps.
struct Against<'a> {
    loaded: &'a LoadedScene,
    labels: &'a LabelStore,
    store: &'a DepthStore,
    surfaces: ByteCache<ViewIndex, Surface>,
}

struct Surface {
    estimate: Arc<DepthEstimate>,
    labels: Arc<LabelMap>,
    border_distance: Grid<u8>,
}

impl Surface {
    fn witness(&self) -> Witness<'_> {
        let (camera, depth) = (&self.estimate.camera, &self.estimate.depth);
        Witness { camera, depth, labels: &self.labels, border_distance: &self.border_distance }
    }
}

impl Against<'_> {
    fn disagreements(&self, views: &[ViewIndex], progress: &Progress) -> Result<Vec<(ViewIndex, Outcome)>> {
        let mut cameras: Vec<Option<Camera>> = vec![None; self.loaded.scene.views.len()];
        for &view in views {
            cameras[view.index()] = Some(self.load(view)?.estimate.camera.clone());
        }
        let neighbors = neighbors_of(&self.loaded.scene, &cameras)?;
        let steps = progress.start(crate::progress::Stage::CheckLabels, views.len());
        let of = |&view: &ViewIndex| {
            let retained = neighbors[view.index()].retained.iter().map(|n| n.view);
            let others = retained.filter(|v| *v != view && cameras[v.index()].is_some());
            let others = others.map(|v| self.load(v)).collect::<Result<Vec<Arc<Surface>>>>()?;
            let outcome = at_odds(&*self.load(view)?, &others);
            steps.step();
            Ok((view, outcome))
        };
        views.iter().map(of).collect()
    }

    fn load(&self, view: ViewIndex) -> Result<Arc<Surface>> {
        self.surfaces.get_or_load(view, || {
            let estimate = self.store.read(self.loaded.scene.views[view.index()].id)?;
            let size = estimate.depth.size();
            let labels = self.labels.load(view, size)?;
            let border_distance = border_distance(&labels, ConsensusOptions::default().border);
            Ok((Surface { estimate, labels, border_distance }, size.area() * BYTES_PER_PIXEL))
        })
    }
}

/// The labels of `own` against the vote of the `others` alone.
fn at_odds(own: &Surface, others: &[Arc<Surface>]) -> Outcome {
    let silent = LabelMap::filled(own.labels.size(), ClassId::VOID.0);
    let reference = Witness { labels: &silent, ..own.witness() };
    let witnesses: Vec<Witness<'_>> = others.iter().map(|surface| surface.witness()).collect();
    let vote = label_consensus(&reference, &witnesses, &ConsensusOptions::default());
    let pairs =
        own.labels.data().iter().zip(vote.labels.data()).filter(|(own, vote)| **own != 0 && **vote != 0);
    pairs.fold(Outcome::default(), |sum, (own, vote)| Outcome {
        compared: sum.compared + 1,
        other: sum.other + u64::from(own != vote),
    })
}

/// The same by the classes of the pixels that see each sparse point.
fn by_sparse_points(
    loaded: &LoadedScene,
    labels: &LabelStore,
    usable: &[LabelRequest],
    progress: &Progress,
) -> Result<Vec<(ViewIndex, Outcome)>> {
    let cameras = cameras_at_image_size(loaded, false, progress)?;
    let tracks = &loaded.scene.tracks;
    let mut seen: Vec<Vec<(ViewIndex, u16)>> = vec![Vec::new(); tracks.len()];
    for request in usable {
        let Some(camera) = &cameras[request.view.index()] else { continue };
        let map = labels.load(request.view, camera.size())?;
        let found: Vec<(usize, u16)> = (0..tracks.len())
            .into_par_iter()
            .filter(|&i| tracks.visibility(i).contains(&request.view))
            .filter_map(|i| {
                let [x, y, z] = camera.project_f32(tracks.point(i));
                let (u, v) = (x / z + 0.5, y / z + 0.5);
                let inside = z > 0.0 && u >= 0.0 && v >= 0.0;
                let label = inside.then(|| map.get(u as usize, v as usize)).flatten();
                label.map(|&label| (i, label))
            })
            .filter(|(_, label)| *label != 0)
            .collect();
        found.into_iter().for_each(|(i, label)| seen[i].push((request.view, label)));
    }
    let mut outcomes: Vec<(ViewIndex, Outcome)> =
        usable.iter().map(|request| (request.view, Outcome::default())).collect();
    for labels in &seen {
        for (view, own) in labels {
            let others = |class: u16| labels.iter().filter(|(v, l)| v != view && *l == class).count();
            let same = others(*own);
            let other = labels.iter().map(|(_, l)| *l).filter(|l| l != own).map(others).max().unwrap_or(0);
            if same == other {
                continue;
            }
            if let Some((_, outcome)) = outcomes.iter_mut().find(|(v, _)| v == view) {
                outcome.compared += 1;
                outcome.other += u64::from(other > same);
            }
        }
    }
    Ok(outcomes)
}
