//! Label maps of all views from a labelled cloud.

use super::record::with_threads;
use crate::error::{Error, Result};
use crate::progress::{Progress, Stage};
use crate::scene::{ResolutionOptions, ViewIndex};
use crate::semantics::{ClassId, ClassTable, LabelledSurface, point_radii, render_labels};
use crate::store::atomic::create_folder;
use crate::store::cameras::working_cameras;
use crate::store::import::load_scene;
use crate::store::label_write::{LabelEncoding, has_colors, write_label_map};
use crate::store::labels::{LabelSources, MissingLabels, UnknownLabel};
use crate::store::paths::is_same_file;
use crate::store::ply_source::PlySource;
use rayon::prelude::*;
use semvs_formats::{Limits, ply};
use std::collections::{BTreeMap, HashMap};
use std::fs::File;
use std::path::PathBuf;

/// `labels render`.
#[derive(Clone, Debug)]
pub struct RenderLabelsJob {
    /// The scene.
    pub scene: PathBuf,
    /// First place of images named by the scene.
    pub working_folder: PathBuf,
    /// The labelled cloud (.ply).
    pub cloud: PathBuf,
    /// Class table; `None`: the classes that the cloud names, else plain ids.
    pub class_table: Option<String>,
    /// Write ids even if all classes have colours.
    pub ids: bool,
    /// Folder to write.
    pub output: PathBuf,
    /// Threads; 0 = all of the machine.
    pub max_threads: usize,
}

/// A label map that was written.
#[derive(Clone, Debug, PartialEq)]
pub struct RenderedView {
    /// The file.
    pub path: PathBuf,
    /// Share of its pixels that have a class.
    pub labelled: f64,
}

/// Writes for every image of the scene `OUTPUT/STEM.png`, at the size of the image.
///
/// # Errors
/// A cloud without labels; classes that the table lacks; two images of one name; a label map that would replace a
/// photograph; what cannot be read or written.
pub fn render_label_maps(job: &RenderLabelsJob, progress: &Progress) -> Result<Vec<RenderedView>> {
    with_threads(job.max_threads, || run(job, progress))
}

fn run(job: &RenderLabelsJob, progress: &Progress) -> Result<Vec<RenderedView>> {
    let loaded = load_scene(&job.scene, &job.working_folder, &Limits::default(), progress)?;
    let full = ResolutionOptions { level: 0, max: u32::MAX, ..ResolutionOptions::default() };
    let cameras = working_cameras(&loaded, &full, false, progress)?;
    let mut targets = Vec::new();
    let mut taken: HashMap<PathBuf, PathBuf> = HashMap::new();
    for (i, camera) in cameras.iter().enumerate() {
        let Some(camera) = camera else { continue };
        let image = loaded.image_path(ViewIndex(i as u32));
        let stem = image.file_stem().unwrap_or_default().to_string_lossy();
        let path = job.output.join(format!("{stem}.png"));
        if path.exists() && is_same_file(&path, &image) {
            return Err(Error::content(
                &path,
                "this is a photograph of the scene; choose another folder (-o)",
            ));
        }
        if let Some(other) = taken.insert(path.clone(), image.clone()) {
            let what = format!("label map of both {} and {}", other.display(), image.display());
            return Err(Error::content(&path, format!("{what}: images need names of their own")));
        }
        targets.push((camera, path));
    }
    let (surface, table) = read_surface(job)?;
    let encoding = match !job.ids && has_colors(&table) {
        true => LabelEncoding::Colors,
        false => LabelEncoding::Ids,
    };
    create_folder(&job.output)?;
    let steps = progress.start(Stage::RenderLabels, targets.len());
    let render = |(camera, path): (&crate::geometry::Camera, PathBuf)| {
        let labels = render_labels(&surface, camera);
        write_label_map(&path, &labels, &table, encoding)?;
        steps.step();
        let labelled = labels.data().iter().filter(|id| **id != 0).count() as f64;
        Ok(RenderedView { path, labelled: labelled / labels.size().area().max(1) as f64 })
    };
    targets.into_par_iter().map(render).collect()
}

fn read_surface(job: &RenderLabelsJob) -> Result<(LabelledSurface, ClassTable)> {
    let path = &job.cloud;
    let file = File::open(path).map_err(|e| Error::io(path, "open", e))?;
    let cloud = ply::read_cloud(file, &Limits::default()).map_err(|e| Error::format(path, e))?;
    if cloud.is_empty() {
        return Err(Error::content(path, "the cloud has no points"));
    }
    if cloud.labels.is_empty() {
        let what = "the points have no labels; give a cloud that was made with --label-path";
        return Err(Error::content(path, what));
    }
    let table = match &job.class_table {
        Some(_) => {
            let class_table = job.class_table.clone();
            let (unknown, missing) = (UnknownLabel::default(), MissingLabels::default());
            LabelSources { label_path: None, class_table, unknown, missing }.table(Limits::default())?
        }
        None => PlySource::open(path, Limits::default())?.listed_classes()?.unwrap_or_else(ClassTable::ids),
    };
    let mut met: BTreeMap<u16, usize> = BTreeMap::new();
    cloud.labels.iter().for_each(|id| *met.entry(*id).or_default() += 1);
    let table = table.with_ids(met.keys().map(|&id| ClassId(id)));
    if let Some((id, count)) = met.iter().find(|(id, _)| **id != 0 && !table.contains(ClassId(**id))) {
        let what = format!("class {id}, of {count} points, is not in class table {}", table.name());
        return Err(Error::content(path, what));
    }
    let positions: Vec<[f64; 3]> = match cloud.positions_f64.is_empty() {
        true => cloud.positions.iter().map(|p| p.map(f64::from)).collect(),
        false => cloud.positions_f64,
    };
    let keep: Vec<usize> =
        (0..positions.len()).filter(|&i| positions[i].iter().all(|v| v.is_finite())).collect();
    let positions: Vec<[f64; 3]> = keep.iter().map(|&i| positions[i]).collect();
    let normals = match cloud.normals.is_empty() {
        true => Vec::new(),
        false => keep.iter().map(|&i| cloud.normals[i]).collect(),
    };
    let labels = keep.iter().map(|&i| cloud.labels[i]).collect();
    let radii = point_radii(&positions);
    Ok((LabelledSurface { positions, normals, labels, radii }, table))
}
