//! The reader.

use std::fs::File;
use std::io::{self, Read};
use std::mem::size_of;
use std::path::Path;

use super::{BUFFER, Place, open};
use crate::{Error, Limits, Result};

/// Elements reserved before their bytes were seen, where the length of the input is unknown.
const RESERVE_UNSEEN: usize = 16 << 10;

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
        let (file, length) = open(path)?;
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

    /// Says that `offset` bytes of the input, which `length` counts, were read before.
    pub(crate) fn start_at(&mut self, offset: u64) {
        self.offset = offset;
    }

    /// Bytes of the input that were read.
    pub(crate) fn offset(&self) -> u64 {
        self.offset
    }

    /// Bytes left, if the length of the input is known.
    pub(crate) fn remaining(&self) -> Option<u64> {
        self.length.map(|n| n.saturating_sub(self.offset))
    }

    /// Longest string allowed, in bytes.
    pub(crate) fn max_string(&self) -> u64 {
        self.limits.max_string
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
            return Err(self.exceeded(bytes, place));
        }
        self.budget -= bytes;
        Ok(())
    }

    fn exceeded(&self, needed: u64, place: &Place<'_>) -> Error {
        Error::Limits { field: place.to_string(), needed, limit: self.budget }
    }

    /// Makes room for as many of `count` elements as it is safe to believe in; the others are left to
    /// [`Reader::push`].
    pub(crate) fn room<T>(&mut self, out: &mut Vec<T>, count: usize, place: &Place<'_>) -> Result<()> {
        let needed = (count as u64).saturating_mul(size_of::<T>() as u64);
        if self.length.is_none() && needed > self.budget {
            return Err(self.exceeded(needed, place));
        }
        self.grow(out, if self.length.is_some() { count } else { count.min(RESERVE_UNSEEN) }, place)
    }

    /// Makes room for `more` elements and charges what is allocated for it: a vector that grows again and again gets
    /// a quarter more than it holds, while the budget lasts.
    #[inline]
    pub(crate) fn grow<T>(&mut self, out: &mut Vec<T>, more: usize, place: &Place<'_>) -> Result<()> {
        if more <= out.capacity() - out.len() { Ok(()) } else { self.enlarge(out, more, place) }
    }

    #[cold]
    fn enlarge<T>(&mut self, out: &mut Vec<T>, more: usize, place: &Place<'_>) -> Result<()> {
        let spare = out.capacity() - out.len();
        let bytes = |elements: usize| (elements as u64).saturating_mul(size_of::<T>() as u64);
        let least = more - spare;
        let ample = least.max(out.len() / 4);
        let extra = if bytes(ample) <= self.budget { ample } else { least };
        self.charge(bytes(extra), place)?;
        out.try_reserve_exact(spare + extra).map_err(|_| Error::Io(io::ErrorKind::OutOfMemory.into()))
    }

    /// Appends an element, for which there may be no room yet.
    #[inline]
    pub(crate) fn push<T>(&mut self, out: &mut Vec<T>, element: T, place: &Place<'_>) -> Result<()> {
        if out.len() == out.capacity() {
            self.grow(out, 1, place)?;
        }
        out.push(element);
        Ok(())
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

    /// All bytes that are buffered; at least `wanted` (≤ buffer size), unless the input ends before.
    #[inline]
    pub(crate) fn buffered(&mut self, wanted: usize) -> Result<&[u8]> {
        if self.end - self.start < wanted {
            self.fill(wanted)?;
        }
        Ok(&self.buffer[self.start..self.end])
    }

    /// Skips `bytes` of what [`Reader::buffered`] returned.
    #[inline]
    pub(crate) fn advance(&mut self, bytes: usize) {
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

    /// Hands the next `count` records of `N` bytes to `take`, in order, as many at a time as are buffered.
    #[inline]
    pub(crate) fn for_each_block<const N: usize>(
        &mut self,
        count: usize,
        place: &Place<'_>,
        mut take: impl FnMut(&[[u8; N]]),
    ) -> Result<()> {
        let mut left = count;
        while left > 0 {
            if self.end - self.start < N && self.fill(N)? < N {
                return Err(self.truncated((left as u64).saturating_mul(N as u64), place));
            }
            let (records, _) = self.buffer[self.start..self.end].as_chunks::<N>();
            let now = records.len().min(left);
            take(&records[..now]);
            self.advance(now * N);
            left -= now;
        }
        Ok(())
    }

    /// Appends `count` elements of `N` bytes each; charges them and reads them in bulk.
    #[inline]
    pub(crate) fn extend<T, const N: usize>(
        &mut self,
        out: &mut Vec<T>,
        count: u64,
        place: &Place<'_>,
        mut decode: impl FnMut(&[u8; N]) -> T,
    ) -> Result<()> {
        let mut left = self.check_count(count, N as u64, place)?;
        self.room(out, left, place)?;
        let piece = if self.length.is_some() { usize::MAX } else { RESERVE_UNSEEN };
        while left > 0 {
            let now = left.min(piece);
            self.grow(out, now, place)?;
            self.for_each_block(now, place, |records| out.extend(records.iter().map(&mut decode)))?;
            left -= now;
        }
        Ok(())
    }

    /// A vector of `count` elements of `N` bytes each.
    pub(crate) fn vec<T, const N: usize>(
        &mut self,
        count: u64,
        place: &Place<'_>,
        decode: impl FnMut(&[u8; N]) -> T,
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

    /// Reads on to the end of the input, or at least `most` bytes, and returns how many bytes that were.
    pub(crate) fn skip(&mut self, most: u64) -> Result<u64> {
        let from = self.offset;
        loop {
            match self.fill(1)? {
                n if n > 0 && self.offset - from < most => self.advance(n),
                _ => return Ok(self.offset - from),
            }
        }
    }
}
