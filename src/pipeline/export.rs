//! Scenes and depth maps as other programs read them.

use super::import::{folder_of, row, warn_of_losses};
use super::prepare::neighbors_of;
use crate::error::{Error, Result};
use crate::progress::Progress;
use crate::report::{OutputReport, RunReport};
use crate::scene::ViewIndex;
use crate::store::archive::{move_names, move_sizes, read_archive, same_place, write_archive};
use crate::store::atomic::AtomicFile;
use crate::store::cameras::cameras_at_image_size;
use crate::store::import::{LoadedScene, load_scene};
use crate::store::paths::SearchPath;
use semvs_formats::mvs::Container;
use semvs_formats::{Limits, neighbors_file, roi};
use std::path::{Path, PathBuf};

/// `export` of a scene as one file.
#[derive(Clone, Debug)]
pub struct ExportSceneJob {
    /// A `.mvs` file or a COLMAP workspace.
    pub scene: PathBuf,
    /// First place of images named by the scene.
    pub working_folder: PathBuf,
    /// The file to write.
    pub output: PathBuf,
    /// What to write.
    pub kind: SceneExport,
}

/// What is written of a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SceneExport {
    /// All of it, as an archive of this kind; `None`: of the kind that it came as.
    Archive(Option<Container>),
    /// Its region of interest as text.
    Roi,
    /// The neighbours of its images as text: those stored, else by the sparse points.
    Neighbors,
}

/// Runs `job`.
///
/// # Errors
/// Unreadable files; nothing to write; a place that cannot be written or is the input.
pub fn export_scene(job: &ExportSceneJob, progress: &Progress) -> Result<RunReport> {
    if same_place(&job.output, &job.scene) {
        return Err(Error::content(&job.output, "--output: this is the input; choose another name"));
    }
    let written = match job.kind {
        SceneExport::Archive(container) => archive(job, container, progress)?,
        SceneExport::Roi => region(job)?,
        SceneExport::Neighbors => neighbors(job, progress)?,
    };
    Ok(RunReport { outputs: vec![written], ..RunReport::default() })
}

fn archive(job: &ExportSceneJob, to: Option<Container>, progress: &Progress) -> Result<OutputReport> {
    let (mut scene, from) = read_archive(&job.scene, &Limits::default())?;
    let to = to.unwrap_or(from);
    let search = match job.scene.is_dir() {
        true => SearchPath { working_folder: job.scene.clone(), scene_folder: job.scene.clone() },
        false => SearchPath::new(&job.working_folder, &job.scene),
    };
    move_names(&mut scene, &search, folder_of(&job.output));
    warn_of_losses(&scene, to, &job.output, progress);
    if is_interface(to) != is_interface(from) {
        move_sizes(&mut scene, to);
    }
    write_archive(&job.output, &scene, to)?;
    Ok(row(&job.output, "scene", Some(scene.points.positions.len() as u64)))
}

fn is_interface(container: Container) -> bool {
    matches!(container, Container::Interface { .. })
}

fn region(job: &ExportSceneJob) -> Result<OutputReport> {
    let (scene, _) = read_archive(&job.scene, &Limits::default())?;
    let Some(obb) = scene.obb else {
        return Err(Error::content(&job.scene, "it has no region of interest"));
    };
    let mut file = AtomicFile::create(&job.output)?;
    roi::write(&mut file, &obb).map_err(|e| Error::format(&job.output, e))?;
    file.commit()?;
    Ok(row(&job.output, "region of interest", None))
}

fn neighbors(job: &ExportSceneJob, progress: &Progress) -> Result<OutputReport> {
    let loaded = load_scene(&job.scene, &job.working_folder, &Limits::default(), progress)?;
    let cameras = cameras_at_image_size(&loaded, false, progress)?;
    let found = neighbors_of(&loaded.scene, &cameras)?;
    let lists: Vec<Vec<u32>> = found.iter().map(|n| n.all.iter().map(|n| n.view.0).collect()).collect();
    let mut file = AtomicFile::create(&job.output)?;
    neighbors_file::write(&mut file, lists.iter().map(Vec::as_slice))
        .map_err(|e| Error::format(&job.output, e))?;
    file.commit()?;
    Ok(row(&job.output, "neighbours", None))
}

/// The image file of every view, made absolute.
pub(super) fn image_files(loaded: &LoadedScene) -> Vec<PathBuf> {
    let path = |i: usize| loaded.image_path(ViewIndex(i as u32));
    let absolute = |i: usize| std::path::absolute(path(i)).unwrap_or_else(|_| path(i));
    (0..loaded.scene.views.len()).map(absolute).collect()
}

/// The names of files relative to the deepest folder that holds them all, `/` between parts.
pub(super) fn names_below_common_folder(files: &[PathBuf]) -> Vec<String> {
    let mut common: Option<&Path> = None;
    for file in files {
        let folder = file.parent().unwrap_or(Path::new(""));
        common = Some(match common {
            None => folder,
            Some(known) => known.ancestors().find(|k| folder.starts_with(k)).unwrap_or(Path::new("")),
        });
    }
    let below = |file: &PathBuf| {
        let name = file.strip_prefix(common.unwrap_or(Path::new(""))).unwrap_or(file);
        name.components().map(|c| c.as_os_str().to_string_lossy()).collect::<Vec<_>>().join("/")
    };
    files.iter().map(below).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_keep_the_folders_that_tell_them_apart() {
        let names =
            |paths: &[&str]| names_below_common_folder(&paths.iter().map(PathBuf::from).collect::<Vec<_>>());
        assert_eq!(names(&["/p/images/a.jpg", "/p/images/b.jpg"]), ["a.jpg", "b.jpg"]);
        assert_eq!(names(&["/p/images/c0/a.jpg", "/p/images/c1/a.jpg"]), ["c0/a.jpg", "c1/a.jpg"]);
        assert_eq!(names(&["/p/a.jpg", "/p/images/a.jpg"]), ["a.jpg", "images/a.jpg"]);
    }
}
