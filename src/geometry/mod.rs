//! Cameras, planes and boxes. Knows no files and no scenes.

mod camera;
mod roi;
mod similarity;

pub use camera::{Camera, Size, normalized_k};
pub use roi::Roi;
pub use similarity::is_similar_depth;
