//! Cameras, planes and boxes. Knows no files and no scenes.

mod camera;
mod lens;
mod roi;
mod similarity;

pub use camera::{Camera, Size, normalized_k};
pub(crate) use lens::Lens;
pub use roi::Roi;
pub use similarity::is_similar_depth;
