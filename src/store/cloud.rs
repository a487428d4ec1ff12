//! Dense clouds as files: the cloud, its parts by class, and the cloud in the colours of its classes.

use super::atomic::{AtomicFile, check_writable};
pub use super::cloud_names::CloudFormat;
use super::cloud_names::{class_paths, label_colors_path, legend_path};
use super::cloud_output::{Columns, Output};
use super::las_cloud::{LasColumns, check_codes};
use super::legend::write_legend;
use super::ply_cloud::ply_layout;
use super::stale_clouds::stale_clouds;
use super::survey::{Survey, survey};
use crate::error::{Error, Result};
use crate::geometry::Placement;
use crate::progress::Progress;
use crate::scene::{CloudLayout, PointSource};
use crate::semantics::{ClassId, ClassPolicy, ClassTable};
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
    /// 64-bit coordinates in PLY files. Default: false.
    pub doubles: bool,
    /// No normals in LAS and LAZ files, where they are extra bytes. Default: false.
    pub las_without_normals: bool,
    /// Where the points go. Default: they stay.
    pub placement: Placement,
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
    /// The picture that says what the class colours mean; `None` without labels.
    pub legend: Option<PathBuf>,
}

/// Files that are written in one pass over the points.
const FILES_PER_PASS: usize = 16;

/// Checks before long work that the files can be written: the cloud at `path`, and what `options` ask for besides.
/// `policy` tells for which classes there can be a file.
///
/// # Errors
/// A place that cannot be written; options about labels without a class table; a class without a LAS code.
pub fn check_cloud_paths(
    path: &Path,
    options: &CloudOptions<'_>,
    policy: Option<&ClassPolicy>,
) -> Result<()> {
    check_writable(path)?;
    let is_kept = |id: &ClassId| policy.is_none_or(|policy| policy.is_kept(*id));
    if let Some(table) = options.table {
        check_writable(&legend_path(path))?;
        if CloudFormat::of(path) != CloudFormat::Ply {
            check_codes(table, is_kept)?;
        }
    }
    if options.color_by_label {
        options.needed_table()?;
        check_writable(&label_colors_path(path))?;
    }
    if options.split_by_class {
        let table = options.needed_table()?;
        let ids: Vec<ClassId> =
            std::iter::once(ClassId::VOID).chain(table.classes().iter().map(|c| c.id)).collect();
        let kept: Vec<ClassId> = ids.into_iter().filter(is_kept).collect();
        class_paths(path, table, &kept).iter().try_for_each(|path| check_writable(path))?;
    }
    Ok(())
}

/// Writes `source` to `path` and, as `options` ask, its parts by class and a copy in class colours beside it. The
/// parts together hold exactly the points of the whole, in its order; a class without points has no file. Labelled points
/// get a legend of their classes.
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
    let survey = survey(source, has.labels, CloudFormat::of(path) != CloudFormat::Ply, &options.placement)?;
    let jobs = jobs(source, path, options, &survey)?;
    let mut files = Vec::new();
    for pass in jobs.chunks(FILES_PER_PASS) {
        write_pass(source, pass, options)?;
        files.extend(pass.iter().map(|job| job.file.clone()));
    }
    let legend = options.table.filter(|_| has.labels).map(|table| {
        let legend = legend_path(path);
        write_legend(&legend, table, &survey.classes).map(|()| legend)
    });
    warn_of_stale(path, &files, progress);
    Ok(WrittenClouds { files, classes: survey.classes, legend: legend.transpose()? })
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

/// A file to write.
pub(super) struct Job {
    pub(super) file: WrittenCloud,
    pub(super) columns: Columns,
}

/// The files to write, the whole cloud first.
fn jobs(
    source: &dyn PointSource,
    path: &Path,
    options: &CloudOptions<'_>,
    survey: &Survey,
) -> Result<Vec<Job>> {
    let format = CloudFormat::of(path);
    let job = |path: PathBuf, points: u64, class: Option<ClassId>, label_colors: bool| {
        let columns = match format {
            CloudFormat::Ply => {
                Columns::Ply(ply_layout(source.layout(), options, label_colors, &survey.classes)?)
            }
            _ => {
                let colors = source.layout().colors || label_colors;
                let has = CloudLayout { colors, ..source.layout() };
                Columns::Las(LasColumns::new(&path, has, options, class, survey)?)
            }
        };
        Ok(Job { file: WrittenCloud { path, points, class, label_colors }, columns })
    };
    let mut jobs = vec![job(path.to_owned(), source.len(), None, false)?];
    if options.color_by_label {
        jobs.push(job(label_colors_path(path), source.len(), None, true)?);
    }
    if options.split_by_class {
        let classes = &survey.classes;
        let ids: Vec<ClassId> = classes.keys().copied().collect();
        for (path, (&id, class)) in class_paths(path, options.needed_table()?, &ids).into_iter().zip(classes)
        {
            jobs.push(job(path, class.points, Some(id), false)?);
        }
    }
    Ok(jobs)
}

/// Writes some files in one pass over the points; they take their names when all are complete.
fn write_pass(source: &dyn PointSource, jobs: &[Job], options: &CloudOptions<'_>) -> Result<()> {
    let mut outputs = jobs.iter().map(|job| Output::create(job, options)).collect::<Result<Vec<_>>>()?;
    source.for_each(&mut |point| outputs.iter_mut().try_for_each(|output| output.take(point)))?;
    let complete = outputs.into_iter().map(Output::finish).collect::<Result<Vec<_>>>()?;
    complete.into_iter().try_for_each(AtomicFile::commit)
}

#[cfg(test)]
#[path = "cloud_tests.rs"]
mod tests;
