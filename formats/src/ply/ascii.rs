//! Decimal text to and from the packed values of the binary encodings.

use super::header::{Element, PropertyType, ScalarType, broken};
use super::record::encode;
use crate::Result;

/// Appends the record of a text line to `out` as `binary_little_endian` stores it. `offset` is the line's place in the
/// file. Values after the last property are ignored.
pub(super) fn pack_line(line: &[u8], element: &Element, offset: u64, out: &mut Vec<u8>) -> Result<()> {
    let field = |name: &str| format!("{}.{name}", element.name);
    let text =
        std::str::from_utf8(line).map_err(|_| broken(offset, &element.name, "the line is not text"))?;
    let mut words = text.split_ascii_whitespace();
    let mut next = |kind: ScalarType, name: &str, out: &mut Vec<u8>| -> Result<f64> {
        let Some(word) = words.next() else {
            return Err(broken(offset, field(name), "the line ends before this value"));
        };
        // straight to f32 where that is the type: the way over f64 would round twice
        let value = match kind {
            ScalarType::F32 => word.parse::<f32>().ok().map(f64::from),
            _ => word.parse::<f64>().ok(),
        };
        match value.filter(|&v| encode(v, kind, out)) {
            Some(value) => Ok(value),
            None => {
                let word: String = word.chars().take(40).flat_map(char::escape_debug).collect();
                Err(broken(offset, field(name), format!("\"{word}\" is not a {kind:?} value")))
            }
        }
    };
    for property in &element.properties {
        match property.kind {
            PropertyType::Scalar(kind) => {
                next(kind, &property.name, out)?;
            }
            PropertyType::List { count, item } => {
                // a negative count is refused when the packed record is walked
                let count = next(count, &property.name, out)?.max(0.0) as u64;
                for _ in 0..count {
                    next(item, &property.name, out)?;
                }
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ply::header::Property;

    #[test]
    fn values_that_the_declared_type_cannot_hold_are_refused() {
        let property = Property { name: "p".into(), kind: PropertyType::Scalar(ScalarType::U8) };
        let element = Element { name: "vertex".into(), count: 1, properties: vec![property] };
        let pack = |line: &[u8]| {
            let mut out = Vec::new();
            pack_line(line, &element, 0, &mut out).map(|()| out)
        };
        assert_eq!(pack(b" 255.0\t7").unwrap(), [255]);
        for bad in [&b"256"[..], b"-1", b"0.5", b"x", b"nan", b"", b"\xff"] {
            assert!(pack(bad).is_err(), "{bad:?}");
        }
    }
}
