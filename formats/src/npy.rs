//! NumPy arrays of floats (`.npy`), format versions 1 to 3.

use crate::wire::{Place, Reader, Writer};
use crate::{Error, Limits, Result};
use std::io::{Read, Write};

const MAGIC: [u8; 6] = *b"\x93NUMPY";
/// Writers pad headers so that data starts at a multiple of this.
const ALIGNMENT: usize = 64;
/// Most dimensions that are read.
const MAX_DIMENSIONS: usize = 3;

/// An array of up to three dimensions.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FloatArray {
    /// Length of every dimension, slowest first; (rows, columns) of a depth map.
    pub shape: Vec<u64>,
    /// Values, last dimension fastest. 64-bit floats of files are rounded.
    pub data: Vec<f32>,
}

/// What a header says of an array.
struct Header {
    /// Bytes of a value: 4 or 8.
    width: u64,
    big_endian: bool,
    fortran_order: bool,
    shape: Vec<u64>,
}

/// Reads an array of 32- or 64-bit floats in either byte order and memory order. `length` is the number of bytes in
/// `source`, if known.
///
/// # Errors
/// [`Error::Format`] for a broken header or a file that is shorter or longer than its header says;
/// [`Error::Unsupported`] for other types of values and more than three dimensions; [`Error::Limits`];
/// [`Error::Io`].
pub fn read(source: impl Read, length: Option<u64>, limits: &Limits) -> Result<FloatArray> {
    let mut r = Reader::new(source, length, limits);
    let root = Place::Root("header");
    if r.array(&root)? != MAGIC {
        return Err(r.error(&root, "not an .npy file"));
    }
    let [major, _minor] = r.array(&root)?;
    let header_length = match major {
        1 => u64::from(r.u16(&root)?),
        2 | 3 => u64::from(r.u32(&root)?),
        other => return Err(Error::Unsupported(format!(".npy format version {other}"))),
    };
    let text = r.text(header_length, &root)?;
    let text = String::from_utf8(text).map_err(|_| r.error(&root, "the header is no text"))?;
    let Header { width, big_endian, fortran_order, shape } = parse(&text).map_err(|e| match e {
        Fault::Broken(what) => r.error(&root, what),
        Fault::Unsupported(what) => Error::Unsupported(what),
    })?;
    let at = Place::Root("values");
    let Some(count) = shape.iter().try_fold(1u64, |n, &side| n.checked_mul(side)) else {
        return Err(r.error(&at, format!("an array of shape {shape:?}")));
    };
    let data = match (width, big_endian) {
        (4, false) => r.vec(count, &at, |b| f32::from_le_bytes(*b))?,
        (4, true) => r.vec(count, &at, |b| f32::from_be_bytes(*b))?,
        (_, false) => r.vec(count, &at, |b| f64::from_le_bytes(*b) as f32)?,
        (_, true) => r.vec(count, &at, |b| f64::from_be_bytes(*b) as f32)?,
    };
    if !r.at_end()? {
        return Err(r.error(&at, format!("bytes follow the {count} values of shape {shape:?}")));
    }
    if !fortran_order || shape.len() < 2 || data.is_empty() {
        return Ok(FloatArray { shape, data });
    }
    r.charge(count.saturating_mul(4), &at)?;
    let data = transposed(&shape, &data);
    Ok(FloatArray { shape, data })
}

/// Writes an array as 32-bit little-endian floats, format version 1.
///
/// # Errors
/// [`Error::Unsupported`] if the shape does not fit the data; [`Error::Io`].
pub fn write(array: &FloatArray, out: impl Write) -> Result<()> {
    let count = array.shape.iter().try_fold(1u64, |n, &side| n.checked_mul(side));
    if array.shape.is_empty() || count != Some(array.data.len() as u64) {
        let what = format!("an array of shape {:?} with {} values", array.shape, array.data.len());
        return Err(Error::Unsupported(what));
    }
    let sides: Vec<String> = array.shape.iter().map(u64::to_string).collect();
    let comma = if sides.len() == 1 { "," } else { "" };
    let shape = sides.join(", ");
    let mut text = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({shape}{comma}), }}");
    let before = MAGIC.len() + 4;
    let padded = (before + text.len() + 1).next_multiple_of(ALIGNMENT) - before;
    text.extend(std::iter::repeat_n(' ', padded - text.len() - 1));
    text.push('\n');
    let mut w = Writer::new(out);
    w.bytes(&MAGIC)?;
    w.bytes(&[1, 0])?;
    w.bytes(&(text.len() as u16).to_le_bytes())?;
    w.bytes(text.as_bytes())?;
    w.f32s(&array.data)?;
    w.finish()
}

/// The values of an array whose first dimension is fastest, with the last one fastest.
fn transposed(shape: &[u64], data: &[f32]) -> Vec<f32> {
    let side = |i: usize| shape.get(i).map_or(1, |&side| side as usize);
    let (a, b, c) = (side(0), side(1), side(2));
    let mut out = Vec::with_capacity(data.len());
    for i in 0..a {
        for j in 0..b {
            out.extend((0..c).map(|k| data[i + a * (j + b * k)]));
        }
    }
    out
}

/// Why a header is not taken.
enum Fault {
    Broken(&'static str),
    Unsupported(String),
}

/// Parses `{'descr': '<f4', 'fortran_order': False, 'shape': (2, 3), }`; the keys come in any order.
fn parse(text: &str) -> std::result::Result<Header, Fault> {
    let body = text.trim().strip_prefix('{').and_then(|t| t.strip_suffix('}'));
    let mut rest = body.ok_or(Fault::Broken("the header is no dictionary"))?.trim();
    let (mut kind, mut order, mut shape) = (None, None, None);
    while !rest.is_empty() {
        let (key, after) = quoted(rest)?;
        let after = after.trim_start().strip_prefix(':').ok_or(Fault::Broken("a key without value"))?;
        let after = after.trim_start();
        rest = match key {
            "descr" => {
                let (value, after) = quoted(after)
                    .map_err(|_| Fault::Unsupported("an array of records; give plain floats".to_owned()))?;
                kind = Some(value);
                after
            }
            "fortran_order" => {
                let end = after.find([',', '}']).unwrap_or(after.len());
                order = Some(match after[..end].trim() {
                    "True" => true,
                    "False" => false,
                    _ => return Err(Fault::Broken("fortran_order is neither True nor False")),
                });
                &after[end..]
            }
            "shape" => {
                let inner = after.strip_prefix('(').ok_or(Fault::Broken("the shape is no tuple"))?;
                let end = inner.find(')').ok_or(Fault::Broken("the shape has no end"))?;
                shape = Some(sides(&inner[..end])?);
                &inner[end + 1..]
            }
            _ => return Err(Fault::Broken("an unknown key")),
        };
        rest = rest.trim_start();
        rest = rest.strip_prefix(',').unwrap_or(rest).trim_start();
    }
    let (Some(kind), Some(fortran_order), Some(shape)) = (kind, order, shape) else {
        return Err(Fault::Broken("descr, fortran_order or shape is missing"));
    };
    let (width, big_endian) = match kind {
        "<f4" | "=f4" | "f4" => (4, false),
        "<f8" | "=f8" | "f8" => (8, false),
        ">f4" => (4, true),
        ">f8" => (8, true),
        other => {
            let what = format!("values of type {other:?}; use float32 or float64 (array.astype('float32'))");
            return Err(Fault::Unsupported(what));
        }
    };
    Ok(Header { width, big_endian, fortran_order, shape })
}

/// The text between the quotes at the start of `text`, and what follows.
fn quoted(text: &str) -> std::result::Result<(&str, &str), Fault> {
    let quote = text.chars().next().filter(|c| matches!(c, '\'' | '"'));
    let quote = quote.ok_or(Fault::Broken("a key or type is not quoted"))?;
    text[1..].split_once(quote).ok_or(Fault::Broken("a quote is not closed"))
}

fn sides(tuple: &str) -> std::result::Result<Vec<u64>, Fault> {
    let words = tuple.split(',').map(str::trim).filter(|word| !word.is_empty());
    let sides: Vec<u64> = words
        .take(MAX_DIMENSIONS + 1)
        .map(|word| word.parse().map_err(|_| Fault::Broken("the shape holds something that is no length")))
        .collect::<std::result::Result<_, _>>()?;
    match sides.len() {
        0 => Err(Fault::Unsupported("an array without dimensions".to_owned())),
        n if n > MAX_DIMENSIONS => {
            Err(Fault::Unsupported("an array of more than three dimensions".to_owned()))
        }
        _ => Ok(sides),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(header: &str, data: &[u8]) -> Vec<u8> {
        let mut bytes = MAGIC.to_vec();
        bytes.extend([1, 0]);
        bytes.extend((header.len() as u16).to_le_bytes());
        bytes.extend(header.as_bytes());
        bytes.extend(data);
        bytes
    }

    fn read_bytes(bytes: &[u8]) -> Result<FloatArray> {
        read(bytes, Some(bytes.len() as u64), &Limits::default())
    }

    #[test]
    fn what_is_written_is_read() {
        for shape in [vec![6], vec![2, 3], vec![1, 2, 3]] {
            let array = FloatArray { shape, data: vec![0.5, 1.0, f32::MIN, 3.0, 4.0, 1e-40] };
            let mut bytes = Vec::new();
            write(&array, &mut bytes).unwrap();
            assert_eq!((bytes.len() - 24) % 64, 0);
            assert_eq!(read_bytes(&bytes).unwrap(), array);
        }
        assert!(write(&FloatArray { shape: vec![2], data: vec![1.0] }, Vec::new()).is_err());
    }

    #[test]
    fn every_byte_order_width_and_memory_order_is_read() {
        let values = [1.0f64, 2.0, 3.0, 4.0, 5.0, 6.0];
        let bytes = |f: &dyn Fn(f64) -> Vec<u8>| values.iter().flat_map(|&v| f(v)).collect::<Vec<u8>>();
        let cases = [
            ("<f4", bytes(&|v| (v as f32).to_le_bytes().to_vec())),
            (">f4", bytes(&|v| (v as f32).to_be_bytes().to_vec())),
            ("<f8", bytes(&|v| v.to_le_bytes().to_vec())),
            (">f8", bytes(&|v| v.to_be_bytes().to_vec())),
        ];
        for (kind, data) in cases {
            let header = format!("{{\"shape\": (2, 3), 'fortran_order':False , 'descr': '{kind}'}}   \n");
            let array = read_bytes(&file(&header, &data)).unwrap();
            assert_eq!((array.shape, array.data), (vec![2, 3], vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0]), "{kind}");
            let header = header.replace("False", "True");
            assert_eq!(
                read_bytes(&file(&header, &data)).unwrap().data,
                [1.0, 3.0, 5.0, 2.0, 4.0, 6.0],
                "{kind}"
            );
        }
    }

    #[test]
    fn hostile_headers_are_refused_before_anything_is_allocated() {
        let f4 = |shape: &str| format!("{{'descr': '<f4', 'fortran_order': False, 'shape': {shape}}}");
        let cases = [
            f4("(18446744073709551615, 2)"),
            f4("(65535, 65535)"),
            f4("(-1, 2)"),
            f4("(1, 2, 3, 4)"),
            f4("()"),
            f4("(1"),
            f4("1"),
            "{}".into(),
            "".into(),
            "{'descr'}".into(),
            "{'descr': }".into(),
            "{'".into(),
            f4("(2, 1)").replace("<f4", "<i4"),
            f4("(2, 1)").replace("False", "Maybe"),
            f4("(2, 1)").replace("'<f4'", "[('a', '<f4')]"),
            f4("(2, 1)").replace("'descr'", "'x'"),
            f4("(3, 1)"),
            f4("(1, 1)"),
        ];
        for header in cases {
            assert!(read_bytes(&file(&header, &[0; 8])).is_err(), "{header}");
        }
        assert!(read_bytes(&file(&f4("(2, 1)"), &[0; 8])).is_ok());
        let unknown_length = file(&f4("(4000000000, 4)"), &[0; 8]);
        assert!(read(unknown_length.as_slice(), None, &Limits::default()).is_err());
        let mut long = MAGIC.to_vec();
        long.extend([2, 0, 0xff, 0xff, 0xff, 0xff]);
        assert!(read(long.as_slice(), None, &Limits::default()).is_err());
    }

    #[test]
    fn damage_is_an_error_or_an_array() {
        let mut whole = Vec::new();
        write(&FloatArray { shape: vec![2, 2], data: vec![1.0; 4] }, &mut whole).unwrap();
        for length in 0..whole.len() {
            assert!(read_bytes(&whole[..length]).is_err(), "{length} bytes");
        }
        for at in 0..whole.len() {
            for value in [0, b'\'', b'9', b'(', 0xff] {
                let mut damaged = whole.clone();
                damaged[at] = value;
                let _ = read_bytes(&damaged);
            }
        }
    }
}
