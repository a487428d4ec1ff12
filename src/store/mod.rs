//! Every access to files: scenes, photographs, masks, depth maps, clouds.

pub mod atomic;
pub mod images;
mod jpeg;
pub mod masks;
pub mod paths;
