//! Every access to files: scenes, photographs, masks, depth maps, clouds.

pub(crate) mod archive;
pub(crate) mod atomic;
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
pub(crate) mod masks;
pub(crate) mod memory;
pub(crate) mod packed;
pub mod paths;
pub mod rasters;
pub mod spool;
mod stale_clouds;
pub(crate) mod stored_cloud;
