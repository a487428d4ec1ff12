//! Cleaning of estimated depth maps: within one map (speckles, gaps) and across neighbouring views.
//!
//! Nothing here opens a file. The within-map filters work in place; the cross-view filters read the unfiltered
//! maps of all views involved and return a new estimate, so that views can be filtered in any order.

mod gaps;
mod options;
mod speckle;

pub use gaps::fill_gaps;
pub use options::DepthFilterOptions;
pub use speckle::remove_speckles;
