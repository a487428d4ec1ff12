//! From a sparse model to the scene value of `.mvs` files.

use crate::error::{Error, Result};
use crate::geometry::local_origin;
use nalgebra::{Matrix3, Vector3};
use semvs_formats::colmap::{Camera, Image, Model, Points};
use semvs_formats::mvs::{self, NO_ID};
use std::collections::HashMap;
use std::path::Path;

/// Distance between COLMAP's image origin, the corner of the first pixel, and ours, its centre.
pub(super) const HALF_PIXEL: f64 = 0.5;

const IDENTITY: [f64; 9] = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];

/// The model as a scene whose image names are `prefix` and the model's names. Images and points keep their order; global
/// IDs are COLMAP's less one, as OpenMVS's importer has it (as they are, if one is 0).
///
/// A model far from the origin is moved near it in doubles, which the scene's transform says, so that points can have 32-bit
/// coordinates.
///
/// Images of one camera, or of equal ones, share a platform; every image has a pose of its own. Errors and ids of
/// points and the key points are dropped.
///
/// # Errors
/// [`Error::Content`] about `place` for a camera with distortion or a track through an image that is not there.
pub(super) fn scene_from_model(model: &Model, prefix: &str, place: &Path) -> Result<mvs::Scene> {
    let mut scene = mvs::Scene::default();
    let mut platform_of: HashMap<u32, usize> = HashMap::new();
    let mut distinct: Vec<&Camera> = Vec::new();
    let first_id = u32::from(model.images.iter().all(|image| image.id > 0));
    for image in &model.images {
        let camera = model
            .cameras
            .iter()
            .find(|camera| camera.id == image.camera_id)
            .ok_or_else(|| Error::content(place, format!("image {} names no camera", image.id)))?;
        let platform = match platform_of.get(&camera.id) {
            Some(&platform) => platform,
            None => {
                let same = |c: &&Camera| {
                    (c.model, c.width, c.height, &c.params)
                        == (camera.model, camera.width, camera.height, &camera.params)
                };
                let platform = distinct.iter().position(same).unwrap_or(distinct.len());
                if platform == distinct.len() {
                    distinct.push(camera);
                    scene.platforms.push(platform_from(camera, place)?);
                }
                platform_of.insert(camera.id, platform);
                platform
            }
        };
        let poses = &mut scene.platforms[platform].poses;
        poses.push(pose_from(image));
        scene.images.push(mvs::Image {
            name: [prefix.as_bytes(), &image.name].concat(),
            platform: platform as u32,
            camera: 0,
            pose: (poses.len() - 1) as u32,
            id: image.id - first_id,
            ..mvs::Image::default()
        });
    }
    let centers = scene.platforms.iter().flat_map(|platform| &platform.poses);
    let origin = local_origin(centers.map(|pose| Vector3::from(pose.center)));
    for pose in scene.platforms.iter_mut().flat_map(|platform| &mut platform.poses) {
        pose.center = (Vector3::from(pose.center) - origin).into();
    }
    for (row, shift) in origin.iter().enumerate() {
        scene.transform[4 * row + 3] = 0.0 - shift;
    }
    scene.points = points_from(&model.points, model, &origin, place)?;
    Ok(scene)
}

fn platform_from(camera: &Camera, place: &Path) -> Result<mvs::Platform> {
    let Some([fx, fy, cx, cy]) = camera.pinhole() else {
        return Err(Error::content(place, format!("camera {} has distortion", camera.id)));
    };
    let camera = mvs::Camera {
        name: b"PINHOLE".to_vec(),
        width: camera.width as u32,
        height: camera.height as u32,
        k: [fx, 0.0, cx - HALF_PIXEL, 0.0, fy, cy - HALF_PIXEL, 0.0, 0.0, 1.0],
        rotation: IDENTITY,
        ..mvs::Camera::default()
    };
    Ok(mvs::Platform { cameras: vec![camera], ..mvs::Platform::default() })
}

/// `x' = R x + t` as rotation and centre `−Rᵀ t`.
fn pose_from(image: &Image) -> mvs::Pose {
    let rotation = image.pose.rotation_matrix();
    let center = -(Matrix3::from_row_slice(&rotation).transpose() * Vector3::from(image.pose.translation));
    mvs::Pose { rotation, center: center.into() }
}

fn points_from(
    points: &Points,
    model: &Model,
    origin: &Vector3<f64>,
    place: &Path,
) -> Result<mvs::PointCloud> {
    let index_of: HashMap<u32, u32> = model.images.iter().zip(0..).map(|(image, i)| (image.id, i)).collect();
    let mut cloud = mvs::PointCloud::default();
    let mut views = Vec::new();
    for (i, position) in points.positions.iter().enumerate() {
        views.clear();
        for element in points.track(i) {
            let Some(&index) = index_of.get(&element.image_id).filter(|&&index| index != NO_ID) else {
                let what = format!(
                    "point {} was seen by image {}, which is not there",
                    points.ids[i], element.image_id
                );
                return Err(Error::content(place, what));
            };
            views.push(index);
        }
        views.sort_unstable();
        let local = Vector3::from(*position) - origin;
        cloud.positions.push([local.x as f32, local.y as f32, local.z as f32]);
        cloud.colors.push(points.colors[i]);
        cloud.views.push(&views, &[]);
    }
    Ok(cloud)
}
