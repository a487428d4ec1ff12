//! What fusion reads of one view.

use crate::error::{Error, Result};
use crate::geometry::Size;
use crate::scene::{ColorImage, DepthEstimate, Grid, LabelMap, ViewIndex};
use std::sync::Arc;

/// The maps of one view, all of one size; immutable and shared.
#[derive(Clone, Debug)]
pub struct FusionMaps {
    /// Depth, normals, confidence, and the camera at the size of the maps.
    pub estimate: Arc<DepthEstimate>,
    /// Colour of every pixel, if points get colours.
    pub color: Option<Arc<ColorImage>>,
    /// Class of every pixel; a view without one is void everywhere.
    pub labels: Option<Arc<LabelMap>>,
    /// Classes as the consistency check sees them, where they differ from `labels`: bands along class borders
    /// are void here. Votes are always taken from `labels`.
    pub checked_labels: Option<Arc<LabelMap>>,
    /// How certain `labels` are, 0..1; `None`: wholly.
    pub label_confidence: Option<Arc<Grid<f32>>>,
}

impl FusionMaps {
    /// Maps without colour and labels.
    pub fn new(estimate: Arc<DepthEstimate>) -> Self {
        FusionMaps { estimate, color: None, labels: None, checked_labels: None, label_confidence: None }
    }

    /// Size of the maps.
    pub fn size(&self) -> Size {
        self.estimate.depth.size()
    }

    /// Refuses maps of different sizes.
    pub(super) fn check(&self, view: ViewIndex) -> Result<()> {
        let size = self.size();
        let differs = |what: &str, other: Size| {
            Err(Error::invalid(format!(
                "view {} ({}): the depth map is {size}, its {what} {other}; estimate the depth map again or scale \
                 the {what} to it",
                view.0, self.estimate.image_name
            )))
        };
        fn size_of<T>(map: Option<&Grid<T>>) -> Option<Size> {
            map.map(Grid::size)
        }
        let sizes = [
            ("normal map", size_of(self.estimate.normal.as_ref())),
            ("confidence map", size_of(self.estimate.confidence.as_ref())),
            ("image", size_of(self.color.as_deref())),
            ("label map", size_of(self.labels.as_deref())),
            ("label map", size_of(self.checked_labels.as_deref())),
            ("camera", Some(self.estimate.camera.size())),
        ];
        for (what, other) in sizes {
            match other {
                Some(other) if other != size => return differs(what, other),
                _ => {}
            }
        }
        Ok(())
    }
}

/// Gives fusion the maps of a view when it needs them; the same view may be asked for several times.
pub trait MapSource: Sync {
    /// The maps of `view`, of the size and with the normals that its [`super::MapInfo`] announced.
    ///
    /// # Errors
    /// Whatever keeps the maps from being read.
    fn load(&self, view: ViewIndex) -> Result<FusionMaps>;
}
