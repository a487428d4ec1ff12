//! The classes of pixels, be they from label maps or masks, and which of them get no depth.

use super::job::LabelJob;
use super::masks::Masks;
use crate::error::Result;
use crate::geometry::{Camera, Size};
use crate::progress::Progress;
use crate::scene::{Grid, LabelMap, ViewIndex};
use crate::semantics::{ClassPolicy, ClassRules, ClassTable, PlanarRegion, planar_regions, void_borders};
use crate::store::images::image_size;
use crate::store::import::LoadedScene;
use crate::store::labels::{LabelRequest, LabelStore};
use semvs_formats::Limits;
use std::path::Path;
use std::sync::Arc;

/// The label maps of a run and what they decide.
#[derive(Debug)]
pub(super) struct Labels {
    store: LabelStore,
    policy: ClassPolicy,
    rules: ClassRules,
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
        Ok(Labels { store, policy, rules: job.rules.clone() })
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

    /// What was asked of labels.
    pub(super) fn rules(&self) -> &ClassRules {
        &self.rules
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
        let checked = self.checked(&labels);
        Ok((labels, checked))
    }

    /// `labels` with void borders where the check wants them.
    pub(super) fn checked(&self, labels: &LabelMap) -> Option<Arc<LabelMap>> {
        let border = self.policy.border();
        (border > 0).then(|| Arc::new(void_borders(labels, border)))
    }
}

/// The classes of a view's pixels, and what to do with each: all that stages before fusion need to know of labels and
/// masks.
#[derive(Clone, Debug)]
pub(super) struct Regions<'a> {
    /// Class ids; what is masked has a class of its own, which is neither estimated nor kept.
    pub(super) map: Arc<LabelMap>,
    /// What to do with them.
    pub(super) policy: &'a ClassPolicy,
}

/// The regions of a view at `size`; `None` without labels and masks.
///
/// # Errors
/// As [`Labels::maps`] and [`Masks::ignored`].
pub(super) fn regions<'a>(
    view: ViewIndex,
    size: Size,
    masks: Option<&'a Masks>,
    labels: Option<&'a Labels>,
) -> Result<Option<Regions<'a>>> {
    let map = labels.map(|labels| labels.maps(view, size)).transpose()?.map(|(map, _)| map);
    Ok(match (masks, labels, map) {
        (Some(masks), _, map) => Some(Regions { map: masks.over(map, view, size)?, policy: masks.policy() }),
        (None, Some(labels), Some(map)) => Some(Regions { map, policy: labels.policy() }),
        _ => None,
    })
}

/// The pixels of a view that get no depth; `None`: all do.
///
/// # Errors
/// As [`regions`].
pub(super) fn skipped(
    view: ViewIndex,
    size: Size,
    masks: Option<&Masks>,
    labels: Option<&Labels>,
) -> Result<Option<Grid<bool>>> {
    let Some(Regions { map, policy }) = regions(view, size, masks, labels)? else { return Ok(None) };
    let skip: Vec<bool> = map.data().iter().map(|&id| !policy.is_estimated(id)).collect();
    Ok(Grid::from_vec(size, skip).filter(|skip| skip.data().contains(&true)))
}

/// The regions of a view whose pixels are drawn towards planes.
///
/// # Errors
/// As [`regions`].
pub(super) fn planar(
    view: ViewIndex,
    size: Size,
    masks: Option<&Masks>,
    labels: Option<&Labels>,
) -> Result<Vec<PlanarRegion>> {
    if !labels.is_some_and(|labels| labels.policy().has_plane_priors()) {
        return Ok(Vec::new());
    }
    let regions = regions(view, size, masks, labels)?;
    Ok(regions.map_or_else(Vec::new, |regions| planar_regions(&regions.map, regions.policy)))
}
