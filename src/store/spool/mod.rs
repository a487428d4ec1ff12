//! A cloud that waits to be written: in memory as far as allowed, beyond that in a temporary file.
//!
//! Fusion pushes points once; exporters walk the finished cloud any number of times. Cropping happens here, because
//! OpenMVS's crop changes the order of the points and only the end of fusion tells it.

mod blocks;
mod crop;
mod record;

use self::blocks::{BlockReader, Blocks};
use self::crop::{CropOrder, InsideBits};
use self::record::RecordFormat;
use crate::error::Result;
use crate::geometry::Roi;
use crate::scene::{CloudLayout, CloudPoint, PointSink, PointSource};
use std::path::Path;

/// Bytes of points that a spool holds in memory by default.
pub const DEFAULT_SPOOL_MEMORY: u64 = 4 << 20;

/// Takes the points of a cloud one by one.
#[derive(Debug)]
pub struct PointSpool {
    format: RecordFormat,
    blocks: Blocks,
    crop: Option<(Roi, InsideBits)>,
    count: u64,
}

impl PointSpool {
    /// A spool for points with the attributes of `layout`, of which those outside `crop` are left out in the end.
    /// Beyond `memory` bytes points go to a nameless file in `folder` that vanishes with the spool.
    pub fn new(layout: CloudLayout, crop: Option<Roi>, folder: &Path, memory: u64) -> Self {
        PointSpool {
            format: RecordFormat::new(layout),
            blocks: Blocks::new(folder, memory),
            crop: crop.map(|roi| (roi, InsideBits::default())),
            count: 0,
        }
    }

    /// Number of points pushed so far.
    pub fn pushed(&self) -> u64 {
        self.count
    }

    /// The finished cloud, cropped.
    ///
    /// # Errors
    /// [`crate::Error::Io`] if the temporary file cannot be written.
    pub fn finish(self) -> Result<SpooledCloud> {
        let order = match self.crop {
            Some((_, inside)) => CropOrder::new(inside),
            None => CropOrder::all(self.count),
        };
        Ok(SpooledCloud { format: self.format, blocks: self.blocks.finish()?, order })
    }
}

impl PointSink for PointSpool {
    fn push(&mut self, point: &CloudPoint<'_>) -> Result<()> {
        if let Some((roi, inside)) = &mut self.crop {
            inside.push(roi.contains(point.position));
        }
        self.count += 1;
        self.blocks.append(self.format.len(point), |block| self.format.encode(point, block))
    }
}

/// A finished cloud in its final order: that of fusion, or after a crop that of OpenMVS, which goes through the points
/// from the last to the first and moves the last one into the place of every one it removes.
#[derive(Debug)]
pub struct SpooledCloud {
    format: RecordFormat,
    blocks: Blocks,
    order: CropOrder,
}

impl SpooledCloud {
    /// Points that the crop has left out.
    pub fn cropped(&self) -> u64 {
        self.blocks.records() - self.order.len()
    }
}

impl PointSource for SpooledCloud {
    fn layout(&self) -> CloudLayout {
        self.format.layout()
    }

    fn len(&self) -> u64 {
        self.order.len()
    }

    fn for_each(&self, visit: &mut dyn FnMut(&CloudPoint<'_>) -> Result<()>) -> Result<()> {
        // Points in their own place and points moved into holes are each read in ascending order, as a rule.
        let mut in_place = BlockReader::new(&self.blocks, self.format);
        let mut moved = BlockReader::new(&self.blocks, self.format);
        let mut decoder = self.format.decoder();
        for (place, source) in self.order.iter().enumerate() {
            let reader = if source == place as u64 { &mut in_place } else { &mut moved };
            visit(&decoder.decode(reader.seek(source)?))?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
