//! Small text files: words with the place they stand at.

use std::io::Read;
use std::path::Path;
use std::str::FromStr;

use crate::{Error, Limits, Result, wire};

/// Reads a whole text file of at most `most` bytes.
pub(crate) fn load(path: &Path, most: u64, limits: &Limits) -> Result<Vec<u8>> {
    let (file, length) = wire::open(path)?;
    let most = most.min(limits.max_bytes);
    let mut text = Vec::new();
    if length.is_none_or(|n| n <= most) {
        file.take(most + 1).read_to_end(&mut text)?;
    }
    match length.unwrap_or(0).max(text.len() as u64) {
        needed if needed > most => Err(Error::Limits { field: "text".into(), needed, limit: most }),
        _ => Ok(text),
    }
}

/// A word of a text and its offset.
#[derive(Clone, Copy)]
pub(crate) struct Word<'a> {
    offset: u64,
    bytes: &'a [u8],
}

/// The words of `line`, which starts at `offset`.
pub(crate) fn words(line: &[u8], offset: u64) -> impl Iterator<Item = Word<'_>> {
    let mut at = 0;
    std::iter::from_fn(move || {
        at += line[at..].iter().take_while(|b| b.is_ascii_whitespace()).count();
        let length = line[at..].iter().take_while(|b| !b.is_ascii_whitespace()).count();
        let word = Word { offset: offset + at as u64, bytes: &line[at..at + length] };
        at += length;
        (length > 0).then_some(word)
    })
}

impl Word<'_> {
    /// The word as a number.
    pub(crate) fn number<T: FromStr>(self, field: &str, kind: &str) -> Result<T> {
        let number = std::str::from_utf8(self.bytes).ok().and_then(|word| word.parse().ok());
        number.ok_or_else(|| {
            let shown = String::from_utf8_lossy(&self.bytes[..self.bytes.len().min(24)]);
            self.error(field, format!("{shown:?} is not {kind}"))
        })
    }

    pub(crate) fn error(self, field: &str, what: String) -> Error {
        Error::Format { offset: self.offset, field: field.into(), what }
    }
}
