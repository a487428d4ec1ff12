//! Readers and writers of the files that dense photogrammetry programs exchange.
//!
//! Bytes in, plain values out, and back: no geometry, no threads, no logging. Every reader takes
//! [`Limits`] and checks counts against the bytes that remain before it allocates.
#![forbid(unsafe_code)]

pub mod dmap;
mod error;
pub mod mvs;
pub mod ply;
mod wire;

pub use error::{Error, Limits, Result};
