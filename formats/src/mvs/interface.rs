//! The MVSI interface archive, versions 0 to 7: reading and writing of every version.

use std::io::{Read, Write};

use super::boxes::StoredBox;
use super::scene::{Camera, Image, Line, NO_ID, Platform, PointCloud, Pose, Scene, ViewScore};
use crate::wire::{Place, Reader, Writer, vec3f};
use crate::{Error, Result};

/// First bytes of versions 1 and later.
pub(crate) const MAGIC: [u8; 4] = *b"MVSI";
/// Bytes before the body of versions 1 and later: magic, version, reserved.
pub(crate) const HEADER: usize = 12;
/// Newest version of the interface archive.
pub const NEWEST_VERSION: u32 = 7;

const ROOT: Place<'static> = Place::Root("");

/// Version and reserved word, from what follows the magic.
pub(crate) fn parse_header(head: &[u8]) -> Result<(u32, u32)> {
    let Some((&[v0, v1, v2, v3, reserved @ ..], _)) = head.split_first_chunk::<{ HEADER - 4 }>() else {
        let what = format!("file ends: the header has {HEADER} bytes, {} are there", head.len() + 4);
        return Err(Error::Format { offset: 0, field: "header".into(), what });
    };
    let version = u32::from_le_bytes([v0, v1, v2, v3]);
    if !(1..=NEWEST_VERSION).contains(&version) {
        return Err(Error::Unsupported(format!(
            "MVSI interface archive of version {version}; versions 0 to {NEWEST_VERSION} can be read"
        )));
    }
    Ok((version, u32::from_le_bytes(reserved)))
}

/// Reads the body that follows the header.
pub(crate) fn read_body<R: Read>(r: &mut Reader<R>, version: u32) -> Result<Scene> {
    if let Some(length) = r.remaining() {
        // The widest ratios of values to bytes: an image of version 0 has 20 bytes, a platform 24.
        r.cap_budget(length.saturating_mul(3).saturating_add(32 << 20));
    }
    let mut scene = Scene::default();
    let place = ROOT.field("platforms");
    scene.platforms = list(r, 24, &place, |r, at| read_platform(r, version, at))?;
    let place = ROOT.field("images");
    let image_size = [20, 20, 20, 24, 24, 32, 32, 52][version.min(7) as usize];
    scene.images = list(r, image_size, &place, |r, at| read_image(r, version, at))?;
    scene.points = read_points(r)?;
    if version >= 1 {
        scene.lines = list(r, 32, &ROOT.field("lines"), read_line)?;
        scene.line_normals = attribute(r, scene.lines.len(), "lines", &ROOT.field("linesNormal"), vec3f)?;
        scene.line_colors = attribute(r, scene.lines.len(), "lines", &ROOT.field("linesColor"), swapped)?;
    }
    if version >= 2 {
        scene.transform = r.f64s(&ROOT.field("transform"))?;
    }
    if version >= 6 {
        let place = ROOT.field("obb");
        let [rotation, min, max] = ["rot", "ptMin", "ptMax"].map(|name| place.field(name));
        StoredBox::Corners { rotation: r.f64s(&rotation)?, min: r.f64s(&min)?, max: r.f64s(&max)? }
            .store(&mut scene);
    }
    Ok(scene)
}

/// A counted list of elements of at least `min_size` bytes.
fn list<R: Read, T>(
    r: &mut Reader<R>,
    min_size: u64,
    place: &Place<'_>,
    mut element: impl FnMut(&mut Reader<R>, &Place<'_>) -> Result<T>,
) -> Result<Vec<T>> {
    let count = r.u64(place)?;
    let count = r.check_count(count, min_size, place)?;
    let mut out = Vec::new();
    r.room(&mut out, count, place)?;
    for i in 0..count {
        let value = element(r, &place.item(i))?;
        r.push(&mut out, value, place)?;
    }
    Ok(out)
}

/// A list that is empty or has one element of `N` bytes for each of `count` owners.
fn attribute<R: Read, T, const N: usize>(
    r: &mut Reader<R>,
    count: usize,
    owners: &str,
    place: &Place<'_>,
    decode: impl Fn(&[u8; N]) -> T,
) -> Result<Vec<T>> {
    let n = r.u64(place)?;
    if n != 0 && n != count as u64 {
        return Err(r.error(place, format!("{n} entries for {count} {owners}")));
    }
    r.vec(n, place, decode)
}

fn swapped(&[b, g, r]: &[u8; 3]) -> [u8; 3] {
    [r, g, b]
}

fn text<R: Read>(r: &mut Reader<R>, place: &Place<'_>) -> Result<Vec<u8>> {
    let length = r.u64(place)?;
    r.text(length, place)
}

fn read_platform<R: Read>(r: &mut Reader<R>, version: u32, at: &Place<'_>) -> Result<Platform> {
    let camera_size = [176, 184, 184, 184, 192, 192, 192, 192][version.min(7) as usize];
    Ok(Platform {
        name: text(r, &at.field("name"))?,
        cameras: list(r, camera_size, &at.field("cameras"), |r, at| read_camera(r, version, at))?,
        poses: list(r, 96, &at.field("poses"), |r, at| {
            Ok(Pose { rotation: r.f64s(&at.field("R"))?, center: r.f64s(&at.field("C"))? })
        })?,
    })
}

fn read_camera<R: Read>(r: &mut Reader<R>, version: u32, at: &Place<'_>) -> Result<Camera> {
    let name = text(r, &at.field("name"))?;
    let band = if version >= 4 { text(r, &at.field("bandName"))? } else { Vec::new() };
    let mut size = [0, 0];
    if version >= 1 {
        size = [r.u32(&at.field("width"))?, r.u32(&at.field("height"))?];
    }
    Ok(Camera {
        name,
        band,
        width: size[0],
        height: size[1],
        k: r.f64s(&at.field("K"))?,
        rotation: r.f64s(&at.field("R"))?,
        center: r.f64s(&at.field("C"))?,
    })
}

fn read_image<R: Read>(r: &mut Reader<R>, version: u32, at: &Place<'_>) -> Result<Image> {
    let mut image = Image { name: text(r, &at.field("name"))?, ..Image::default() };
    if version >= 5 {
        image.mask_name = text(r, &at.field("maskName"))?;
    }
    image.platform = r.u32(&at.field("platformID"))?;
    image.camera = r.u32(&at.field("cameraID"))?;
    image.pose = r.u32(&at.field("poseID"))?;
    image.id = if version >= 3 { r.u32(&at.field("ID"))? } else { NO_ID };
    if version >= 7 {
        image.min_depth = r.f32(&at.field("minDepth"))?;
        image.avg_depth = r.f32(&at.field("avgDepth"))?;
        image.max_depth = r.f32(&at.field("maxDepth"))?;
        image.view_scores = list(r, 24, &at.field("viewScores"), |r, at| {
            let (image, points) = (r.u32(&at.field("ID"))?, r.u32(&at.field("points"))?);
            let [scale, angle, area, score] = r.f32s(at)?;
            Ok(ViewScore { image, points, scale, angle, area, score })
        })?;
    }
    Ok(image)
}

/// Vertices, their views and attributes. Views stay in file order; confidences that are all 0 (not
/// available) become an empty list.
fn read_points<R: Read>(r: &mut Reader<R>) -> Result<PointCloud> {
    let place = ROOT.field("vertices");
    let count = r.u64(&place)?;
    let count = r.check_count(count, 20, &place)?;
    let mut cloud = PointCloud::default();
    r.room(&mut cloud.positions, count, &place)?;
    let views = &mut cloud.views;
    if count > 0 {
        r.room(&mut views.offsets, count + 1, &place)?;
        views.offsets.push(0);
    }
    for i in 0..count {
        let at = place.item(i);
        cloud.positions.push(vec3f(&r.array(&at.field("X"))?));
        let at = at.field("views");
        let n = r.u64(&at)?;
        let n = r.check_count(n, 8, &at)?;
        r.grow(&mut views.images, n, &at)?;
        r.grow(&mut views.weights, n, &at)?;
        r.for_each_block(n, &at, |pairs: &[[u8; 8]]| {
            views.images.extend(pairs.iter().map(|&[a, b, c, d, ..]| u32::from_le_bytes([a, b, c, d])));
            views.weights.extend(pairs.iter().map(|&[.., e, f, g, h]| f32::from_le_bytes([e, f, g, h])));
        })?;
        views.offsets.push(views.images.len() as u64);
    }
    if views.weights.iter().all(|w| w.to_bits() == 0) {
        views.weights = Vec::new();
    }
    cloud.normals = attribute(r, count, "vertices", &ROOT.field("verticesNormal"), vec3f)?;
    cloud.colors = attribute(r, count, "vertices", &ROOT.field("verticesColor"), swapped)?;
    Ok(cloud)
}

fn read_line<R: Read>(r: &mut Reader<R>, at: &Place<'_>) -> Result<Line> {
    let (start, end) = (r.f32s(&at.field("pt1"))?, r.f32s(&at.field("pt2"))?);
    let views = list(r, 8, &at.field("views"), |r, at| Ok((r.u32(at)?, r.f32(at)?)))?;
    Ok(Line { start, end, views })
}

/// Writes an interface archive of the given version, 0 to [`NEWEST_VERSION`].
///
/// Fields younger than the version are left out; version 0, which has no resolutions, gets normalised
/// intrinsics. Confidences that the scene lacks are written as 0 (not available).
///
/// # Errors
/// [`Error::Unsupported`] for an unknown version or a scene with a mesh; [`Error::Invalid`] for indices out of
/// range or attributes of a wrong length; [`Error::Io`].
pub fn write_interface(out: impl Write, scene: &Scene, version: u32) -> Result<()> {
    scene.check_lengths()?;
    scene.check_indices()?;
    write(out, scene, version, 0)
}

/// [`write_interface`] with the header's reserved word, and indices as they are.
pub(crate) fn write(out: impl Write, scene: &Scene, version: u32, reserved: u32) -> Result<()> {
    if version > NEWEST_VERSION {
        return Err(Error::Unsupported(format!(
            "MVSI version {version} cannot be written; choose 0 to {NEWEST_VERSION}"
        )));
    }
    if !scene.mesh.is_empty() {
        let what = "a scene with a mesh cannot be an interface archive; write a native archive";
        return Err(Error::Unsupported(what.into()));
    }
    scene.check_lengths()?;
    let mut writer = Writer::new(out);
    let w = &mut writer;
    if version >= 1 {
        w.bytes(&MAGIC)?;
        w.u32(version)?;
        w.u32(reserved)?;
    }
    w.u64(scene.platforms.len() as u64)?;
    scene.platforms.iter().try_for_each(|p| write_platform(w, p, version))?;
    w.u64(scene.images.len() as u64)?;
    scene.images.iter().try_for_each(|i| write_image(w, i, version))?;
    write_points(w, &scene.points)?;
    if version >= 1 {
        write_lines(w, scene)?;
    }
    if version >= 2 {
        w.f64s(&scene.transform)?;
    }
    if version >= 6 {
        write_box(w, scene)?;
    }
    writer.finish()
}

fn write_text<W: Write>(w: &mut Writer<W>, text: &[u8]) -> Result<()> {
    w.u64(text.len() as u64)?;
    w.bytes(text)
}

fn write_platform<W: Write>(w: &mut Writer<W>, platform: &Platform, version: u32) -> Result<()> {
    write_text(w, &platform.name)?;
    w.u64(platform.cameras.len() as u64)?;
    for camera in &platform.cameras {
        write_text(w, &camera.name)?;
        if version >= 4 {
            write_text(w, &camera.band)?;
        }
        if version >= 1 {
            w.u32(camera.width)?;
            w.u32(camera.height)?;
        }
        w.f64s(&if version >= 1 { camera.k } else { camera.normalized_k() })?;
        w.f64s(&camera.rotation)?;
        w.f64s(&camera.center)?;
    }
    w.u64(platform.poses.len() as u64)?;
    for pose in &platform.poses {
        w.f64s(&pose.rotation)?;
        w.f64s(&pose.center)?;
    }
    Ok(())
}

fn write_image<W: Write>(w: &mut Writer<W>, image: &Image, version: u32) -> Result<()> {
    write_text(w, &image.name)?;
    if version >= 5 {
        write_text(w, &image.mask_name)?;
    }
    w.u32(image.platform)?;
    w.u32(image.camera)?;
    w.u32(image.pose)?;
    if version >= 3 {
        w.u32(image.id)?;
    }
    if version >= 7 {
        w.f32s(&[image.min_depth, image.avg_depth, image.max_depth])?;
        w.u64(image.view_scores.len() as u64)?;
        for s in &image.view_scores {
            w.u32(s.image)?;
            w.u32(s.points)?;
            w.f32s(&[s.scale, s.angle, s.area, s.score])?;
        }
    }
    Ok(())
}

fn write_points<W: Write>(w: &mut Writer<W>, cloud: &PointCloud) -> Result<()> {
    w.u64(cloud.positions.len() as u64)?;
    for (i, position) in cloud.positions.iter().enumerate() {
        let (images, weights) = (cloud.views.images_of(i), cloud.views.weights_of(i));
        w.f32s(position)?;
        w.u64(images.len() as u64)?;
        for (j, &image) in images.iter().enumerate() {
            w.u32(image)?;
            w.f32s(&[weights.get(j).copied().unwrap_or(0.0)])?;
        }
    }
    write_vectors(w, &cloud.normals)?;
    write_colors(w, &cloud.colors)
}

fn write_lines<W: Write>(w: &mut Writer<W>, scene: &Scene) -> Result<()> {
    w.u64(scene.lines.len() as u64)?;
    for line in &scene.lines {
        w.f32s(&line.start)?;
        w.f32s(&line.end)?;
        w.u64(line.views.len() as u64)?;
        for &(image, confidence) in &line.views {
            w.u32(image)?;
            w.f32s(&[confidence])?;
        }
    }
    write_vectors(w, &scene.line_normals)?;
    write_colors(w, &scene.line_colors)
}

fn write_vectors<W: Write>(w: &mut Writer<W>, vectors: &[[f32; 3]]) -> Result<()> {
    w.u64(vectors.len() as u64)?;
    w.f32s(vectors.as_flattened())
}

fn write_colors<W: Write>(w: &mut Writer<W>, colors: &[[u8; 3]]) -> Result<()> {
    w.u64(colors.len() as u64)?;
    colors.iter().try_for_each(|c| w.bytes(&swapped(c)))
}

fn write_box<W: Write>(w: &mut Writer<W>, scene: &Scene) -> Result<()> {
    if let StoredBox::Corners { rotation, min, max } = StoredBox::corners_of(scene) {
        w.f64s(&rotation)?;
        w.f64s(&min)?;
        w.f64s(&max)?;
    }
    Ok(())
}
