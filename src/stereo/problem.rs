//! One view to estimate and what it is matched with.

use crate::geometry::Camera;
pub use crate::scene::SparsePoint;
use crate::scene::{GrayImage, Grid, ImageId};
use crate::semantics::PlanarRegion;
use std::sync::Arc;

/// A grey image with its camera at the size of that image.
#[derive(Clone, Debug)]
pub struct SourceImage {
    /// Luma, 0 black .. 1 white.
    pub gray: Arc<GrayImage>,
    /// Camera at the size of `gray`.
    pub camera: Camera,
    /// Global ID of the view.
    pub id: ImageId,
}

/// One reference view, the source views it is matched with, and what is known beforehand.
#[derive(Clone, Debug)]
pub struct StereoProblem {
    /// The view to estimate.
    pub reference: SourceImage,
    /// Path of the reference image as the scene names it.
    pub image_name: String,
    /// The views it is matched with, best first; at least one.
    pub sources: Vec<SourceImage>,
    /// Every hypothesis has its depth in `[min, max)`; `0 < min < max`.
    pub depth_range: (f32, f32),
    /// Sparse points that start the search.
    pub sparse: Vec<SparsePoint>,
    /// Pixels that get no depth (masked, or of a class that is not estimated).
    pub skip: Option<Grid<bool>>,
    /// Regions of the reference whose pixels are drawn towards planes.
    pub regions: Vec<PlanarRegion>,
}
