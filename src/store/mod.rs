//! Every access to files: scenes, photographs, masks, depth maps, clouds.

pub mod archive;
pub mod atomic;
pub(crate) mod byte_cache;
pub mod cameras;
pub mod cloud;
mod cloud_names;
pub mod colmap;
mod depth_map;
pub mod depth_store;
pub mod diagnostics;
pub mod export;
pub mod images;
pub mod import;
mod jpeg;
mod label_png;
pub mod labels;
pub mod masks;
pub mod memory;
pub mod packed;
pub mod paths;
pub mod rasters;
pub mod spool;
mod stale_clouds;
pub mod stored_cloud;
