//! The text archive: tokens between white space.

use std::io::{Read, Write};
use std::str::FromStr;

use super::{Classes, Sink, Source};
use crate::wire::{Place, Reader, Writer};
use crate::{Error, Result};

/// Longest token that is believed to be a number.
const LONGEST_TOKEN: usize = 400;

/// Reads a text archive.
pub(in crate::mvs) struct TextSource<'a, R> {
    reader: &'a mut Reader<R>,
    classes: Classes,
}

impl<'a, R: Read> TextSource<'a, R> {
    pub(in crate::mvs) fn new(reader: &'a mut Reader<R>) -> Self {
        TextSource { reader, classes: Classes::default() }
    }

    /// Skips white space, then takes the next token and parses it.
    fn token<T>(&mut self, place: &Place<'_>, parse: impl FnOnce(&[u8]) -> Option<T>) -> Result<T> {
        loop {
            let bytes = self.reader.buffered(LONGEST_TOKEN)?;
            let start = bytes.iter().take_while(|&&b| is_blank(b)).count();
            if start > 0 && bytes.len() - start < LONGEST_TOKEN {
                self.reader.advance(start);
                continue;
            }
            let token = &bytes[start..];
            let length = token.iter().take(LONGEST_TOKEN).take_while(|&&b| !is_blank(b)).count();
            if length == 0 {
                return Err(self.reader.error(place, "file ends: a number was expected"));
            }
            return match parse(&token[..length]) {
                Some(value) => {
                    self.reader.advance(start + length);
                    Ok(value)
                }
                None => {
                    let shown = String::from_utf8_lossy(&token[..length.min(24)]).into_owned();
                    Err(self.reader.error(place, format!("{shown:?} is not a number that can stand here")))
                }
            };
        }
    }

    fn many<T>(
        &mut self,
        out: &mut Vec<T>,
        count: u64,
        place: &Place<'_>,
        mut next: impl FnMut(&mut Self) -> Result<T>,
    ) -> Result<()> {
        for _ in 0..self.room(out, count, 1, place)? {
            let value = next(self)?;
            self.push(out, value, place)?;
        }
        Ok(())
    }
}

/// Space, tab, line feed, vertical tab, form feed, carriage return.
#[inline]
fn is_blank(byte: u8) -> bool {
    byte == b' ' || byte.wrapping_sub(b'\t') < 5
}

/// A decimal natural number.
#[inline]
fn natural(token: &[u8]) -> Option<u64> {
    if token.is_empty() {
        return None;
    }
    token.iter().try_fold(0u64, |value, &digit| {
        let digit = digit.wrapping_sub(b'0');
        if digit > 9 { None } else { value.checked_mul(10)?.checked_add(digit.into()) }
    })
}

/// A decimal number in any notation.
fn decimal<T: FromStr>(token: &[u8]) -> Option<T> {
    std::str::from_utf8(token).ok()?.parse().ok()
}

/// A float in the notation that archives use, if it can be had exactly rounded without a general parser: up to 15
/// digits and a small exponent make an exact product in `f64` (Clinger 1990), which is rounded once more unless it
/// lies next to the middle between two floats.
#[inline]
fn short_float(token: &[u8]) -> Option<f32> {
    const POWERS: [f64; 16] =
        [1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15];
    let (negative, token) = match token {
        [b'-', rest @ ..] => (true, rest),
        rest => (false, rest),
    };
    let (&first, rest) = token.split_first()?;
    let (b'0'..=b'9', Some((b'.', rest))) = (first, rest.split_first()) else { return None };
    let digits = rest.iter().take_while(|b| b.is_ascii_digit()).count();
    let (fraction, exponent) = rest.split_at(digits);
    let [b'e', sign @ (b'+' | b'-'), tens @ b'0'..=b'9', ones @ b'0'..=b'9'] = exponent else { return None };
    if digits > 14 {
        return None;
    }
    let mantissa = fraction.iter().fold(u64::from(first - b'0'), |m, d| 10 * m + u64::from(d - b'0'));
    let exponent = i32::from(10 * (tens - b'0') + ones - b'0') * if *sign == b'-' { -1 } else { 1 };
    let scale = exponent - digits as i32;
    let power = POWERS.get(scale.unsigned_abs() as usize)?;
    let value = if scale < 0 { mantissa as f64 / power } else { mantissa as f64 * power };
    let below = value.to_bits() & 0x1fff_ffff; // what `f32` has no room for
    if (0x0fff_ffff..=0x1000_0001).contains(&below) {
        return None;
    }
    Some(if negative { -value } else { value } as f32)
}

impl<R: Read> Source for TextSource<'_, R> {
    fn classes(&mut self) -> &mut Classes {
        &mut self.classes
    }

    fn u8(&mut self, place: &Place<'_>) -> Result<u8> {
        self.token(place, |t| natural(t)?.try_into().ok())
    }

    fn u32(&mut self, place: &Place<'_>) -> Result<u32> {
        self.token(place, |t| natural(t)?.try_into().ok())
    }

    fn u64(&mut self, place: &Place<'_>) -> Result<u64> {
        self.token(place, natural)
    }

    fn f32(&mut self, place: &Place<'_>) -> Result<f32> {
        self.token(place, |t| short_float(t).or_else(|| decimal(t)))
    }

    fn f64(&mut self, place: &Place<'_>) -> Result<f64> {
        self.token(place, decimal)
    }

    fn string(&mut self, place: &Place<'_>) -> Result<Vec<u8>> {
        let length = self.u64(place)?;
        self.reader.u8(place)?;
        self.reader.text(length, place)
    }

    fn room<T>(&mut self, out: &mut Vec<T>, count: u64, _: u64, place: &Place<'_>) -> Result<usize> {
        // Every element is at least a digit and a separator; the last separator may be missing.
        let count = self.reader.check_count(count, 1, place)?;
        self.reader.room(out, count, place)?;
        Ok(count)
    }

    fn push<T>(&mut self, out: &mut Vec<T>, element: T, place: &Place<'_>) -> Result<()> {
        self.reader.push(out, element, place)
    }

    fn u8s(&mut self, out: &mut Vec<u8>, count: u64, place: &Place<'_>) -> Result<()> {
        self.many(out, count, place, |s| s.u8(place))
    }

    fn u32s(&mut self, out: &mut Vec<u32>, count: u64, place: &Place<'_>) -> Result<()> {
        self.many(out, count, place, |s| s.u32(place))
    }

    fn f32s(&mut self, out: &mut Vec<f32>, count: u64, place: &Place<'_>) -> Result<()> {
        self.many(out, count, place, |s| s.f32(place))
    }

    fn vectors(&mut self, out: &mut Vec<[f32; 3]>, count: u64, place: &Place<'_>) -> Result<()> {
        self.many(out, count, place, |s| s.f32_array(place))
    }

    fn triples(&mut self, out: &mut Vec<[u32; 3]>, count: u64, place: &Place<'_>) -> Result<()> {
        self.many(out, count, place, |s| Ok([s.u32(place)?, s.u32(place)?, s.u32(place)?]))
    }

    fn colors(&mut self, out: &mut Vec<[u8; 3]>, count: u64, place: &Place<'_>) -> Result<()> {
        self.many(out, count, place, |s| {
            s.constant(3, place)?;
            let [b, g, r] = [s.u8(place)?, s.u8(place)?, s.u8(place)?];
            Ok([r, g, b])
        })
    }

    fn error(&self, place: &Place<'_>, what: String) -> Error {
        self.reader.error(place, what)
    }
}

/// Writes a text archive: one line, tokens separated by one space.
pub(in crate::mvs) struct TextSink<W: Write> {
    writer: Writer<W>,
    classes: Classes,
    token: Vec<u8>,
}

impl<W: Write> TextSink<W> {
    pub(in crate::mvs) fn new(out: W) -> Self {
        TextSink { writer: Writer::new(out), classes: Classes::default(), token: Vec::new() }
    }

    pub(in crate::mvs) fn finish(mut self) -> Result<()> {
        self.writer.bytes(b"\n")?;
        self.writer.finish()
    }

    /// A token and the separator before it, unless it is the first one.
    fn put(&mut self, print: impl FnOnce(&mut Vec<u8>) -> std::io::Result<()>) -> Result<()> {
        let first = self.token.is_empty();
        self.token.clear();
        self.token.push(b' ');
        print(&mut self.token)?;
        self.writer.bytes(&self.token[usize::from(first)..])
    }

    /// A number in C's scientific notation, which has at least two digits in the exponent.
    fn float(&mut self, value: f64, digits: usize) -> Result<()> {
        if !value.is_finite() {
            let what = format!("{value} cannot be stored in a text archive");
            return Err(Error::Invalid { field: "text archive".into(), what });
        }
        self.put(|token| {
            write!(token, "{value:.digits$e}")?;
            let e = token.iter().rposition(|&b| b == b'e').unwrap_or(0) + 1;
            match token.get(e) {
                Some(b'-') => {}
                _ => token.insert(e, b'+'),
            }
            if token.len() == e + 2 {
                token.insert(e + 1, b'0');
            }
            Ok(())
        })
    }
}

impl<W: Write> Sink for TextSink<W> {
    fn classes(&mut self) -> &mut Classes {
        &mut self.classes
    }

    fn u8(&mut self, value: u8) -> Result<()> {
        self.u64(value.into())
    }

    fn u32(&mut self, value: u32) -> Result<()> {
        self.u64(value.into())
    }

    fn u64(&mut self, value: u64) -> Result<()> {
        self.put(|token| write!(token, "{value}"))
    }

    fn f32(&mut self, value: f32) -> Result<()> {
        self.float(value.into(), 9)
    }

    fn f64(&mut self, value: f64) -> Result<()> {
        self.float(value, 17)
    }

    fn string(&mut self, value: &[u8]) -> Result<()> {
        self.u64(value.len() as u64)?;
        self.writer.bytes(b" ")?;
        self.writer.bytes(value)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Limits;

    #[test]
    fn numbers_look_as_c_prints_them() {
        let mut out = Vec::new();
        let mut sink = TextSink::new(&mut out);
        for value in [1.0, -0.1, 1e-10, 1.5e10, 1e100, 0.0] {
            sink.f64(value).unwrap();
        }
        sink.f32(0.1).unwrap();
        sink.finish().unwrap();
        let expected = "1.00000000000000000e+00 -1.00000000000000006e-01 1.00000000000000004e-10 \
                        1.50000000000000000e+10 1.00000000000000002e+100 0.00000000000000000e+00 1.000000015e-01\n";
        assert_eq!(String::from_utf8(out).unwrap(), expected);
        assert!(TextSink::new(Vec::new()).f32(f32::NAN).is_err());
    }

    #[test]
    fn any_white_space_and_any_notation_is_read() {
        let text = b"\n\t 12\r\n  1.5  -2e3 3  a b 7 0  \x0c9";
        let mut reader = Reader::from_bytes(text, &Limits::default());
        let source = &mut TextSource::new(&mut reader);
        let place = Place::Root("x");
        assert_eq!(source.u32(&place).unwrap(), 12);
        assert_eq!(source.f32(&place).unwrap(), 1.5);
        assert_eq!(source.f64(&place).unwrap(), -2000.0);
        assert_eq!(source.string(&place).unwrap(), b" a ");
        assert!(source.u8(&place).unwrap_err().to_string().contains("\"b\""));
    }

    #[test]
    fn the_short_way_to_floats_rounds_as_the_long_one() {
        let mut state = 1u64;
        let mut short = 0;
        for _ in 0..200_000 {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            let value = f32::from_bits((state >> 32) as u32 & 0x8fff_ffff | 0x3800_0000);
            for text in [format!("{value:.9e}"), format!("{value:.7e}"), format!("{value:.13e}")] {
                let (mantissa, exponent) = text.split_once('e').unwrap();
                let exponent: i32 = exponent.parse().unwrap();
                let text =
                    format!("{mantissa}e{}{:02}", if exponent < 0 { '-' } else { '+' }, exponent.abs());
                if let Some(found) = short_float(text.as_bytes()) {
                    assert_eq!(found.to_bits(), text.parse::<f32>().unwrap().to_bits(), "{text}");
                    short += 1;
                }
            }
        }
        assert!(short > 300_000, "the short way was hardly ever taken: {short}");
        // Exactly between two floats: 1 + 2⁻²⁴.
        assert_eq!(short_float(b"1.0000000596046448e+00"), None);
        for odd in [&b"1"[..], b"", b".5e+00", b"1.5", b"1.5e5", b"1.5e+005", b"+1.5e+00", b"1.x5e+00"] {
            assert_eq!(short_float(odd), None);
        }
        assert_eq!(short_float(b"-0.000000000e+00").map(f32::to_bits), Some((-0.0f32).to_bits()));
    }

    #[test]
    fn numbers_that_do_not_fit_are_refused() {
        let read = |text: &[u8]| {
            let mut reader = Reader::from_bytes(text, &Limits::default());
            TextSource::new(&mut reader).u8(&Place::Root("x"))
        };
        assert_eq!(read(b"255").unwrap(), 255);
        for bad in [&b"256"[..], b"-1", b"1.0", b"", b"  ", b"99999999999999999999999", b"0x1", &[b'1'; 1000]]
        {
            assert!(read(bad).is_err(), "{bad:?}");
        }
    }
}
