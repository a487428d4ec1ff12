//! The depth maps of a scene, one `.dmap` file per view, and the ones read lately.

use super::atomic::AtomicFile;
use super::byte_cache::ByteCache;
use super::colmap::{ColmapMapHeader, ColmapMaps};
use super::depth_map::{estimate_from_file, file_from_estimate};
use super::paths::{SearchPath, name_relative_to};
use crate::error::{Error, Result};
use crate::geometry::Camera;
use crate::scene::{DepthEstimate, ImageId};
use nalgebra::{Matrix3, Vector3};
use semvs_formats::dmap::{DepthMapFile, DepthMapHeader, read_header};
use semvs_formats::{Limits, mvs::NO_ID};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// File name of the depth map of an image: at least four digits, more are kept.
pub fn depth_map_name(id: ImageId) -> String {
    format!("depth{id}.dmap")
}

/// What a folder holds for a view.
#[derive(Debug)]
pub enum Existing {
    /// No file.
    Absent,
    /// A map of this image with this camera at this size.
    Usable,
    /// A file that is not that, and why.
    Unusable(String),
}

/// The depth maps in one folder. May be used by many threads at once.
#[derive(Debug)]
pub struct DepthStore {
    folder: PathBuf,
    images: SearchPath,
    limits: Limits,
    cache: ByteCache<ImageId, DepthEstimate>,
    /// The maps of a COLMAP workspace instead of those in `folder`; they are only read.
    colmap: Option<ColmapMaps>,
}

impl DepthStore {
    /// The depth maps in `folder`, of which up to `cache_bytes` are kept in memory. `images` says what the image
    /// names of estimates mean, so that files can name them relative to `folder`.
    pub fn new(folder: &Path, images: SearchPath, cache_bytes: usize, limits: Limits) -> Self {
        let cache = ByteCache::new(cache_bytes);
        DepthStore { folder: folder.to_owned(), images, limits, cache, colmap: None }
    }

    /// The maps of a COLMAP workspace. Nothing can be written; nothing is kept in memory.
    pub fn colmap(maps: ColmapMaps, images: SearchPath) -> Self {
        DepthStore {
            colmap: Some(maps.clone()),
            ..DepthStore::new(&maps.folder(), images, 0, Limits::default())
        }
    }

    /// The folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// The file of a view, be it there or not.
    pub fn path(&self, id: ImageId) -> PathBuf {
        let in_workspace = self.colmap.as_ref().and_then(|maps| maps.path(id));
        in_workspace.unwrap_or_else(|| self.folder.join(depth_map_name(id)))
    }

    /// The file of a view relative to the folder.
    pub fn name(&self, id: ImageId) -> String {
        let path = self.path(id);
        path.strip_prefix(&self.folder).unwrap_or(&path).display().to_string()
    }

    /// Whether these are the maps of a COLMAP workspace.
    pub fn is_colmap(&self) -> bool {
        self.colmap.is_some()
    }

    /// The file that [`DepthStore::write_pending`] writes.
    fn pending_path(&self, id: ImageId) -> PathBuf {
        self.folder.join(format!("depth{id}.geo.dmap"))
    }

    /// Whether the folder holds a usable map of the view with this global ID and camera (at the size of the maps).
    /// Reads the header only.
    pub fn existing(&self, id: ImageId, camera: &Camera) -> Existing {
        match self.header(id) {
            Err(error) => Existing::Unusable(error.to_string()),
            Ok(None) => Existing::Absent,
            Ok(Some(header)) => match difference(&header, id, camera) {
                Some(what) => Existing::Unusable(format!("{}: {what}", self.path(id).display())),
                None => Existing::Usable,
            },
        }
    }

    /// What the depth map of a view says before its planes; `None` if there is no file.
    ///
    /// # Errors
    /// The file cannot be read or is damaged.
    pub fn header(&self, id: ImageId) -> Result<Option<DepthMapHeader>> {
        let path = self.path(id);
        if let Some(maps) = &self.colmap {
            return Ok(maps.header(id)?.map(|header| colmap_header(id, header)));
        }
        match read_header(&path, &self.limits) {
            Ok(header) => Ok(Some(header)),
            Err(semvs_formats::Error::Io(e)) if e.kind() == std::io::ErrorKind::NotFound => Ok(None),
            Err(error) => Err(Error::format(&path, error)),
        }
    }

    /// The depth map of a view, from memory if it was read lately.
    ///
    /// # Errors
    /// The file is missing or damaged, or is the map of another image.
    pub fn read(&self, id: ImageId) -> Result<Arc<DepthEstimate>> {
        self.cache.get_or_load(id, || {
            let path = self.path(id);
            let estimate = match &self.colmap {
                Some(maps) => maps.read(id)?,
                None => read_depth_map(&path, self.limits)?,
            };
            if estimate.image_id != id {
                let what = format!(
                    "this is the depth map of image {}, not {id}; estimate it again",
                    estimate.image_id
                );
                return Err(Error::content(&path, what));
            }
            let bytes = bytes_of(&estimate);
            Ok((estimate, bytes))
        })
    }

    /// Writes the depth map of `estimate.image_id`, whole or not at all.
    ///
    /// # Errors
    /// The file cannot be written, or the estimate cannot be stored (sizes that differ, more than 254 sources).
    pub fn write(&self, estimate: &DepthEstimate) -> Result<()> {
        self.write_to(&self.path(estimate.image_id), estimate)?;
        self.cache.remove(estimate.image_id);
        Ok(())
    }

    /// Writes a depth map beside the current one, which stays readable until [`DepthStore::publish`]: a pass that
    /// reads its neighbours' maps must not see maps of its own.
    ///
    /// # Errors
    /// As [`DepthStore::write`].
    pub fn write_pending(&self, estimate: &DepthEstimate) -> Result<()> {
        self.write_to(&self.pending_path(estimate.image_id), estimate)
    }

    /// Puts the pending depth map of a view in the place of the current one.
    ///
    /// # Errors
    /// There is none, or it cannot be renamed.
    pub fn publish(&self, id: ImageId) -> Result<()> {
        let (pending, path) = (self.pending_path(id), self.path(id));
        std::fs::rename(&pending, &path).map_err(|e| Error::io(&pending, "rename", e))?;
        self.cache.remove(id);
        Ok(())
    }

    /// Deletes the pending depth map of a view, if there is one and it can be.
    pub fn discard_pending(&self, id: ImageId) {
        // What remains is overwritten by the next run.
        let _ = std::fs::remove_file(self.pending_path(id));
    }

    /// Deletes the depth map of a view, if there is one.
    ///
    /// # Errors
    /// It cannot be deleted.
    pub fn delete(&self, id: ImageId) -> Result<()> {
        self.check_ours()?;
        let path = self.path(id);
        self.cache.remove(id);
        match std::fs::remove_file(&path) {
            Err(e) if e.kind() != std::io::ErrorKind::NotFound => Err(Error::io(&path, "delete", e)),
            _ => Ok(()),
        }
    }

    /// Refuses to touch the maps of a COLMAP workspace.
    fn check_ours(&self) -> Result<()> {
        match self.colmap {
            Some(_) => Err(Error::content(&self.folder, "the depth maps of COLMAP are only read")),
            None => Ok(()),
        }
    }

    fn write_to(&self, path: &Path, estimate: &DepthEstimate) -> Result<()> {
        self.check_ours()?;
        let name = name_relative_to(&self.images.find(&estimate.image_name), &self.folder);
        write_depth_map(path, estimate, &name)
    }
}

/// The header of a map of COLMAP as that of a depth map of ours.
fn colmap_header(id: ImageId, header: ColmapMapHeader) -> DepthMapHeader {
    let camera = &header.camera;
    let row_major = |m: &Matrix3<f64>| std::array::from_fn(|i| m[(i / 3, i % 3)]);
    let (width, height) = (camera.size().width, camera.size().height);
    DepthMapHeader {
        image_width: width,
        image_height: height,
        width,
        height,
        image_name: header.image_name.into_bytes(),
        ids: vec![id.0],
        k: row_major(camera.k()),
        rotation: row_major(camera.rotation()),
        center: (*camera.center()).into(),
        has_normal: header.has_normal,
        ..DepthMapHeader::default()
    }
}

/// Reads what the depth map at `path` says before its planes.
///
/// # Errors
/// [`Error`] about `path`.
pub fn read_depth_header(path: &Path, limits: Limits) -> Result<DepthMapHeader> {
    read_header(path, &limits).map_err(|e| Error::format(path, e))
}

/// Reads the depth map at `path`. Its `image_name` is the file's: relative to the folder of the depth map.
///
/// # Errors
/// [`Error`] about `path`.
pub fn read_depth_map(path: &Path, limits: Limits) -> Result<DepthEstimate> {
    let file = DepthMapFile::read(path, &limits).map_err(|e| Error::format(path, e))?;
    estimate_from_file(file).map_err(|what| Error::content(path, what))
}

/// Writes a depth map to `path`, whole or not at all; `image_name` is the reference image relative to the file's
/// folder.
///
/// # Errors
/// [`Error`] about `path`.
pub fn write_depth_map(path: &Path, estimate: &DepthEstimate, image_name: &str) -> Result<()> {
    let file = file_from_estimate(estimate, image_name);
    let mut out = AtomicFile::create(path)?;
    file.write(&mut out).map_err(|e| Error::writing(path, e))?;
    out.commit()
}

/// Bytes that an estimate takes in memory, but for small change.
fn bytes_of(estimate: &DepthEstimate) -> usize {
    let normal = estimate.normal.as_ref().map_or(0, |map| size_of_val(map.data()));
    let confidence = estimate.confidence.as_ref().map_or(0, |map| size_of_val(map.data()));
    size_of_val(estimate.depth.data()) + normal + confidence
}

/// Largest difference of focal length and principal point in pixels of the map. Programs scale intrinsics in `f32`
/// here and there; another calibration differs by more.
const K_TOLERANCE: f64 = 0.02;
/// Largest difference of an element of the rotation: a thousandth of a pixel at the border of an ordinary image.
const ROTATION_TOLERANCE: f64 = 1e-6;
/// Largest difference of a coordinate of the centre, relative to the larger of 1 and the coordinate: what is left of
/// a centre after a decimal text format.
const CENTER_TOLERANCE: f64 = 1e-7;

/// In what a depth map is not the one wanted.
fn difference(header: &DepthMapHeader, id: ImageId, camera: &Camera) -> Option<String> {
    let size = camera.size();
    let found = header.ids.first().copied().unwrap_or(NO_ID);
    if found != id.0 {
        return Some(format!("it is the depth map of image {}", ImageId(found)));
    }
    if (header.width, header.height) != (size.width, size.height) {
        return Some(format!("it has {}×{} pixels instead of {size}", header.width, header.height));
    }
    let stored = super::depth_map::camera_of(header);
    let k = (stored.k() - camera.k()).abs();
    if [(0, 0), (1, 1), (0, 2), (1, 2)].iter().any(|&at| k[at] > K_TOLERANCE) {
        return Some("its camera has other intrinsics than the scene's".to_owned());
    }
    let rotation: Matrix3<f64> = (stored.rotation() - camera.rotation()).abs();
    if rotation.max() > ROTATION_TOLERANCE {
        return Some("its camera has another rotation than the scene's".to_owned());
    }
    let apart: Vector3<f64> = (stored.center() - camera.center()).abs();
    let moved = apart.iter().zip(camera.center()).any(|(&d, &c)| d > CENTER_TOLERANCE * c.abs().max(1.0));
    moved.then(|| "its camera stands elsewhere than the scene's".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Size;
    use crate::scene::Grid;

    fn estimate(id: u32, depth: f32) -> DepthEstimate {
        let size = Size::new(3, 2);
        let k = Matrix3::new(2.0, 0.0, 1.0, 0.0, 2.5, 0.5, 0.0, 0.0, 1.0);
        let camera = Camera::new(size, k, Matrix3::identity(), Vector3::new(1.0, 2.0, 3.0));
        DepthEstimate {
            image_id: ImageId(id),
            image_name: "images/a.jpg".into(),
            source_ids: vec![ImageId(7), ImageId(12_345)],
            camera,
            depth_range: (0.5, 9.0),
            depth: Grid::filled(size, depth),
            normal: Some(Grid::filled(size, [0.0, 0.0, -1.0])),
            confidence: Some(Grid::filled(size, 0.5)),
        }
    }

    fn store(folder: &Path) -> DepthStore {
        let images =
            SearchPath { working_folder: folder.join("project"), scene_folder: folder.join("project") };
        DepthStore::new(&folder.join("maps"), images, 1 << 20, Limits::default())
    }

    #[test]
    fn files_are_named_by_the_global_id() {
        let names = [7, 1234, 123_456].map(|id| depth_map_name(ImageId(id)));
        assert_eq!(names, ["depth0007.dmap", "depth1234.dmap", "depth123456.dmap"]);
    }

    #[test]
    fn what_is_written_is_read_and_names_its_image_from_its_folder() {
        let scratch = tempfile::tempdir().unwrap();
        let store = store(scratch.path());
        let written = estimate(12, 4.0);
        store.write(&written).unwrap();
        let read = store.read(ImageId(12)).unwrap();
        assert_eq!(read.image_name, "../project/images/a.jpg");
        assert_eq!(*read, DepthEstimate { image_name: read.image_name.clone(), ..written });
        assert!(Arc::ptr_eq(&read, &store.read(ImageId(12)).unwrap()));
    }

    #[test]
    fn a_new_map_replaces_the_cached_one_and_a_pending_one_waits() {
        let scratch = tempfile::tempdir().unwrap();
        let store = store(scratch.path());
        let depth = || store.read(ImageId(5)).unwrap().depth[(0, 0)];
        store.write(&estimate(5, 1.0)).unwrap();
        assert_eq!(depth(), 1.0);
        store.write(&estimate(5, 2.0)).unwrap();
        assert_eq!(depth(), 2.0);
        store.write_pending(&estimate(5, 3.0)).unwrap();
        assert_eq!(depth(), 2.0);
        store.publish(ImageId(5)).unwrap();
        assert_eq!(depth(), 3.0);
        store.write_pending(&estimate(5, 4.0)).unwrap();
        store.discard_pending(ImageId(5));
        store.discard_pending(ImageId(5));
        assert_eq!(depth(), 3.0);
        assert!(store.publish(ImageId(5)).is_err());
        store.delete(ImageId(5)).unwrap();
        store.delete(ImageId(5)).unwrap();
        assert!(store.read(ImageId(5)).is_err());
        assert_eq!(std::fs::read_dir(store.folder()).unwrap().count(), 0);
    }

    #[test]
    fn an_existing_map_must_be_of_this_image_size_and_camera() {
        let scratch = tempfile::tempdir().unwrap();
        let store = store(scratch.path());
        let ours = estimate(5, 1.0);
        let (size, k, rotation, center) =
            (ours.camera.size(), *ours.camera.k(), *ours.camera.rotation(), *ours.camera.center());
        assert!(matches!(store.existing(ImageId(5), &ours.camera), Existing::Absent));
        store.write(&ours).unwrap();
        let verdict = |camera: Camera| match store.existing(ImageId(5), &camera) {
            Existing::Absent => panic!("absent"),
            Existing::Usable => String::new(),
            Existing::Unusable(why) => why,
        };
        assert_eq!(verdict(ours.camera.clone()), "");
        let mut nearly = k;
        nearly[(0, 2)] += 0.01;
        assert_eq!(verdict(Camera::new(size, nearly, rotation, center.add_scalar(1e-8))), "");
        let mut other = k;
        other[(0, 0)] += 0.1;
        assert!(verdict(Camera::new(size, other, rotation, center)).contains("intrinsics"));
        let turned = *nalgebra::Rotation3::from_axis_angle(&Vector3::y_axis(), 1e-5).matrix();
        assert!(verdict(Camera::new(size, k, turned, center)).contains("rotation"));
        assert!(
            verdict(Camera::new(size, k, rotation, center.add_scalar(1e-4))).contains("stands elsewhere")
        );
        let small = Camera::new(Size::new(2, 2), k, rotation, center);
        assert!(verdict(small).contains("3×2 pixels instead of 2×2"));
        std::fs::copy(store.path(ImageId(5)), store.path(ImageId(6))).unwrap();
        let Existing::Unusable(why) = store.existing(ImageId(6), &ours.camera) else { panic!("usable") };
        assert!(why.ends_with("depth0006.dmap: it is the depth map of image 0005"), "{why}");
        assert!(
            store.read(ImageId(6)).unwrap_err().to_string().contains("depth map of image 0005, not 0006")
        );
        std::fs::write(store.path(ImageId(5)), b"DR").unwrap();
        assert!(verdict(ours.camera.clone()).contains("depth0005.dmap"));
    }

    #[test]
    fn many_threads_read_at_once() {
        let scratch = tempfile::tempdir().unwrap();
        let store = store(scratch.path());
        for id in 0..8 {
            store.write(&estimate(id, 1.0 + id as f32)).unwrap();
        }
        std::thread::scope(|scope| {
            for start in 0..4 {
                let store = &store;
                scope.spawn(move || {
                    for i in 0..64 {
                        let id = (start + i) % 8;
                        assert_eq!(store.read(ImageId(id)).unwrap().depth[(2, 1)], 1.0 + id as f32);
                    }
                });
            }
        });
    }
}
