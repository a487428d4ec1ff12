//! Depth and normal maps of the dense stage (`*.photometric.bin`, `*.geometric.bin`).

use crate::wire::{Place, Reader, Writer};
use crate::{Error, Limits, Result};
use std::io::{Read, Write};

/// Longest header accepted, in bytes.
const MAX_HEADER: usize = 64;

/// A raster of one (depth) or three (normal) channels, channel after channel, each row by row.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Matrix {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// 1 for depths along the optical axis (0 or less = none), 3 for normals in the camera frame.
    pub channels: u32,
    /// Value of (row, column, channel) at `(channel * height + row) * width + column`. Real files hold absurd values in
    /// pixels that were never set.
    pub data: Vec<f32>,
}

impl Matrix {
    /// A map of one value per pixel, row by row; `None` if `values` does not have that many.
    pub fn from_depths(width: u32, height: u32, values: Vec<f32>) -> Option<Self> {
        let fits = values.len() as u64 == u64::from(width) * u64::from(height);
        fits.then_some(Matrix { width, height, channels: 1, data: values })
    }

    /// A map of one normal per pixel, row by row; `None` if `normals` does not have that many.
    pub fn from_normals(width: u32, height: u32, normals: &[[f32; 3]]) -> Option<Self> {
        let fits = normals.len() as u64 == u64::from(width) * u64::from(height);
        let data = || (0..3).flat_map(|k| normals.iter().map(move |n| n[k])).collect();
        fits.then(|| Matrix { width, height, channels: 3, data: data() })
    }

    /// One vector per pixel, row by row; `None` unless there are three channels.
    pub fn normals(&self) -> Option<Vec<[f32; 3]>> {
        if self.channels != 3 {
            return None;
        }
        let pixels = self.data.len() / 3;
        let (x, rest) = self.data.split_at(pixels);
        let (y, z) = rest.split_at(pixels);
        Some(x.iter().zip(y).zip(z).map(|((x, y), z)| [*x, *y, *z]).collect())
    }

    /// Reads a map. `length` is the number of bytes in `source`, if known.
    ///
    /// # Errors
    /// [`Error::Format`] for a broken header or a file that is shorter or longer than its header says;
    /// [`Error::Limits`]; [`Error::Io`].
    pub fn read(source: impl Read, length: Option<u64>, limits: &Limits) -> Result<Self> {
        let mut r = Reader::new(source, length, limits);
        let [width, height, channels] = read_header(&mut r)?;
        let root = Place::Root("matrix");
        let pixels = u64::from(width) * u64::from(height);
        let Some(count) = pixels.checked_mul(channels.into()) else {
            return Err(r.error(&root, format!("{width} x {height} x {channels} values")));
        };
        let data = r.vec(count, &root, |b| f32::from_le_bytes(*b))?;
        if !r.at_end()? {
            let what = format!("bytes follow the {width} x {height} x {channels} values");
            return Err(r.error(&root, what));
        }
        Ok(Matrix { width, height, channels, data })
    }

    /// Writes the map.
    ///
    /// # Errors
    /// [`Error::Unsupported`] if the sizes do not fit the data; [`Error::Io`].
    pub fn write(&self, out: impl Write) -> Result<()> {
        let pixels = u64::from(self.width) * u64::from(self.height);
        if pixels.checked_mul(self.channels.into()) != Some(self.data.len() as u64) || self.data.is_empty() {
            let what = format!(
                "a {} x {} x {} map of {} values",
                self.width,
                self.height,
                self.channels,
                self.data.len()
            );
            return Err(Error::Unsupported(what));
        }
        let mut w = Writer::new(out);
        w.bytes(format!("{}&{}&{}&", self.width, self.height, self.channels).as_bytes())?;
        w.f32s(&self.data)?;
        w.finish()
    }
}

/// Width, height and channels of the map in `source`, whose header alone is read. `length` is the number of bytes in
/// `source`, if known.
///
/// # Errors
/// [`Error::Format`] for a broken header or a length that is not what the header says; [`Error::Io`].
pub fn read_matrix_size(source: impl Read, length: Option<u64>) -> Result<[u32; 3]> {
    let mut r = Reader::new(source, length.map(|n| n.min(MAX_HEADER as u64)), &Limits::default());
    let sizes = read_header(&mut r)?;
    let values = sizes.iter().try_fold(4u64, |n, &size| n.checked_mul(size.into()));
    let expected = values.and_then(|n| n.checked_add(r.offset()));
    if length.is_some_and(|found| expected != Some(found)) {
        let [width, height, channels] = sizes;
        let what =
            format!("{} bytes, not those of {width} x {height} x {channels} values", length.unwrap_or(0));
        return Err(r.error(&Place::Root("matrix"), what));
    }
    Ok(sizes)
}

/// `width&height&channels&`, each at least 1.
pub(super) fn read_header<R: Read>(r: &mut Reader<R>) -> Result<[u32; 3]> {
    let root = Place::Root("header");
    let mut sizes = [0; 3];
    let mut bytes = 0;
    for size in &mut sizes {
        let mut value = 0u32;
        loop {
            let [byte] = r.array(&root)?;
            bytes += 1;
            let digit = char::from(byte).to_digit(10);
            let longer = digit.and_then(|d| value.checked_mul(10)?.checked_add(d));
            match longer {
                Some(longer) => value = longer,
                None if byte == b'&' && value > 0 => break,
                None => return Err(r.error(&root, "not the form width&height&channels&")),
            }
            if bytes > MAX_HEADER {
                return Err(r.error(&root, "longer than any size"));
            }
        }
        *size = value;
    }
    Ok(sizes)
}
