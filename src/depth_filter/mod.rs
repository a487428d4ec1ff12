//! Cleaning of estimated depth maps: within one map (speckles, gaps) and across neighbouring views.
//!
//! Nothing here opens a file. The within-map filters work in place; the cross-view filters read the unfiltered
//! maps of all views involved and return a new estimate, so that views can be filtered in any order and at the
//! same time.

mod consistency;
mod gaps;
mod normals;
mod options;
mod speckle;
mod unbiased;
mod warp;
mod witness;

use crate::scene::{DepthEstimate, LabelMap};

pub use consistency::{MAX_NEIGHBORS, filter_consistency};
pub use gaps::fill_gaps;
pub use normals::normals_from_depth;
pub use options::DepthFilterOptions;
pub use speckle::remove_speckles;
pub use unbiased::{UnbiasedFilterOptions, Votes, count_votes, filter_unbiased};

/// A view as the cross-view filters see it.
#[derive(Clone, Copy, Debug)]
pub struct FilterView<'a> {
    /// The unfiltered maps.
    pub estimate: &'a DepthEstimate,
    /// Class of every pixel, at the size of the maps. Where both views have one, a neighbour's pixel of another
    /// class neither confirms nor refutes a depth.
    pub labels: Option<&'a LabelMap>,
}

impl<'a> FilterView<'a> {
    /// A view without labels.
    pub fn new(estimate: &'a DepthEstimate) -> Self {
        FilterView { estimate, labels: None }
    }
}
