//! The rasters of one view, all of the same size.

use super::{Grid, ImageId};
use crate::geometry::Camera;

/// Red, green, blue.
pub type ColorImage = Grid<[u8; 3]>;
/// Luma, 0 black .. 1 white.
pub type GrayImage = Grid<f32>;
/// Depth along the optical axis in scene units; 0 = no estimate.
pub type DepthMap = Grid<f32>;
/// Unit normals in the camera frame, facing the camera; meaningless where the depth is 0.
pub type NormalMap = Grid<[f32; 3]>;
/// Confidence, 0 worst; 1 best for a fresh estimate, more after the adjust filter has summed neighbours.
pub type ConfidenceMap = Grid<f32>;
/// Class ids; 0 = void.
pub type LabelMap = Grid<u16>;

/// What is known about the surface seen by one view.
#[derive(Clone, Debug, PartialEq)]
pub struct DepthEstimate {
    /// The reference view's global ID.
    pub image_id: ImageId,
    /// Path of the reference image as the scene names it.
    pub image_name: String,
    /// Global IDs of the source views it was matched with, best first.
    pub source_ids: Vec<ImageId>,
    /// Camera at the size of the maps.
    pub camera: Camera,
    /// Every valid depth lies in `[min, max)`.
    pub depth_range: (f32, f32),
    /// Depth of every pixel.
    pub depth: DepthMap,
    /// Normal of every pixel.
    pub normal: Option<NormalMap>,
    /// Confidence of every pixel.
    pub confidence: Option<ConfidenceMap>,
}
