//! What can be said of a finished cloud whose points know the views that see them: which points stand where nothing can
//! be, and how large a pixel is at each point.

mod blocks;
mod directions;
mod footprint;
mod visibility;

pub use footprint::{PointScale, point_scales};
pub use visibility::{PointViews, point_visibility, swap_removed};
