//! The native project archive: its frame, its kinds, its compression.

mod read;
mod write;

use std::io::{BufRead, BufReader, Read, Write};

use super::boost::{BinarySink, BinarySource, TextSink, TextSource};
use super::scene::Scene;
use crate::wire::{Place, Reader};
use crate::{Error, Limits, Result};

/// First bytes.
pub(super) const MAGIC: [u8; 4] = *b"MVS\0";
/// Bytes before the body: magic, version, kind, reserved.
pub(super) const HEADER: usize = 20;
/// The only version of the frame.
const VERSION: u32 = 1;
/// Bytes after the data that are counted at most, where they must be decompressed for it.
const MOST_TRAILING: u64 = 1 << 20;
/// Values that a compressed project may hold however small its file is, in bytes.
const FREE_EXPANSION: u64 = 24 << 20;
/// Bytes of values for each byte of a compressed project beyond that.
const MOST_EXPANSION: u64 = 4;
/// Logarithm of the longest distance over which zstd may refer back: 32 MiB, that of its level 20.
const MOST_WINDOW_LOG: u32 = 25;

/// How the body of a native project is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ArchiveKind {
    /// Decimal text (type 0).
    Text,
    /// Binary (type 1).
    Binary,
    /// Binary in a zlib stream (type 2).
    Zlib,
    /// Binary in zstd frames (type 3).
    Zstd,
}

impl ArchiveKind {
    /// All kinds, at the position of the number that files store.
    pub const ALL: [ArchiveKind; 4] =
        [ArchiveKind::Text, ArchiveKind::Binary, ArchiveKind::Zlib, ArchiveKind::Zstd];
}

/// What the first [`HEADER`] bytes say: kind and reserved field.
pub(super) fn parse_header(head: &[u8]) -> Result<(ArchiveKind, u64)> {
    let Some(head) = head.first_chunk::<HEADER>() else {
        let what =
            format!("file ends: a native project has a header of {HEADER} bytes, {} are there", head.len());
        return Err(Error::Format { offset: 0, field: "header".into(), what });
    };
    let [_, _, _, _, v0, v1, v2, v3, k0, k1, k2, k3, reserved @ ..] = *head;
    let version = u32::from_le_bytes([v0, v1, v2, v3]);
    if version != VERSION {
        return Err(Error::Unsupported(format!(
            "native project of version {version}; version 1 can be read"
        )));
    }
    let kind = u32::from_le_bytes([k0, k1, k2, k3]);
    match ArchiveKind::ALL.get(kind as usize) {
        Some(&kind) => Ok((kind, u64::from_le_bytes(reserved))),
        None => Err(Error::Unsupported(format!(
            "native project of archive type {kind}; types 0 to 3 can be read"
        ))),
    }
}

/// Reads the body that follows the header; returns the scene and how many bytes follow it. `length` is that of the
/// body, if known.
pub(super) fn read_body(
    source: impl Read,
    length: Option<u64>,
    kind: ArchiveKind,
    limits: &Limits,
) -> Result<(Scene, u64)> {
    let mut source = BufReader::with_capacity(128 << 10, source);
    if source.fill_buf()?.is_empty() {
        let what = "the project is empty: nothing follows its header".into();
        return Err(Error::Format { offset: HEADER as u64, field: "body".into(), what });
    }
    match kind {
        ArchiveKind::Text | ArchiveKind::Binary => {
            let mut r = Reader::new(source, length.map(|n| n + HEADER as u64), limits);
            r.start_at(HEADER as u64);
            if let Some(length) = length {
                // Decimal digits can be shorter than the numbers they stand for.
                r.cap_budget(
                    length.saturating_mul(if kind == ArchiveKind::Text { 4 } else { 3 }) + (32 << 20),
                );
            }
            read_stream(r, kind)
        }
        ArchiveKind::Zlib => read_compressed(flate2::bufread::ZlibDecoder::new(source), length, kind, limits),
        ArchiveKind::Zstd => {
            let mut decoder = zstd::stream::read::Decoder::with_buffer(source)?;
            decoder.window_log_max(MOST_WINDOW_LOG)?;
            read_compressed(decoder, length, kind, limits)
        }
    }
}

/// Reads from a decompressor, of whose output only the size of the file tells how much to expect.
fn read_compressed(
    decoder: impl Read,
    length: Option<u64>,
    kind: ArchiveKind,
    limits: &Limits,
) -> Result<(Scene, u64)> {
    let mut r = Reader::new(decoder, None, limits);
    if let Some(length) = length {
        r.cap_budget(length.saturating_mul(MOST_EXPANSION).saturating_add(FREE_EXPANSION));
    }
    read_stream(r, kind).map_err(|error| match error {
        Error::Limits { field, needed, limit } if length.is_some() && limit < limits.max_bytes => {
            let rule = format!(
                "a compressed project may hold {MOST_EXPANSION} times its size and {} MiB, save it as binary",
                FREE_EXPANSION >> 20
            );
            Error::Limits { field: format!("{field} ({rule})"), needed, limit }
        }
        error => error,
    })
}

fn read_stream<R: Read>(mut r: Reader<R>, kind: ArchiveKind) -> Result<(Scene, u64)> {
    let place = Place::Root("body");
    let outcome = (|| {
        let scene = match kind {
            ArchiveKind::Text => read::read_scene(&mut TextSource::new(&mut r))?,
            _ => read::read_scene(&mut BinarySource::new(&mut r))?,
        };
        Ok((scene, trailing(&mut r, kind)?))
    })();
    outcome.map_err(|error| match error {
        // What the medium does wrong has a code of the system; what a decompressor finds has none.
        Error::Io(e)
            if e.raw_os_error().is_none() && matches!(kind, ArchiveKind::Zlib | ArchiveKind::Zstd) =>
        {
            r.error(&place, format!("the compressed data is damaged ({e})"))
        }
        Error::Format { offset, field, what } => {
            let what = format!("{what} (damaged, or a native project of another OpenMVS release than 2.3)");
            Error::Format { offset, field, what }
        }
        error => error,
    })
}

/// Bytes after the data, the line end of text archives aside.
fn trailing<R: Read>(r: &mut Reader<R>, kind: ArchiveKind) -> Result<u64> {
    if kind == ArchiveKind::Text {
        let blank = r.buffered(2)?.iter().take_while(|b| b.is_ascii_whitespace()).count();
        r.advance(blank);
    }
    match r.remaining() {
        Some(left) => Ok(left),
        None => r.skip(MOST_TRAILING),
    }
}

/// Writes a native project.
///
/// Intrinsics are normalised on the way if their camera has a resolution. Lines, the transform, names and bands of
/// cameras, and smallest and largest depths have no place in a project and are left out.
///
/// # Errors
/// [`Error::Invalid`] for indices out of range, attributes of a wrong length and, in text archives, numbers that are
/// not finite; [`Error::Io`].
pub fn write_project(out: impl Write, scene: &Scene, kind: ArchiveKind) -> Result<()> {
    scene.check_lengths()?;
    scene.check_indices()?;
    write(out, scene, kind, 0)
}

/// [`write_project`] with the header's reserved field, and indices as they are.
pub(super) fn write(mut out: impl Write, scene: &Scene, kind: ArchiveKind, reserved: u64) -> Result<()> {
    scene.check_lengths()?;
    let mut header = MAGIC.to_vec();
    header.extend(VERSION.to_le_bytes());
    header.extend((kind as u32).to_le_bytes());
    header.extend(reserved.to_le_bytes());
    out.write_all(&header)?;
    match kind {
        ArchiveKind::Text => {
            let mut sink = TextSink::new(out);
            write::write_scene(&mut sink, scene)?;
            sink.finish()
        }
        ArchiveKind::Binary => write_binary(out, scene),
        ArchiveKind::Zlib => {
            let mut encoder = flate2::write::ZlibEncoder::new(out, flate2::Compression::fast());
            write_binary(&mut encoder, scene)?;
            Ok(encoder.finish()?.flush()?)
        }
        ArchiveKind::Zstd => {
            let mut encoder = zstd::stream::write::Encoder::new(out, 1)?;
            write_binary(&mut encoder, scene)?;
            Ok(encoder.finish()?.flush()?)
        }
    }
}

fn write_binary(out: impl Write, scene: &Scene) -> Result<()> {
    let mut sink = BinarySink::new(out);
    write::write_scene(&mut sink, scene)?;
    sink.finish()
}
