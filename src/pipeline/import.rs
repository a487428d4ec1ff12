//! What other programs made, as scene files and depth maps.

use super::prepare::neighbors_of;
use crate::depth_filter::normals_from_depth;
use crate::error::{Error, Result};
use crate::geometry::Camera;
use crate::progress::Progress;
use crate::report::{OutputReport, RunReport};
use crate::scene::{DepthEstimate, DepthMap, ImageId, Scene, ViewIndex};
use crate::store::archive::{move_sizes, same_place, write_archive};
use crate::store::atomic::AtomicFile;
use crate::store::cameras::{camera_of_map, cameras_at_image_size};
use crate::store::colmap::{ColmapMaps, Pass, Workspace};
use crate::store::depth_store::DepthStore;
use crate::store::import::{LoadedScene, load_scene};
use crate::store::rasters::{RasterFormat, read_depth};
use rayon::prelude::*;
use semvs_formats::mvs::Container;
use semvs_formats::{Limits, ply};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// `import` of a COLMAP folder.
#[derive(Clone, Debug)]
pub struct ImportSceneJob {
    /// Workspace or sparse model.
    pub workspace: PathBuf,
    /// Folder of the images, if it is not where COLMAP has it.
    pub images: Option<PathBuf>,
    /// The scene file to write.
    pub scene: PathBuf,
    /// Kind of archive.
    pub container: Container,
    /// Also write the maps of this pass as `depthNNNN.dmap` beside the scene.
    pub maps: Option<Pass>,
    /// Also write the cloud of COLMAP's fusion, with views, beside the scene: `SCENE.ply`.
    pub fused: bool,
}

/// `import` of a folder of depths.
#[derive(Clone, Debug)]
pub struct ImportDepthsJob {
    /// Folder of `.pfm`, `.npy` or 16-bit `.png` files, named like the images.
    pub depths: PathBuf,
    /// The scene of the images: a `.mvs` file or a COLMAP workspace.
    pub scene: PathBuf,
    /// First place of images named by the scene.
    pub working_folder: PathBuf,
    /// Folder of the depth maps to write.
    pub output: PathBuf,
    /// Values of PNG files are depth times this.
    pub depth_scale: f32,
    /// Compute normals from the depths; else there are none.
    pub normals: bool,
}

/// Sources that are noted in a depth map, at most.
const MOST_SOURCES: usize = 12;

/// Writes a COLMAP model as a scene file, and its depth maps if the job asks for them.
///
/// # Errors
/// Unreadable files, cameras with distortion, places that cannot be written.
pub fn import_scene(job: &ImportSceneJob, progress: &Progress) -> Result<RunReport> {
    let limits = Limits::default();
    let workspace = Workspace::at(&job.workspace, job.images.as_deref())?;
    if workspace.owns(&job.scene) {
        return Err(Error::content(
            &job.scene,
            "this is a file of COLMAP; choose another name for the scene",
        ));
    }
    let folder = folder_of(&job.scene);
    let mut archive = workspace.read_scene_for(folder, &limits)?;
    warn_of_losses(&archive, job.container, &job.scene, progress);
    move_sizes(&mut archive, job.container);
    write_archive(&job.scene, &archive, job.container)?;
    let points = archive.points.positions.len() as u64;
    let mut outputs = vec![row(&job.scene, "scene", Some(points))];
    if job.fused {
        let path = job.scene.with_extension("ply");
        if workspace.owns(&path) {
            return Err(Error::content(&path, "this is a file of COLMAP; choose another name for the scene"));
        }
        let cloud = workspace.read_fused(&limits)?;
        let layout = ply::Layout::openmvs(!cloud.colors.is_empty(), !cloud.normals.is_empty(), false);
        let mut file = AtomicFile::create(&path)?;
        ply::write_cloud(&mut file, &layout, &cloud).map_err(|e| Error::format(&path, e))?;
        file.commit()?;
        outputs.push(row(&path, "dense cloud", Some(cloud.len() as u64)));
    }
    if let Some(pass) = job.maps {
        // Names in the scene just written are relative to its folder.
        let loaded = load_scene(&job.scene, folder, &limits, progress)?;
        let maps = ColmapMaps::of_scene(&workspace, pass, &loaded.scene, folder);
        if !maps.any() {
            let what = format!("no {} depth map here; leave --maps out", pass.name());
            return Err(Error::content(&maps.folder(), what));
        }
        let sources = sources(&loaded, progress);
        let store = DepthStore::new(folder, loaded.search.clone(), 0, limits);
        let written = loaded.scene.views.par_iter().zip(&sources).map(|(view, sources)| {
            if maps.header(view.id)?.is_none() {
                return Ok(None);
            }
            let mut estimate = maps.read(view.id)?;
            estimate.source_ids.clone_from(sources);
            store.write(estimate)?;
            Ok(Some(row(&store.path(view.id), super::DEPTH_MAP, None)))
        });
        outputs.extend(written.collect::<Result<Vec<_>>>()?.into_iter().flatten());
    }
    Ok(RunReport { outputs, points, ..RunReport::default() })
}

/// Writes depths of the user's as depth maps of a scene's images.
///
/// # Errors
/// Unreadable files, a depth map of another shape than its image, a file that is named like two images, no file that is
/// named like an image.
pub fn import_depths(job: &ImportDepthsJob, progress: &Progress) -> Result<RunReport> {
    let limits = Limits::default();
    if !(job.depth_scale.is_finite() && job.depth_scale > 0.0) {
        return Err(Error::invalid("--depth-scale must be above 0"));
    }
    let loaded = load_scene(&job.scene, &job.working_folder, &limits, progress)?;
    let files = match_files(&loaded.scene, &job.depths)?;
    let missing: Vec<&str> = (loaded.scene.views.iter().enumerate())
        .filter(|(i, view)| view.calibration.is_some() && !files.contains_key(&ViewIndex(*i as u32)))
        .map(|(_, view)| view.name.as_str())
        .collect();
    if !missing.is_empty() {
        progress.warn(format!(
            "{}: {} images have no depths: {}",
            job.depths.display(),
            missing.len(),
            missing.join(", ")
        ));
    }
    let cameras = cameras_at_image_size(&loaded, false, progress)?;
    let sources = sources_with(&loaded, &cameras, progress);
    let store = DepthStore::new(&job.output, loaded.search.clone(), 0, limits);
    let files: Vec<(ViewIndex, PathBuf)> = files.into_iter().collect();
    let written = files.par_iter().map(|(view, path)| {
        let at = view.index();
        let Some(full) = &cameras[at] else { return Ok(None) };
        if same_place(&store.path(loaded.scene.views[at].id), path) {
            return Err(Error::content(path, "this would be overwritten; choose another --output"));
        }
        let depth = read_depth(path, job.depth_scale, &limits)?;
        let estimate = estimate_of(&loaded, *view, full, depth, path, job.normals)?;
        store.write(DepthEstimate { source_ids: sources[at].clone(), ..estimate })?;
        Ok(Some(row(&store.path(loaded.scene.views[at].id), super::DEPTH_MAP, None)))
    });
    let outputs = written.collect::<Result<Vec<_>>>()?.into_iter().flatten().collect();
    Ok(RunReport { outputs, ..RunReport::default() })
}

/// The depths of a view with everything that a depth map says besides.
fn estimate_of(
    loaded: &LoadedScene,
    view: ViewIndex,
    full: &Camera,
    depth: DepthMap,
    path: &Path,
    normals: bool,
) -> Result<DepthEstimate> {
    let known = &loaded.scene.views[view.index()];
    let calibration = known.calibration.as_ref();
    let camera = calibration.and_then(|c| camera_of_map(c, full.size(), depth.size())).ok_or_else(|| {
        let what = format!(
            "{} pixels, the image {} has {}: depths must have its size or be reduced on both sides alike",
            depth.size(),
            known.name,
            full.size()
        );
        Error::content(path, what)
    })?;
    let valid = || depth.data().iter().copied().filter(|&d| d > 0.0);
    let (near, far) = valid().fold((f32::INFINITY, 0f32), |(near, far), d| (near.min(d), far.max(d)));
    if far == 0.0 {
        return Err(Error::content(path, "not one depth above 0"));
    }
    let normal = normals.then(|| normals_from_depth(&depth, &camera));
    Ok(DepthEstimate {
        image_id: known.id,
        image_name: known.name.clone(),
        source_ids: Vec::new(),
        camera,
        depth_range: (near, far.next_up()),
        depth,
        normal,
        confidence: None,
    })
}

/// The file of every view that has one: the view's image name with another extension, or the end of it from any `/`
/// on; the longest end counts.
fn match_files(scene: &Scene, folder: &Path) -> Result<BTreeMap<ViewIndex, PathBuf>> {
    if !folder.is_dir() {
        return Err(Error::content(folder, "no such folder of depths"));
    }
    let mut found = BTreeMap::new();
    let mut taken: BTreeMap<PathBuf, &str> = BTreeMap::new();
    for (i, view) in scene.views.iter().enumerate().filter(|(_, view)| view.calibration.is_some()) {
        let Some(path) = file_of(&view.name, folder) else { continue };
        if let Some(other) = taken.insert(path.clone(), &view.name) {
            let what = format!(
                "both {other} and {} have this name: put the depths into folders named like those of the images",
                view.name
            );
            return Err(Error::content(&path, what));
        }
        found.insert(ViewIndex(i as u32), path);
    }
    if found.is_empty() {
        let example = scene.views.first().map_or("", |view| view.name.as_str());
        let what =
            format!("no .pfm, .npy or .png here is named like an image of the scene, such as {example}");
        return Err(Error::content(folder, what));
    }
    Ok(found)
}

fn file_of(name: &str, folder: &Path) -> Option<PathBuf> {
    let starts = std::iter::once(0).chain(name.match_indices('/').map(|(at, _)| at + 1));
    let ends = starts.map(|at| &name[at..]).filter(|end| !end.is_empty() && !end.starts_with('/'));
    ends.filter(|end| !end.split('/').any(|part| part == ".."))
        .flat_map(|end| RasterFormat::ALL.map(|format| folder.join(end).with_extension(format.extension())))
        .find(|path| path.is_file())
}

/// What every view is matched with, as far as it can be told without its images' pixels.
fn sources(loaded: &LoadedScene, progress: &Progress) -> Vec<Vec<ImageId>> {
    match cameras_at_image_size(loaded, false, progress) {
        Ok(cameras) => sources_with(loaded, &cameras, progress),
        Err(error) => no_sources(loaded, &error, progress),
    }
}

fn no_sources(loaded: &LoadedScene, error: &Error, progress: &Progress) -> Vec<Vec<ImageId>> {
    progress.warn(format!("{error}; the depth maps name no neighbours"));
    vec![Vec::new(); loaded.scene.views.len()]
}

fn sources_with(loaded: &LoadedScene, cameras: &[Option<Camera>], progress: &Progress) -> Vec<Vec<ImageId>> {
    let neighbors = match neighbors_of(&loaded.scene, cameras) {
        Ok(neighbors) => neighbors,
        Err(error) => return no_sources(loaded, &error, progress),
    };
    let ids = |view: &crate::scene::ViewNeighbors| {
        view.all.iter().take(MOST_SOURCES).map(|n| loaded.scene.views[n.view.index()].id).collect()
    };
    neighbors.iter().map(ids).collect()
}

/// Says what an archive of this kind cannot hold of the scene.
pub(super) fn warn_of_losses(
    scene: &semvs_formats::mvs::Scene,
    container: Container,
    path: &Path,
    progress: &Progress,
) {
    for lost in scene.losses(container) {
        progress.warn(format!("{}: this kind of archive does not hold {lost}: left out", path.display()));
    }
}

pub(super) fn row(path: &Path, content: &str, points: Option<u64>) -> OutputReport {
    OutputReport { path: path.display().to_string(), content: content.to_owned(), points }
}

/// The folder that a file is in.
pub(super) fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_found_by_the_longest_end_of_the_image_name() {
        let scratch = tempfile::tempdir().unwrap();
        std::fs::create_dir_all(scratch.path().join("cam0")).unwrap();
        for name in ["cam0/a.npy", "a.pfm", "b.png"] {
            std::fs::write(scratch.path().join(name), b"").unwrap();
        }
        let found = |name: &str| {
            file_of(name, scratch.path())
                .map(|p| p.strip_prefix(scratch.path()).unwrap().display().to_string())
        };
        assert_eq!(found("images/cam0/a.jpg").as_deref(), Some("cam0/a.npy"));
        assert_eq!(found("images/cam1/a.jpg").as_deref(), Some("a.pfm"));
        assert_eq!(found("../photos/b.x.jpg"), None);
        assert_eq!(found("/photos/b.jpg").as_deref(), Some("b.png"));
    }
}
