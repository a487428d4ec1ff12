//! The depth maps of a scene, one `.dmap` file per view, as many as fit in memory too.

use super::atomic::{AtomicFile, sync_folder};
use super::byte_cache::ByteCache;
use super::colmap::ColmapMaps;
use super::depth_map::{colmap_header, estimate_from_file, file_from_estimate, make_readable};
use super::digest::{Digest, DigestingWriter};
use super::faults::{self, Access};
use super::map_fit::difference;
use super::map_summary::{MapSummary, Summaries};
use super::paths::{SearchPath, name_relative_to};
use crate::error::{Error, Result};
use crate::geometry::Camera;
use crate::scene::{DepthEstimate, ImageId};
use nalgebra::Vector3;
use semvs_formats::Limits;
use semvs_formats::dmap::{DepthMapFile, DepthMapHeader, read_header};
use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

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

/// Which of the maps of a view.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum MapStage {
    /// The result, `depthNNNN.dmap`.
    Final,
    /// What a stage of an unfinished run has made, `depthNNNN.passK.dmap`.
    Pass(u32),
}

/// The depth maps in one folder. May be used by many threads at once.
#[derive(Debug)]
pub struct DepthStore {
    folder: PathBuf,
    images: SearchPath,
    limits: Limits,
    /// Maps that were read or written lately.
    held: ByteCache<(ImageId, MapStage), DepthEstimate>,
    /// What files must hold that others rely on.
    expected: Mutex<HashMap<(ImageId, MapStage), Digest>>,
    summaries: Summaries,
    /// Where the origin of the cameras is in the coordinates of the files.
    origin: Vector3<f64>,
    /// The maps of a COLMAP workspace instead of those in `folder`; they are only read.
    colmap: Option<ColmapMaps>,
}

impl DepthStore {
    /// The depth maps in `folder`, of which up to `memory` bytes are held in memory. `images` says what the image
    /// names of estimates mean, so that files can name them relative to `folder`.
    pub fn new(folder: &Path, images: SearchPath, memory: usize, limits: Limits) -> Self {
        let (held, summaries) = (ByteCache::new(memory), Summaries::default());
        let (folder, expected) = (folder.to_owned(), Mutex::default());
        let origin = Vector3::zeros();
        DepthStore { folder, images, limits, held, expected, summaries, origin, colmap: None }
    }

    /// The same for cameras whose origin is at `origin` in the coordinates of the files.
    pub fn with_origin(self, origin: Vector3<f64>) -> Self {
        DepthStore { origin, ..self }
    }

    /// The maps of a COLMAP workspace. Nothing can be written; nothing is kept in memory.
    pub fn colmap(maps: ColmapMaps, images: SearchPath) -> Self {
        DepthStore {
            colmap: Some(maps.clone()),
            ..DepthStore::new(&maps.folder(), images, 0, Limits::default())
        }
    }

    /// From now on up to `memory` bytes of maps are held in memory.
    pub fn hold(&self, memory: usize) {
        self.held.set_budget(memory);
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

    /// The file of a view's map of `stage`, be it there or not.
    pub fn stage_path(&self, id: ImageId, stage: MapStage) -> PathBuf {
        match stage {
            MapStage::Final => self.path(id),
            MapStage::Pass(pass) => self.folder.join(format!("depth{id}.pass{pass}.dmap")),
        }
    }

    /// Whether the folder holds a usable map of the view with this global ID and camera (at the size of the maps).
    /// Reads the header only.
    pub fn existing(&self, id: ImageId, camera: &Camera) -> Existing {
        match self.header(id) {
            Err(error) => Existing::Unusable(error.to_string()),
            Ok(None) => Existing::Absent,
            Ok(Some(header)) => match difference(&header, id, &camera.moved(&self.origin)) {
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
        self.read_stage(id, MapStage::Final)
    }

    /// The depth map of a view that `stage` has left, from memory if it is there.
    ///
    /// # Errors
    /// As [`DepthStore::read`]; the bytes of the file are others than [`DepthStore::rely_on`] said.
    pub fn read_stage(&self, id: ImageId, stage: MapStage) -> Result<Arc<DepthEstimate>> {
        let load = || {
            let estimate = self.read_file(id, stage)?;
            let bytes = bytes_of(&estimate);
            Ok((estimate, bytes))
        };
        self.held.get_or_load((id, stage), load)
    }

    /// The depth map of a view for whoever needs it last: memory holds it no longer.
    ///
    /// # Errors
    /// As [`DepthStore::read`].
    pub fn take(&self, id: ImageId) -> Result<Arc<DepthEstimate>> {
        match self.held.remove((id, MapStage::Final)) {
            Some(held) => Ok(held),
            None => Ok(Arc::new(self.read_file(id, MapStage::Final)?)),
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

    fn read_file(&self, id: ImageId, stage: MapStage) -> Result<DepthEstimate> {
        let path = self.stage_path(id, stage);
        faults::meet(Access::Read, &path).map_err(|e| Error::io(&path, "read", e))?;
        if let Some(expected) = self.expected().get(&(id, stage)).copied()
            && Digest::of_file(&path)? != expected
        {
            let what =
                "its bytes are not those that were written; run again, and what depends on it is made again";
            return Err(Error::content(&path, what));
        }
        let mut estimate = match &self.colmap {
            Some(maps) => maps.read(id)?,
            None => read_depth_map(&path, self.limits)?,
        };
        estimate.camera = estimate.camera.moved(&-self.origin);
        if estimate.image_id != id {
            let what =
                format!("this is the depth map of image {}, not {id}; estimate it again", estimate.image_id);
            return Err(Error::content(&path, what));
        }
        if stage == MapStage::Final {
            self.summaries.enter(&estimate);
        }
        Ok(estimate)
    }

    /// Says what the file of a map must hold: then it is not read if it holds anything else.
    pub(crate) fn rely_on(&self, id: ImageId, stage: MapStage, content: Digest) {
        self.expected().insert((id, stage), content);
    }

    /// Makes `estimate` the depth map of its view.
    ///
    /// # Errors
    /// The file cannot be written whole, or the estimate cannot be stored (sizes that differ, more than 254 sources).
    pub fn write(&self, estimate: DepthEstimate) -> Result<()> {
        self.write_stage(estimate, MapStage::Final, true).map(drop)
    }

    /// Makes `estimate` the map that `stage` has left of its view; returns the digest of the file. One that is not
    /// `lasting` may be damaged after a power failure.
    ///
    /// # Errors
    /// As [`DepthStore::write`].
    pub(crate) fn write_stage(
        &self,
        mut estimate: DepthEstimate,
        stage: MapStage,
        lasting: bool,
    ) -> Result<Digest> {
        self.check_ours()?;
        make_readable(&mut estimate);
        let id = estimate.image_id;
        // A reader must not find the old map in memory once the new one is in the file, or the other way round.
        self.held.remove((id, stage));
        self.expected().remove(&(id, stage));
        let path = self.stage_path(id, stage);
        let name = name_relative_to(&self.images.find(&estimate.image_name), &self.folder);
        let camera = estimate.camera.moved(&self.origin);
        let content = write_with_digest(&path, &estimate, &camera, &name, lasting)?;
        self.summaries.enter(&estimate);
        self.rely_on(id, stage, content);
        let bytes = bytes_of(&estimate);
        self.held.insert((id, stage), Arc::new(estimate), bytes);
        Ok(content)
    }

    /// Makes the map that `pass` has left of a view its result.
    ///
    /// # Errors
    /// There is none, or it cannot be renamed.
    pub(crate) fn publish(&self, id: ImageId, pass: u32) -> Result<()> {
        let (from, to) = ((id, MapStage::Pass(pass)), (id, MapStage::Final));
        let path = self.stage_path(id, from.1);
        let renamed =
            faults::meet(Access::Rename, &path).and_then(|()| std::fs::rename(&path, self.path(id)));
        renamed.map_err(|e| Error::io(&path, "rename", e))?;
        let mut expected = self.expected();
        if let Some(content) = expected.remove(&from) {
            expected.insert(to, content);
        }
        self.held.remove(to);
        if let Some(estimate) = self.held.remove(from) {
            let bytes = bytes_of(&estimate);
            self.held.insert(to, estimate, bytes);
        }
        Ok(())
    }

    /// Brings the names of published maps to the medium.
    pub(crate) fn sync(&self) {
        sync_folder(&self.folder);
    }

    /// Deletes what `pass` has left of a view, if there is anything and it can be.
    pub(crate) fn discard(&self, id: ImageId, pass: u32) {
        let stage = MapStage::Pass(pass);
        self.held.remove((id, stage));
        self.expected().remove(&(id, stage));
        // What remains is found to be unneeded by the next run.
        let _ = std::fs::remove_file(self.stage_path(id, stage));
    }

    /// Deletes what passes of any run have left of these views.
    pub(crate) fn discard_passes(&self, ids: &[ImageId]) {
        let ids: HashSet<ImageId> = ids.iter().copied().collect();
        let pass_of = |name: &str| {
            let (id, pass) = name.strip_prefix("depth")?.strip_suffix(".dmap")?.split_once(".pass")?;
            Some((ImageId(id.parse().ok()?), pass.parse::<u32>().ok()?))
        };
        for entry in std::fs::read_dir(&self.folder).into_iter().flatten().flatten() {
            match entry.file_name().to_str().and_then(pass_of) {
                Some((id, pass)) if ids.contains(&id) => self.discard(id, pass),
                _ => {}
            }
        }
    }

    fn expected(&self) -> MutexGuard<'_, HashMap<(ImageId, MapStage), Digest>> {
        self.expected.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Deletes the depth map of a view, if there is one.
    ///
    /// # Errors
    /// It cannot be deleted.
    pub fn delete(&self, id: ImageId) -> Result<()> {
        self.check_ours()?;
        let path = self.path(id);
        self.held.remove((id, MapStage::Final));
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
}

/// Bytes that an estimate takes in memory, but for small change.
fn bytes_of(estimate: &DepthEstimate) -> usize {
    let normal = estimate.normal.as_ref().map_or(0, |map| size_of_val(map.data()));
    let confidence = estimate.confidence.as_ref().map_or(0, |map| size_of_val(map.data()));
    size_of_val(estimate.depth.data()) + normal + confidence
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
    write_with_digest(path, estimate, &estimate.camera, image_name, true).map(drop)
}

fn write_with_digest(
    path: &Path,
    estimate: &DepthEstimate,
    camera: &Camera,
    image_name: &str,
    lasting: bool,
) -> Result<Digest> {
    let file = file_from_estimate(estimate, camera, image_name);
    let mut out = DigestingWriter::new(AtomicFile::create(path)?);
    file.write(&mut out).map_err(|e| Error::writing(path, e))?;
    let (out, content) = out.finish();
    if lasting {
        out.commit()?
    } else {
        out.commit_passing()?
    }
    Ok(content)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Size;
    use crate::scene::Grid;
    use nalgebra::Matrix3;

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
        store.write(written.clone()).unwrap();
        store.take(ImageId(12)).unwrap();
        let read = store.read(ImageId(12)).unwrap();
        assert_eq!(read.image_name, "../project/images/a.jpg");
        assert_eq!(*read, DepthEstimate { image_name: read.image_name.clone(), ..written });
        assert!(Arc::ptr_eq(&read, &store.read(ImageId(12)).unwrap()));
    }

    #[test]
    fn a_new_map_replaces_the_cached_one_and_those_of_passes_wait() {
        let scratch = tempfile::tempdir().unwrap();
        let store = store(scratch.path());
        let id = ImageId(5);
        let depth = || store.read(id).unwrap().depth[(0, 0)];
        store.write(estimate(5, 1.0)).unwrap();
        assert_eq!(depth(), 1.0);
        store.write(estimate(5, 2.0)).unwrap();
        assert_eq!(depth(), 2.0);
        store.write_stage(estimate(5, 3.0), MapStage::Pass(1), true).unwrap();
        assert_eq!(depth(), 2.0);
        assert_eq!(store.read_stage(id, MapStage::Pass(1)).unwrap().depth[(0, 0)], 3.0);
        store.publish(id, 1).unwrap();
        assert_eq!(depth(), 3.0);
        assert!(store.read_stage(id, MapStage::Pass(1)).is_err());
        store.write_stage(estimate(5, 4.0), MapStage::Pass(1), false).unwrap();
        store.discard(id, 1);
        store.discard(id, 1);
        assert_eq!(depth(), 3.0);
        assert!(store.publish(id, 1).is_err());
        store.delete(id).unwrap();
        store.delete(id).unwrap();
        assert!(store.read(id).is_err());
        assert_eq!(std::fs::read_dir(store.folder()).unwrap().count(), 0);
    }

    #[test]
    fn what_others_rely_on_is_not_read_once_it_has_changed() {
        let scratch = tempfile::tempdir().unwrap();
        // Nothing is held in memory.
        let store = DepthStore { held: ByteCache::new(0), ..store(scratch.path()) };
        let (id, stage) = (ImageId(5), MapStage::Pass(0));
        store.write_stage(estimate(5, 3.0), stage, false).unwrap();
        assert!(store.read_stage(id, stage).is_ok());
        let path = store.stage_path(id, stage);
        let whole = std::fs::read(&path).unwrap();
        for at in 0..whole.len() {
            let mut bytes = whole.clone();
            bytes[at] ^= 1;
            std::fs::write(&path, bytes).unwrap();
            assert!(store.read_stage(id, stage).is_err(), "byte {at}");
        }
        std::fs::write(&path, &whole).unwrap();
        assert!(store.read_stage(id, stage).is_ok());
    }

    #[test]
    fn an_existing_map_must_be_of_this_image_size_and_camera() {
        let scratch = tempfile::tempdir().unwrap();
        let store = store(scratch.path());
        let ours = estimate(5, 1.0);
        let (size, k, rotation, center) =
            (ours.camera.size(), *ours.camera.k(), *ours.camera.rotation(), *ours.camera.center());
        assert!(matches!(store.existing(ImageId(5), &ours.camera), Existing::Absent));
        store.write(ours.clone()).unwrap();
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
            store.write(estimate(id, 1.0 + id as f32)).unwrap();
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
