//! Depth maps to points.
//!
//! Maps are immutable; what points claim is kept in a bit or two per pixel beside them, so maps can leave memory and come
//! back. A view's turn has three passes over bands of rows: correspondences (parallel), claims (in raster order),
//! sums (parallel). Only the second depends on order, and it touches bits alone; so the result is the sequential one
//! for any number of threads, and the passes of successive bands run at the same time.

mod accumulate;
mod color;
mod correspond;
mod maps;
mod merge;
mod normals;
mod options;
mod order;
mod participant;
mod pipe;
mod plan;
mod smoothed;
mod state;
mod stream;
mod summary;
mod unfused;
mod working_set;

pub use maps::{FusionMaps, MapSource};
pub use normals::WithNormals;
pub use options::{AttributeSource, FusionOptions, Support};
pub use plan::{FusionView, MapInfo};
pub use smoothed::WithSmoothLabels;
pub use stream::{FusionInput, fuse};
pub use summary::{ClassCounts, FusionSummary};
pub use unfused::project_maps;

#[cfg(test)]
mod tests;
