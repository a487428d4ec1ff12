//! Depth maps to a cropped cloud.

use super::job::RoiJob;
use super::label_votes::LabelVotes;
use super::memory_plan::MemoryPlan;
use super::prepare::Prepared;
use crate::depth_filter::normals_from_depth;
use crate::error::{Error, Result};
use crate::fusion::{
    AttributeSource, FusionInput, FusionMaps, FusionOptions, FusionSummary, FusionView, MapInfo, MapSource,
    fuse,
};
use crate::geometry::Size;
use crate::progress::{Event, Progress};
use crate::scene::{DepthEstimate, PointSource, ViewIndex};
use crate::semantics::{Consensus, Voters};
use crate::store::depth_store::DepthStore;
use crate::store::spool::{PointSpool, SpooledCloud};
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

/// A cloud in its final order, and how it came about.
pub(super) struct Fused {
    pub(super) cloud: SpooledCloud,
    pub(super) summary: FusionSummary,
}

/// `options` for a scene of `usable` images, of which `maps` have a depth map: like OpenMVS, a scene with fewer images
/// than must agree on a point makes do with what it has.
///
/// # Errors
/// So few depth maps that no point can come about.
pub(super) fn possible(
    options: &FusionOptions,
    usable: usize,
    maps: usize,
    progress: &Progress,
) -> Result<FusionOptions> {
    let asked = options.number_views_fuse;
    if asked < 2 {
        return Ok(*options);
    }
    let fewest = asked.min(u32::try_from(usable.max(2)).unwrap_or(u32::MAX));
    if maps < fewest as usize {
        let remedy = match maps {
            0 | 1 => "--number-views-fuse 1 makes a point of every depth".to_owned(),
            maps => format!("give --number-views-fuse {maps}"),
        };
        return Err(Error::invalid(format!(
            "no point is possible: {fewest} images must agree on one (--number-views-fuse), and {maps} of {usable} have \
             a depth map or can get one; {remedy}"
        )));
    }
    if fewest < asked {
        progress.warn(format!(
            "--number-views-fuse {asked}: only {usable} images can be used; {fewest} must agree"
        ));
    }
    Ok(FusionOptions { number_views_fuse: fewest, ..*options })
}

/// Fuses the maps of `views`. Points beyond memory wait in `folder`.
///
/// # Errors
/// A map or an image cannot be read; the folder cannot be written.
#[allow(clippy::too_many_arguments, reason = "all that fusion depends on")]
pub(super) fn fuse_maps(
    prepared: &Prepared,
    store: &DepthStore,
    views: &[ViewIndex],
    options: &FusionOptions,
    roi: &RoiJob,
    folder: &Path,
    memory: &MemoryPlan,
    progress: &Progress,
) -> Result<Fused> {
    let start = Instant::now();
    let options = &FusionOptions { map_memory: memory.fusion, ..*options };
    let derive_normals = options.estimate_normals == AttributeSource::DuringFusion;
    let voting = prepared.labels.as_ref().filter(|labels| labels.rules().voters == Voters::All);
    let votes = voting.map(|labels| LabelVotes::new(prepared, labels, store, views));
    let maps = FusionSource {
        prepared,
        store,
        colors: options.estimate_colors != AttributeSource::None,
        derive_normals,
        votes,
    };
    let fusion_views = fusion_views(prepared, store, views, derive_normals)?;
    let policy = prepared.labels.as_ref().map(|labels| labels.policy());
    let input = FusionInput { views: &fusion_views, source: &maps, policy };
    let region = prepared.loaded.scene.roi.as_ref().filter(|_| roi.crop);
    let crop = region.map(|region| region.with_border(roi.border)).transpose()?;
    let mut spool = PointSpool::new(input.layout(options), crop, folder, memory.points);
    let summary = fuse(&input, options, progress, &mut spool)?;
    let cloud = spool.finish()?;
    progress.event(Event::Fused {
        maps: summary.maps,
        depths: summary.depths,
        points: summary.points,
        elapsed: start.elapsed(),
    });
    if cloud.cropped() > 0 {
        progress.info(format!(
            "{} points outside the region of interest are left out, {} remain",
            cloud.cropped(),
            cloud.len()
        ));
    }
    Ok(Fused { cloud, summary })
}

/// All views of the scene as fusion wants them; those of `views` have maps.
fn fusion_views(
    prepared: &Prepared,
    store: &DepthStore,
    views: &[ViewIndex],
    derive_normals: bool,
) -> Result<Vec<FusionView>> {
    let mut out: Vec<FusionView> = prepared
        .neighbors
        .iter()
        .map(|n| FusionView {
            maps: None,
            neighbors: n.retained.iter().map(|r| r.view).collect(),
            neighbor_count: n.all.len(),
        })
        .collect();
    for &view in views {
        let id = prepared.id(view);
        let header = store
            .header(id)?
            .ok_or_else(|| Error::content(&store.path(id), "the depth map is gone; run again"))?;
        let size = Size::new(header.width, header.height);
        out[view.index()].maps = Some(MapInfo { size, normals: header.has_normal || derive_normals });
    }
    Ok(out)
}

struct FusionSource<'a> {
    prepared: &'a Prepared,
    store: &'a DepthStore,
    colors: bool,
    /// Maps without normals get them from the shape of their depths.
    derive_normals: bool,
    /// Where all views vote on labels.
    votes: Option<LabelVotes<'a>>,
}

impl MapSource for FusionSource<'_> {
    fn load(&self, view: ViewIndex) -> Result<FusionMaps> {
        let mut estimate = self.store.take(self.prepared.id(view))?;
        if let Some(masks) = &self.prepared.masks {
            estimate = masks.unmasked(view, estimate)?;
        }
        if self.derive_normals && estimate.normal.is_none() {
            let normal = normals_from_depth(&estimate.depth, &estimate.camera);
            estimate = Arc::new(DepthEstimate { normal: Some(normal), ..DepthEstimate::clone(&estimate) });
        }
        let size = estimate.depth.size();
        let color = self.colors.then(|| self.prepared.images.color(view, size)).transpose()?;
        let (labels, checked_labels, label_confidence) = match (&self.votes, &self.prepared.labels) {
            (Some(votes), Some(labels)) => {
                let Consensus { labels: map, confidence } = votes.of(view, &estimate)?;
                let checked = labels.checked(&map);
                (Some(Arc::new(map)), checked, Some(Arc::new(confidence)))
            }
            (None, Some(labels)) => {
                let (map, checked) = labels.maps(view, size)?;
                (Some(map), checked, None)
            }
            (_, None) => (None, None, None),
        };
        Ok(FusionMaps { estimate, color, labels, checked_labels, label_confidence })
    }
}
