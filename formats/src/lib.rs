//! Readers and writers of the files that dense photogrammetry programs exchange.
//!
//! Bytes in, plain values out, and back: no geometry, no threads, no logging. Every reader takes
//! [`Limits`] and checks counts against the bytes that remain before it allocates; errors name the field and the byte.
//!
//! | module | files |
//! | --- | --- |
//! | [`mvs`] | OpenMVS scenes: interface archives of versions 0 to 7, native projects |
//! | [`dmap`] | OpenMVS depth maps |
//! | [`ply`], [`las`] | clouds of points |
//! | [`colmap`] | sparse models as text and binary, dense maps, fused visibility |
//! | [`pfm`], [`npy`] | rasters of numbers |
//! | [`roi`], [`neighbors_file`] | regions of interest and lists of neighbours as text |
//!
//! # Scenes
//!
//! ```
//! use semvs_formats::{Limits, mvs};
//!
//! # fn main() -> semvs_formats::Result<()> {
//! let mut scene = mvs::read("../compat-fixtures/facade6/scene.mvs", &Limits::default())?;
//! let repairs = scene.repair()?; // drops what leads nowhere ...
//! scene.check()?; // ... and names what cannot be used
//! assert_eq!((scene.images.len(), repairs.dropped_views), (6, 0));
//! assert!(!scene.points.positions.is_empty());
//!
//! let mut bytes = Vec::new();
//! mvs::write_interface(&mut bytes, &scene, mvs::NEWEST_VERSION)?;
//! mvs::write_project(&mut bytes, &scene, mvs::ArchiveKind::Zstd)?;
//! # Ok(())
//! # }
//! ```
//!
//! # Depth maps
//!
//! ```
//! use semvs_formats::{Limits, dmap::DepthMapFile};
//!
//! # fn main() -> semvs_formats::Result<()> {
//! # let packed = std::fs::read("../compat-fixtures/facade6/openmvs-2.3.0/post7/depth0000.dmap.zst").unwrap();
//! # let bytes = zstd::decode_all(&packed[..]).unwrap();
//! // Or DepthMapFile::read("depth0000.dmap", &limits).
//! let map = DepthMapFile::from_bytes(&bytes, &Limits::default())?;
//! assert_eq!((map.width, map.height, map.ids[0]), (200, 150, 0));
//! let valid = map.depth.iter().filter(|&&depth| depth > 0.0).count();
//! assert!(valid > map.depth.len() / 2);
//!
//! let mut again = Vec::new();
//! map.write(&mut again)?;
//! assert_eq!(again, bytes);
//! # Ok(())
//! # }
//! ```
//!
//! # Clouds
//!
//! ```
//! use semvs_formats::{Limits, ply};
//!
//! # fn main() -> semvs_formats::Result<()> {
//! let file = std::fs::File::open("../compat-fixtures/facade6/truth/truth.ply").unwrap();
//! let cloud = ply::read_cloud(file, &Limits::default())?;
//! assert_eq!(cloud.labels.len(), cloud.len());
//! # Ok(())
//! # }
//! ```
//!
//! # What is promised
//!
//! Public items follow [Semantic Versioning](https://semver.org): while the version is 0.x, a change that breaks programs raises
//! the middle number. What a file holds is given as it stands, so a new version of a format may bring new fields: make values
//! from `Default` with `..` where there is one. No type of another crate is part of an interface. What is written is read back to
//! the same values, and files of OpenMVS are written back byte for byte.
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
