//! From a `.mvs` file or a COLMAP workspace to the scene that every stage sees.

use super::colmap::Workspace;
use super::images::image_size;
use super::paths::{SearchPath, clean_name};
use crate::error::{Error, Result};
use crate::geometry::{Roi, Size, local_origin, normalized_k};
use crate::progress::Progress;
use crate::scene::{Calibration, ImageId, Neighbor, Scene, Tracks, View, ViewIndex};
use nalgebra::{Matrix3, Vector3};
use semvs_formats::Limits;
use semvs_formats::mvs::{self, NO_ID, SceneFile};
use std::path::{Path, PathBuf};

/// A scene and what its file said beyond it.
#[derive(Clone, Debug)]
pub struct LoadedScene {
    /// What the stages work on.
    pub scene: Scene,
    /// What the file held, repaired; exports start from it. Its images are those of [`Scene::views`], in the same order.
    pub archive: mvs::Scene,
    /// Which archive the file is.
    pub container: mvs::Container,
    /// The scene file or the folder of the workspace.
    pub path: PathBuf,
    /// Where the scene's names are looked for.
    pub search: SearchPath,
    /// The workspace, if the scene is one.
    pub workspace: Option<Workspace>,
    /// Where the origin of [`LoadedScene::scene`] is in the coordinates of [`LoadedScene::archive`].
    pub origin: Vector3<f64>,
}

impl LoadedScene {
    /// Moves a scene that is far from the origin near it, for single precision to be enough.
    pub fn make_local(&mut self) {
        let centers = self.scene.views.iter().filter_map(|v| v.calibration.as_ref()).map(|c| c.center);
        let origin = local_origin(centers);
        if origin == Vector3::zeros() {
            return;
        }
        let shift = -origin;
        for calibration in self.scene.views.iter_mut().filter_map(|v| v.calibration.as_mut()) {
            calibration.center += shift;
        }
        self.scene.tracks.shift(&shift);
        if let Some(roi) = &mut self.scene.roi {
            roi.center += shift;
        }
        self.origin += origin;
    }

    /// The photograph of a view.
    pub fn image_path(&self, view: ViewIndex) -> PathBuf {
        self.search.find(&self.scene.views[view.index()].name)
    }
}

/// Refuses a file in the place of the folder that names are relative to.
///
/// # Errors
/// [`Error::Content`].
pub(crate) fn check_working_folder(folder: &Path) -> Result<()> {
    match folder.exists() && !folder.is_dir() {
        true => Err(Error::content(folder, "this is a file; --working-folder (-w) takes a folder")),
        false => Ok(()),
    }
}

/// Loads the scene file at `path`. Names in it are relative to `working_folder` (empty = the current folder) or,
/// failing that, to the folder of the file. A folder is taken for a COLMAP workspace; its images are its own.
///
/// What can be left out without harm is, with a warning: sparse points at no finite place, views of points that name
/// no calibrated image, neighbour scores that lead nowhere. Where images share a global ID, all get
/// their position as ID.
///
/// # Errors
/// [`Error`] if the file cannot be read, a calibrated image has impossible camera data, or fewer than two images
/// are calibrated.
pub fn load_scene(
    path: &Path,
    working_folder: &Path,
    limits: &Limits,
    progress: &Progress,
) -> Result<LoadedScene> {
    check_working_folder(working_folder)?;
    let workspace = path.is_dir().then(|| Workspace::at(path, None)).transpose()?;
    let (mut archive, container, search, trailing_bytes) = match &workspace {
        Some(workspace) => {
            let container = mvs::Container::Interface { version: mvs::NEWEST_VERSION };
            let search = SearchPath { working_folder: path.to_owned(), scene_folder: path.to_owned() };
            (workspace.read_scene(limits)?, container, search, 0)
        }
        None => {
            let file = SceneFile::read(path, limits).map_err(|e| Error::format(path, e))?;
            (file.scene, file.container, SearchPath::new(working_folder, path), file.trailing_bytes)
        }
    };
    // Before repair merges them: a view that observed a point twice counts twice in view selection.
    let tracks = import_tracks(&archive);
    let repairs = archive.repair().map_err(|e| Error::format(path, e))?;
    warn_of_repairs(path, &repairs, progress);
    warn_of_remains(path, &archive, trailing_bytes, progress);
    archive.check().map_err(|e| Error::format(path, e))?;
    let views = import_views(path, &archive, container, &search, progress)?;
    let calibrated = views.iter().filter(|v| v.calibration.is_some()).count();
    if calibrated < 2 {
        let what = format!(
            "{calibrated} of its {} images have a pose: at least two are needed; orient the photographs first",
            views.len()
        );
        return Err(Error::content(path, what));
    }
    let roi = archive.obb.as_ref().map(import_roi);
    let scene = Scene { views, tracks, roi };
    Ok(LoadedScene {
        scene,
        archive,
        container,
        path: path.to_owned(),
        search,
        workspace,
        origin: Vector3::zeros(),
    })
}

/// The views in file order.
fn import_views(
    path: &Path,
    archive: &mvs::Scene,
    container: mvs::Container,
    search: &SearchPath,
    progress: &Progress,
) -> Result<Vec<View>> {
    let mut views = Vec::with_capacity(archive.images.len());
    for (i, image) in archive.images.iter().enumerate() {
        let name = clean_name(&String::from_utf8_lossy(&image.name));
        let mask =
            (!image.mask_name.is_empty()).then(|| clean_name(&String::from_utf8_lossy(&image.mask_name)));
        let calibration = match import_calibration(archive, image) {
            Some(mut calibration) => {
                if calibration.size.is_none() {
                    // The working size of a project archive does when the photograph is elsewhere.
                    let stored =
                        (image.width > 0 && image.height > 0).then(|| Size::new(image.width, image.height));
                    match (image_size(&search.find(&name)), stored) {
                        (Ok(size), _) | (Err(_), Some(size)) => {
                            size_from_file(&mut calibration, container, size);
                        }
                        (Err(error), None) => {
                            progress.warn(format!("{error}; its size is not in the scene either"));
                        }
                    }
                }
                Some(calibration)
            }
            None if image.pose == NO_ID => None,
            None => {
                return Err(Error::content(
                    path,
                    format!("image {i} ({name}) names a camera that is not there"),
                ));
            }
        };
        let neighbors = import_neighbors(archive, i);
        let avg_depth = if image.avg_depth.is_finite() { image.avg_depth.max(0.0) } else { 0.0 };
        views.push(View { name, mask, id: ImageId(image.id_at(i)), calibration, neighbors, avg_depth });
    }
    Ok(views)
}

/// Pose and intrinsics of an image: `R = Rc Rp`, `C = Rpᵀ Cc + Cp`; `None` if it is uncalibrated or an index is
/// out of range.
pub(crate) fn import_calibration(archive: &mvs::Scene, image: &mvs::Image) -> Option<Calibration> {
    if image.pose == NO_ID {
        return None;
    }
    let platform = archive.platforms.get(image.platform as usize)?;
    let camera = platform.cameras.get(image.camera as usize)?;
    let pose = platform.poses.get(image.pose as usize)?;
    let pose_rotation = Matrix3::from_row_slice(&pose.rotation);
    let rotation = Matrix3::from_row_slice(&camera.rotation) * pose_rotation;
    let center = pose_rotation.transpose() * Vector3::from(camera.center) + Vector3::from(pose.center);
    let k = Matrix3::from_row_slice(&camera.k);
    let size = (camera.width > 0 && camera.height > 0).then(|| Size::new(camera.width, camera.height));
    let normalized_k = size.map_or(k, |size| normalized_k(&k, size));
    Some(Calibration { normalized_k, rotation, center, size })
}

/// Gives a camera that was stored without a size that of its image file, and undoes the older way of normalising the
/// principal point, `c / max(w, h)` without half-pixel terms, which files up to version 5 may use.
fn size_from_file(calibration: &mut Calibration, container: mvs::Container, size: Size) {
    /// A principal point is near 0.5 by the older rule and near 0 by the newer one.
    const OLDER_RULE: f64 = 0.3;
    calibration.size = Some(size);
    let k = &mut calibration.normalized_k;
    let is_old = matches!(container, mvs::Container::Interface { version } if version <= 5);
    if is_old && k[(0, 2)] > OLDER_RULE && k[(1, 2)] > OLDER_RULE {
        let shift = 0.5 / f64::from(size.longest()) - 0.5;
        k[(0, 2)] += shift;
        k[(1, 2)] += shift;
    }
}

/// What of the file is not used.
fn warn_of_remains(path: &Path, archive: &mvs::Scene, trailing_bytes: u64, progress: &Progress) {
    if trailing_bytes > 0 {
        progress.warn(format!(
            "{}: {trailing_bytes} bytes after the end of the scene are ignored",
            path.display()
        ));
    }
    if archive.stored_box.is_some_and(|stored| stored.is_damaged()) {
        progress.warn(format!(
            "{}: its region of interest holds numbers that are not finite and is ignored",
            path.display()
        ));
    }
}

/// One line for each kind of flaw that was set right.
fn warn_of_repairs(path: &Path, repairs: &mvs::Repairs, progress: &Progress) {
    let kinds = [
        (repairs.dropped_points, "sparse points at no finite place are left out"),
        (repairs.dropped_views, "views of sparse points name no calibrated image and are left out"),
        (repairs.zeroed_weights, "confidences of sparse points are no numbers >= 0 and count as unknown"),
        (repairs.dropped_view_scores, "neighbour entries lead nowhere and are left out"),
        (repairs.shared_ids, "images share the global ID of another one; all get their position as ID"),
    ];
    for (count, what) in kinds.iter().filter(|(count, _)| *count > 0) {
        progress.warn(format!("{}: {count} {what}", path.display()));
    }
}

/// The stored neighbours of image `index` that are calibrated.
fn import_neighbors(archive: &mvs::Scene, index: usize) -> Vec<Neighbor> {
    let calibrated = |s: &&mvs::ViewScore| archive.images[s.image as usize].pose != NO_ID;
    let neighbor = |s: &mvs::ViewScore| Neighbor {
        view: ViewIndex(s.image),
        points: s.points,
        scale: s.scale,
        angle: s.angle,
        area: s.area,
        score: s.score,
    };
    archive.images[index].view_scores.iter().filter(calibrated).map(neighbor).collect()
}

/// The sparse points with the calibrated views that see them.
fn import_tracks(archive: &mvs::Scene) -> Tracks {
    let calibrated = |&v: &u32| archive.images.get(v as usize).is_some_and(|image| image.pose != NO_ID);
    let mut tracks = Tracks::default();
    for (i, point) in archive.points.positions.iter().enumerate() {
        if point.iter().all(|c| c.is_finite()) {
            let views = archive.points.views.images_of(i).iter().copied().filter(calibrated);
            tracks.push(*point, views.map(ViewIndex));
        }
    }
    tracks
}

/// The stored box, in the single precision that it is used with.
pub(crate) fn import_roi(obb: &mvs::Obb) -> Roi {
    let single = |v: f64| f64::from(v as f32);
    Roi {
        rotation: Matrix3::from_row_slice(&obb.rotation).map(single),
        center: Vector3::from(obb.center).map(single),
        half_extent: Vector3::from(obb.half_extent).map(single),
    }
}

#[cfg(test)]
mod tests;
