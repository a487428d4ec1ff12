//! From the scene back to a `.mvs` file.

use super::atomic::{AtomicFile, write_file};
use super::import::LoadedScene;
use super::paths::{SearchPath, clean_name, name_relative_to};
use crate::error::{Error, Result};
use crate::geometry::{Camera, Roi};
use crate::scene::{Neighbor, PointSource, Scene, ViewIndex, ViewNeighbors};
use nalgebra::Vector3;
use semvs_formats::mvs::{self, NEWEST_VERSION, NO_ID};
use std::path::Path;

/// The archive that OpenMVS leaves after densification in interface mode: the sparse points as they were, cameras
/// at working resolution, neighbour scores, the region of interest. Image names are relative to the working folder.
///
/// Names of platforms and cameras, lines and the transform are dropped, as OpenMVS does. `cameras` (`None` = not
/// processed: the stored camera stays) and `neighbors` have one entry per view.
pub fn interface_archive(
    loaded: &LoadedScene,
    cameras: &[Option<Camera>],
    neighbors: &[ViewNeighbors],
) -> mvs::Scene {
    let mut archive = mvs::Scene {
        platforms: export_platforms(&loaded.archive, cameras),
        images: loaded.archive.images.clone(),
        points: loaded.archive.points.clone(),
        obb: loaded
            .scene
            .roi
            .as_ref()
            .map(|roi| export_roi(&Roi { center: roi.center + loaded.origin, ..roi.clone() })),
        // A model that was moved says so.
        transform: loaded
            .workspace
            .as_ref()
            .map_or(mvs::Scene::default().transform, |_| loaded.archive.transform),
        ..mvs::Scene::default()
    };
    for (i, image) in archive.images.iter_mut().enumerate() {
        export_image(image, &loaded.scene, i, &loaded.search);
        if let Some(neighbors) = neighbors.get(i) {
            image.avg_depth = neighbors.avg_depth;
            image.view_scores = neighbors.all.iter().map(export_neighbor).collect();
        }
    }
    archive
}

/// The archive that OpenMVS leaves after densification in project mode: as [`interface_archive`], but with the dense
/// `cloud` in place of the sparse points, platform names, the working size of every processed image, and the mesh that a
/// project brought along.
///
/// # Errors
/// Those of `cloud`.
pub fn project_archive(
    loaded: &LoadedScene,
    cameras: &[Option<Camera>],
    neighbors: &[ViewNeighbors],
    cloud: &dyn PointSource,
) -> Result<mvs::Scene> {
    let mut archive = interface_archive(loaded, cameras, neighbors);
    for (platform, stored) in archive.platforms.iter_mut().zip(&loaded.archive.platforms) {
        platform.name.clone_from(&stored.name);
    }
    for (image, camera) in archive.images.iter_mut().zip(cameras) {
        let size = camera.as_ref().map(Camera::size).unwrap_or_default();
        (image.width, image.height) = (size.width, size.height);
    }
    let has = cloud.layout();
    let mut points = mvs::PointCloud::default();
    let mut images = Vec::new();
    cloud.for_each(&mut |point| {
        let place = Vector3::from(point.position.map(f64::from)) + loaded.origin;
        points.positions.push([place.x as f32, place.y as f32, place.z as f32]);
        if has.normals {
            points.normals.push(point.normal);
        }
        if has.colors {
            points.colors.push(point.color);
        }
        if has.views {
            images.clear();
            images.extend(point.views.iter().map(|v| v.0));
            points.views.push(&images, point.weights);
        }
        Ok(())
    })?;
    archive.points = points;
    archive.mesh.clone_from(&loaded.archive.mesh);
    Ok(archive)
}

/// Leaves in `archive` only the images of `views` (ascending), with their neighbours among them, the points that at least
/// two of them see, and `roi` as the region of interest.
pub fn restrict_archive(archive: &mut mvs::Scene, views: &[ViewIndex], roi: &Roi) {
    const MIN_VIEWS: usize = 2;
    let mut place = vec![None; archive.images.len()];
    for (i, view) in views.iter().enumerate() {
        place[view.index()] = Some(i as u32);
    }
    let remaining = |image: u32| place.get(image as usize).copied().flatten();
    let images = std::mem::take(&mut archive.images);
    archive.images = images.into_iter().zip(&place).filter(|(_, p)| p.is_some()).map(|(i, _)| i).collect();
    for image in &mut archive.images {
        let scores = std::mem::take(&mut image.view_scores);
        let moved = |s: mvs::ViewScore| Some(mvs::ViewScore { image: remaining(s.image)?, ..s });
        image.view_scores = scores.into_iter().filter_map(moved).collect();
    }
    let all = std::mem::take(&mut archive.points);
    let (mut images, mut weights) = (Vec::new(), Vec::new());
    for (i, &position) in all.positions.iter().enumerate() {
        images.clear();
        weights.clear();
        for (k, &image) in all.views.images_of(i).iter().enumerate() {
            if let Some(image) = remaining(image) {
                images.push(image);
                weights.extend(all.views.weights_of(i).get(k));
            }
        }
        if images.len() >= MIN_VIEWS {
            archive.points.positions.push(position);
            archive.points.normals.extend(all.normals.get(i));
            archive.points.colors.extend(all.colors.get(i));
            archive.points.views.push(&images, &weights);
        }
    }
    archive.obb = Some(export_roi(roi));
}

/// Makes the names of images and masks in `archive`, which are relative to `from`, relative to `to`.
pub fn relocate_names(archive: &mut mvs::Scene, from: &Path, to: &Path) {
    let relocated = |stored: &[u8]| match std::str::from_utf8(stored) {
        Ok(name) if !name.is_empty() && !Path::new(name).is_absolute() => {
            name_relative_to(&from.join(name), to).into_bytes()
        }
        _ => stored.to_vec(),
    };
    for image in &mut archive.images {
        image.name = relocated(&image.name);
        image.mask_name = relocated(&image.mask_name);
    }
}

/// Writes a project archive, whole or not at all.
///
/// # Errors
/// [`Error`] if the place cannot be written or the archive has an index out of range.
pub fn write_project(path: &Path, archive: &mvs::Scene, kind: mvs::ArchiveKind) -> Result<()> {
    let mut file = AtomicFile::create(path)?;
    mvs::write_project(&mut file, archive, kind).map_err(|e| Error::writing(path, e))?;
    file.commit()
}

/// Writes the header of a project archive of a kind that does not exist, and nothing after it.
///
/// # Errors
/// [`Error`] if the place cannot be written.
pub fn write_project_header(path: &Path, kind: i32) -> Result<()> {
    let mut whole = Vec::new();
    let empty = mvs::Scene::default();
    mvs::write_project(&mut whole, &empty, mvs::ArchiveKind::Binary).map_err(|e| Error::format(path, e))?;
    // Magic, version, kind, reserved.
    let mut header = whole.get(..20).unwrap_or_default().to_vec();
    header[8..12].copy_from_slice(&kind.to_le_bytes());
    write_file(path, &header)
}

/// Writes an interface archive of the newest version, whole or not at all.
///
/// # Errors
/// [`Error`] if the place cannot be written or the archive has an index out of range.
pub fn write_interface(path: &Path, archive: &mvs::Scene) -> Result<()> {
    let mut file = AtomicFile::create(path)?;
    mvs::write_interface(&mut file, archive, NEWEST_VERSION).map_err(|e| Error::writing(path, e))?;
    file.commit()
}

/// The platforms without names; each camera with the size and intrinsics of the first processed view that uses it.
fn export_platforms(archive: &mvs::Scene, cameras: &[Option<Camera>]) -> Vec<mvs::Platform> {
    let mut platforms = archive.platforms.clone();
    let mut used: Vec<Vec<bool>> = platforms.iter().map(|p| vec![false; p.cameras.len()]).collect();
    let calibrated = archive.images.iter().zip(cameras).filter(|(image, _)| image.pose != NO_ID);
    for processed in [true, false] {
        for (image, camera) in calibrated.clone().filter(|(_, camera)| camera.is_some() == processed) {
            let (p, c) = (image.platform as usize, image.camera as usize);
            let Some(stored) = platforms.get_mut(p).and_then(|platform| platform.cameras.get_mut(c)) else {
                continue;
            };
            if std::mem::replace(&mut used[p][c], true) {
                continue;
            }
            if let Some(camera) = camera {
                (stored.width, stored.height) = (camera.size().width, camera.size().height);
                let rows = camera.k().transpose();
                stored.k.copy_from_slice(rows.as_slice());
            }
        }
    }
    for (platform, used) in platforms.iter_mut().zip(&used) {
        platform.name.clear();
        for (camera, &used) in platform.cameras.iter_mut().zip(used) {
            camera.name.clear();
            camera.band.clear();
            if !used {
                camera.k = camera.normalized_k();
                (camera.width, camera.height) = (0, 0);
            }
        }
    }
    platforms
}

/// Names, IDs and depths of image `index` as OpenMVS writes them.
fn export_image(image: &mut mvs::Image, scene: &Scene, index: usize, search: &SearchPath) {
    image.name = export_name(&image.name, search);
    image.mask_name = export_name(&image.mask_name, search);
    image.id = scene.views[index].id.0;
    (image.min_depth, image.max_depth) = (0.0, 0.0);
    (image.width, image.height) = (0, 0);
    if image.pose == NO_ID {
        (image.platform, image.camera) = (NO_ID, NO_ID);
    }
}

/// A stored name relative to the working folder; bytes that are no text stay as they are.
fn export_name(stored: &[u8], search: &SearchPath) -> Vec<u8> {
    let Ok(text) = std::str::from_utf8(stored) else { return stored.to_vec() };
    if text.is_empty() {
        return Vec::new();
    }
    let name = clean_name(text);
    let found = search.find(&name);
    let is_beside = !Path::new(&name).is_absolute() && found == search.working_folder.join(&name);
    if is_beside { name.into_bytes() } else { name_relative_to(&found, &search.working_folder).into_bytes() }
}

fn export_neighbor(neighbor: &Neighbor) -> mvs::ViewScore {
    mvs::ViewScore {
        image: neighbor.view.0,
        points: neighbor.points,
        scale: neighbor.scale,
        angle: neighbor.angle,
        area: neighbor.area,
        score: neighbor.score,
    }
}

fn export_roi(roi: &Roi) -> mvs::Obb {
    let mut rotation = [0.0; 9];
    rotation.copy_from_slice(roi.rotation.transpose().as_slice());
    mvs::Obb { rotation, center: roi.center.into(), half_extent: roi.half_extent.into() }
}

#[cfg(test)]
mod tests;
