//! Readers and writers of the files that dense photogrammetry programs exchange.
//!
//! Bytes in, plain values out, and back: no geometry, no threads, no logging. Every reader takes
//! [`Limits`] and checks counts against the bytes that remain before it allocates.
//!
//! ```no_run
//! use semvs_formats::{Limits, dmap::DepthMapFile, mvs};
//!
//! # fn main() -> semvs_formats::Result<()> {
//! let limits = Limits::default();
//! let mut scene = mvs::read("scene.mvs", &limits)?;
//! let repairs = scene.repair()?; // drops what leads nowhere ...
//! scene.check()?; // ... and names what cannot be used
//! println!("{} images, {} points", scene.images.len(), scene.points.positions.len());
//! println!("{} views dropped", repairs.dropped_views);
//!
//! let map = DepthMapFile::read("depth0000.dmap", &limits)?;
//! let valid = map.depth.iter().filter(|&&depth| depth > 0.0).count();
//! println!("view {}: {}×{}, {valid} depths", map.ids[0], map.width, map.height);
//!
//! let mut bytes = Vec::new();
//! mvs::write_interface(&mut bytes, &scene, mvs::NEWEST_VERSION)?;
//! mvs::write_project(&mut bytes, &scene, mvs::ArchiveKind::Zstd)?;
//! # Ok(())
//! # }
//! ```
#![forbid(unsafe_code)]

pub mod colmap;
pub mod dmap;
mod error;
pub mod las;
pub mod mvs;
pub mod neighbors_file;
pub mod npy;
mod number;
pub mod pfm;
pub mod ply;
pub mod roi;
mod source;
mod text;
mod wire;

pub use error::{Error, Limits, Result};
