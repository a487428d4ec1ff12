//! Which images confirmed each pixel of a depth map.

use super::matrix::read_header;
use crate::mvs::Visibility;
use crate::wire::{Place, Reader, Writer};
use crate::{Error, Limits, Result};
use std::io::{Read, Write};

/// The images whose depth maps agree with a depth map, per pixel.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ConsistencyGraph {
    /// Columns of the depth map.
    pub width: u32,
    /// Rows of the depth map.
    pub height: u32,
    /// Column and row of the pixels that have a list, in file order.
    pub pixels: Vec<[u32; 2]>,
    /// The images of each of `pixels`: positions in the order of the model's images; no weights.
    pub images: Visibility,
}

impl ConsistencyGraph {
    /// Reads a graph. `length` is the number of bytes in `source`, if known.
    ///
    /// # Errors
    /// [`Error::Format`] for a broken header, a pixel outside the map, a negative count or index, or an incomplete
    /// last record; [`Error::Limits`]; [`Error::Io`].
    pub fn read(source: impl Read, length: Option<u64>, limits: &Limits) -> Result<Self> {
        let mut r = Reader::new(source, length, limits);
        let [width, height, _] = read_header(&mut r)?;
        let mut graph = ConsistencyGraph { width, height, ..Default::default() };
        graph.images.offsets.push(0);
        let root = Place::Root("pixels");
        while !r.at_end()? {
            let at = root.item(graph.pixels.len());
            let [column, row, count] = [r.u32(&at)?, r.u32(&at)?, r.u32(&at)?];
            if column >= width || row >= height {
                let what = format!("column {column}, row {row} is outside {width} x {height}");
                return Err(r.error(&at, what));
            }
            if count > i32::MAX as u32 {
                return Err(r.error(&at, format!("a count of {}", count as i32)));
            }
            r.charge(16, &at)?;
            r.extend(&mut graph.images.images, count.into(), &at, |b| u32::from_le_bytes(*b))?;
            graph.pixels.push([column, row]);
            graph.images.offsets.push(graph.images.images.len() as u64);
        }
        Ok(graph)
    }

    /// Writes the graph.
    ///
    /// # Errors
    /// [`Error::Unsupported`] if the lists do not fit the pixels; [`Error::Io`].
    pub fn write(&self, out: impl Write) -> Result<()> {
        if self.images.offsets.len() != self.pixels.len() + 1 {
            let what = format!("{} lists for {} pixels", self.images.offsets.len(), self.pixels.len());
            return Err(Error::Unsupported(what));
        }
        let mut w = Writer::new(out);
        w.bytes(format!("{}&{}&1&", self.width, self.height).as_bytes())?;
        for ([column, row], range) in self.pixels.iter().zip(self.images.offsets.windows(2)) {
            let images = self.images.images.get(range[0] as usize..range[1] as usize).unwrap_or(&[]);
            w.u32(*column)?;
            w.u32(*row)?;
            w.u32(images.len() as u32)?;
            w.records(images, |image| image.to_le_bytes())?;
        }
        w.finish()
    }
}
