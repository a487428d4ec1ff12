//! The writer.

use std::io::Write;

use super::BUFFER;
use crate::Result;

/// Buffered little-endian writer; call [`Writer::finish`] at the end.
pub(crate) struct Writer<W: Write> {
    sink: W,
    buffer: Vec<u8>,
}

impl<W: Write> Writer<W> {
    pub(crate) fn new(sink: W) -> Self {
        Writer { sink, buffer: Vec::with_capacity(64 << 10) }
    }

    #[inline]
    pub(crate) fn bytes(&mut self, bytes: &[u8]) -> Result<()> {
        self.buffer.extend_from_slice(bytes);
        if self.buffer.len() >= BUFFER {
            self.sink.write_all(&self.buffer)?;
            self.buffer.clear();
        }
        Ok(())
    }

    pub(crate) fn u32(&mut self, value: u32) -> Result<()> {
        self.bytes(&value.to_le_bytes())
    }

    pub(crate) fn u64(&mut self, value: u64) -> Result<()> {
        self.bytes(&value.to_le_bytes())
    }

    pub(crate) fn f32s(&mut self, values: &[f32]) -> Result<()> {
        self.records(values, |v| v.to_le_bytes())
    }

    pub(crate) fn f64s(&mut self, values: &[f64]) -> Result<()> {
        self.records(values, |v| v.to_le_bytes())
    }

    /// Values of `N` bytes each, in bulk.
    #[inline]
    pub(crate) fn records<T, const N: usize>(
        &mut self,
        values: &[T],
        encode: impl Fn(&T) -> [u8; N],
    ) -> Result<()> {
        for values in values.chunks(BUFFER / N) {
            let start = self.buffer.len();
            self.buffer.resize(start + N * values.len(), 0);
            let (slots, _) = self.buffer[start..].as_chunks_mut::<N>();
            slots.iter_mut().zip(values).for_each(|(slot, value)| *slot = encode(value));
            self.bytes(&[])?;
        }
        Ok(())
    }

    /// Hands everything to the sink and flushes it.
    pub(crate) fn finish(mut self) -> Result<()> {
        self.sink.write_all(&self.buffer)?;
        Ok(self.sink.flush()?)
    }
}
