//! Reading of the body of a native project.

use super::super::boost::{Class, Source};
use super::super::boxes::StoredBox;
use super::super::mesh::{IndexLists, Mesh, Texture};
use super::super::scene::{Camera, Image, Platform, PointCloud, Pose, Scene, ViewScore, Visibility};
use crate::Result;
use crate::wire::Place;

const ROOT: Place<'static> = Place::Root("");

/// Reads a whole scene.
pub(super) fn read_scene<S: Source>(s: &mut S) -> Result<Scene> {
    s.class(Class::Scene, &ROOT.field("scene"))?;
    let mut scene = Scene {
        platforms: list(s, Class::PlatformList, 16, &ROOT.field("platforms"), read_platform)?,
        images: list(s, Class::ImageList, 48, &ROOT.field("images"), read_image)?,
        ..Scene::default()
    };
    scene.points = read_cloud(s, &ROOT.field("pointcloud"))?;
    scene.mesh = read_mesh(s, &ROOT.field("mesh"))?;
    let place = ROOT.field("obb");
    s.class(Class::Obb, &place)?;
    s.class(Class::EMat33f, &place)?;
    let rotation = s.f32_array(&place.field("rot"))?;
    s.class(Class::EVec3f, &place)?;
    let center = s.f32_array(&place.field("pos"))?;
    StoredBox::Center { rotation, center, half_extent: s.f32_array(&place.field("ext"))? }.store(&mut scene);
    Ok(scene)
}

/// A list with a 32-bit count, of elements of at least `min_size` bytes.
fn list<S: Source, T>(
    s: &mut S,
    class: Class,
    min_size: u64,
    place: &Place<'_>,
    element: impl Fn(&mut S, &Place<'_>) -> Result<T>,
) -> Result<Vec<T>> {
    s.class(class, place)?;
    let count = s.u32(place)?;
    let mut out = Vec::new();
    for i in 0..s.room(&mut out, count.into(), min_size, place)? {
        let value = element(s, &place.item(i))?;
        s.push(&mut out, value, place)?;
    }
    Ok(out)
}

fn string<S: Source>(s: &mut S, place: &Place<'_>) -> Result<Vec<u8>> {
    s.class(Class::String, place)?;
    s.string(place)
}

fn matrix<S: Source>(s: &mut S, class: Class, place: &Place<'_>) -> Result<[f64; 9]> {
    s.class(class, place)?;
    s.class(Class::Matx33d, place)?;
    s.constant(9, place)?;
    s.f64_array(place)
}

fn point<S: Source>(s: &mut S, place: &Place<'_>) -> Result<[f64; 3]> {
    s.class(Class::Point3d, place)?;
    s.class(Class::CvPoint3d, place)?;
    s.f64_array(place)
}

fn read_platform<S: Source>(s: &mut S, at: &Place<'_>) -> Result<Platform> {
    s.class(Class::Platform, at)?;
    Ok(Platform {
        name: string(s, &at.field("name"))?,
        cameras: list(s, Class::CameraList, 184, &at.field("cameras"), |s, at| {
            s.class(Class::Camera, at)?;
            Ok(Camera {
                k: matrix(s, Class::KMatrix, &at.field("K"))?,
                rotation: matrix(s, Class::RMatrix, &at.field("R"))?,
                center: point(s, &at.field("C"))?,
                ..Camera::default()
            })
        })?,
        poses: list(s, Class::PoseList, 104, &at.field("poses"), |s, at| {
            s.class(Class::Pose, at)?;
            let rotation = matrix(s, Class::RMatrix, &at.field("R"))?;
            Ok(Pose { rotation, center: point(s, &at.field("C"))? })
        })?,
    })
}

fn read_image<S: Source>(s: &mut S, at: &Place<'_>) -> Result<Image> {
    s.class(Class::Image, at)?;
    Ok(Image {
        platform: s.u32(&at.field("platformID"))?,
        camera: s.u32(&at.field("cameraID"))?,
        pose: s.u32(&at.field("poseID"))?,
        id: s.u32(&at.field("ID"))?,
        name: string(s, &at.field("name"))?,
        mask_name: string(s, &at.field("maskName"))?,
        width: s.u32(&at.field("width"))?,
        height: s.u32(&at.field("height"))?,
        view_scores: list(s, Class::ViewScoreList, 24, &at.field("viewScores"), |s, at| {
            s.class(Class::ViewScore, at)?;
            let (image, points) = (s.u32(&at.field("ID"))?, s.u32(&at.field("points"))?);
            let [scale, angle, area, score] = s.f32_array(at)?;
            Ok(ViewScore { image, points, scale, angle, area, score })
        })?,
        avg_depth: s.f32(&at.field("avgDepth"))?,
        ..Image::default()
    })
}

/// Vectors with a count of 64 or (in meshes) 32 bits.
fn vectors<S: Source>(s: &mut S, class: Class, place: &Place<'_>) -> Result<Vec<[f32; 3]>> {
    s.class(class, place)?;
    let count = if class == Class::PointList { s.u64(place)? } else { s.u32(place)?.into() };
    let mut out = Vec::new();
    if count > 0 {
        s.class(Class::Point3f, place)?;
        s.class(Class::CvPoint3f, place)?;
        s.vectors(&mut out, count, place)?;
    }
    Ok(out)
}

fn read_cloud<S: Source>(s: &mut S, at: &Place<'_>) -> Result<PointCloud> {
    s.class(Class::PointCloud, at)?;
    let positions = vectors(s, Class::PointList, &at.field("points"))?;
    let mut views = read_views(s, positions.len(), &at.field("pointViews"))?;
    read_weights(s, &mut views, &at.field("pointWeights"))?;
    let place = at.field("normals");
    let normals = vectors(s, Class::PointList, &place)?;
    attribute(s, normals.len(), positions.len(), &place)?;
    let place = at.field("colors");
    s.class(Class::ColorList, &place)?;
    let count = s.u64(&place)?;
    let mut colors = Vec::new();
    if count > 0 {
        s.class(Class::Pixel, &place)?;
        s.colors(&mut colors, count, &place)?;
    }
    attribute(s, colors.len(), positions.len(), &place)?;
    Ok(PointCloud { positions, views, normals, colors })
}

/// Checks that an attribute is absent or complete.
fn attribute<S: Source>(s: &S, entries: usize, owners: usize, place: &Place<'_>) -> Result<()> {
    if entries == 0 || entries == owners {
        return Ok(());
    }
    Err(s.error(place, format!("{entries} entries for {owners} elements")))
}

fn read_views<S: Source>(s: &mut S, points: usize, place: &Place<'_>) -> Result<Visibility> {
    s.class(Class::ViewsList, place)?;
    let count = s.u64(place)?;
    let mut views = Visibility::default();
    if count == 0 {
        return Ok(views);
    }
    let count = s.room(&mut views.offsets, count, 4, place)?;
    attribute(s, count, points, place)?;
    s.push(&mut views.offsets, 0, place)?;
    s.class(Class::ViewArr, place)?;
    for i in 0..count {
        let at = place.item(i);
        let n = s.u32(&at)?;
        s.u32s(&mut views.images, n.into(), &at)?;
        s.push(&mut views.offsets, views.images.len() as u64, &at)?;
    }
    Ok(views)
}

fn read_weights<S: Source>(s: &mut S, views: &mut Visibility, place: &Place<'_>) -> Result<()> {
    s.class(Class::WeightsList, place)?;
    let count = s.u64(place)?;
    if count == 0 {
        return Ok(());
    }
    if count != views.len() as u64 {
        return Err(s.error(place, format!("{count} lists of weights for {} lists of views", views.len())));
    }
    s.class(Class::WeightArr, place)?;
    for i in 0..views.len() {
        let at = place.item(i);
        let (n, expected) = (s.u32(&at)?, views.range(i).len());
        if n as usize != expected {
            return Err(s.error(&at, format!("{n} weights for {expected} views")));
        }
        s.f32s(&mut views.weights, n.into(), &at)?;
    }
    Ok(())
}

fn read_mesh<S: Source>(s: &mut S, at: &Place<'_>) -> Result<Mesh> {
    s.class(Class::Mesh, at)?;
    let mut mesh =
        Mesh { vertices: vectors(s, Class::MeshPointList, &at.field("vertices"))?, ..Mesh::default() };
    let place = at.field("faces");
    s.class(Class::FaceList, &place)?;
    let count = s.u32(&place)?;
    if count > 0 {
        s.class(Class::Point3u, &place)?;
        s.class(Class::CvPoint3u, &place)?;
        s.triples(&mut mesh.faces, count.into(), &place)?;
    }
    mesh.vertex_normals = vectors(s, Class::MeshPointList, &at.field("vertexNormals"))?;
    mesh.vertex_vertices = read_lists(s, &at.field("vertexVertices"))?;
    mesh.vertex_faces = read_lists(s, &at.field("vertexFaces"))?;
    let place = at.field("vertexBoundary");
    s.class(Class::BoolList, &place)?;
    let count = s.u64(&place)?;
    s.u8s(&mut mesh.vertex_boundary, count, &place)?;
    mesh.face_normals = vectors(s, Class::MeshPointList, &at.field("faceNormals"))?;
    let place = at.field("faceTexcoords");
    s.class(Class::TexCoordList, &place)?;
    let count = s.u32(&place)?;
    if count > 0 {
        s.class(Class::Point2f, &place)?;
        s.class(Class::CvPoint2f, &place)?;
        for _ in 0..s.room(&mut mesh.face_texcoords, count.into(), 8, &place)? {
            let coordinates = s.f32_array(&place)?;
            s.push(&mut mesh.face_texcoords, coordinates, &place)?;
        }
    }
    let place = at.field("faceTexindices");
    s.class(Class::TexIndexList, &place)?;
    let count = s.u32(&place)?;
    s.u8s(&mut mesh.face_textures, count.into(), &place)?;
    let place = at.field("textures");
    s.class(Class::TextureList, &place)?;
    for i in 0..s.u8(&place)? {
        mesh.textures.push(read_texture(s, &place.item(i.into()))?);
    }
    Ok(mesh)
}

fn read_lists<S: Source>(s: &mut S, place: &Place<'_>) -> Result<IndexLists> {
    s.class(Class::IdxListList, place)?;
    let count = s.u32(place)?;
    let mut lists = IndexLists::default();
    if count > 0 {
        s.class(Class::IdxList, place)?;
    }
    for i in 0..s.room(&mut lists.ends, count.into(), 4, place)? {
        let at = place.item(i);
        let n = s.u32(&at)?;
        s.u32s(&mut lists.indices, n.into(), &at)?;
        s.push(&mut lists.ends, lists.indices.len() as u64, &at)?;
    }
    Ok(lists)
}

fn read_texture<S: Source>(s: &mut S, at: &Place<'_>) -> Result<Texture> {
    for class in [Class::Image8U3, Class::DMatrix8U3, Class::CvMat8U3] {
        s.class(class, at)?;
    }
    let (width, height) = (s.u32(&at.field("cols"))?, s.u32(&at.field("rows"))?);
    if width == 0 || height == 0 || width.max(height) > i32::MAX as u32 {
        return Err(s.error(at, format!("a texture of {width}×{height} pixels is not possible")));
    }
    let mut pixels = Vec::new();
    s.class(Class::Pixel, at)?;
    s.colors(&mut pixels, u64::from(width) * u64::from(height), at)?;
    Ok(Texture { width, height, pixels })
}
