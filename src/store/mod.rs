//! Every access to files: scenes, photographs, masks, depth maps, clouds.

pub mod atomic;
mod byte_cache;
pub mod images;
mod jpeg;
mod label_png;
pub mod labels;
pub mod masks;
pub mod paths;
