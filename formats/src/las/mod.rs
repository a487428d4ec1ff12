//! LAS 1.4 point clouds and their compressed form, LAZ: streaming write, and what a file says of itself.
//!
//! Points are written in record format 6, with colours in format 7; what the format has no place for goes into extra
//! bytes that a record in the header declares. The same points give the same bytes: no date, no random identifier.
//!
//! ```
//! use semvs_formats::las::{Frame, Header, Layout, LasPoint, LasWriter};
//!
//! let layout = Layout { colors: true, ..Layout::default() };
//! let points = [LasPoint { position: [500_000.25, 4_000_000.5, 12.0], classification: 6, ..LasPoint::default() }];
//! let bounds = [points[0].position; 2];
//! let header = Header { frame: Frame::fitting(bounds)?, bounds, points: 1, software: "example".into() };
//! let mut writer = LasWriter::new(std::io::Cursor::new(Vec::new()), &layout, &header)?;
//! writer.write(&points)?;
//! let bytes = writer.finish()?.into_inner();
//! assert!(bytes.starts_with(b"LASF"));
//! # Ok::<(), semvs_formats::Error>(())
//! ```

mod frame;
mod header;
mod info;
#[cfg(test)]
mod tests;
mod write;

pub use frame::Frame;
pub use header::{Extra, Header, Layout};
pub use info::LasInfo;
pub use write::{LasPoint, LasWriter};
