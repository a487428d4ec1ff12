//! Small jobs on a scene without depth maps: its region of interest and neighbour lists as text.

use super::job::{SceneArchive, SceneJob};
use super::outputs::{summary, write_archive};
use super::prepare::load;
use crate::error::{Error, Result};
use crate::progress::{Event, Progress};
use crate::store::atomic::AtomicFile;
use crate::store::export::interface_archive;
use crate::store::import::{LoadedScene, load_scene};
use crate::store::stored_cloud::{StoredCloud, resaved_archive};
use semvs_formats::{Limits, mvs, neighbors_file, roi};
use std::io::Read;
use std::path::Path;
use std::time::Instant;

/// Writes the scene with the region of interest in the text file `region` to `path`, as the archive `kind`.
///
/// # Errors
/// Unreadable files, a place that cannot be written.
pub fn import_roi(
    job: &SceneJob,
    region: &Path,
    path: &Path,
    kind: SceneArchive,
    progress: &Progress,
) -> Result<()> {
    let loaded = load(job, progress)?;
    let start = Instant::now();
    let obb = roi::read(region, &Limits::default()).map_err(|e| Error::format(region, e))?;
    let points = StoredCloud::new(&loaded.archive.points).copied();
    let mut archive = resaved_archive(&loaded, points, matches!(kind, SceneArchive::Project(_)));
    archive.obb = Some(obb);
    write_archive(path, &archive, kind)?;
    let scene = summary(&archive, kind == SceneArchive::Interface);
    progress.event(Event::SceneSaved { path: path.to_owned(), scene, elapsed: start.elapsed() });
    Ok(())
}

/// Writes the region of interest, stored or estimated, as text to `path`; `false`: there is none.
///
/// # Errors
/// Unreadable files, a place that cannot be written.
pub fn export_roi(job: &SceneJob, path: &Path, progress: &Progress) -> Result<bool> {
    let loaded = load(job, progress)?;
    let Some(obb) = interface_archive(&loaded, &no_cameras(&loaded), &[]).obb else { return Ok(false) };
    let mut file = AtomicFile::create(path)?;
    roi::write(&mut file, &obb).map_err(|e| Error::writing(path, e))?;
    file.commit()?;
    Ok(true)
}

/// Writes the neighbour lists that came with the scene, or with the job's view-neighbour file, as text to `path`.
///
/// # Errors
/// No image has neighbours; unreadable files; a place that cannot be written.
pub fn export_neighbors(job: &SceneJob, path: &Path, progress: &Progress) -> Result<()> {
    let loaded = load(job, progress)?;
    let views = &loaded.scene.views;
    if views.iter().all(|v| v.neighbors.is_empty()) {
        let what = "no image has neighbours stored: densify the scene first, or give --view-neighbors-file";
        return Err(Error::content(&loaded.path, what));
    }
    let lists: Vec<Vec<u32>> =
        views.iter().map(|view| view.neighbors.iter().map(|n| n.view.0).collect()).collect();
    let mut file = AtomicFile::create(path)?;
    neighbors_file::write(&mut file, lists.iter().map(Vec::as_slice)).map_err(|e| Error::writing(path, e))?;
    file.commit()
}

/// Whether the scene is a project archive, with what OpenMVS would take for its dense cloud.
pub fn is_project(job: &SceneJob) -> bool {
    let mut head = Vec::with_capacity(64);
    let read = std::fs::File::open(&job.scene).and_then(|file| file.take(64).read_to_end(&mut head));
    let container = read.ok().and_then(|_| mvs::identify(&head).ok().flatten());
    matches!(container, Some(mvs::Container::Project { .. }))
}

/// Whether the scene can be read, be its images there or not.
pub fn is_readable(job: &SceneJob) -> bool {
    load_scene(&job.scene, &job.working_folder, &Limits::default(), &Progress::silent()).is_ok()
}

/// Cameras stay as they are stored.
fn no_cameras(loaded: &LoadedScene) -> Vec<Option<crate::geometry::Camera>> {
    vec![None; loaded.scene.views.len()]
}
