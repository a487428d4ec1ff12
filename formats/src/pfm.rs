//! Portable float maps (`.pfm`): one or three 32-bit floats per pixel.

use crate::wire::{Place, Reader, Writer};
use crate::{Error, Limits, Result};
use std::io::{Read, Write};

/// Longest word of a header, in bytes.
const MAX_WORD: usize = 32;

/// A raster of floats.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FloatMap {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// 1 (`Pf`) or 3 (`PF`) values per pixel.
    pub channels: u32,
    /// Row-major, top row first (files have the bottom row first), the values of a pixel together.
    pub data: Vec<f32>,
}

/// Reads a map of either byte order; the scale's magnitude is ignored, as everybody does. `length` is the number of
/// bytes in `source`, if known.
///
/// # Errors
/// [`Error::Format`] for a broken header or a file that is shorter or longer than its header says;
/// [`Error::Limits`]; [`Error::Io`].
pub fn read(source: impl Read, length: Option<u64>, limits: &Limits) -> Result<FloatMap> {
    let mut r = Reader::new(source, length, limits);
    let at = Place::Root("header");
    let channels: u32 = match word(&mut r)?.as_str() {
        "Pf" => 1,
        "PF" => 3,
        other => return Err(r.error(&at, format!("\"{other}\" is neither Pf nor PF: not a PFM file"))),
    };
    let mut sizes = [0u32; 2];
    for size in &mut sizes {
        let text = word(&mut r)?;
        *size = match text.parse() {
            Ok(side) if side > 0 => side,
            _ => return Err(r.error(&at, format!("\"{text}\" is not a width or height"))),
        };
    }
    let [width, height] = sizes;
    let text = word(&mut r)?;
    let scale = match text.parse::<f64>() {
        Ok(scale) if scale.is_finite() && scale != 0.0 => scale,
        _ => return Err(r.error(&at, format!("\"{text}\" is not a scale: negative = little-endian"))),
    };
    let root = Place::Root("pixels");
    let row = u64::from(width) * u64::from(channels);
    let Some(count) = row.checked_mul(height.into()) else {
        return Err(r.error(&root, format!("{width} x {height} x {channels} values")));
    };
    let little = scale < 0.0;
    let decode = |b: &[u8; 4]| if little { f32::from_le_bytes(*b) } else { f32::from_be_bytes(*b) };
    let mut data = r.vec(count, &root, decode)?;
    if !r.at_end()? {
        return Err(r.error(&root, format!("bytes follow the {width} x {height} x {channels} values")));
    }
    flip(&mut data, row as usize);
    Ok(FloatMap { width, height, channels, data })
}

/// Writes a map, little-endian.
///
/// # Errors
/// [`Error::Unsupported`] if the sizes do not fit the data or there are neither 1 nor 3 channels; [`Error::Io`].
pub fn write(map: &FloatMap, out: impl Write) -> Result<()> {
    let kind = match map.channels {
        1 => "Pf",
        3 => "PF",
        other => return Err(Error::Unsupported(format!("a PFM file of {other} channels"))),
    };
    let row = u64::from(map.width) * u64::from(map.channels);
    if row == 0 || row.checked_mul(map.height.into()) != Some(map.data.len() as u64) || map.data.is_empty() {
        let what = format!("a {} x {} PFM file of {} values", map.width, map.height, map.data.len());
        return Err(Error::Unsupported(what));
    }
    let mut w = Writer::new(out);
    w.bytes(format!("{kind}\n{} {}\n-1.0\n", map.width, map.height).as_bytes())?;
    map.data.chunks_exact(row as usize).rev().try_for_each(|row| w.f32s(row))?;
    w.finish()
}

/// Turns the order of rows of `row` values around.
fn flip(data: &mut [f32], row: usize) {
    let rows = data.len() / row.max(1);
    for upper in 0..rows / 2 {
        let (top, bottom) = data.split_at_mut((rows - 1 - upper) * row);
        top[upper * row..(upper + 1) * row].swap_with_slice(&mut bottom[..row]);
    }
}

/// The next word and the one white space after it.
fn word<R: Read>(r: &mut Reader<R>) -> Result<String> {
    let at = Place::Root("header");
    let mut word = String::new();
    loop {
        let byte = r.u8(&at)?;
        match byte {
            b' ' | b'\t' | b'\n' | b'\r' if word.is_empty() => {}
            b' ' | b'\t' | b'\n' | b'\r' => return Ok(word),
            0x21..=0x7e if word.len() < MAX_WORD => word.push(char::from(byte)),
            _ => return Err(r.error(&at, "not the text of a PFM header")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map(channels: u32) -> FloatMap {
        let data = (0..3 * 2 * channels).map(|v| v as f32 + 0.5).collect();
        FloatMap { width: 3, height: 2, channels, data }
    }

    fn read_bytes(bytes: &[u8]) -> Result<FloatMap> {
        read(bytes, Some(bytes.len() as u64), &Limits::default())
    }

    #[test]
    fn what_is_written_is_read_and_the_bottom_row_comes_first() {
        for channels in [1, 3] {
            let mut bytes = Vec::new();
            write(&map(channels), &mut bytes).unwrap();
            assert_eq!(read_bytes(&bytes).unwrap(), map(channels));
        }
        let mut bytes = Vec::new();
        write(&map(1), &mut bytes).unwrap();
        assert_eq!(&bytes[..12], b"Pf\n3 2\n-1.0\n");
        assert_eq!(bytes[12..16], 3.5f32.to_le_bytes());
    }

    #[test]
    fn big_endian_files_are_read() {
        let mut bytes = b"Pf 1\t2\r1e0\n".to_vec();
        bytes.extend(2.0f32.to_be_bytes());
        bytes.extend(1.0f32.to_be_bytes());
        assert_eq!(read_bytes(&bytes).unwrap().data, [1.0, 2.0]);
    }

    #[test]
    fn hostile_headers_are_refused_before_anything_is_allocated() {
        let cases = [
            "",
            "Pf",
            "P6\n1 1\n-1\n",
            "Pf\n0 1\n-1\n",
            "Pf\n-1 1\n-1\n",
            "Pf\n1 1\n0\n",
            "Pf\n1 1\nnan\n",
            "Pf\n4294967295 4294967295\n-1\n",
            "PF\n65535 65535\n-1.0\nabcd",
            "Pf\n1 1\n-1.0\n12345",
            "Pf\n99999999999 1\n-1.0\n",
            "Pf\n11111111111111111111111111111111111111 1\n-1.0\n",
            "Pf\n\u{e9} 1\n-1\n",
        ];
        for text in cases {
            assert!(read_bytes(text.as_bytes()).is_err(), "{text:?}");
        }
        let small = Limits { max_bytes: 3, ..Limits::default() };
        let bytes = b"Pf\n1 1\n-1.0\nabcd";
        assert!(matches!(read(&bytes[..], Some(16), &small), Err(Error::Limits { .. })));
        assert!(read(&b"PF\n65535 65535\n-1.0\nabcd"[..], None, &Limits::default()).is_err());
    }

    #[test]
    fn damage_is_an_error_or_a_map() {
        let mut whole = Vec::new();
        write(&map(1), &mut whole).unwrap();
        for length in 0..whole.len() {
            assert!(read_bytes(&whole[..length]).is_err(), "{length} bytes");
        }
        for at in 0..whole.len() {
            for value in [0, b' ', b'9', 0xff] {
                let mut damaged = whole.clone();
                damaged[at] = value;
                let _ = read_bytes(&damaged);
            }
        }
    }

    #[test]
    fn maps_that_do_not_fit_are_not_written() {
        for bad in [FloatMap { width: 4, ..map(1) }, FloatMap { channels: 2, ..map(1) }, FloatMap::default()]
        {
            assert!(matches!(write(&bad, Vec::new()), Err(Error::Unsupported(_))));
        }
    }
}
