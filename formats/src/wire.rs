//! Little-endian reader and writer that know their offset; counted vectors under limits.

use std::fmt;
use std::fs::File;
use std::io::{self, Read, Write};
use std::mem::size_of;
use std::path::Path;

use crate::{Error, Limits, Result};

/// Bytes that a [`Reader`] or [`Writer`] holds at most.
const BUFFER: usize = 256 << 10;
/// Elements reserved before their bytes were seen, where the length of the input is unknown.
const RESERVE_UNSEEN: usize = 16 << 10;

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

/// Buffered little-endian reader. Every count is checked against the bytes that remain (where they are
/// known) and every allocation against the budget of the [`Limits`].
pub(crate) struct Reader<R> {
    source: R,
    buffer: Box<[u8]>,
    start: usize,
    end: usize,
    /// Position of `buffer[start]` in the input.
    offset: u64,
    /// Total length of the input, if known.
    length: Option<u64>,
    /// Bytes that may still be allocated for values.
    budget: u64,
    limits: Limits,
}

impl<'a> Reader<&'a [u8]> {
    pub(crate) fn from_bytes(bytes: &'a [u8], limits: &Limits) -> Self {
        Reader::new(bytes, Some(bytes.len() as u64), limits)
    }
}

impl Reader<File> {
    pub(crate) fn open(path: &Path, limits: &Limits) -> Result<Self> {
        let file = File::open(path)?;
        let metadata = file.metadata()?;
        if metadata.is_dir() {
            return Err(Error::Io(io::ErrorKind::IsADirectory.into()));
        }
        let length = metadata.is_file().then_some(metadata.len());
        Ok(Reader::new(file, length, limits))
    }
}

impl<R: Read> Reader<R> {
    pub(crate) fn new(source: R, length: Option<u64>, limits: &Limits) -> Self {
        let capacity = length.map_or(BUFFER, |n| n.clamp(64, BUFFER as u64) as usize);
        Reader {
            source,
            buffer: vec![0; capacity].into_boxed_slice(),
            start: 0,
            end: 0,
            offset: 0,
            length,
            budget: limits.max_bytes,
            limits: *limits,
        }
    }

    /// Bytes left, if the length of the input is known.
    pub(crate) fn remaining(&self) -> Option<u64> {
        self.length.map(|n| n.saturating_sub(self.offset))
    }

    /// Caps what may still be allocated, for inputs whose values cannot need more.
    pub(crate) fn cap_budget(&mut self, bytes: u64) {
        self.budget = self.budget.min(bytes);
    }

    /// An [`Error::Format`] at the current offset.
    pub(crate) fn error(&self, place: &Place<'_>, what: impl Into<String>) -> Error {
        Error::Format { offset: self.offset, field: place.to_string(), what: what.into() }
    }

    /// Reserves `bytes` of the budget for values of `place`.
    pub(crate) fn charge(&mut self, bytes: u64, place: &Place<'_>) -> Result<()> {
        if bytes > self.budget {
            return Err(Error::Limits { field: place.to_string(), needed: bytes, limit: self.budget });
        }
        self.budget -= bytes;
        Ok(())
    }

    /// Charges `count` elements of `T` and makes room for as many as it is safe to believe in.
    pub(crate) fn room<T>(&mut self, out: &mut Vec<T>, count: usize, place: &Place<'_>) -> Result<()> {
        self.charge((count as u64).saturating_mul(size_of::<T>() as u64), place)?;
        let now = if self.length.is_some() { count } else { count.min(RESERVE_UNSEEN) };
        out.try_reserve(now).map_err(|_| Error::Io(io::ErrorKind::OutOfMemory.into()))
    }

    /// Makes at least `wanted` (≤ buffer size) bytes contiguous in the buffer, unless the input ends before.
    fn fill(&mut self, wanted: usize) -> Result<usize> {
        if self.end - self.start < wanted {
            self.buffer.copy_within(self.start..self.end, 0);
            self.end -= self.start;
            self.start = 0;
            while self.end < wanted {
                match self.source.read(&mut self.buffer[self.end..]) {
                    Ok(0) => break,
                    Ok(n) => self.end += n,
                    Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
                    Err(e) => return Err(Error::Io(e)),
                }
            }
        }
        Ok(self.end - self.start)
    }

    fn truncated(&self, wanted: u64, place: &Place<'_>) -> Error {
        let have = (self.end - self.start) as u64;
        self.error(place, format!("file ends: {wanted} bytes needed, {have} left"))
    }

    fn advance(&mut self, bytes: usize) {
        self.start += bytes;
        self.offset += bytes as u64;
    }

    /// The next `N` bytes.
    #[inline]
    pub(crate) fn array<const N: usize>(&mut self, place: &Place<'_>) -> Result<[u8; N]> {
        if self.end - self.start < N && self.fill(N)? < N {
            return Err(self.truncated(N as u64, place));
        }
        let mut out = [0; N];
        out.copy_from_slice(&self.buffer[self.start..self.start + N]);
        self.advance(N);
        Ok(out)
    }

    /// Up to `N` bytes at the current position without consuming them.
    pub(crate) fn peek(&mut self, n: usize) -> Result<&[u8]> {
        let have = self.fill(n)?.min(n);
        Ok(&self.buffer[self.start..self.start + have])
    }

    #[inline]
    pub(crate) fn u8(&mut self, place: &Place<'_>) -> Result<u8> {
        Ok(self.array::<1>(place)?[0])
    }

    #[inline]
    pub(crate) fn u16(&mut self, place: &Place<'_>) -> Result<u16> {
        Ok(u16::from_le_bytes(self.array(place)?))
    }

    #[inline]
    pub(crate) fn u32(&mut self, place: &Place<'_>) -> Result<u32> {
        Ok(u32::from_le_bytes(self.array(place)?))
    }

    #[inline]
    pub(crate) fn u64(&mut self, place: &Place<'_>) -> Result<u64> {
        Ok(u64::from_le_bytes(self.array(place)?))
    }

    #[inline]
    pub(crate) fn f32(&mut self, place: &Place<'_>) -> Result<f32> {
        Ok(f32::from_le_bytes(self.array(place)?))
    }

    /// `N` consecutive doubles.
    pub(crate) fn f64s<const N: usize>(&mut self, place: &Place<'_>) -> Result<[f64; N]> {
        let mut out = [0.0; N];
        for value in &mut out {
            *value = f64::from_le_bytes(self.array(place)?);
        }
        Ok(out)
    }

    /// `N` consecutive floats.
    pub(crate) fn f32s<const N: usize>(&mut self, place: &Place<'_>) -> Result<[f32; N]> {
        let mut out = [0.0; N];
        for value in &mut out {
            *value = f32::from_le_bytes(self.array(place)?);
        }
        Ok(out)
    }

    /// Checks that `count` elements of at least `min_size` bytes can follow.
    pub(crate) fn check_count(&self, count: u64, min_size: u64, place: &Place<'_>) -> Result<usize> {
        let needed = count.checked_mul(min_size);
        if let Some(left) = self.remaining()
            && needed.is_none_or(|n| n > left)
        {
            let what =
                format!("{count} elements of at least {min_size} bytes do not fit in the {left} bytes left");
            return Err(self.error(place, what));
        }
        usize::try_from(count).map_err(|_| Error::Limits {
            field: place.to_string(),
            needed: needed.unwrap_or(u64::MAX),
            limit: self.budget,
        })
    }

    /// Hands the next `count` records of `N` bytes to `each`, in order.
    #[inline]
    pub(crate) fn for_each<const N: usize>(
        &mut self,
        count: usize,
        place: &Place<'_>,
        mut each: impl FnMut(&[u8; N]),
    ) -> Result<()> {
        let mut left = count;
        while left > 0 {
            let have = match self.end - self.start {
                buffered if buffered >= N => buffered,
                _ => self.fill(N)?,
            };
            let (records, _) = self.buffer[self.start..self.start + have].as_chunks::<N>();
            if records.is_empty() {
                return Err(self.truncated((left as u64).saturating_mul(N as u64), place));
            }
            let now = records.len().min(left);
            records[..now].iter().for_each(&mut each);
            self.advance(now * N);
            left -= now;
        }
        Ok(())
    }

    /// Appends `count` elements of `N` bytes each; charges them and reads them in bulk.
    pub(crate) fn extend<T, const N: usize>(
        &mut self,
        out: &mut Vec<T>,
        count: u64,
        place: &Place<'_>,
        decode: impl Fn(&[u8; N]) -> T,
    ) -> Result<()> {
        let count = self.check_count(count, N as u64, place)?;
        self.room(out, count, place)?;
        self.for_each(count, place, |record| out.push(decode(record)))
    }

    /// A vector of `count` elements of `N` bytes each.
    pub(crate) fn vec<T, const N: usize>(
        &mut self,
        count: u64,
        place: &Place<'_>,
        decode: impl Fn(&[u8; N]) -> T,
    ) -> Result<Vec<T>> {
        let mut out = Vec::new();
        self.extend(&mut out, count, place, decode)?;
        Ok(out)
    }

    /// `length` bytes that form a name or a path; at most [`Limits::max_string`].
    pub(crate) fn text(&mut self, length: u64, place: &Place<'_>) -> Result<Vec<u8>> {
        if length > self.limits.max_string {
            let limit = self.limits.max_string;
            return Err(self.error(place, format!("text of {length} bytes is longer than {limit}")));
        }
        self.vec(length, place, |&[byte]| byte)
    }

    /// Whether the input ends here.
    pub(crate) fn at_end(&mut self) -> Result<bool> {
        Ok(self.fill(1)? == 0)
    }

    /// Reads to the end of the input and returns how many bytes that were.
    pub(crate) fn skip_rest(&mut self) -> Result<u64> {
        let from = self.offset;
        loop {
            match self.fill(1)? {
                0 => return Ok(self.offset - from),
                n => self.advance(n),
            }
        }
    }
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
        values.iter().try_for_each(|v| self.bytes(&v.to_le_bytes()))
    }

    pub(crate) fn f64s(&mut self, values: &[f64]) -> Result<()> {
        values.iter().try_for_each(|v| self.bytes(&v.to_le_bytes()))
    }

    /// Hands everything to the sink and flushes it.
    pub(crate) fn finish(mut self) -> Result<()> {
        self.sink.write_all(&self.buffer)?;
        Ok(self.sink.flush()?)
    }
}
