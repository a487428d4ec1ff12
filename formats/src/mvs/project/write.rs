//! Writing of the body of a native project.

use super::super::boost::{Class, Sink};
use super::super::boxes::StoredBox;
use super::super::mesh::{IndexLists, Mesh};
use super::super::scene::{Image, Platform, PointCloud, Scene};
use crate::Result;

/// Writes a whole scene whose lengths have been checked.
pub(super) fn write_scene<S: Sink>(s: &mut S, scene: &Scene) -> Result<()> {
    s.class(Class::Scene)?;
    s.class(Class::PlatformList)?;
    s.u32(scene.platforms.len() as u32)?;
    scene.platforms.iter().try_for_each(|p| write_platform(s, p))?;
    s.class(Class::ImageList)?;
    s.u32(scene.images.len() as u32)?;
    scene.images.iter().try_for_each(|i| write_image(s, i))?;
    write_cloud(s, &scene.points)?;
    write_mesh(s, &scene.mesh)?;
    s.class(Class::Obb)?;
    if let StoredBox::Center { rotation, center, half_extent } = StoredBox::center_of(scene) {
        s.class(Class::EMat33f)?;
        s.f32s(&rotation)?;
        s.class(Class::EVec3f)?;
        s.f32s(&center)?;
        s.f32s(&half_extent)?;
    }
    Ok(())
}

fn write_string<S: Sink>(s: &mut S, value: &[u8]) -> Result<()> {
    s.class(Class::String)?;
    s.string(value)
}

fn write_matrix<S: Sink>(s: &mut S, class: Class, matrix: &[f64; 9]) -> Result<()> {
    s.class(class)?;
    s.class(Class::Matx33d)?;
    s.u64(9)?;
    s.f64s(matrix)
}

fn write_point<S: Sink>(s: &mut S, point: &[f64; 3]) -> Result<()> {
    s.class(Class::Point3d)?;
    s.class(Class::CvPoint3d)?;
    s.f64s(point)
}

fn write_platform<S: Sink>(s: &mut S, platform: &Platform) -> Result<()> {
    s.class(Class::Platform)?;
    write_string(s, &platform.name)?;
    s.class(Class::CameraList)?;
    s.u32(platform.cameras.len() as u32)?;
    for camera in &platform.cameras {
        s.class(Class::Camera)?;
        write_matrix(s, Class::KMatrix, &camera.normalized_k())?;
        write_matrix(s, Class::RMatrix, &camera.rotation)?;
        write_point(s, &camera.center)?;
    }
    s.class(Class::PoseList)?;
    s.u32(platform.poses.len() as u32)?;
    for pose in &platform.poses {
        s.class(Class::Pose)?;
        write_matrix(s, Class::RMatrix, &pose.rotation)?;
        write_point(s, &pose.center)?;
    }
    Ok(())
}

fn write_image<S: Sink>(s: &mut S, image: &Image) -> Result<()> {
    s.class(Class::Image)?;
    s.u32s(&[image.platform, image.camera, image.pose, image.id])?;
    write_string(s, &image.name)?;
    write_string(s, &image.mask_name)?;
    s.u32s(&[image.width, image.height])?;
    s.class(Class::ViewScoreList)?;
    s.u32(image.view_scores.len() as u32)?;
    for score in &image.view_scores {
        s.class(Class::ViewScore)?;
        s.u32s(&[score.image, score.points])?;
        s.f32s(&[score.scale, score.angle, score.area, score.score])?;
    }
    s.f32(image.avg_depth)
}

/// Vectors with a count of 64 or (in meshes) 32 bits.
fn write_vectors<S: Sink>(s: &mut S, class: Class, vectors: &[[f32; 3]]) -> Result<()> {
    s.class(class)?;
    if class == Class::PointList {
        s.u64(vectors.len() as u64)?
    } else {
        s.u32(vectors.len() as u32)?
    }
    if !vectors.is_empty() {
        s.class(Class::Point3f)?;
        s.class(Class::CvPoint3f)?;
    }
    s.f32s(vectors.as_flattened())
}

fn write_cloud<S: Sink>(s: &mut S, cloud: &PointCloud) -> Result<()> {
    s.class(Class::PointCloud)?;
    write_vectors(s, Class::PointList, &cloud.positions)?;
    let views = &cloud.views;
    s.class(Class::ViewsList)?;
    s.u64(views.len() as u64)?;
    for i in 0..views.len() {
        s.class(Class::ViewArr)?;
        let images = views.images_of(i);
        s.u32(images.len() as u32)?;
        s.u32s(images)?;
    }
    s.class(Class::WeightsList)?;
    let lists = if views.weights.is_empty() { 0 } else { views.len() };
    s.u64(lists as u64)?;
    for i in 0..lists {
        s.class(Class::WeightArr)?;
        let weights = views.weights_of(i);
        s.u32(weights.len() as u32)?;
        s.f32s(weights)?;
    }
    write_vectors(s, Class::PointList, &cloud.normals)?;
    s.class(Class::ColorList)?;
    s.u64(cloud.colors.len() as u64)?;
    write_colors(s, &cloud.colors)
}

fn write_colors<S: Sink>(s: &mut S, colors: &[[u8; 3]]) -> Result<()> {
    for &color in colors {
        s.class(Class::Pixel)?;
        s.color(color)?;
    }
    Ok(())
}

fn write_mesh<S: Sink>(s: &mut S, mesh: &Mesh) -> Result<()> {
    s.class(Class::Mesh)?;
    write_vectors(s, Class::MeshPointList, &mesh.vertices)?;
    s.class(Class::FaceList)?;
    s.u32(mesh.faces.len() as u32)?;
    if !mesh.faces.is_empty() {
        s.class(Class::Point3u)?;
        s.class(Class::CvPoint3u)?;
    }
    s.u32s(mesh.faces.as_flattened())?;
    write_vectors(s, Class::MeshPointList, &mesh.vertex_normals)?;
    write_lists(s, &mesh.vertex_vertices)?;
    write_lists(s, &mesh.vertex_faces)?;
    s.class(Class::BoolList)?;
    s.u64(mesh.vertex_boundary.len() as u64)?;
    mesh.vertex_boundary.iter().try_for_each(|&b| s.u8(b))?;
    write_vectors(s, Class::MeshPointList, &mesh.face_normals)?;
    s.class(Class::TexCoordList)?;
    s.u32(mesh.face_texcoords.len() as u32)?;
    if !mesh.face_texcoords.is_empty() {
        s.class(Class::Point2f)?;
        s.class(Class::CvPoint2f)?;
    }
    s.f32s(mesh.face_texcoords.as_flattened())?;
    s.class(Class::TexIndexList)?;
    s.u32(mesh.face_textures.len() as u32)?;
    mesh.face_textures.iter().try_for_each(|&t| s.u8(t))?;
    s.class(Class::TextureList)?;
    s.u8(mesh.textures.len() as u8)?;
    for texture in &mesh.textures {
        for class in [Class::Image8U3, Class::DMatrix8U3, Class::CvMat8U3] {
            s.class(class)?;
        }
        s.u32s(&[texture.width, texture.height])?;
        write_colors(s, &texture.pixels)?;
    }
    Ok(())
}

fn write_lists<S: Sink>(s: &mut S, lists: &IndexLists) -> Result<()> {
    s.class(Class::IdxListList)?;
    s.u32(lists.ends.len() as u32)?;
    for list in lists.iter() {
        s.class(Class::IdxList)?;
        s.u32(list.len() as u32)?;
        s.u32s(list)?;
    }
    Ok(())
}
