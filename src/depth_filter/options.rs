//! Options of the filters; names and defaults are those of OpenMVS's dense configuration table.

use crate::error::{Error, Result};

/// How depth maps are cleaned after estimation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DepthFilterOptions {
    /// "Depth Diff Threshold": relative depth difference, > 0, from which the thresholds of all filters are
    /// derived (×0.7 speckles, ×2.5 gaps, ×1.2 and ×0.8 consistency). Default 0.01.
    pub depth_diff_threshold: f32,
    /// "Speckle Size": connected regions with fewer pixels are removed; 0 and 1 remove nothing. Default 100.
    pub speckle_size: u32,
    /// "Interpolate Gap Size": longest run of missing pixels in a row or column that is filled; 0 = none.
    /// Default 7.
    pub interpolate_gap_size: u32,
    /// "Min Views Filter": neighbours that must see the pixel for it to be judged at all; lowered to the number
    /// of calibrated views − 1. Default 2.
    pub min_views_filter: u32,
    /// "Min Views Filter Adjust": neighbours that must agree with a depth in the adjust variant; lowered
    /// likewise. Default 1.
    pub min_views_filter_adjust: u32,
    /// "Filter Adjust": `true` replaces a depth by the weighted mean of the agreeing ones, `false` keeps depths
    /// as they are and is strict. Default `true`.
    pub filter_adjust: bool,
}

impl Default for DepthFilterOptions {
    fn default() -> Self {
        DepthFilterOptions {
            depth_diff_threshold: 0.01,
            speckle_size: 100,
            interpolate_gap_size: 7,
            min_views_filter: 2,
            min_views_filter_adjust: 1,
            filter_adjust: true,
        }
    }
}

impl DepthFilterOptions {
    /// Refuses thresholds that no depth could meet.
    ///
    /// # Errors
    /// [`Error::Invalid`] naming the option.
    pub fn check(&self) -> Result<()> {
        if !(self.depth_diff_threshold > 0.0 && self.depth_diff_threshold < 1.0) {
            return Err(Error::invalid(format!(
                "\"Depth Diff Threshold\" is {}: give a relative difference between 0 and 1, such as 0.01",
                self.depth_diff_threshold
            )));
        }
        Ok(())
    }
}
