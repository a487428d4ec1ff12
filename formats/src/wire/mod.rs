//! Little-endian reader and writer that know their offset; counted vectors under limits.

mod reader;
mod writer;

use std::fmt;
use std::fs::File;
use std::io;
use std::path::Path;

pub(crate) use reader::Reader;
pub(crate) use writer::Writer;

use crate::{Error, Result};

/// Bytes that a [`Reader`] or [`Writer`] holds at most.
const BUFFER: usize = 256 << 10;

/// Where a value belongs, for error messages; built on the stack, rendered only when something is wrong.
#[derive(Clone, Copy)]
pub(crate) enum Place<'a> {
    Root(&'static str),
    Field(&'a Place<'a>, &'static str),
    Item(&'a Place<'a>, u64),
}

impl<'a> Place<'a> {
    pub(crate) fn field(&'a self, name: &'static str) -> Place<'a> {
        Place::Field(self, name)
    }

    pub(crate) fn item(&'a self, index: usize) -> Place<'a> {
        Place::Item(self, index as u64)
    }
}

impl fmt::Display for Place<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Place::Root(name) => f.write_str(name),
            Place::Field(Place::Root(""), name) => f.write_str(name),
            Place::Field(parent, name) => write!(f, "{parent}.{name}"),
            Place::Item(parent, index) => write!(f, "{parent}[{index}]"),
        }
    }
}

/// A file and its length, which only regular files have.
pub(crate) fn open(path: &Path) -> Result<(File, Option<u64>)> {
    let file = File::open(path)?;
    let metadata = file.metadata()?;
    if metadata.is_dir() {
        return Err(Error::Io(io::ErrorKind::IsADirectory.into()));
    }
    Ok((file, metadata.is_file().then_some(metadata.len())))
}

/// Three floats from twelve bytes.
#[inline]
pub(crate) fn vec3f(bytes: &[u8; 12]) -> [f32; 3] {
    let b = bytes;
    [
        f32::from_le_bytes([b[0], b[1], b[2], b[3]]),
        f32::from_le_bytes([b[4], b[5], b[6], b[7]]),
        f32::from_le_bytes([b[8], b[9], b[10], b[11]]),
    ]
}

/// Twelve bytes from three floats.
#[inline]
pub(crate) fn vec3f_bytes(&[x, y, z]: &[f32; 3]) -> [u8; 12] {
    let ([a, b, c, d], [e, f, g, h], [i, j, k, l]) = (x.to_le_bytes(), y.to_le_bytes(), z.to_le_bytes());
    [a, b, c, d, e, f, g, h, i, j, k, l]
}
