//! Scene files as they are: read whole, written as another kind of archive.

use super::atomic::AtomicFile;
use super::colmap::Workspace;
use super::paths::{SearchPath, clean_name, name_relative_to};
use crate::error::{Error, Result};
use crate::geometry::{Size, normalized_k};
use crate::scene::Calibration;
use nalgebra::{Matrix3, Vector3};
use semvs_formats::Limits;
use semvs_formats::mvs::{self, Container, NO_ID, SceneFile};
use std::path::Path;

/// Reads everything that the scene file at `path` holds, nothing repaired; a folder is taken for a COLMAP workspace.
///
/// # Errors
/// [`Error`] about `path`.
pub(crate) fn read_archive(path: &Path, limits: &Limits) -> Result<(mvs::Scene, Container)> {
    if path.is_dir() {
        let scene = Workspace::at(path, None)?.read_scene(limits)?;
        return Ok((scene, Container::Interface { version: mvs::NEWEST_VERSION }));
    }
    let file = SceneFile::read(path, limits).map_err(|e| Error::format(path, e))?;
    Ok((file.scene, file.container))
}

/// Writes a scene as an archive of this kind, whole or not at all. Meshes and textures go into project archives;
/// everything else that the archive cannot hold ([`mvs::Scene::losses`]) is left out.
///
/// # Errors
/// The place cannot be written; a mesh for an interface archive; an index that leads nowhere.
pub(crate) fn write_archive(path: &Path, scene: &mvs::Scene, container: Container) -> Result<()> {
    let mut file = AtomicFile::create(path)?;
    let written = match container {
        Container::Interface { version } => mvs::write_interface(&mut file, scene, version),
        Container::Project { kind } => mvs::write_project(&mut file, scene, kind),
    };
    written.map_err(|e| Error::format(path, e))?;
    file.commit()
}

/// Moves image sizes to where an archive of the kind `to` has them: interface archives at the cameras, with intrinsics
/// in pixels; project archives at the images, with normalised intrinsics.
pub(crate) fn move_sizes(scene: &mut mvs::Scene, to: Container) {
    for image in scene.images.iter_mut().filter(|image| image.pose != NO_ID) {
        let platform = scene.platforms.get_mut(image.platform as usize);
        let Some(camera) = platform.and_then(|p| p.cameras.get_mut(image.camera as usize)) else { continue };
        match to {
            Container::Interface { .. } if camera.width == 0 && image.width > 0 => {
                camera.k = pixel_k(camera, Size::new(image.width, image.height));
                (camera.width, camera.height) = (image.width, image.height);
            }
            Container::Project { .. } if image.width == 0 => {
                (image.width, image.height) = (camera.width, camera.height);
            }
            _ => {}
        }
    }
    if matches!(to, Container::Interface { .. }) {
        scene.images.iter_mut().for_each(|image| (image.width, image.height) = (0, 0));
    }
}

/// Normalised intrinsics in pixels of `size`.
fn pixel_k(camera: &mvs::Camera, size: Size) -> [f64; 9] {
    let k = Matrix3::from_row_slice(&camera.k);
    let stored = (camera.width > 0).then(|| Size::new(camera.width, camera.height));
    let calibration = Calibration {
        normalized_k: stored.map_or(k, |stored| normalized_k(&k, stored)),
        rotation: Matrix3::identity(),
        center: Vector3::zeros(),
        size: None,
    };
    let k = *calibration.camera_at(size).k();
    std::array::from_fn(|i| k[(i / 3, i % 3)])
}

/// Makes names of images and masks, which `search` finds, relative to `folder`. Names that are found from there by
/// themselves, absolute ones and ones that are no text stay to the byte.
pub(crate) fn move_names(scene: &mut mvs::Scene, search: &SearchPath, folder: &Path) {
    let moved = |stored: &[u8]| {
        let Ok(text) = std::str::from_utf8(stored) else { return stored.to_vec() };
        let name = clean_name(text);
        if text.is_empty() || Path::new(&name).is_absolute() {
            return stored.to_vec();
        }
        let from = match search.working_folder.join(&name).exists() {
            true => &search.working_folder,
            false => &search.scene_folder,
        };
        match same_place(from, folder) {
            true => stored.to_vec(),
            false => name_relative_to(&from.join(&name), folder).into_bytes(),
        }
    };
    for image in &mut scene.images {
        image.name = moved(&image.name);
        image.mask_name = moved(&image.mask_name);
    }
}

/// Whether two paths mean the same place, be it there or not.
pub(crate) fn same_place(a: &Path, b: &Path) -> bool {
    let resolved = |path: &Path| {
        let path = if path.as_os_str().is_empty() { Path::new(".") } else { path };
        path.canonicalize().or_else(|_| std::path::absolute(path)).ok()
    };
    resolved(a).is_some_and(|a| resolved(b) == Some(a))
}

#[cfg(test)]
mod tests {
    use super::*;
    use semvs_formats::mvs::ArchiveKind;

    fn facade() -> std::path::PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("compat-fixtures/facade6")
    }

    #[test]
    fn sizes_go_to_the_images_and_back() {
        let limits = Limits::default();
        let (mut scene, container) = read_archive(&facade().join("scene.mvs"), &limits).unwrap();
        let before = scene.clone();
        let project = Container::Project { kind: ArchiveKind::Binary };
        move_sizes(&mut scene, project);
        assert_eq!((scene.images[3].width, scene.images[3].height), (400, 300));
        let scratch = tempfile::tempdir().unwrap();
        let path = scratch.path().join("a.mvs");
        write_archive(&path, &scene, project).unwrap();
        let (mut back, found) = read_archive(&path, &limits).unwrap();
        assert_eq!(found, project);
        assert_eq!(back.platforms[0].cameras[0].width, 0);
        move_sizes(&mut back, container);
        let (k, expected) = (back.platforms[0].cameras[0].k, before.platforms[0].cameras[0].k);
        assert_eq!((back.platforms[0].cameras[0].width, back.images[3].width), (400, 0));
        // Dividing and multiplying by 400 is exact to rounding.
        assert!(k.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-9), "{k:?} {expected:?}");
        assert_eq!(back.points, before.points);
    }

    #[test]
    fn names_move_with_the_file_and_else_stay() {
        let (scene, _) = read_archive(&facade().join("scene.mvs"), &Limits::default()).unwrap();
        let search = SearchPath::new(Path::new("/nowhere"), &facade().join("scene.mvs"));
        let moved = |folder: &Path| {
            let mut scene = scene.clone();
            move_names(&mut scene, &search, folder);
            String::from_utf8(scene.images[0].name.clone()).unwrap()
        };
        assert_eq!(moved(&facade()).into_bytes(), scene.images[0].name);
        assert_eq!(moved(&facade().join("sub")), "../images/0003.jpg");
    }
}
