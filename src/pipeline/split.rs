//! A scene with depth maps to scenes that can be fused one after the other.

use super::job::{SceneArchive, SceneJob};
use super::outputs::{summary, write_archive};
use super::prepare::load;
use super::record::with_threads;
use crate::error::{Error, Result};
use crate::geometry::Size;
use crate::progress::{Event, Progress};
use crate::scene::{ImageId, ViewIndex};
use crate::store::atomic::check_writable;
use crate::store::depth_store::{DepthStore, Existing};
use crate::store::export::restrict_archive;
use crate::store::import::LoadedScene;
use crate::store::stored_cloud::resaved_archive;
use crate::sub_scenes::{Chunk, Sample, split};
use rayon::prelude::*;
use semvs_formats::Limits;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Every so many pixels there is a sample.
const STEP: usize = 8;
/// What a sample of a view of focal length 1 counts at depth 1.
const SAMPLE_AREA: f64 = 0.01;

/// `--sub-scene-area`: the scene in parts.
#[derive(Clone, Debug)]
pub struct SplitJob {
    /// The scene.
    pub input: SceneJob,
    /// Folder of its depth maps.
    pub depth_maps: PathBuf,
    /// Largest summed area of the samples of a part; a sample counts 0.01 · focal length / depth.
    pub max_area: f32,
    /// Folder of the parts, `scene_NNNN.mvs`.
    pub folder: PathBuf,
    /// Archive that the parts are written as.
    pub archive: SceneArchive,
    /// Name images in the parts by their position in the scene instead of their ID in it, as OpenMVS does: then depth
    /// maps are only found where the two are the same.
    pub number_by_position: bool,
}

/// Runs `job`; returns the files. Fewer than two parts: nothing is written.
///
/// # Errors
/// There are no depth maps, or a file cannot be read or written.
pub fn split_scene(job: &SplitJob, progress: &Progress) -> Result<Vec<PathBuf>> {
    with_threads(job.input.max_threads, || run(job, progress))
}

fn run(job: &SplitJob, progress: &Progress) -> Result<Vec<PathBuf>> {
    if !(job.max_area > 0.0 && job.max_area.is_finite()) {
        return Err(Error::invalid("--sub-scene-area must be a number > 0"));
    }
    check_writable(&part_path(&job.folder, 0))?;
    let loaded = load(&job.input, progress)?;
    let store = DepthStore::new(&job.depth_maps, loaded.search.clone(), 0, Limits::default());
    let views = mapped_views(&loaded, &store, job.input.strict, progress)?;
    let samples = samples(&loaded, &store, &views)?;
    let (count, maps) = (samples.len(), views.len());
    let chunks = split(samples, loaded.scene.roi.as_ref(), job.max_area);
    progress.info(format!("Scene divided into {} parts: {count} samples of {maps} depth maps", chunks.len()));
    if chunks.len() < 2 {
        progress.info("The scene is small enough to be fused at once; nothing is written");
        return Ok(Vec::new());
    }
    let ids: Vec<ImageId> = (0..loaded.scene.views.len())
        .map(|i| if job.number_by_position { ImageId(i as u32) } else { loaded.scene.views[i].id })
        .collect();
    let mut paths = Vec::with_capacity(chunks.len());
    for (i, chunk) in chunks.iter().enumerate() {
        let path = part_path(&job.folder, i);
        write_part(&path, &loaded, chunk, &ids, job.archive, progress)?;
        paths.push(path);
    }
    let stale = part_path(&job.folder, chunks.len());
    if stale.exists() {
        progress.warn(format!("{}: is from an earlier split with more parts; remove it", stale.display()));
    }
    Ok(paths)
}

fn part_path(folder: &Path, i: usize) -> PathBuf {
    folder.join(format!("scene_{i:04}.mvs"))
}

/// The views with a depth map that belongs to the scene.
fn mapped_views(
    loaded: &LoadedScene,
    store: &DepthStore,
    strict: bool,
    progress: &Progress,
) -> Result<Vec<ViewIndex>> {
    let mut views = Vec::new();
    for (i, view) in loaded.scene.views.iter().enumerate() {
        let Some(calibration) = &view.calibration else { continue };
        let size = match store.header(view.id) {
            Ok(Some(header)) => Size::new(header.width, header.height),
            Ok(None) => continue,
            Err(error) if strict => return Err(error),
            Err(error) => {
                progress.warn(format!("{error}; it is left out"));
                continue;
            }
        };
        match store.existing(view.id, &calibration.camera_at(size)) {
            Existing::Usable => views.push(ViewIndex(i as u32)),
            Existing::Unusable(why) if strict => return Err(Error::Invalid(why)),
            Existing::Unusable(why) => progress.warn(format!("{why}; it is left out")),
            Existing::Absent => {}
        }
    }
    if views.is_empty() {
        let what = "no depth map of the scene's images is here; make them first with --fusion-mode 1";
        return Err(Error::content(store.folder(), what));
    }
    Ok(views)
}

/// Some of the depths of every map.
fn samples(loaded: &LoadedScene, store: &DepthStore, views: &[ViewIndex]) -> Result<Vec<Sample>> {
    let of_view = |&view: &ViewIndex| -> Result<Vec<Sample>> {
        let estimate = store.read(loaded.scene.views[view.index()].id)?;
        let (depth, camera) = (&estimate.depth, &estimate.camera);
        let focal = camera.intrinsics().0;
        let mut samples = Vec::new();
        for y in (depth.height() % STEP / 2..depth.height()).step_by(STEP) {
            for x in (depth.width() % STEP / 2..depth.width()).step_by(STEP) {
                let z = f64::from(depth[(x, y)]);
                if z > 0.0 && z.is_finite() {
                    let point = camera.world_from_image(x as f64, y as f64, z);
                    let area = (SAMPLE_AREA * focal / z) as f32;
                    samples.push(Sample { position: point.map(|v| v as f32).into(), area, view });
                }
            }
        }
        Ok(samples)
    };
    let all = views.par_iter().map(of_view).collect::<Result<Vec<_>>>()?;
    Ok(all.concat())
}

fn write_part(
    path: &Path,
    loaded: &LoadedScene,
    chunk: &Chunk,
    ids: &[ImageId],
    archive: SceneArchive,
    progress: &Progress,
) -> Result<()> {
    let start = Instant::now();
    let points = loaded.archive.points.clone();
    let mut part = resaved_archive(loaded, points, matches!(archive, SceneArchive::Project(_)));
    for (image, id) in part.images.iter_mut().zip(ids) {
        image.id = id.0;
    }
    restrict_archive(&mut part, &chunk.views, &chunk.roi);
    let (images, points) = (part.images.len(), part.points.positions.len());
    write_archive(path, &part, archive)?;
    progress.info(format!(
        "{}: {images} images, {points} points, area {:.0} (sub-scene)",
        path.display(),
        chunk.area
    ));
    let scene = summary(&part, archive == SceneArchive::Interface);
    progress.event(Event::SceneSaved { path: path.to_owned(), scene, elapsed: start.elapsed() });
    Ok(())
}
