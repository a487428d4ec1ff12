//! Whether a scene can be used: indices, lengths, numbers.

use super::boxes::is_orthonormal;
use super::mesh::Mesh;
use super::scene::{Camera, Image, NO_ID, Scene, Visibility};
use crate::wire::Place;
use crate::{Error, Result};

/// Largest image side that is believed.
const MAX_SIDE: u32 = 65_535;

/// Focal lengths that are believed, in units of the longer image side; 0.5 to 5 are usual.
const FOCAL: std::ops::Range<f64> = 1e-3..1e5;
/// Largest difference of the lower entries of intrinsics from 0, 0, 0, 1.
const LAST_ROW_TOLERANCE: f64 = 1e-6;
/// Largest coordinate of a camera centre; geocentric coordinates in millimetres are below 1e10.
const FARTHEST: f64 = 1e12;

const ROOT: Place<'static> = Place::Root("");

fn invalid(place: &Place<'_>, what: impl Into<String>) -> Error {
    Error::Invalid { field: place.to_string(), what: what.into() }
}

impl Scene {
    /// Checks what no program can work around: every index of a calibrated image, the lengths of attributes, the
    /// intrinsics, rotations and centres of cameras and poses that a calibrated image uses, and image names.
    ///
    /// Reading a file does not call this, so that damaged scenes can be inspected and rewritten.
    /// Flaws that can be dropped without losing the scene are the business of [`Scene::repair`], to be called first.
    ///
    /// # Errors
    /// [`Error::Invalid`] naming the first bad value, such as `images[3].camera`.
    pub fn check(&self) -> Result<()> {
        self.check_lengths()?;
        self.check_indices()?;
        let place = ROOT.field("images");
        for (i, image) in self.images.iter().enumerate() {
            let at = place.item(i);
            check_name(&image.name, &at.field("name"))?;
            check_name(&image.mask_name, &at.field("maskName"))?;
            if (image.width == 0) != (image.height == 0) || image.width.max(image.height) > MAX_SIDE {
                return Err(invalid(&at, format!("size {}×{} is not possible", image.width, image.height)));
            }
        }
        let used = self.used_cameras_and_poses();
        for (p, (platform, (cameras, poses))) in self.platforms.iter().zip(&used).enumerate() {
            let platforms = ROOT.field("platforms");
            let at = platforms.item(p);
            let place = at.field("cameras");
            for (c, camera) in platform.cameras.iter().enumerate().filter(|&(c, _)| cameras[c]) {
                check_camera(camera, &place.item(c))?;
            }
            let place = at.field("poses");
            for (i, pose) in platform.poses.iter().enumerate().filter(|&(i, _)| poses[i]) {
                let at = place.item(i);
                check_rotation(&pose.rotation, &at.field("R"))?;
                check_center(&pose.center, &at.field("C"))?;
            }
        }
        Ok(())
    }

    /// For each platform, which of its cameras and poses a calibrated image uses.
    fn used_cameras_and_poses(&self) -> Vec<(Vec<bool>, Vec<bool>)> {
        let mut used: Vec<_> = self
            .platforms
            .iter()
            .map(|p| (vec![false; p.cameras.len()], vec![false; p.poses.len()]))
            .collect();
        for image in self.images.iter().filter(|i| i.pose != NO_ID) {
            if let Some((cameras, poses)) = used.get_mut(image.platform as usize) {
                cameras.get_mut(image.camera as usize).into_iter().for_each(|c| *c = true);
                poses.get_mut(image.pose as usize).into_iter().for_each(|p| *p = true);
            }
        }
        used
    }

    /// Checks the lengths of attributes, without which no file can be written.
    pub(crate) fn check_lengths(&self) -> Result<()> {
        let points = self.points.positions.len();
        check_views(&self.points.views, points)?;
        check_length(self.points.normals.len(), points, "points", "verticesNormal")?;
        check_length(self.points.colors.len(), points, "points", "verticesColor")?;
        check_length(self.line_normals.len(), self.lines.len(), "lines", "linesNormal")?;
        check_length(self.line_colors.len(), self.lines.len(), "lines", "linesColor")?;
        check_mesh_lengths(&self.mesh)
    }

    /// Checks the indices, which programs that read a scene trust; lengths must have been checked.
    pub(crate) fn check_indices(&self) -> Result<()> {
        let place = ROOT.field("images");
        for (i, image) in self.images.iter().enumerate() {
            self.check_image_indices(image, &place.item(i))?;
        }
        let images = self.images.len();
        let views = &self.points.views;
        if let Some(entry) = views.images.iter().position(|&i| i as usize >= images) {
            let point = views.offsets.partition_point(|&o| o <= entry as u64) - 1;
            let place = ROOT.field("vertices");
            check_index(views.images[entry], images, "images", &place.item(point).field("views"))?;
        }
        let place = ROOT.field("lines");
        for (i, line) in self.lines.iter().enumerate() {
            for &(image, _) in &line.views {
                check_index(image, images, "images", &place.item(i).field("views"))?;
            }
        }
        check_mesh_indices(&self.mesh)
    }

    fn check_image_indices(&self, image: &Image, at: &Place<'_>) -> Result<()> {
        for (i, score) in image.view_scores.iter().enumerate() {
            check_index(score.image, self.images.len(), "images", &at.field("viewScores").item(i))?;
        }
        if image.pose == NO_ID {
            return Ok(());
        }
        check_index(image.platform, self.platforms.len(), "platforms", &at.field("platform"))?;
        let platform = &self.platforms[image.platform as usize];
        check_index(image.camera, platform.cameras.len(), "cameras of its platform", &at.field("camera"))?;
        check_index(image.pose, platform.poses.len(), "poses of its platform", &at.field("pose"))
    }
}

fn check_views(views: &Visibility, points: usize) -> Result<()> {
    let place = ROOT.field("views");
    let lists = views.len();
    let ordered = views.offsets.is_sorted()
        && views.offsets.first().is_none_or(|&o| o == 0)
        && views.offsets.last().copied().unwrap_or(0) == views.images.len() as u64;
    if !ordered || (lists != 0 && lists != points) {
        return Err(invalid(&place, format!("{lists} lists of views do not fit {points} points")));
    }
    if !views.weights.is_empty() && views.weights.len() != views.images.len() {
        let (weights, images) = (views.weights.len(), views.images.len());
        return Err(invalid(&place, format!("{weights} weights for {images} views")));
    }
    Ok(())
}

fn check_mesh_lengths(mesh: &Mesh) -> Result<()> {
    let (vertices, faces) = (mesh.vertices.len(), mesh.faces.len());
    check_length(mesh.vertex_normals.len(), vertices, "vertices", "mesh.vertexNormals")?;
    check_length(mesh.vertex_vertices.ends.len(), vertices, "vertices", "mesh.vertexVertices")?;
    check_length(mesh.vertex_faces.ends.len(), vertices, "vertices", "mesh.vertexFaces")?;
    check_length(mesh.vertex_boundary.len(), vertices, "vertices", "mesh.vertexBoundary")?;
    check_length(mesh.face_normals.len(), faces, "faces", "mesh.faceNormals")?;
    check_length(mesh.face_texcoords.len(), faces.saturating_mul(3), "face corners", "mesh.faceTexcoords")?;
    check_length(mesh.face_textures.len(), faces, "faces", "mesh.faceTexindices")?;
    for (field, lists) in [("vertexVertices", &mesh.vertex_vertices), ("vertexFaces", &mesh.vertex_faces)] {
        if !lists.ends.is_sorted() || lists.ends.last().copied().unwrap_or(0) != lists.indices.len() as u64 {
            return Err(invalid(&ROOT.field("mesh").field(field), "the ends of its lists are out of order"));
        }
    }
    let place = ROOT.field("mesh");
    let place = place.field("textures");
    if mesh.textures.len() > 255 {
        return Err(invalid(&place, format!("{} textures, at most 255 are possible", mesh.textures.len())));
    }
    for (i, texture) in mesh.textures.iter().enumerate() {
        let (w, h, pixels) = (texture.width, texture.height, texture.pixels.len());
        if w == 0 || h == 0 || w.max(h) > i32::MAX as u32 || u64::from(w) * u64::from(h) != pixels as u64 {
            return Err(invalid(&place.item(i), format!("{pixels} pixels do not make a picture of {w}×{h}")));
        }
    }
    Ok(())
}

fn check_mesh_indices(mesh: &Mesh) -> Result<()> {
    let (vertices, faces) = (mesh.vertices.len(), mesh.faces.len());
    let place = ROOT.field("mesh");
    let all = |indices: &[u32], count: usize, of: &str, field: &'static str| {
        indices.iter().try_for_each(|&i| check_index(i, count, of, &place.field(field)))
    };
    all(mesh.faces.as_flattened(), vertices, "vertices", "faces")?;
    all(&mesh.vertex_vertices.indices, vertices, "vertices", "vertexVertices")?;
    all(&mesh.vertex_faces.indices, faces, "faces", "vertexFaces")?;
    let textures = mesh.textures.len();
    mesh.face_textures
        .iter()
        .try_for_each(|&t| check_index(t.into(), textures, "textures", &place.field("faceTexindices")))
}

fn check_index(index: u32, count: usize, of: &str, place: &Place<'_>) -> Result<()> {
    if (index as usize) < count {
        return Ok(());
    }
    Err(invalid(place, format!("index {index} is out of range, there are {count} {of}")))
}

fn check_length(entries: usize, owners: usize, of: &str, field: &'static str) -> Result<()> {
    if entries == 0 || entries == owners {
        return Ok(());
    }
    Err(invalid(&ROOT.field(field), format!("{entries} entries for {owners} {of}")))
}

fn check_name(name: &[u8], place: &Place<'_>) -> Result<()> {
    match name.iter().position(|&b| b == 0) {
        None => Ok(()),
        Some(at) => Err(invalid(place, format!("a path cannot hold a zero byte (position {at})"))),
    }
}

fn check_camera(camera: &Camera, at: &Place<'_>) -> Result<()> {
    let (w, h) = (camera.width, camera.height);
    if (w == 0) != (h == 0) || w.max(h) > MAX_SIDE {
        return Err(invalid(at, format!("resolution {w}×{h} is not possible")));
    }
    let place = at.field("K");
    check_intrinsics(camera, &place)?;
    check_rotation(&camera.rotation, &at.field("R"))?;
    check_center(&camera.center, &at.field("C"))
}

/// Positive focal lengths of a believable size, and a last row of 0, 0, 1.
fn check_intrinsics(camera: &Camera, place: &Place<'_>) -> Result<()> {
    let k = &camera.k;
    check_finite(k, place)?;
    if k[0] <= 0.0 || k[4] <= 0.0 {
        return Err(invalid(
            place,
            format!("focal lengths must be positive, they are {} and {}", k[0], k[4]),
        ));
    }
    let side = f64::from(camera.width.max(camera.height).max(1));
    if [k[0], k[4]].iter().any(|f| !FOCAL.contains(&(f / side))) {
        let what = format!("focal lengths {} and {} are impossible for images of {side} pixels", k[0], k[4]);
        return Err(invalid(place, what));
    }
    if [k[1], k[2], k[5]].iter().any(|v| v.abs() > FOCAL.end * side) {
        let what = format!("skew {} or principal point ({}, {}) is impossible", k[1], k[2], k[5]);
        return Err(invalid(place, what));
    }
    let below = [k[3], k[6], k[7], k[8] - 1.0];
    if below.iter().any(|v| v.abs() > LAST_ROW_TOLERANCE) {
        let what =
            format!("not of the form [f s c; 0 f c; 0 0 1]: {}, {}, {}, {} below", k[3], k[6], k[7], k[8]);
        return Err(invalid(place, what));
    }
    Ok(())
}

/// Finite, and near enough for double precision to tell two cameras apart.
fn check_center(center: &[f64; 3], place: &Place<'_>) -> Result<()> {
    check_finite(center, place)?;
    match center.iter().find(|v| v.abs() > FARTHEST) {
        Some(v) => Err(invalid(place, format!("{v} is too far from the origin, {FARTHEST:e} is the limit"))),
        None => Ok(()),
    }
}

fn check_finite(values: &[f64], place: &Place<'_>) -> Result<()> {
    match values.iter().find(|v| !v.is_finite()) {
        None => Ok(()),
        Some(v) => Err(invalid(place, format!("{v} is not a finite number"))),
    }
}

fn check_rotation(r: &[f64; 9], place: &Place<'_>) -> Result<()> {
    check_finite(r, place)?;
    let det = r[0] * (r[4] * r[8] - r[5] * r[7]) - r[1] * (r[3] * r[8] - r[5] * r[6])
        + r[2] * (r[3] * r[7] - r[4] * r[6]);
    if !is_orthonormal(r) || det <= 0.0 {
        return Err(invalid(place, format!("not a rotation (determinant {det:.6})")));
    }
    Ok(())
}
