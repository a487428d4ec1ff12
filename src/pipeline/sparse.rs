//! Sparse points and neighbours from files of their own.

use crate::error::{Error, Result};
use crate::progress::Progress;
use crate::scene::{Scene, Tracks, ViewIndex, override_neighbors};
use crate::store::import::LoadedScene;
use semvs_formats::{Limits, mvs, neighbors_file, ply};
use std::fs::File;
use std::path::Path;

/// Replaces the sparse points of `loaded` by those of the PLY at `path`, whose view lists hold positions of images
/// in the scene.
///
/// # Errors
/// An unreadable file, one without points or view lists, a view that is not in the scene.
pub(super) fn replace_points(loaded: &mut LoadedScene, path: &Path) -> Result<()> {
    let file = File::open(path).map_err(|e| Error::io(path, "open", e))?;
    let cloud = ply::read_cloud(file, &Limits::default()).map_err(|e| Error::format(path, e))?;
    if cloud.is_empty() || !cloud.has_views() {
        let what = "a cloud with points and their view_indices is needed (--pointcloud-file)";
        return Err(Error::content(path, what));
    }
    let count = loaded.scene.views.len();
    if let Some(bad) = cloud.views.images.iter().find(|&&i| i as usize >= count) {
        let what = format!("a point is seen by image {bad}, the scene has {count} images");
        return Err(Error::content(path, what));
    }
    let mut tracks = Tracks::default();
    for (i, &point) in cloud.positions.iter().enumerate() {
        if point.iter().all(|v| v.is_finite()) {
            let calibrated = |v: &&u32| loaded.scene.views[**v as usize].calibration.is_some();
            tracks.push(point, cloud.images_of(i).iter().filter(calibrated).map(|&v| ViewIndex(v)));
        }
    }
    loaded.scene.tracks = tracks;
    for view in &mut loaded.scene.views {
        view.neighbors.clear();
    }
    loaded.archive.points = mvs::PointCloud {
        positions: cloud.positions,
        views: cloud.views,
        normals: cloud.normals,
        colors: cloud.colors,
    };
    // What is written again has sorted views of images that take part, like the points of a scene.
    loaded.archive.repair().map_err(|e| Error::format(path, e))?;
    Ok(())
}

/// Replaces the neighbours of the views that the view-neighbour file at `path` names.
///
/// # Errors
/// An unreadable file, an image that is not in the scene.
pub(super) fn override_from_file(scene: &mut Scene, path: &Path, progress: &Progress) -> Result<()> {
    let file = neighbors_file::read(path, scene.views.len(), &Limits::default());
    let file = file.map_err(|e| Error::format(path, e))?;
    let lists: Vec<(ViewIndex, Vec<ViewIndex>)> = file
        .lists
        .iter()
        .map(|list| (ViewIndex(list.image), list.neighbors.iter().map(|&n| ViewIndex(n)).collect()))
        .collect();
    if let Some(first) = file.alone.first() {
        let (path, count) = (path.display(), file.alone.len());
        progress.warn(format!(
            "{path}: {count} images stand alone in their line, such as {first}; their neighbours do not change"
        ));
    }
    override_neighbors(scene, &lists)
}
