//! Pixels that get no depth: masked ones, and those of classes that are not estimated.

use super::job::{LabelJob, MaskJob};
use crate::error::{Error, Result};
use crate::geometry::{Camera, Size};
use crate::progress::Progress;
use crate::scene::{Grid, LabelMap, ViewIndex};
use crate::semantics::{ClassPolicy, ClassTable, void_borders};
use crate::store::images::image_size;
use crate::store::import::LoadedScene;
use crate::store::labels::{LabelRequest, LabelStore};
use crate::store::masks::{default_mask_name, load_mask, mask_in_folder};
use crate::store::paths::name_relative_to;
use semvs_formats::{Limits, mvs};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The label maps of a run and what they decide.
#[derive(Debug)]
pub(super) struct Labels {
    store: LabelStore,
    policy: ClassPolicy,
}

impl Labels {
    /// Finds and checks the label maps of all views that have a camera.
    ///
    /// # Errors
    /// As [`LabelStore::open`] and [`ClassPolicy::new`].
    pub(super) fn open(
        job: &LabelJob,
        loaded: &LoadedScene,
        cameras: &[Option<Camera>],
        progress: &Progress,
    ) -> Result<Self> {
        let requests: Vec<LabelRequest> = cameras
            .iter()
            .enumerate()
            .filter(|(_, camera)| camera.is_some())
            .map(|(i, _)| {
                let view = ViewIndex(i as u32);
                let image = loaded.image_path(view);
                let mask = loaded.scene.views[i].mask.as_deref().map(|name| loaded.search.find(name));
                let size = image_size(&image).ok();
                LabelRequest { view, image, mask, size }
            })
            .collect();
        Labels::open_requests(job, &requests, progress)
    }

    /// Finds and checks the label maps of `requests`.
    ///
    /// # Errors
    /// As [`LabelStore::open`] and [`ClassPolicy::new`].
    pub(super) fn open_requests(
        job: &LabelJob,
        requests: &[LabelRequest],
        progress: &Progress,
    ) -> Result<Self> {
        let store = LabelStore::open(&job.sources, requests, Limits::default(), progress)?;
        let policy = ClassPolicy::new(store.table(), &job.rules)?;
        Ok(Labels { store, policy })
    }

    /// The classes.
    pub(super) fn table(&self) -> &ClassTable {
        self.store.table()
    }

    /// The classes, and what to do with each.
    pub(super) fn classes(&self) -> (&ClassTable, &ClassPolicy) {
        (self.table(), self.policy())
    }

    /// What to do with each class.
    pub(super) fn policy(&self) -> &ClassPolicy {
        &self.policy
    }

    /// The label map of a view, if it has one.
    pub(super) fn file(&self, view: ViewIndex) -> Option<&Path> {
        self.store.file(view)
    }

    /// The labels of a view at `size`, and the same with void borders where the check wants them.
    ///
    /// # Errors
    /// As [`LabelStore::load`].
    pub(super) fn maps(&self, view: ViewIndex, size: Size) -> Result<(Arc<LabelMap>, Option<Arc<LabelMap>>)> {
        let labels = self.store.load(view, size)?;
        let border = self.policy.border();
        let checked = (border > 0).then(|| Arc::new(void_borders(&labels, border)));
        Ok((labels, checked))
    }
}

/// The masks of a run.
#[derive(Debug)]
pub(super) struct Masks {
    ignore: u16,
    /// Whether the files are those of a folder that was named.
    in_folder: bool,
    files: Vec<Option<PathBuf>>,
}

impl Masks {
    /// Finds the masks of all views that have a camera. A view without one is used whole, with a warning, unless
    /// a folder was named.
    ///
    /// # Errors
    /// A mask is missing in the folder that was named.
    pub(super) fn find(
        job: &MaskJob,
        loaded: &LoadedScene,
        cameras: &[Option<Camera>],
        progress: &Progress,
    ) -> Result<Self> {
        let mut files = Vec::with_capacity(cameras.len());
        for (view, camera) in loaded.scene.views.iter().zip(cameras) {
            if camera.is_none() {
                files.push(None);
                continue;
            }
            let file = match (&job.folder, &view.mask) {
                (Some(folder), _) => mask_in_folder(folder, &view.name),
                (None, Some(mask)) => loaded.search.find(mask),
                (None, None) => loaded.search.find(&default_mask_name(&view.name)),
            };
            if !file.is_file() {
                let what = format!("no such mask for image {}", view.name);
                if job.folder.is_some() {
                    return Err(Error::content(&file, format!("{what} (--mask-path)")));
                }
                progress.warn(format!("{}: {what}; the image is used whole", file.display()));
                files.push(None);
                continue;
            }
            files.push(Some(file));
        }
        Ok(Masks { ignore: job.ignore, in_folder: job.folder.is_some(), files })
    }

    /// Names the masks of a folder that was named in the scene to be written, relative to the working folder.
    pub(super) fn enter(&self, archive: &mut mvs::Scene, working_folder: &Path) {
        for (image, file) in archive.images.iter_mut().zip(&self.files).filter(|_| self.in_folder) {
            if let Some(file) = file {
                image.mask_name = name_relative_to(file, working_folder).into_bytes();
            }
        }
    }

    /// The pixels of a view to ignore at `size`; `None` if it has no mask or one that cannot be read, with a
    /// warning.
    pub(super) fn ignored(&self, view: ViewIndex, size: Size, progress: &Progress) -> Option<Grid<bool>> {
        let file = self.files[view.index()].as_ref()?;
        match load_mask(file, size) {
            Ok(mask) => {
                let ignored = mask.data().iter().map(|&value| value == self.ignore).collect();
                Grid::from_vec(size, ignored)
            }
            Err(error) => {
                progress.warn(format!("{error}; the image is used whole"));
                None
            }
        }
    }
}

/// The pixels of a view that get no depth; `None`: all do.
///
/// # Errors
/// As [`Labels::maps`].
pub(super) fn skipped(
    view: ViewIndex,
    size: Size,
    masks: Option<&Masks>,
    labels: Option<&Labels>,
    progress: &Progress,
) -> Result<Option<Grid<bool>>> {
    let mut skip = masks.and_then(|masks| masks.ignored(view, size, progress));
    if let Some(labels) = labels {
        let (map, _) = labels.maps(view, size)?;
        let unwanted = |&id: &u16| !labels.policy().is_estimated(id);
        if map.data().iter().any(unwanted) {
            let skip = skip.get_or_insert_with(|| Grid::filled(size, false));
            for (skip, id) in skip.data_mut().iter_mut().zip(map.data()) {
                *skip |= unwanted(id);
            }
        }
    }
    Ok(skip)
}
