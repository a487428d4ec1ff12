//! Masks: regions of one class that nobody wants.

use super::job::MaskJob;
use super::skip::Labels;
use crate::error::{Error, Result};
use crate::geometry::{Camera, Size};
use crate::progress::Progress;
use crate::scene::{DepthEstimate, Grid, LabelMap, ViewIndex};
use crate::semantics::{ClassId, ClassPolicy};
use crate::store::byte_cache::ByteCache;
use crate::store::images::image_size;
use crate::store::import::LoadedScene;
use crate::store::labels::have_one_shape;
use crate::store::masks::{default_mask_name, load_mask, mask_in_folder};
use crate::store::paths::name_relative_to;
use rayon::prelude::*;
use semvs_formats::mvs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Bytes of masks that are kept for the next use.
const CACHE_BYTES: usize = 64 << 20;

/// The masks of a run, as label maps of two classes: what is masked, which is neither estimated nor kept, and the rest.
#[derive(Debug)]
pub(super) struct Masks {
    ignore: u16,
    /// Whether the files are those of a folder that was named.
    in_folder: bool,
    files: Vec<Option<PathBuf>>,
    /// The class of what is masked.
    masked: ClassId,
    /// What to do with each class, masked or of the label maps.
    policy: ClassPolicy,
    cache: ByteCache<(ViewIndex, Size), Grid<bool>>,
}

/// A view whose mask is wanted.
#[derive(Clone, Debug)]
pub(super) struct MaskRequest {
    /// Its photograph as the scene names it.
    pub(super) image_name: String,
    /// Its photograph.
    pub(super) image: PathBuf,
    /// Where its mask should be, unless a folder is named.
    pub(super) mask: PathBuf,
}

/// The class of what is not masked, where no label says more.
const REST: ClassId = ClassId(1);

impl Masks {
    /// Finds and checks the masks of all views of a scene that have a camera.
    ///
    /// # Errors
    /// As [`Masks::open`].
    pub(super) fn find(
        job: &MaskJob,
        loaded: &LoadedScene,
        cameras: &[Option<Camera>],
        labels: Option<&Labels>,
        progress: &Progress,
    ) -> Result<Self> {
        let request = |(i, camera): (usize, &Option<Camera>)| {
            camera.as_ref()?;
            let view = &loaded.scene.views[i];
            let mask = match &view.mask {
                Some(mask) => loaded.search.find(mask),
                None => loaded.search.find(&default_mask_name(&view.name)),
            };
            let image = loaded.image_path(ViewIndex(i as u32));
            Some(MaskRequest { image_name: view.name.clone(), image, mask })
        };
        let requests: Vec<Option<MaskRequest>> = cameras.iter().enumerate().map(request).collect();
        Masks::open(job, &requests, labels, progress)
    }

    /// Finds the mask of every view and reads each once. A view without one, or with one that cannot be read, is used
    /// whole, with a warning.
    ///
    /// # Errors
    /// A mask is missing in the folder that was named, or is not of the size of the view's label map.
    pub(super) fn open(
        job: &MaskJob,
        requests: &[Option<MaskRequest>],
        labels: Option<&Labels>,
        progress: &Progress,
    ) -> Result<Self> {
        let files = requests
            .iter()
            .map(|request| request.as_ref().map_or(Ok(None), |request| find(job, request, progress)))
            .collect::<Result<Vec<Option<PathBuf>>>>()?;
        let checked: Vec<Result<Checked>> = files
            .into_par_iter()
            .zip(requests)
            .enumerate()
            .map(|(i, (file, request))| match (file, request) {
                (Some(file), Some(request)) => {
                    let of_labels = labels.and_then(|labels| labels.file(ViewIndex(i as u32)));
                    check(file, request, of_labels)
                }
                _ => Ok(Checked::default()),
            })
            .collect();
        let checked = checked.into_iter().collect::<Result<Vec<_>>>()?;
        checked.iter().filter_map(|c| c.remark.as_ref()).for_each(|remark| progress.warn(remark.as_str()));
        let files = checked.into_iter().map(|checked| checked.file).collect();
        let (masked, policy) = match labels {
            Some(labels) => (labels.table().free_id(), labels.policy().clone()),
            None => (ClassId(REST.0 + 1), ClassPolicy::default()),
        };
        Ok(Masks {
            ignore: job.ignore,
            in_folder: job.folder.is_some(),
            files,
            masked,
            policy: policy.dropping(masked),
            cache: ByteCache::new(CACHE_BYTES),
        })
    }

    /// What to do with each class, masked or of the label maps.
    pub(super) fn policy(&self) -> &ClassPolicy {
        &self.policy
    }

    /// Names the masks of a folder that was named in the scene to be written, relative to the working folder.
    pub(super) fn enter(&self, archive: &mut mvs::Scene, working_folder: &Path) {
        for (image, file) in archive.images.iter_mut().zip(&self.files).filter(|_| self.in_folder) {
            if let Some(file) = file {
                image.mask_name = name_relative_to(file, working_folder).into_bytes();
            }
        }
    }

    /// The pixels of a view to ignore at `size`; `None` if it has no mask.
    ///
    /// # Errors
    /// The file has changed for the worse since it was checked.
    pub(super) fn ignored(&self, view: ViewIndex, size: Size) -> Result<Option<Arc<Grid<bool>>>> {
        let Some(file) = &self.files[view.index()] else { return Ok(None) };
        let load = || {
            let mask = load_mask(file, size)?;
            let ignored = mask.data().iter().map(|&value| value == self.ignore).collect();
            let ignored = Grid::from_vec(size, ignored).unwrap_or_default();
            Ok((ignored, size.area()))
        };
        self.cache.get_or_load((view, size), load).map(Some)
    }

    /// The classes of a view at `size`: those of `labels`, or one for all, where nothing is masked.
    ///
    /// # Errors
    /// As [`Masks::ignored`].
    pub(super) fn over(
        &self,
        labels: Option<Arc<LabelMap>>,
        view: ViewIndex,
        size: Size,
    ) -> Result<Arc<LabelMap>> {
        let mut map = match &labels {
            Some(labels) => LabelMap::clone(labels),
            None => Grid::filled(size, REST.0),
        };
        if let Some(ignored) = self.ignored(view, size)? {
            for (id, _) in map.data_mut().iter_mut().zip(ignored.data()).filter(|(_, ignored)| **ignored) {
                *id = self.masked.0;
            }
        }
        Ok(Arc::new(map))
    }

    /// `estimate`, that of `view`, without the depths of masked pixels, which maps made elsewhere may have.
    ///
    /// # Errors
    /// As [`Masks::ignored`].
    pub(super) fn unmasked(
        &self,
        view: ViewIndex,
        estimate: Arc<DepthEstimate>,
    ) -> Result<Arc<DepthEstimate>> {
        let Some(ignored) = self.ignored(view, estimate.depth.size())? else { return Ok(estimate) };
        let covers = |(depth, ignored): (&f32, &bool)| *ignored && *depth > 0.0;
        if !estimate.depth.data().iter().zip(ignored.data()).any(covers) {
            return Ok(estimate);
        }
        let mut estimate = DepthEstimate::clone(&estimate);
        for (depth, &ignored) in estimate.depth.data_mut().iter_mut().zip(ignored.data()) {
            if ignored {
                *depth = 0.0;
            }
        }
        Ok(Arc::new(estimate))
    }
}

/// The mask that a view has.
fn find(job: &MaskJob, request: &MaskRequest, progress: &Progress) -> Result<Option<PathBuf>> {
    let file = match &job.folder {
        Some(folder) => mask_in_folder(folder, &request.image_name),
        None => request.mask.clone(),
    };
    if file.is_file() {
        return Ok(Some(file));
    }
    let what = format!("no such mask for image {}", request.image_name);
    if job.folder.is_some() {
        return Err(Error::content(&file, format!("{what} (--mask-path)")));
    }
    progress.warn(format!("{}: {what}; the image is used whole", file.display()));
    Ok(None)
}

/// A mask that can be used, and what is odd about it.
#[derive(Default)]
struct Checked {
    file: Option<PathBuf>,
    remark: Option<String>,
}

/// The mask, if it can be read; it must have the size of the view's label map.
fn check(file: PathBuf, request: &MaskRequest, labels: Option<&Path>) -> Result<Checked> {
    let size = image_size(&file).and_then(|size| load_mask(&file, size).map(|_| size));
    let size = match size {
        Ok(size) => size,
        Err(error) => {
            let remark = format!("{error}; the image is used whole");
            return Ok(Checked { file: None, remark: Some(remark) });
        }
    };
    if let Some(labels) = labels {
        let of_labels = image_size(labels)?;
        if of_labels != size {
            let what = format!(
                "this mask has {size} pixels, the label map {} of the same view has {of_labels}: give them one size, or \
                 only one of them",
                labels.display()
            );
            return Err(Error::content(&file, what));
        }
    }
    let remark = image_size(&request.image).ok().filter(|image| !have_one_shape(size, *image)).map(|image| {
        let image_name = &request.image_name;
        format!(
            "{}: the mask has {size} pixels, image {image_name} has {image}; it is stretched",
            file.display()
        )
    });
    Ok(Checked { file: Some(file), remark })
}
