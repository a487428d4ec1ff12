//! What a report says of depth maps, noted when they pass by.

use crate::geometry::Size;
use crate::scene::{DepthEstimate, ImageId};
use std::collections::HashMap;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// A depth map in a few numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MapSummary {
    /// Columns and rows.
    pub size: Size,
    /// Depths allowed, scene units.
    pub depth_range: (f32, f32),
    /// Pixels with a depth.
    pub valid_depths: u64,
    /// Mean confidence of those; `None` = there are none, or no confidences.
    pub mean_confidence: Option<f64>,
}

impl MapSummary {
    /// The numbers of `estimate`.
    pub fn of(estimate: &DepthEstimate) -> Self {
        let depths = estimate.depth.data();
        let valid = depths.iter().filter(|&&d| d > 0.0).count();
        let confidence = estimate.confidence.as_ref().filter(|_| valid > 0);
        let sum = |confidence: &[f32]| {
            let pairs = confidence.iter().zip(depths).filter(|(_, d)| **d > 0.0);
            pairs.map(|(c, _)| f64::from(*c)).sum::<f64>()
        };
        MapSummary {
            size: estimate.depth.size(),
            depth_range: estimate.depth_range,
            valid_depths: valid as u64,
            mean_confidence: confidence.map(|map| sum(map.data()) / valid as f64),
        }
    }
}

/// The summaries of the maps that were read or written last, by view.
#[derive(Debug, Default)]
pub(super) struct Summaries(Mutex<HashMap<ImageId, MapSummary>>);

impl Summaries {
    pub(super) fn get(&self, id: ImageId) -> Option<MapSummary> {
        self.lock().get(&id).copied()
    }

    pub(super) fn enter(&self, estimate: &DepthEstimate) {
        let summary = MapSummary::of(estimate);
        self.lock().insert(estimate.image_id, summary);
    }

    fn lock(&self) -> MutexGuard<'_, HashMap<ImageId, MapSummary>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::synthetic::estimate_of_depths;

    #[test]
    fn a_summary_counts_what_has_a_depth() {
        let mut map = estimate_of_depths(4, 2, |x, _| if x == 0 { 0.0 } else { 5.0 });
        map.confidence.as_mut().unwrap().data_mut()[1] = 0.3;
        let summary = MapSummary::of(&map);
        assert_eq!((summary.size, summary.valid_depths), (Size::new(4, 2), 6));
        // Five of 0.9 and one of 0.3, in single precision.
        assert!((summary.mean_confidence.unwrap() - 0.8).abs() < 1e-6);
        map.depth.data_mut().fill(0.0);
        assert_eq!(MapSummary::of(&map).mean_confidence, None);
    }
}
