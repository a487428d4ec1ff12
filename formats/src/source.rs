//! Buffered bytes with a known offset, read by line or by record.

use crate::{Error, Result};
use std::io::{ErrorKind, Read};

/// Bytes asked of the reader at a time.
const BLOCK: usize = 256 << 10;

/// Makes room for `more` elements: a vector that grows again and again gets a quarter more than it holds, where the
/// standard library would double it.
#[inline]
pub(crate) fn grow<T>(out: &mut Vec<T>, more: usize) {
    if out.capacity() - out.len() < more {
        out.reserve_exact(more.max(out.len() / 4).max(4));
    }
}

/// A reader with a window of bytes that are read but not consumed.
pub(crate) struct Source<R> {
    inner: R,
    buffer: Vec<u8>,
    start: usize,
    end: usize,
    consumed: u64,
    ended: bool,
}

impl<R: Read> Source<R> {
    pub(crate) fn new(inner: R) -> Self {
        Source { inner, buffer: vec![0; BLOCK], start: 0, end: 0, consumed: 0, ended: false }
    }

    /// Offset in the file of the first byte not consumed.
    pub(crate) fn offset(&self) -> u64 {
        self.consumed
    }

    /// Bytes read but not consumed.
    pub(crate) fn window(&self) -> &[u8] {
        &self.buffer[self.start..self.end]
    }

    pub(crate) fn consume(&mut self, bytes: usize) {
        debug_assert!(bytes <= self.end - self.start);
        self.start += bytes;
        self.consumed += bytes as u64;
    }

    /// Reads on; false at the end of the file. A full window is doubled, so it grows only with bytes that exist.
    pub(crate) fn fill(&mut self) -> Result<bool> {
        if self.start > 0 {
            self.buffer.copy_within(self.start..self.end, 0);
            self.end -= self.start;
            self.start = 0;
        }
        if self.end == self.buffer.len() {
            self.buffer.resize(self.end * 2, 0);
        }
        let before = self.end;
        while self.end < self.buffer.len() && !self.ended {
            match self.inner.read(&mut self.buffer[self.end..]) {
                Ok(0) => self.ended = true,
                Ok(n) => self.end += n,
                Err(e) if e.kind() == ErrorKind::Interrupted => {}
                Err(e) => return Err(e.into()),
            }
        }
        Ok(self.end > before)
    }

    /// Consumes a line into `line` without its `\n` or `\r\n`; false, with an empty line, at the end of the file.
    pub(crate) fn line(&mut self, line: &mut Vec<u8>, max: u64, field: &str) -> Result<bool> {
        line.clear();
        let mut searched = 0;
        let (length, skip) = loop {
            if let Some(i) = self.window()[searched..].iter().position(|&b| b == b'\n') {
                break (searched + i, searched + i + 1);
            }
            searched = self.window().len();
            if searched as u64 > max {
                break (searched, searched);
            }
            if !self.fill()? {
                break (searched, searched);
            }
        };
        if length as u64 > max {
            return Err(Error::Limits { field: field.into(), needed: length as u64, limit: max });
        }
        line.extend_from_slice(&self.window()[..length]);
        if line.last() == Some(&b'\r') {
            line.pop();
        }
        self.consume(skip);
        Ok(skip > 0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Hands out one byte at a time.
    struct Trickle<'a>(&'a [u8]);

    impl Read for Trickle<'_> {
        fn read(&mut self, out: &mut [u8]) -> std::io::Result<usize> {
            let n = self.0.len().min(out.len()).min(1);
            out[..n].copy_from_slice(&self.0[..n]);
            self.0 = &self.0[n..];
            Ok(n)
        }
    }

    #[test]
    fn lines_and_offsets_do_not_depend_on_how_the_bytes_arrive() {
        let mut source = Source::new(Trickle(b"one\r\n\ntwo"));
        let mut line = Vec::new();
        assert!(source.line(&mut line, 10, "l").unwrap());
        assert_eq!((line.as_slice(), source.offset()), (&b"one"[..], 5));
        assert!(source.line(&mut line, 10, "l").unwrap());
        assert_eq!((line.as_slice(), source.offset()), (&b""[..], 6));
        assert!(source.line(&mut line, 10, "l").unwrap());
        assert_eq!((line.as_slice(), source.offset()), (&b"two"[..], 9));
        assert!(!source.line(&mut line, 10, "l").unwrap());
    }

    #[test]
    fn a_full_window_grows_and_keeps_its_bytes() {
        let bytes: Vec<u8> = (0..3 * BLOCK).map(|i| (i % 251) as u8).collect();
        let mut source = Source::new(bytes.as_slice());
        source.fill().unwrap();
        source.consume(7);
        while source.fill().unwrap() {}
        assert_eq!(source.window(), &bytes[7..]);
    }
}
