//! What other programs use: few types with private fields over the parts of this package, so that those may change.

mod camera;
mod cloud;
mod densify;
mod depth_map;
mod fuse;
mod labels;
mod scene;

pub use camera::{Camera, Pixel};
pub use cloud::{Cloud, Point};
pub use densify::{Densify, Step, Summary};
pub use depth_map::{DepthMap, DepthMapBuilder};
pub use fuse::{FuseOptions, FuseView, fuse};
pub use labels::{ClassTable, LabelMap};
pub use scene::{Scene, View};
