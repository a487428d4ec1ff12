//! PLY point clouds: header, streaming read, streaming write.
//!
//! ```
//! use semvs_formats::{Limits, ply};
//!
//! let cloud = ply::Cloud { positions: vec![[0.0, 1.0, 2.0]], labels: vec![4], ..Default::default() };
//! let layout = ply::Layout::plain(false, false).with_label(false, false);
//! let mut file = Vec::new();
//! ply::write_cloud(&mut file, &layout, &cloud)?;
//! assert_eq!(ply::read_cloud(file.as_slice(), &Limits::default())?, cloud);
//! # Ok::<(), semvs_formats::Error>(())
//! ```

mod ascii;
mod cloud;
mod columns;
mod header;
mod layout;
mod read;
mod record;
#[cfg(test)]
mod tests;
mod write;

pub use cloud::Cloud;
pub use header::{Element, Encoding, Header, Property, PropertyType, ScalarType, TypeNames};
pub use layout::{Field, Layout};
pub use read::{PointReader, read_cloud};
pub use write::{PlyWriter, write_cloud};
