//! What a LAS or LAZ file says of itself.

use crate::{Error, Limits, Result};
use std::io::Read;

/// The header of a file, of any version and point record format.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LasInfo {
    /// Major and minor version.
    pub version: (u8, u8),
    /// Point record format, 0 to 10.
    pub format: u8,
    /// Whether the points are compressed (LAZ).
    pub compressed: bool,
    /// Points.
    pub points: u64,
    /// Steps of the coordinates.
    pub scale: [f64; 3],
    /// Coordinates of the integers 0.
    pub offset: [f64; 3],
    /// Least and largest coordinates.
    pub bounds: [[f64; 3]; 2],
    /// Program that made the file.
    pub software: String,
    /// Declared extra bytes: type and name of each, such as `uint16 label`.
    pub extras: Vec<String>,
    /// Classification codes that have a name.
    pub class_names: Vec<(u8, String)>,
}

/// Bytes of the header that all versions have.
const COMMON: usize = 227;
/// Bytes of a variable length record before its data.
const RECORD_HEADER: usize = 54;
/// Most records that are looked at.
const MOST_RECORDS: u32 = 1 << 16;
/// Classification codes that there are.
const MOST_CODES: usize = 256;
/// Types of extra bytes by their codes.
const TYPES: [&str; 11] =
    ["bytes", "uint8", "int8", "uint16", "int16", "uint32", "int32", "uint64", "int64", "float32", "float64"];

impl LasInfo {
    /// Reads header and variable length records; the points are not read.
    ///
    /// # Errors
    /// [`Error::Format`] for another kind of file, one that ends early and sizes that contradict each other;
    /// [`Error::Limits`] for more records than anyone has; [`Error::Io`].
    pub fn read(mut reader: impl Read, limits: &Limits) -> Result<Self> {
        let head = take(&mut reader, COMMON, 0, "header")?;
        if !head.starts_with(b"LASF") {
            return Err(broken(0, "signature", "this is no LAS file, which would start with \"LASF\""));
        }
        let header_size = usize::from(u16_at(&head, 94));
        if header_size < COMMON {
            return Err(broken(
                94,
                "header size",
                format!("{header_size} bytes, at least {COMMON} are needed"),
            ));
        }
        let rest = take(&mut reader, header_size - COMMON, COMMON, "header")?;
        let triple = |at: usize| std::array::from_fn(|axis| f64_at(&head, at + 8 * axis));
        let bound = |which: usize| std::array::from_fn(|axis| f64_at(&head, 179 + 16 * axis + 8 * which));
        let mut info = LasInfo {
            version: (head[24], head[25]),
            // The two highest bits say that the points are compressed.
            format: head[104] & 0x3f,
            compressed: head[104] & 0xc0 != 0,
            points: u32_at(&head, 107).into(),
            scale: triple(131),
            offset: triple(155),
            bounds: [bound(1), bound(0)],
            software: text(&head[58..90]),
            ..LasInfo::default()
        };
        let counts_at = 247 - COMMON;
        if info.version >= (1, 4) && rest.len() >= counts_at + 8 {
            info.points = u64_at(&rest, counts_at);
        }
        info.read_records(reader, header_size, u32_at(&head, 96), u32_at(&head, 100), limits)?;
        Ok(info)
    }

    fn read_records(
        &mut self,
        mut reader: impl Read,
        mut at: usize,
        to_points: u32,
        count: u32,
        limits: &Limits,
    ) -> Result<()> {
        if count > MOST_RECORDS {
            let needed = u64::from(count) * RECORD_HEADER as u64;
            let limit = limits.max_bytes.min(u64::from(MOST_RECORDS) * RECORD_HEADER as u64);
            return Err(Error::Limits { field: "variable length records".into(), needed, limit });
        }
        for i in 0..count {
            let field = format!("variable length record {i}");
            let head = take(&mut reader, RECORD_HEADER, at, &field)?;
            let length = usize::from(u16_at(&head, 20));
            if at + RECORD_HEADER + length > to_points as usize {
                return Err(broken(at as u64, &field, "it reaches into the points"));
            }
            let data = take(&mut reader, length, at + RECORD_HEADER, &field)?;
            at += RECORD_HEADER + length;
            match (text(&head[2..18]).as_str(), u16_at(&head, 18)) {
                ("LASF_Spec", 0) => {
                    let named =
                        |entry: &[u8]| Some((entry[0], text(&entry[1..]))).filter(|(_, n)| !n.is_empty());
                    let room = MOST_CODES.saturating_sub(self.class_names.len());
                    self.class_names.extend(data.chunks_exact(16).filter_map(named).take(room));
                }
                ("LASF_Spec", 4) => {
                    let kind = |code: u8| TYPES.get(usize::from(code)).copied().unwrap_or("values");
                    let shown = |entry: &[u8]| format!("{} {}", kind(entry[2]), text(&entry[4..36]));
                    self.extras.extend(data.chunks_exact(192).map(shown));
                }
                _ => {}
            }
        }
        Ok(())
    }
}

/// The next `count` bytes, at most 64 KiB of them.
fn take(reader: &mut impl Read, count: usize, at: usize, field: &str) -> Result<Vec<u8>> {
    let mut bytes = vec![0; count];
    reader.read_exact(&mut bytes).map_err(|e| match e.kind() {
        std::io::ErrorKind::UnexpectedEof => broken(at as u64, field, "the file ends within it"),
        _ => Error::Io(e),
    })?;
    Ok(bytes)
}

fn broken(offset: u64, field: &str, what: impl Into<String>) -> Error {
    Error::Format { offset, field: field.to_owned(), what: what.into() }
}

/// Text up to the first zero byte.
fn text(field: &[u8]) -> String {
    let end = field.iter().position(|&byte| byte == 0).unwrap_or(field.len());
    String::from_utf8_lossy(&field[..end]).into_owned()
}

fn array<const N: usize>(bytes: &[u8], at: usize) -> [u8; N] {
    std::array::from_fn(|i| bytes[at + i])
}

fn u16_at(bytes: &[u8], at: usize) -> u16 {
    u16::from_le_bytes(array(bytes, at))
}

fn u32_at(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes(array(bytes, at))
}

fn u64_at(bytes: &[u8], at: usize) -> u64 {
    u64::from_le_bytes(array(bytes, at))
}

fn f64_at(bytes: &[u8], at: usize) -> f64 {
    f64::from_le_bytes(array(bytes, at))
}
