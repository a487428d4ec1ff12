//! The scene: views, sparse tracks, neighbours, and the rasters that belong to a view.

mod cloud;
mod depth_range;
mod grid;
mod ids;
mod maps;
mod model;
mod neighbor_scores;
mod neighbors;
mod pairing;
mod resample;
mod resolution;
mod roi_estimate;
#[cfg(test)]
pub(crate) mod synthetic;
mod tower;
mod tower_points;
mod trws;
mod virtual_points;

pub use cloud::{CloudLayout, CloudPoint, PointCloud, PointSink, PointSource};
pub use depth_range::{DEFAULT_DEPTH_RANGE, SparseInit, SparsePoint};
pub use grid::Grid;
pub use ids::{ImageId, ViewIndex};
pub use maps::{ColorImage, ConfidenceMap, DepthEstimate, DepthMap, GrayImage, LabelMap, NormalMap};
pub use model::{Calibration, Neighbor, Scene, Tracks, View};
pub use neighbors::{NeighborOptions, OutsideRoi, ViewNeighbors, override_neighbors, select_neighbors};
pub use pairing::PairingOptions;
pub(crate) use resample::area_rgb;
pub use resample::{area_color, gray_from_color, resize_gray, resize_nearest};
pub use resolution::{ResolutionOptions, scaled_size};
pub use roi_estimate::{RoiEstimation, estimate_roi};
pub use tower::looks_like_tower;
pub use tower_points::{TowerPoints, tower_points};
pub use virtual_points::virtual_points;
