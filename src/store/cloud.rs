//! Dense clouds as PLY files: the cloud, its parts by class, and the cloud in the colours of its classes.

use super::atomic::{AtomicFile, check_writable};
use super::cloud_names::{class_paths, label_colors_path};
use super::stale_clouds::stale_clouds;
use crate::error::{Error, Result};
use crate::progress::Progress;
use crate::scene::{CloudLayout, CloudPoint, PointSource};
use crate::semantics::{ClassId, ClassPolicy, ClassTable};
use semvs_formats::ply::{self, Cloud, PlyWriter};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Which columns a PLY cloud has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PlyLayout {
    /// Position, colour, normal, label: opens everywhere.
    #[default]
    Plain,
    /// The same and lists of views and weights, as OpenMVS writes and needs them.
    OpenMvs,
    /// Position, colour, normal, label under OpenMVS's type names: what it writes beside a project archive.
    OpenMvsProject,
    /// The only layout that OpenDroneMap's point filter reads; labels are left out.
    Odm,
}

/// How a cloud is written, and what is written besides.
#[derive(Clone, Copy, Debug, Default)]
pub struct CloudOptions<'a> {
    /// Columns. Default: plain.
    pub layout: PlyLayout,
    /// The classes of the labels; needed where the points have labels.
    pub table: Option<&'a ClassTable>,
    /// One more cloud per class. Default: false.
    pub split_by_class: bool,
    /// One more cloud in the colours of the classes. Default: false.
    pub color_by_label: bool,
}

/// A cloud on disk.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WrittenCloud {
    /// The file.
    pub path: PathBuf,
    /// Points in it.
    pub points: u64,
    /// The only class in it; `None` = all.
    pub class: Option<ClassId>,
    /// Whether its colours are those of the classes.
    pub label_colors: bool,
}

/// The points of one class in a cloud.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ClassPoints {
    /// Points.
    pub points: u64,
    /// Sum of their label confidences, taken in the cloud's order.
    pub confidence_sum: f64,
}

/// What [`write_clouds`] wrote.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct WrittenClouds {
    /// The files, the whole cloud first; empty for an empty cloud.
    pub files: Vec<WrittenCloud>,
    /// Points by class; empty without labels.
    pub classes: BTreeMap<ClassId, ClassPoints>,
}

/// Files that are written in one pass over the points.
const FILES_PER_PASS: usize = 16;
/// Points that a file's columns hold before they are encoded.
const POINTS_PER_CHUNK: usize = 4096;

/// Checks before long work that the files can be written: the cloud at `path`, and what `options` ask for besides.
/// `policy` tells for which classes there can be a file.
///
/// # Errors
/// A place that cannot be written; options about labels without a class table.
pub fn check_cloud_paths(
    path: &Path,
    options: &CloudOptions<'_>,
    policy: Option<&ClassPolicy>,
) -> Result<()> {
    check_writable(path)?;
    if options.color_by_label {
        options.needed_table()?;
        check_writable(&label_colors_path(path))?;
    }
    if options.split_by_class {
        let table = options.needed_table()?;
        let is_kept = |id: &ClassId| policy.is_none_or(|policy| policy.is_kept(*id));
        let ids: Vec<ClassId> =
            std::iter::once(ClassId::VOID).chain(table.classes().iter().map(|c| c.id)).collect();
        let kept: Vec<ClassId> = ids.into_iter().filter(is_kept).collect();
        class_paths(path, table, &kept).iter().try_for_each(|path| check_writable(path))?;
    }
    Ok(())
}

/// Writes `source` to `path` and, as `options` ask, its parts by class and a copy in class colours beside it. The
/// parts together hold exactly the points of the whole, in its order; a class without points has no file.
///
/// An empty cloud is not written, which is warned of: what is at `path` stays.
///
/// # Errors
/// A file cannot be written (then none of its pass appears), the cloud cannot be read, labels without class table,
/// the `openmvs` layout for points without views.
pub fn write_clouds(
    source: &dyn PointSource,
    path: &Path,
    options: &CloudOptions<'_>,
    progress: &Progress,
) -> Result<WrittenClouds> {
    if source.is_empty() {
        let stale = if path.exists() { "; the file there is from before" } else { "" };
        progress.warn(format!("{}: not written, the cloud has no points{stale}", path.display()));
        return Ok(WrittenClouds::default());
    }
    let has = source.layout();
    if !has.labels && (options.split_by_class || options.color_by_label) {
        return Err(options.needs_labels());
    }
    let classes = if has.labels { count_classes(source)? } else { BTreeMap::new() };
    let jobs = jobs(source, path, options, &classes)?;
    let mut files = Vec::new();
    for pass in jobs.chunks(FILES_PER_PASS) {
        write_pass(source, pass, options.table)?;
        files.extend(pass.iter().map(|job| job.file.clone()));
    }
    warn_of_stale(path, &files, progress);
    Ok(WrittenClouds { files, classes })
}

/// Clouds by class of an earlier run stay, but do not belong to this one.
fn warn_of_stale(path: &Path, files: &[WrittenCloud], progress: &Progress) {
    let written: Vec<&Path> = files.iter().map(|file| file.path.as_path()).collect();
    let stale: Vec<String> =
        stale_clouds(path, &written).iter().map(|path| path.display().to_string()).collect();
    if !stale.is_empty() {
        progress.warn(format!("clouds of an earlier run, not of this one: {}", stale.join(", ")));
    }
}

impl<'a> CloudOptions<'a> {
    fn needed_table(&self) -> Result<&'a ClassTable> {
        self.table.ok_or_else(|| self.needs_labels())
    }

    fn needs_labels(&self) -> Error {
        let option = if self.split_by_class { "--split-by-class" } else { "--color-by-label" };
        Error::invalid(format!("{option} needs labels, which these points lack"))
    }
}

fn count_classes(source: &dyn PointSource) -> Result<BTreeMap<ClassId, ClassPoints>> {
    let mut classes: BTreeMap<ClassId, ClassPoints> = BTreeMap::new();
    source.for_each(&mut |point| {
        let class = classes.entry(ClassId(point.label)).or_default();
        class.points += 1;
        class.confidence_sum += f64::from(point.label_confidence);
        Ok(())
    })?;
    Ok(classes)
}

/// A file to write.
struct Job {
    file: WrittenCloud,
    layout: ply::Layout,
}

/// The files to write, the whole cloud first.
fn jobs(
    source: &dyn PointSource,
    path: &Path,
    options: &CloudOptions<'_>,
    classes: &BTreeMap<ClassId, ClassPoints>,
) -> Result<Vec<Job>> {
    let job = |path: PathBuf, points: u64, class: Option<ClassId>, label_colors: bool| {
        let layout = ply_layout(source.layout(), options, label_colors, classes)?;
        Ok(Job { file: WrittenCloud { path, points, class, label_colors }, layout })
    };
    let mut jobs = vec![job(path.to_owned(), source.len(), None, false)?];
    if options.color_by_label {
        jobs.push(job(label_colors_path(path), source.len(), None, true)?);
    }
    if options.split_by_class {
        let ids: Vec<ClassId> = classes.keys().copied().collect();
        for (path, (&id, class)) in class_paths(path, options.needed_table()?, &ids).into_iter().zip(classes)
        {
            jobs.push(job(path, class.points, Some(id), false)?);
        }
    }
    Ok(jobs)
}

/// The columns and comments of a file of points that have `has`.
fn ply_layout(
    has: CloudLayout,
    options: &CloudOptions<'_>,
    label_colors: bool,
    classes: &BTreeMap<ClassId, ClassPoints>,
) -> Result<ply::Layout> {
    let colors = has.colors || label_colors;
    let mut layout = match options.layout {
        PlyLayout::Plain => ply::Layout::plain(colors, has.normals),
        PlyLayout::OpenMvsProject => {
            let plain = ply::Layout::plain(colors, has.normals);
            ply::Layout { type_names: ply::TypeNames::Sized, ..plain }
        }
        PlyLayout::Odm if has.views && colors && has.normals => return Ok(ply::Layout::odm()),
        PlyLayout::Odm => {
            return Err(Error::invalid("--ply-layout odm needs colours, normals and views; use plain"));
        }
        PlyLayout::OpenMvs if has.views => ply::Layout::openmvs(colors, has.normals, has.weights),
        PlyLayout::OpenMvs => {
            return Err(Error::invalid("these points have no views for --ply-layout openmvs; use plain"));
        }
    };
    if has.confidence {
        layout.fields.push(ply::Field::Confidence);
    }
    if has.labels {
        let table = options.table.ok_or_else(|| Error::invalid("labelled points without a class table"))?;
        let listed = table.classes().iter().map(|class| class.id);
        let wide = listed.chain(classes.keys().copied()).any(|id| id.0 > u16::from(u8::MAX));
        layout = layout.with_label(wide, true).with_comments(table.classes().iter().map(|class| {
            let [r, g, b] = table.color(class.id);
            // One word per name, so that every comment has the same number of words.
            let name = class.name.split_whitespace().collect::<Vec<_>>().join("_");
            format!("class {} {name} {r} {g} {b}", class.id)
        }));
    }
    Ok(layout)
}

/// Writes some files in one pass over the points; they take their names when all are complete.
fn write_pass(source: &dyn PointSource, jobs: &[Job], table: Option<&ClassTable>) -> Result<()> {
    let mut outputs = jobs.iter().map(Output::create).collect::<Result<Vec<_>>>()?;
    source.for_each(&mut |point| {
        for output in &mut outputs {
            output.take(point, table)?;
        }
        Ok(())
    })?;
    let complete = outputs.into_iter().map(Output::finish).collect::<Result<Vec<_>>>()?;
    complete.into_iter().try_for_each(AtomicFile::commit)
}

/// A file being written.
struct Output<'a> {
    job: &'a Job,
    writer: PlyWriter<AtomicFile>,
    chunk: Cloud,
}

impl<'a> Output<'a> {
    fn create(job: &'a Job) -> Result<Self> {
        let file = AtomicFile::create(&job.file.path)?;
        let writer = PlyWriter::new(file, &job.layout, job.file.points)
            .map_err(|e| Error::writing(&job.file.path, e))?;
        Ok(Output { job, writer, chunk: Cloud::default() })
    }

    /// Appends a point if it belongs in this file.
    fn take(&mut self, point: &CloudPoint<'_>, table: Option<&ClassTable>) -> Result<()> {
        let file = &self.job.file;
        if file.class.is_some_and(|class| class.0 != point.label) {
            return Ok(());
        }
        let color = match table {
            Some(table) if file.label_colors => table.color(ClassId(point.label)),
            _ => point.color,
        };
        let chunk = &mut self.chunk;
        for field in &self.job.layout.fields {
            match field {
                ply::Field::Position | ply::Field::PositionF64 => chunk.positions.push(point.position),
                ply::Field::Color => chunk.colors.push(color),
                ply::Field::Normal => chunk.normals.push(point.normal),
                ply::Field::LabelU8 | ply::Field::LabelU16 => chunk.labels.push(point.label),
                ply::Field::LabelConfidence => chunk.label_confidence.push(point.label_confidence),
                ply::Field::Confidence => chunk.confidence.push(point.confidence),
                ply::Field::ViewIndices => {
                    let views = &mut chunk.views;
                    if views.offsets.is_empty() {
                        views.offsets.push(0);
                    }
                    views.images.extend(point.views.iter().map(|view| view.0));
                    views.offsets.push(views.images.len() as u64);
                }
                ply::Field::ViewWeights => chunk.views.weights.extend_from_slice(point.weights),
                ply::Field::ViewCount => chunk.view_counts.push(point.views.len() as u32),
                ply::Field::Value => chunk.value.push(0.0),
            }
        }
        if chunk.positions.len() >= POINTS_PER_CHUNK { self.flush() } else { Ok(()) }
    }

    fn flush(&mut self) -> Result<()> {
        self.writer.write(&self.chunk).map_err(|e| Error::writing(&self.job.file.path, e))?;
        self.chunk.clear();
        Ok(())
    }

    /// The complete file, not yet under its name.
    fn finish(mut self) -> Result<AtomicFile> {
        self.flush()?;
        self.writer.finish().map_err(|e| Error::writing(&self.job.file.path, e))
    }
}

#[cfg(test)]
#[path = "cloud_tests.rs"]
mod tests;
