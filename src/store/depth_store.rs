//! The depth maps of a scene, one `.dmap` file per view, as many as fit in memory too.

use super::atomic::AtomicFile;
use super::colmap::{ColmapMapHeader, ColmapMaps};
use super::depth_map::{estimate_from_file, file_from_estimate, make_readable};
use super::held_maps::{HeldMaps, Slot};
use super::map_summary::{MapSummary, Summaries};
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

/// Whether a depth map is a result.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lasting {
    /// It is, and has a file.
    Result,
    /// Another one will take its place before the run ends: it gets a file only if it does not fit in memory.
    Passing,
}

/// The depth maps in one folder. May be used by many threads at once.
#[derive(Debug)]
pub struct DepthStore {
    folder: PathBuf,
    images: SearchPath,
    limits: Limits,
    held: HeldMaps,
    summaries: Summaries,
    /// The maps of a COLMAP workspace instead of those in `folder`; they are only read.
    colmap: Option<ColmapMaps>,
}

impl DepthStore {
    /// The depth maps in `folder`, of which up to `memory` bytes are held in memory. `images` says what the image
    /// names of estimates mean, so that files can name them relative to `folder`.
    pub fn new(folder: &Path, images: SearchPath, memory: usize, limits: Limits) -> Self {
        let (held, summaries) = (HeldMaps::new(memory), Summaries::default());
        DepthStore { folder: folder.to_owned(), images, limits, held, summaries, colmap: None }
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

    /// The depth map of a view, from memory if it is there.
    ///
    /// # Errors
    /// The file is missing or damaged, or is the map of another image.
    pub fn read(&self, id: ImageId) -> Result<Arc<DepthEstimate>> {
        if let Some(held) = self.held.get(id) {
            return Ok(held);
        }
        let estimate = Arc::new(self.read_file(id)?);
        self.held.hold_read(&estimate);
        Ok(estimate)
    }

    /// The depth map of a view for whoever needs it last: if there is a file, memory holds it no longer.
    ///
    /// # Errors
    /// As [`DepthStore::read`].
    pub fn take(&self, id: ImageId) -> Result<Arc<DepthEstimate>> {
        match self.held.take(id) {
            Some(held) => Ok(held),
            None => Ok(Arc::new(self.read_file(id)?)),
        }
    }

    /// What a report says of the depth map of a view; it is read only if it was neither read nor written before.
    ///
    /// # Errors
    /// As [`DepthStore::read`].
    pub fn summary(&self, id: ImageId) -> Result<MapSummary> {
        match self.summaries.get(id) {
            Some(summary) => Ok(summary),
            None => Ok(MapSummary::of(&*self.take(id)?)),
        }
    }

    fn read_file(&self, id: ImageId) -> Result<DepthEstimate> {
        let path = self.path(id);
        let estimate = match &self.colmap {
            Some(maps) => maps.read(id)?,
            None => read_depth_map(&path, self.limits)?,
        };
        if estimate.image_id != id {
            let what =
                format!("this is the depth map of image {}, not {id}; estimate it again", estimate.image_id);
            return Err(Error::content(&path, what));
        }
        self.summaries.enter(&estimate);
        Ok(estimate)
    }

    /// Makes `estimate` the depth map of its view.
    ///
    /// # Errors
    /// The file cannot be written whole, or the estimate cannot be stored (sizes that differ, more than 254 sources).
    pub fn write(&self, estimate: DepthEstimate, lasting: Lasting) -> Result<()> {
        self.put(Slot::Current, estimate, lasting)
    }

    /// Keeps a depth map beside the current one, which stays readable until [`DepthStore::publish`]: a pass that
    /// reads its neighbours' maps must not see maps of its own.
    ///
    /// # Errors
    /// As [`DepthStore::write`].
    pub fn write_pending(&self, estimate: DepthEstimate, lasting: Lasting) -> Result<()> {
        self.put(Slot::Pending, estimate, lasting)
    }

    fn put(&self, slot: Slot, mut estimate: DepthEstimate, lasting: Lasting) -> Result<()> {
        make_readable(&mut estimate);
        let (id, estimate) = (estimate.image_id, Arc::new(estimate));
        if lasting == Lasting::Passing && self.colmap.is_none() && self.held.hold(slot, &estimate, false) {
            return Ok(());
        }
        // A reader must not find the old map in memory once the new one is in the file, or the other way round.
        self.held.remove(id, slot);
        let path = match slot {
            Slot::Current => self.path(id),
            Slot::Pending => self.pending_path(id),
        };
        self.write_to(&path, &estimate)?;
        self.summaries.enter(&estimate);
        self.held.hold(slot, &estimate, true);
        Ok(())
    }

    /// Puts the pending depth map of a view in the place of the current one.
    ///
    /// # Errors
    /// There is none, or it cannot be renamed.
    pub fn publish(&self, id: ImageId) -> Result<()> {
        if self.held.publish(id) == Some(false) {
            return Ok(());
        }
        let (pending, path) = (self.pending_path(id), self.path(id));
        std::fs::rename(&pending, &path).map_err(|e| Error::io(&pending, "rename", e))
    }

    /// Deletes the pending depth map of a view, if there is one and it can be.
    pub fn discard_pending(&self, id: ImageId) {
        self.held.remove(id, Slot::Pending);
        self.summaries.forget(id);
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
        self.held.remove(id, Slot::Current);
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
        store.write(written.clone(), Lasting::Result).unwrap();
        store.take(ImageId(12)).unwrap();
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
        store.write(estimate(5, 1.0), Lasting::Result).unwrap();
        assert_eq!(depth(), 1.0);
        store.write(estimate(5, 2.0), Lasting::Result).unwrap();
        assert_eq!(depth(), 2.0);
        store.write_pending(estimate(5, 3.0), Lasting::Result).unwrap();
        assert_eq!(depth(), 2.0);
        store.publish(ImageId(5)).unwrap();
        assert_eq!(depth(), 3.0);
        store.write_pending(estimate(5, 4.0), Lasting::Result).unwrap();
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
    fn passing_maps_have_a_file_only_where_memory_is_short() {
        let scratch = tempfile::tempdir().unwrap();
        // 120 bytes each.
        let store = DepthStore { held: HeldMaps::new(300), ..store(scratch.path()) };
        let depth = |id| store.read(ImageId(id)).unwrap().depth[(0, 0)];
        let files = || std::fs::read_dir(store.folder()).map_or(0, Iterator::count);
        for id in 1..=3 {
            store.write(estimate(id, 1.0), Lasting::Passing).unwrap();
        }
        assert_eq!(files(), 1, "two of three fit");
        for id in 1..=3 {
            store.write_pending(estimate(id, 2.0), Lasting::Passing).unwrap();
        }
        assert_eq!([1, 2, 3].map(depth), [1.0; 3]);
        (1..=3).for_each(|id| store.publish(ImageId(id)).unwrap());
        assert_eq!([1, 2, 3].map(depth), [2.0; 3]);
        for id in 1..=3 {
            store.write_pending(estimate(id, 3.0), Lasting::Result).unwrap();
        }
        (1..=3).for_each(|id| store.publish(ImageId(id)).unwrap());
        assert_eq!(files(), 3);
        assert_eq!([1, 2, 3].map(|id| store.take(ImageId(id)).unwrap().depth[(0, 0)]), [3.0; 3]);
        std::fs::remove_file(store.path(ImageId(1))).unwrap();
        assert!(store.read(ImageId(1)).is_err(), "whoever needed it last has taken it");
        assert_eq!(store.summary(ImageId(1)).unwrap().valid_depths, 6);
    }

    #[test]
    fn an_existing_map_must_be_of_this_image_size_and_camera() {
        let scratch = tempfile::tempdir().unwrap();
        let store = store(scratch.path());
        let ours = estimate(5, 1.0);
        let (size, k, rotation, center) =
            (ours.camera.size(), *ours.camera.k(), *ours.camera.rotation(), *ours.camera.center());
        assert!(matches!(store.existing(ImageId(5), &ours.camera), Existing::Absent));
        store.write(ours.clone(), Lasting::Result).unwrap();
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
            store.write(estimate(id, 1.0 + id as f32), Lasting::Result).unwrap();
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
