//! Digests that tell whether two inputs are the same: XXH3 of 128 bits (Collet 2020). They guard against accidents, not
//! against malice.

use crate::error::{Error, Result};
use serde::{Deserialize, Serialize};
use std::fmt::{Display, Formatter};
use std::fs::File;
use std::io::{Read, Write};
use std::path::Path;
use xxhash_rust::xxh3::Xxh3;

/// Bytes that are read from a file at a time.
const CHUNK: usize = 1 << 20;

/// A digest; as text 32 hexadecimal digits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Digest(u128);

impl Digest {
    /// The digest of what `parts` enters.
    pub(crate) fn of(parts: impl FnOnce(&mut Digester)) -> Self {
        let mut digester = Digester::new();
        parts(&mut digester);
        digester.finish()
    }

    /// The digest of the bytes of a file.
    ///
    /// # Errors
    /// It cannot be read.
    pub(crate) fn of_file(path: &Path) -> Result<Self> {
        let failed = |source| Error::io(path, "read", source);
        let mut file = File::open(path).map_err(failed)?;
        let mut digester = Digester::new();
        let mut chunk = vec![0; CHUNK];
        loop {
            match file.read(&mut chunk) {
                Ok(0) => return Ok(digester.finish()),
                Ok(length) => digester.0.update(&chunk[..length]),
                Err(e) if e.kind() == std::io::ErrorKind::Interrupted => {}
                Err(e) => return Err(failed(e)),
            }
        }
    }
}

impl Display for Digest {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:032x}", self.0)
    }
}

impl From<Digest> for String {
    fn from(digest: Digest) -> Self {
        digest.to_string()
    }
}

impl TryFrom<String> for Digest {
    type Error = String;
    fn try_from(text: String) -> std::result::Result<Self, String> {
        match u128::from_str_radix(&text, 16) {
            Ok(value) if text.len() == 32 => Ok(Digest(value)),
            _ => Err(format!("{text:?} is no digest")),
        }
    }
}

/// Sums up values of which every one has a known length or is preceded by it, so that no two sequences look alike.
pub(crate) struct Digester(Xxh3);

impl Digester {
    pub(crate) fn new() -> Self {
        Digester(Xxh3::new())
    }

    /// Bytes of any number.
    pub(crate) fn bytes(&mut self, bytes: &[u8]) -> &mut Self {
        self.number(bytes.len() as u64);
        self.0.update(bytes);
        self
    }

    /// A text.
    pub(crate) fn text(&mut self, text: &str) -> &mut Self {
        self.bytes(text.as_bytes())
    }

    /// A whole number.
    pub(crate) fn number(&mut self, number: u64) -> &mut Self {
        self.0.update(&number.to_le_bytes());
        self
    }

    /// Real numbers, bit for bit.
    pub(crate) fn reals<'a>(&mut self, reals: impl IntoIterator<Item = &'a f64>) -> &mut Self {
        reals.into_iter().for_each(|real| self.0.update(&real.to_bits().to_le_bytes()));
        self
    }

    /// Another digest.
    pub(crate) fn digest(&mut self, digest: Digest) -> &mut Self {
        self.0.update(&digest.0.to_le_bytes());
        self
    }

    /// The digest of everything so far.
    pub(crate) fn finish(&self) -> Digest {
        Digest(self.0.digest128())
    }
}

/// Passes bytes on to a file and sums them up as [`Digest::of_file`] does.
pub(crate) struct DigestingWriter<W> {
    inner: W,
    digester: Digester,
}

impl<W: Write> DigestingWriter<W> {
    pub(crate) fn new(inner: W) -> Self {
        DigestingWriter { inner, digester: Digester::new() }
    }

    /// What was written to, and the digest of what was written.
    pub(crate) fn finish(self) -> (W, Digest) {
        let digest = self.digester.finish();
        (self.inner, digest)
    }
}

impl<W: Write> Write for DigestingWriter<W> {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        let written = self.inner.write(bytes)?;
        self.digester.0.update(&bytes[..written]);
        Ok(written)
    }
    fn flush(&mut self) -> std::io::Result<()> {
        self.inner.flush()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_written_has_the_digest_of_the_file() {
        let scratch = tempfile::tempdir().unwrap();
        let path = scratch.path().join("file");
        let bytes: Vec<u8> = (0..3_000_000u64).map(|i| ((i * i) >> 7) as u8).collect();
        let mut writer = DigestingWriter::new(File::create(&path).unwrap());
        bytes.chunks(777).for_each(|chunk| writer.write_all(chunk).unwrap());
        let digest = writer.finish().1;
        assert_eq!(Digest::of_file(&path).unwrap(), digest);
        let text = String::from(digest);
        assert_eq!(Digest::try_from(text.clone()), Ok(digest));
        assert!(Digest::try_from(text[1..].to_owned()).is_err());
        let mut changed = bytes;
        changed[2_000_000] ^= 1;
        std::fs::write(&path, changed).unwrap();
        assert_ne!(Digest::of_file(&path).unwrap(), digest);
    }

    #[test]
    fn where_a_value_ends_counts() {
        let of = |a: &str, b: &str| {
            Digest::of(|d| {
                d.text(a).text(b).number(7);
            })
        };
        assert_ne!(of("ab", "c"), of("a", "bc"));
        assert_eq!(of("ab", "c"), of("ab", "c"));
    }
}
