//! Streaming writer of LAS and LAZ files.

use super::frame::Frame;
use super::header::{Extra, Header, Layout};
use crate::{Error, Result};
use laz::LasZipCompressor;
use std::io::{Seek, Write};

/// One point; attributes that the [`Layout`] lacks are ignored.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LasPoint {
    /// Coordinates, within the bounds of the [`Header`].
    pub position: [f64; 3],
    /// ASPRS classification code.
    pub classification: u8,
    /// Red, green, blue; written with 16 bits, times 256 as the format asks for.
    pub color: [u8; 3],
    /// Unit normal.
    pub normal: [f32; 3],
    /// Class id, 0 = void.
    pub label: u16,
    /// Share of the label's votes, 0..1.
    pub label_confidence: f32,
    /// Confidence of the depth.
    pub confidence: f32,
    /// Number of views that see the point.
    pub views: u16,
}

/// Writes points into a file whose number of points and bounds are known.
pub struct LasWriter<W: Write + Seek + Send + Sync + 'static> {
    sink: Sink<W>,
    frame: Frame,
    layout: Layout,
    declared: u64,
    written: u64,
    record: Vec<u8>,
}

enum Sink<W: Write + Seek + Send + Sync + 'static> {
    Plain(W),
    Compressed(Box<LasZipCompressor<'static, W>>),
}

impl<W: Write + Seek + Send + Sync + 'static> LasWriter<W> {
    /// Writes the header. `writer` should buffer; it stands at the start of the file.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn new(mut writer: W, layout: &Layout, header: &Header) -> Result<Self> {
        writer.write_all(&header.encode(layout)?)?;
        let sink = match layout.compressed {
            false => Sink::Plain(writer),
            true => {
                let compressor = LasZipCompressor::new(writer, layout.laz());
                Sink::Compressed(Box::new(compressor.map_err(|e| Error::Unsupported(e.to_string()))?))
            }
        };
        let (frame, layout) = (header.frame, layout.clone());
        Ok(LasWriter { sink, frame, layout, declared: header.points, written: 0, record: Vec::new() })
    }

    /// Appends `points`.
    ///
    /// # Errors
    /// [`Error::Format`] for a point outside the bounds or more points than declared, [`Error::Io`].
    pub fn write(&mut self, points: &[LasPoint]) -> Result<()> {
        for point in points {
            if self.written == self.declared {
                return Err(self.miscounted("more"));
            }
            self.encode(point)?;
            match &mut self.sink {
                Sink::Plain(writer) => writer.write_all(&self.record)?,
                Sink::Compressed(compressor) => compressor.compress_one(&self.record)?,
            }
            self.written += 1;
        }
        Ok(())
    }

    /// Completes the file and hands the writer back.
    ///
    /// # Errors
    /// [`Error::Format`] if the number of points is not the declared one, [`Error::Io`].
    pub fn finish(self) -> Result<W> {
        if self.written != self.declared {
            return Err(self.miscounted("fewer"));
        }
        let mut writer = match self.sink {
            Sink::Plain(writer) => writer,
            Sink::Compressed(mut compressor) => {
                compressor.done()?;
                compressor.into_inner()
            }
        };
        writer.flush()?;
        Ok(writer)
    }

    /// Puts the bytes of `point` into `record`.
    fn encode(&mut self, point: &LasPoint) -> Result<()> {
        /// The first of one return.
        const ONLY_RETURN: u8 = 0x11;
        let record = &mut self.record;
        record.clear();
        for (axis, &value) in point.position.iter().enumerate() {
            let Some(steps) = self.frame.quantize(axis, value) else {
                let what = format!("{value} is beyond what the file can hold");
                return Err(Error::Format { offset: 0, field: format!("point[{}]", self.written), what });
            };
            record.extend(steps.to_le_bytes());
        }
        // Intensity; returns; flags, classification, user data; scan angle, source, time.
        record.extend([0, 0, ONLY_RETURN, 0, point.classification, 0]);
        record.extend([0; 2 + 2 + 8]);
        if self.layout.colors {
            record.extend(point.color.into_iter().flat_map(|c| (u16::from(c) << 8).to_le_bytes()));
        }
        for extra in &self.layout.extras {
            match extra {
                Extra::Normal => record.extend(point.normal.into_iter().flat_map(f32::to_le_bytes)),
                Extra::Label => record.extend(point.label.to_le_bytes()),
                Extra::LabelConfidence => record.extend(point.label_confidence.to_le_bytes()),
                Extra::Confidence => record.extend(point.confidence.to_le_bytes()),
                Extra::Views => record.extend(point.views.to_le_bytes()),
            }
        }
        Ok(())
    }

    fn miscounted(&self, how: &str) -> Error {
        let what = format!("{how} points than the {} declared", self.declared);
        Error::Format { offset: 0, field: "number of points".into(), what }
    }
}
