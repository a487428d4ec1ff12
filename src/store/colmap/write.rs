//! From a scene to the files that COLMAP's programs read.

use super::scene::HALF_PIXEL;
use super::{Pass, depth_map_path};
use crate::error::{Error, Result};
use crate::geometry::Camera;
use crate::scene::Scene;
use crate::store::atomic::{AtomicFile, write_file};
use nalgebra::{Rotation3, UnitQuaternion};
use semvs_formats::colmap::{
    self, CameraModel, Encoding, Image, Model, ModelFile, Observation, PatchMatchEntry, PatchMatchSources,
    Pose, TrackElement, fusion_config, patch_match_config, write_visibility,
};
use semvs_formats::mvs::{PointCloud, Visibility};
use semvs_formats::ply;
use std::path::Path;

/// Source images that `patch-match.cfg` asks for.
const AUTO_SOURCES: u32 = 20;
const WHITE: [u8; 3] = [255; 3];

/// The scene as a sparse model. `cameras` (at the sizes of the images; `None`: the image is left out) and `names`
/// (relative to the image folder) have one entry per view.
///
/// Every camera is a PINHOLE; equal ones are one. Image ids are the global IDs plus one, so that importing gives them back.
/// The key points are the projections of `points`, whose errors are 0.
pub fn model_from_scene(
    scene: &Scene,
    cameras: &[Option<Camera>],
    names: &[String],
    points: &PointCloud,
) -> Model {
    let mut model = Model::default();
    let ids_fit = scene.views.iter().all(|view| view.id.0 < u32::MAX);
    let mut place_of = vec![None; scene.views.len()];
    for (i, view) in scene.views.iter().enumerate() {
        let Some(camera) = &cameras[i] else { continue };
        place_of[i] = Some(model.images.len());
        let camera_id = add_camera(&mut model, camera);
        let rotation = Rotation3::from_matrix_unchecked(*camera.rotation());
        let q = UnitQuaternion::from_rotation_matrix(&rotation).into_inner();
        let translation = -(camera.rotation() * camera.center());
        model.images.push(Image {
            id: if ids_fit { view.id.0 + 1 } else { i as u32 + 1 },
            pose: Pose { rotation: [q.w, q.i, q.j, q.k], translation: translation.into() },
            camera_id,
            name: names[i].clone().into_bytes(),
            observations: Vec::new(),
        });
    }
    for (i, position) in points.positions.iter().enumerate() {
        add_point(&mut model, cameras, &place_of, points, i, *position);
    }
    model
}

/// The id of the camera, which is added unless there is an equal one.
fn add_camera(model: &mut Model, camera: &Camera) -> u32 {
    let (fx, fy, cx, cy) = camera.intrinsics();
    let params = vec![fx, fy, cx + HALF_PIXEL, cy + HALF_PIXEL];
    let (width, height) = (camera.size().width.into(), camera.size().height.into());
    let same = |c: &&colmap::Camera| (c.width, c.height, &c.params) == (width, height, &params);
    if let Some(known) = model.cameras.iter().find(same) {
        return known.id;
    }
    let id = model.cameras.len() as u32 + 1;
    model.cameras.push(colmap::Camera { id, model: CameraModel::Pinhole, width, height, params });
    id
}

/// Adds point `index` of `points` and where it is seen; not if it is seen nowhere.
fn add_point(
    model: &mut Model,
    cameras: &[Option<Camera>],
    place_of: &[Option<usize>],
    points: &PointCloud,
    index: usize,
    position: [f32; 3],
) {
    let id = index as u64 + 1;
    let before = model.points.tracks.len();
    for &view in points.views.images_of(index) {
        let at = view as usize;
        let (Some(&Some(place)), Some(Some(camera))) = (place_of.get(at), cameras.get(at)) else { continue };
        let in_camera = camera.cam_from_world(&position.map(f64::from).into());
        let (x, y) = camera.image_from_cam(&in_camera);
        let image = &mut model.images[place];
        let observation = image.observations.len() as u32;
        image.observations.push(Observation { position: [x + HALF_PIXEL, y + HALF_PIXEL], point_id: id });
        model.points.tracks.push(TrackElement { image_id: image.id, observation });
    }
    if model.points.tracks.len() > before {
        model.points.ids.push(id);
        model.points.positions.push(position.map(f64::from));
        model.points.colors.push(points.colors.get(index).copied().unwrap_or(WHITE));
        model.points.errors.push(0.0);
        model.points.track_ends.push(model.points.tracks.len() as u64);
    }
}

/// Writes the model's files into `folder`; no rigs and frames, without which COLMAP makes its own.
///
/// # Errors
/// The folder cannot be written; a name that the encoding cannot hold.
pub fn write_model(folder: &Path, model: &Model, encoding: Encoding) -> Result<()> {
    for file in ModelFile::REQUIRED {
        let path = folder.join(file.name(encoding));
        let mut out = AtomicFile::create(&path)?;
        model.write_file(file, encoding, &mut out).map_err(|e| Error::format(&path, e))?;
        out.commit()?;
    }
    Ok(())
}

/// Writes `patch-match.cfg` and `fusion.cfg` for these images into the folder `stereo`, where they are missing.
///
/// # Errors
/// The folder cannot be written.
pub fn write_configs(stereo: &Path, names: &[&str]) -> Result<()> {
    let entry = |name: &&str| PatchMatchEntry {
        image: (*name).to_owned(),
        sources: PatchMatchSources::Auto(AUTO_SOURCES),
    };
    let patch_match = patch_match_config(&names.iter().map(entry).collect::<Vec<_>>());
    for (name, text) in [("patch-match.cfg", patch_match), ("fusion.cfg", fusion_config(names))] {
        let path = stereo.join(name);
        if !path.exists() {
            write_file(&path, text.as_bytes())?;
        }
    }
    Ok(())
}

/// Writes a cloud with views as COLMAP's fusion leaves it: `path` and `path.vis`. `place_of` says for every view of the
/// scene at which position of the model's images it is.
///
/// # Errors
/// The places cannot be written.
pub fn write_fused(path: &Path, mut cloud: ply::Cloud, place_of: &[Option<u32>]) -> Result<()> {
    let count = cloud.len();
    if cloud.colors.is_empty() {
        cloud.colors = vec![WHITE; count];
    }
    if cloud.normals.is_empty() {
        cloud.normals = vec![[0.0; 3]; count];
    }
    let mut views = Visibility::default();
    for i in 0..count {
        let places = cloud.images_of(i).iter().filter_map(|&v| place_of.get(v as usize).copied().flatten());
        views.push(&places.collect::<Vec<u32>>(), &[]);
    }
    let mut file = AtomicFile::create(path)?;
    ply::write_cloud(&mut file, &ply::Layout::colmap(), &cloud).map_err(|e| Error::format(path, e))?;
    let lists = crate::store::paths::with_suffix(path, ".vis");
    let mut out = AtomicFile::create(&lists)?;
    write_visibility(&views, &mut out).map_err(|e| Error::format(&lists, e))?;
    file.commit()?;
    out.commit()
}

/// Whether a map of any of these images is in the folder `stereo`.
pub fn has_maps(stereo: &Path, names: &[String]) -> bool {
    names.iter().any(|name| depth_map_path(stereo, name, Pass::Geometric).exists())
}
