//! The scene: views, sparse tracks, neighbours, and the rasters that belong to a view.

mod grid;
mod ids;
mod maps;
mod model;

pub use grid::Grid;
pub use ids::{ImageId, ViewIndex};
pub use maps::{ColorImage, ConfidenceMap, DepthEstimate, DepthMap, GrayImage, LabelMap, NormalMap};
pub use model::{Calibration, Neighbor, Scene, Tracks, View};
