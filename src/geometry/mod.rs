//! Cameras, planes and boxes. Knows no files and no scenes.

mod camera;
mod roi;

pub use camera::{Camera, Size, normalized_k};
pub use roi::Roi;
