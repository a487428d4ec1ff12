//! The labels of a view as all views vote on them that see the same surface.

use super::prepare::Prepared;
use super::skip::Labels;
use crate::error::Result;
use crate::geometry::Camera;
use crate::scene::{DepthEstimate, DepthMap, Grid, LabelMap, ViewIndex};
use crate::semantics::{Consensus, ConsensusOptions, Witness, border_distance, label_consensus};
use crate::store::byte_cache::ByteCache;
use crate::store::depth_store::DepthStore;
use rayon::prelude::*;
use std::sync::Arc;

/// Bytes of depths and labels that are kept for the next view.
const MEMORY: usize = 256 << 20;
/// Bytes per pixel of what is kept: depth, class, distance to a border.
const BYTES_PER_PIXEL: usize = 7;

/// Depth maps and label maps that are held against each other. Any number of views: what lies beyond [`MEMORY`] is read
/// again.
pub(super) struct LabelVotes<'a> {
    prepared: &'a Prepared,
    labels: &'a Labels,
    store: &'a DepthStore,
    has_map: Vec<bool>,
    surfaces: ByteCache<ViewIndex, Surface>,
    options: ConsensusOptions,
}

/// What a view says of surfaces and their classes.
struct Surface {
    camera: Camera,
    depth: DepthMap,
    labels: Arc<LabelMap>,
    border_distance: Grid<u8>,
}

impl Surface {
    fn witness(&self) -> Witness<'_> {
        Witness {
            camera: &self.camera,
            depth: &self.depth,
            labels: &self.labels,
            border_distance: &self.border_distance,
        }
    }
}

impl<'a> LabelVotes<'a> {
    /// The votes of `views`, which have depth maps in `store`.
    pub(super) fn new(
        prepared: &'a Prepared,
        labels: &'a Labels,
        store: &'a DepthStore,
        views: &[ViewIndex],
    ) -> Self {
        let mut has_map = vec![false; prepared.neighbors.len()];
        views.iter().for_each(|view| has_map[view.index()] = true);
        let own = ConsensusOptions::default();
        let border = u8::try_from(labels.policy().border()).unwrap_or(u8::MAX).max(own.border);
        let options = ConsensusOptions { border, ..own };
        LabelVotes { prepared, labels, store, has_map, surfaces: ByteCache::new(MEMORY), options }
    }

    /// The labels of `view`, whose estimate is `estimate`, by the vote of all its neighbours.
    ///
    /// # Errors
    /// A depth map or label map of a neighbour cannot be read.
    pub(super) fn of(&self, view: ViewIndex, estimate: &DepthEstimate) -> Result<Consensus> {
        let own = self.surfaces.get_or_load(view, || self.surface(view, estimate))?;
        let neighbors: Vec<ViewIndex> = self.prepared.neighbors[view.index()]
            .retained
            .iter()
            .map(|n| n.view)
            .filter(|n| *n != view && self.has_map[n.index()])
            .collect();
        let others: Vec<Arc<Surface>> =
            neighbors.into_par_iter().map(|view| self.load(view)).collect::<Result<_>>()?;
        let witnesses: Vec<Witness<'_>> = others.iter().map(|surface| surface.witness()).collect();
        Ok(label_consensus(&own.witness(), &witnesses, &self.options))
    }

    fn load(&self, view: ViewIndex) -> Result<Arc<Surface>> {
        self.surfaces.get_or_load(view, || {
            let mut estimate = self.store.read(self.prepared.id(view))?;
            if let Some(masks) = &self.prepared.masks {
                estimate = masks.unmasked(view, estimate)?;
            }
            self.surface(view, &estimate)
        })
    }

    fn surface(&self, view: ViewIndex, estimate: &DepthEstimate) -> Result<(Surface, usize)> {
        let depth = estimate.depth.clone();
        let (labels, _) = self.labels.maps(view, depth.size())?;
        let border_distance = border_distance(&labels, self.options.border);
        let bytes = depth.size().area() * BYTES_PER_PIXEL;
        Ok((Surface { camera: estimate.camera.clone(), depth, labels, border_distance }, bytes))
    }
}
