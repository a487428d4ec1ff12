//! Cameras, boxes, places, nearest points. Knows no files and no scenes.

mod camera;
mod lens;
mod local_origin;
mod nearest;
mod placement;
mod roi;
mod similarity;

pub use camera::{Camera, Size, normalized_k};
pub(crate) use lens::Lens;
pub use local_origin::local_origin;
pub(crate) use nearest::{Nearest, NearestIndex};
pub use placement::Placement;
pub use roi::Roi;
pub use similarity::is_similar_depth;
