//! The depth and normal maps of COLMAP's dense stage as depth estimates.

use super::{Pass, Workspace};
use crate::error::{Error, Result};
use crate::geometry::{Camera, Size};
use crate::scene::{DepthEstimate, Grid, ImageId, NormalMap, Scene};
use crate::store::atomic::AtomicFile;
use semvs_formats::Limits;
use semvs_formats::colmap::{Matrix, read_matrix_size};
use std::collections::BTreeMap;
use std::fs::File;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

/// A depth further from the sparse points of its view than this factor is an uninitialised pixel.
const BEYOND_POINTS: f32 = 100.0;
/// Lengths of stored normals that are taken for unit vectors, rounding aside.
const UNIT_LENGTH: RangeInclusive<f32> = 0.99..=1.01;

/// The maps of one pass in a workspace. They are only read.
#[derive(Clone, Debug)]
pub struct ColmapMaps {
    stereo: PathBuf,
    pass: Pass,
    views: BTreeMap<ImageId, MapView>,
}

#[derive(Clone, Debug)]
struct MapView {
    /// Name of the image in the scene.
    scene_name: String,
    /// Name of the image in the workspace.
    name: String,
    /// At the size of the image.
    camera: Camera,
    /// Depths that can be meant.
    plausible: RangeInclusive<f32>,
}

/// What a map of COLMAP says before its values.
#[derive(Clone, Debug)]
pub struct ColmapMapHeader {
    /// The camera at the size of the map: intrinsics are scaled per axis.
    pub camera: Camera,
    /// Name of the image in the scene.
    pub image_name: String,
    /// Whether there is a normal map.
    pub has_normal: bool,
}

impl ColmapMaps {
    /// The maps that `pass` left in `workspace` for the calibrated views of `scene`, which is the workspace's.
    pub fn new(workspace: &Workspace, pass: Pass, scene: &Scene) -> Self {
        Self::of_scene(workspace, pass, scene, &workspace.root)
    }

    /// [`ColmapMaps::new`] for a scene whose names are relative to `folder`.
    pub fn of_scene(workspace: &Workspace, pass: Pass, scene: &Scene, folder: &Path) -> Self {
        let prefix = workspace.image_prefix(folder);
        let ranges = plausible_depths(scene);
        let views = scene.views.iter().zip(ranges).filter_map(|(view, plausible)| {
            let calibration = view.calibration.as_ref()?;
            let name = view.name.strip_prefix(&prefix).unwrap_or(&view.name).to_owned();
            let camera = calibration.camera_at(calibration.size?);
            Some((view.id, MapView { scene_name: view.name.clone(), name, camera, plausible }))
        });
        ColmapMaps { stereo: workspace.stereo(), pass, views: views.collect() }
    }

    /// Whether the workspace has any depth map of this pass.
    pub fn any(&self) -> bool {
        self.views.keys().any(|&id| self.path(id).is_some_and(|path| path.is_file()))
    }

    /// The folder of the depth maps.
    pub fn folder(&self) -> PathBuf {
        self.stereo.join("depth_maps")
    }

    /// The depth map of a view of the scene, be it there or not.
    pub fn path(&self, id: ImageId) -> Option<PathBuf> {
        self.views.get(&id).map(|view| depth_map_path(&self.stereo, &view.name, self.pass))
    }

    /// What the depth map of a view says before its values; `None` if there is none.
    ///
    /// # Errors
    /// The file cannot be read or is no map, or has another shape than the camera.
    pub fn header(&self, id: ImageId) -> Result<Option<ColmapMapHeader>> {
        let Some(view) = self.views.get(&id) else { return Ok(None) };
        let path = depth_map_path(&self.stereo, &view.name, self.pass);
        let file = match File::open(&path) {
            Ok(file) => file,
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            Err(e) => return Err(Error::io(&path, "open", e)),
        };
        let length = file.metadata().map_err(|e| Error::io(&path, "read", e))?.len();
        let [width, height, channels] =
            read_matrix_size(file, Some(length)).map_err(|e| Error::format(&path, e))?;
        if channels != 1 {
            return Err(Error::content(&path, format!("{channels} channels; a depth map has 1")));
        }
        let size = Size::new(width, height);
        check_shape(&path, size, view.camera.size())?;
        let has_normal = normal_map_path(&self.stereo, &view.name, self.pass).is_file();
        Ok(Some(ColmapMapHeader {
            camera: view.camera.scaled_per_axis(size),
            image_name: view.scene_name.clone(),
            has_normal,
        }))
    }

    /// The maps of a view. COLMAP stores no confidence, so there is none; depths that cannot be meant (not finite, not
    /// above 0, a hundred times nearer or further than every sparse point of the view) become 0, normals that are
    /// no unit vectors become the zero vector.
    ///
    /// # Errors
    /// A file is missing, damaged, or of another shape.
    pub fn read(&self, id: ImageId) -> Result<DepthEstimate> {
        let header = self.header(id)?;
        let (Some(view), Some(header)) = (self.views.get(&id), header) else {
            return Err(Error::content(&self.folder(), format!("no depth map of image {id}")));
        };
        let path = depth_map_path(&self.stereo, &view.name, self.pass);
        let size = header.camera.size();
        let mut depth = read_matrix(&path)?.data;
        let (mut near, mut far) = (f32::INFINITY, 0f32);
        for value in &mut depth {
            if view.plausible.contains(value) {
                (near, far) = (near.min(*value), far.max(*value));
            } else {
                *value = 0.0;
            }
        }
        let depth_range = if far > 0.0 { (near, far.next_up()) } else { (0.0, 0.0) };
        let depth = Grid::from_vec(size, depth)
            .ok_or_else(|| Error::content(&path, "changed while it was read; run again"))?;
        let normal = header.has_normal.then(|| self.read_normals(&view.name, size)).transpose()?;
        Ok(DepthEstimate {
            image_id: id,
            image_name: header.image_name,
            source_ids: Vec::new(),
            camera: header.camera,
            depth_range,
            depth,
            normal,
            confidence: None,
        })
    }

    fn read_normals(&self, name: &str, size: Size) -> Result<NormalMap> {
        let path = normal_map_path(&self.stereo, name, self.pass);
        let matrix = read_matrix(&path)?;
        let found = Size::new(matrix.width, matrix.height);
        let normals = matrix.normals().filter(|_| found == size).ok_or_else(|| {
            let what = format!(
                "{found} pixels of {} channels; the depth map has {size}, normals have 3",
                matrix.channels
            );
            Error::content(&path, what)
        })?;
        Grid::from_vec(size, normals.into_iter().map(unit_or_zero).collect())
            .ok_or_else(|| Error::content(&path, "the normals do not fill the map"))
    }
}

/// Writes an estimate as depth map and, if it has normals, normal map of the image `name` in the folder `stereo`, as
/// those of the geometric pass.
///
/// # Errors
/// The place cannot be written.
pub fn write_maps(stereo: &Path, name: &str, estimate: &DepthEstimate) -> Result<()> {
    let size = estimate.depth.size();
    let depth = Matrix::from_depths(size.width, size.height, estimate.depth.data().to_vec());
    let path = depth_map_path(stereo, name, Pass::Geometric);
    write_matrix(&path, depth)?;
    let Some(normal) = &estimate.normal else { return Ok(()) };
    // Where there is no depth, normals may be stale: COLMAP's are 0 there.
    let gated = normal.data().iter().zip(estimate.depth.data());
    let normals: Vec<[f32; 3]> = gated.map(|(n, &d)| if d > 0.0 { *n } else { [0.0; 3] }).collect();
    let path = normal_map_path(stereo, name, Pass::Geometric);
    write_matrix(&path, Matrix::from_normals(size.width, size.height, &normals))
}

/// `stereo/depth_maps/NAME.PASS.bin`.
pub fn depth_map_path(stereo: &Path, name: &str, pass: Pass) -> PathBuf {
    stereo.join("depth_maps").join(format!("{name}.{}.bin", pass.name()))
}

/// `stereo/normal_maps/NAME.PASS.bin`.
pub fn normal_map_path(stereo: &Path, name: &str, pass: Pass) -> PathBuf {
    stereo.join("normal_maps").join(format!("{name}.{}.bin", pass.name()))
}

fn read_matrix(path: &Path) -> Result<Matrix> {
    let file = File::open(path).map_err(|e| Error::io(path, "open", e))?;
    let length = file.metadata().map_err(|e| Error::io(path, "read", e))?.len();
    Matrix::read(file, Some(length), &Limits::default()).map_err(|e| Error::format(path, e))
}

fn write_matrix(path: &Path, matrix: Option<Matrix>) -> Result<()> {
    let matrix = matrix.ok_or_else(|| Error::content(path, "the values do not fill the map"))?;
    let mut file = AtomicFile::create(path)?;
    matrix.write(&mut file).map_err(|e| Error::writing(path, e))?;
    file.commit()
}

fn unit_or_zero(normal: [f32; 3]) -> [f32; 3] {
    let [x, y, z] = normal;
    let length = (x * x + y * y + z * z).sqrt();
    if UNIT_LENGTH.contains(&length) { normal.map(|v| v / length) } else { [0.0; 3] }
}

/// Refuses maps that are not the image, reduced: each side may be rounded.
fn check_shape(path: &Path, map: Size, image: Size) -> Result<()> {
    let factor = f64::from(map.longest()) / f64::from(image.longest());
    let agrees = |m: u32, i: u32| (f64::from(i) * factor - f64::from(m)).abs() <= 1.0;
    if factor <= 1.0 && agrees(map.width, image.width) && agrees(map.height, image.height) {
        return Ok(());
    }
    Err(Error::content(
        path,
        format!("a map of {map} pixels for an image of {image}: was the workspace made anew?"),
    ))
}

/// For every view the depths from a hundredth of the nearest to a hundred times the furthest sparse point.
fn plausible_depths(scene: &Scene) -> Vec<RangeInclusive<f32>> {
    let mut ranges = vec![(f32::INFINITY, 0f32); scene.views.len()];
    for (point, views) in scene.tracks.iter() {
        for &view in views {
            if let Some(calibration) = &scene.views[view.index()].calibration {
                let in_world = nalgebra::Vector3::from(point.map(f64::from));
                let depth = (calibration.rotation * (in_world - calibration.center)).z as f32;
                if depth > 0.0 {
                    let (near, far) = &mut ranges[view.index()];
                    (*near, *far) = (near.min(depth), far.max(depth));
                }
            }
        }
    }
    let widened = |(near, far): (f32, f32)| {
        if far > 0.0 { near / BEYOND_POINTS..=far * BEYOND_POINTS } else { f32::MIN_POSITIVE..=f32::MAX }
    };
    ranges.into_iter().map(widened).collect()
}
