//! One view to estimate and what it is matched with.

use super::texels::SourceTexels;
use crate::geometry::Camera;
pub use crate::scene::SparsePoint;
use crate::scene::{GrayImage, Grid, ImageId, LabelMap};
use crate::semantics::PlanarRegion;
use std::sync::Arc;

/// The image to estimate, with its camera at the size of that image.
#[derive(Clone, Debug)]
pub struct ReferenceImage {
    /// Luma, 0 black .. 1 white.
    pub gray: Arc<GrayImage>,
    /// Camera at the size of `gray`.
    pub camera: Camera,
    /// Global ID of the view.
    pub id: ImageId,
}

impl ReferenceImage {
    /// The same image for others to be matched with, halved up to `halvings` times.
    pub fn as_source(&self, halvings: u32) -> SourceImage {
        let texels = Arc::new(SourceTexels::new(&self.gray, halvings));
        SourceImage { texels, camera: self.camera.clone(), id: self.id }
    }
}

/// An image that the reference is matched with, with its camera at the size of that image.
#[derive(Clone, Debug)]
pub struct SourceImage {
    /// Grey levels; at as many resolutions as the reference is to be estimated at, or fewer are used.
    pub texels: Arc<SourceTexels>,
    /// Camera at the size of `texels`.
    pub camera: Camera,
    /// Global ID of the view.
    pub id: ImageId,
}

/// The classes of the pixels of all views of a problem; 0 is of any class.
#[derive(Clone, Debug)]
pub struct ProblemLabels {
    /// Of the reference, at its image's size.
    pub reference: Arc<LabelMap>,
    /// Of every source, at its image's size.
    pub sources: Vec<Arc<LabelMap>>,
    /// What a source costs more at a pixel where it shows another class, 0..=2.
    pub cost: f32,
}

/// One reference view, the source views it is matched with, and what is known beforehand.
#[derive(Clone, Debug)]
pub struct StereoProblem {
    /// The view to estimate.
    pub reference: ReferenceImage,
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
    /// Classes that hypotheses and matches heed.
    pub labels: Option<ProblemLabels>,
    /// Regions of the reference whose pixels are drawn towards planes.
    pub regions: Vec<PlanarRegion>,
}
