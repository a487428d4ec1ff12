//! The binary archive.

use std::io::{Read, Write};

use super::{Classes, Sink, Source};
use crate::wire::{Place, Reader, Writer, vec3f};
use crate::{Error, Result};

/// Reads a binary archive.
pub(in crate::mvs) struct BinarySource<'a, R> {
    reader: &'a mut Reader<R>,
    classes: Classes,
}

impl<'a, R: Read> BinarySource<'a, R> {
    pub(in crate::mvs) fn new(reader: &'a mut Reader<R>) -> Self {
        BinarySource { reader, classes: Classes::default() }
    }
}

impl<R: Read> Source for BinarySource<'_, R> {
    fn classes(&mut self) -> &mut Classes {
        &mut self.classes
    }

    fn u8(&mut self, place: &Place<'_>) -> Result<u8> {
        self.reader.u8(place)
    }

    fn u32(&mut self, place: &Place<'_>) -> Result<u32> {
        self.reader.u32(place)
    }

    fn u64(&mut self, place: &Place<'_>) -> Result<u64> {
        self.reader.u64(place)
    }

    fn f32(&mut self, place: &Place<'_>) -> Result<f32> {
        self.reader.f32(place)
    }

    fn f64(&mut self, place: &Place<'_>) -> Result<f64> {
        Ok(f64::from_le_bytes(self.reader.array(place)?))
    }

    fn string(&mut self, place: &Place<'_>) -> Result<Vec<u8>> {
        let length = self.reader.u64(place)?;
        self.reader.text(length, place)
    }

    fn room<T>(&mut self, out: &mut Vec<T>, count: u64, min_size: u64, place: &Place<'_>) -> Result<usize> {
        let count = self.reader.check_count(count, min_size, place)?;
        self.reader.room(out, count, place)?;
        Ok(count)
    }

    fn push<T>(&mut self, out: &mut Vec<T>, element: T, place: &Place<'_>) -> Result<()> {
        self.reader.push(out, element, place)
    }

    fn u8s(&mut self, out: &mut Vec<u8>, count: u64, place: &Place<'_>) -> Result<()> {
        self.reader.extend(out, count, place, |&[byte]| byte)
    }

    fn u32s(&mut self, out: &mut Vec<u32>, count: u64, place: &Place<'_>) -> Result<()> {
        self.reader.extend(out, count, place, |&bytes| u32::from_le_bytes(bytes))
    }

    fn f32s(&mut self, out: &mut Vec<f32>, count: u64, place: &Place<'_>) -> Result<()> {
        self.reader.extend(out, count, place, |&bytes| f32::from_le_bytes(bytes))
    }

    fn vectors(&mut self, out: &mut Vec<[f32; 3]>, count: u64, place: &Place<'_>) -> Result<()> {
        self.reader.extend(out, count, place, vec3f)
    }

    fn triples(&mut self, out: &mut Vec<[u32; 3]>, count: u64, place: &Place<'_>) -> Result<()> {
        self.reader.extend(out, count, place, |b: &[u8; 12]| {
            [0, 4, 8].map(|i| u32::from_le_bytes([b[i], b[i + 1], b[i + 2], b[i + 3]]))
        })
    }

    fn colors(&mut self, out: &mut Vec<[u8; 3]>, count: u64, place: &Place<'_>) -> Result<()> {
        let mut sound = true;
        self.reader.extend(out, count, place, |&[c0, c1, c2, c3, c4, c5, c6, c7, b, g, r]| {
            sound &= u64::from_le_bytes([c0, c1, c2, c3, c4, c5, c6, c7]) == 3;
            [r, g, b]
        })?;
        if sound { Ok(()) } else { Err(self.error(place, "a colour does not have 3 channels".into())) }
    }

    fn error(&self, place: &Place<'_>, what: String) -> Error {
        self.reader.error(place, what)
    }
}

/// Writes a binary archive.
pub(in crate::mvs) struct BinarySink<W: Write> {
    writer: Writer<W>,
    classes: Classes,
}

impl<W: Write> BinarySink<W> {
    pub(in crate::mvs) fn new(out: W) -> Self {
        BinarySink { writer: Writer::new(out), classes: Classes::default() }
    }

    pub(in crate::mvs) fn finish(self) -> Result<()> {
        self.writer.finish()
    }
}

impl<W: Write> Sink for BinarySink<W> {
    fn classes(&mut self) -> &mut Classes {
        &mut self.classes
    }

    fn u8(&mut self, value: u8) -> Result<()> {
        self.writer.bytes(&[value])
    }

    fn u32(&mut self, value: u32) -> Result<()> {
        self.writer.u32(value)
    }

    fn u64(&mut self, value: u64) -> Result<()> {
        self.writer.u64(value)
    }

    fn f32(&mut self, value: f32) -> Result<()> {
        self.writer.bytes(&value.to_le_bytes())
    }

    fn f64(&mut self, value: f64) -> Result<()> {
        self.writer.bytes(&value.to_le_bytes())
    }

    fn string(&mut self, value: &[u8]) -> Result<()> {
        self.u64(value.len() as u64)?;
        self.writer.bytes(value)
    }

    fn u32s(&mut self, values: &[u32]) -> Result<()> {
        self.writer.records(values, |v| v.to_le_bytes())
    }

    fn f32s(&mut self, values: &[f32]) -> Result<()> {
        self.writer.f32s(values)
    }

    fn color(&mut self, [r, g, b]: [u8; 3]) -> Result<()> {
        self.writer.bytes(&[3, 0, 0, 0, 0, 0, 0, 0, b, g, r])
    }
}
