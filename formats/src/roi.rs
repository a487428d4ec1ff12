//! Region-of-interest text files (`<name>_roi.txt`): 15 numbers.

use std::io::Write;
use std::path::Path;

use crate::mvs::Obb;
use crate::text::{load, words};
use crate::{Error, Limits, Result};

/// Longest file that is believed to hold 15 numbers.
const LONGEST: u64 = 64 << 10;

/// Reads a region of interest.
///
/// # Errors
/// [`Error::Io`], [`Error::Limits`], and as [`parse`].
pub fn read(path: impl AsRef<Path>, limits: &Limits) -> Result<Obb> {
    parse(&load(path.as_ref(), LONGEST, limits)?)
}

/// Parses a region of interest: rotation row by row, centre, half extents, in lines of any length.
///
/// # Errors
/// [`Error::Format`] if there are not exactly 15 finite numbers, or they are no box: a half extent that is not
/// positive, rows that are not orthonormal.
pub fn parse(text: &[u8]) -> Result<Obb> {
    let mut values = [0.0; 15];
    let mut count = 0;
    for word in words(text, 0) {
        let value: f64 = word.number("roi", "a number")?;
        match values.get_mut(count) {
            Some(slot) if value.is_finite() => *slot = value,
            Some(_) => return Err(word.error("roi", format!("{value} is not a finite number"))),
            None => return Err(word.error("roi", "more than 15 numbers".into())),
        }
        count += 1;
    }
    let fail = |what: String| Error::Format { offset: text.len() as u64, field: "roi".into(), what };
    if count < values.len() {
        return Err(fail(format!("{count} numbers, 15 are needed: rotation, centre, half extents")));
    }
    let [r0, r1, r2, r3, r4, r5, r6, r7, r8, x, y, z, a, b, c] = values;
    let obb =
        Obb { rotation: [r0, r1, r2, r3, r4, r5, r6, r7, r8], center: [x, y, z], half_extent: [a, b, c] };
    if !obb.is_valid() {
        return Err(fail("no box: half extents must be positive, rows of the rotation orthonormal".into()));
    }
    Ok(obb)
}

/// Writes a region of interest: three lines of three numbers, then six of one, each with all its digits.
///
/// # Errors
/// [`Error::Invalid`] if the box is not valid; [`Error::Io`].
pub fn write(mut out: impl Write, obb: &Obb) -> Result<()> {
    if !obb.is_valid() {
        let what = "half extents must be positive, rows of the rotation orthonormal".into();
        return Err(Error::Invalid { field: "roi".into(), what });
    }
    let words = obb.rotation.map(|v| v.to_string());
    let width = words.iter().map(String::len).max().unwrap_or(0);
    let mut text = String::new();
    for row in words.as_chunks::<3>().0 {
        let row = row.each_ref().map(|word| format!("{word:>width$}"));
        text += &(row.join(" ") + "\n");
    }
    for value in obb.center.iter().chain(&obb.half_extent) {
        text += &format!("{value}\n");
    }
    Ok(out.write_all(text.as_bytes())?)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(text: &str) -> String {
        parse(text.as_bytes()).unwrap_err().to_string()
    }

    #[test]
    fn line_structure_does_not_matter() {
        let lines = b"0 0 1\n-1 0 0\n0 -1 0\n10\n0\n-2.5e1\n1 2 3\n";
        let flat = b" 0 0 1 -1\t0 0 0 -1 0 10 0\r\n-25 1 2 3";
        let obb = parse(lines).unwrap();
        assert_eq!(parse(flat).unwrap(), obb);
        assert_eq!(obb.rotation, [0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0, -1.0, 0.0]);
        assert_eq!((obb.center, obb.half_extent), ([10.0, 0.0, -25.0], [1.0, 2.0, 3.0]));
    }

    #[test]
    fn every_digit_survives() {
        let (s, c) = 0.3f64.sin_cos();
        let obb = Obb {
            rotation: [c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0],
            center: [1.0 / 3.0, -1e6 / 7.0, 1e-9],
            half_extent: [0.1, 2.0, 1e12],
        };
        let mut text = Vec::new();
        write(&mut text, &obb).unwrap();
        assert_eq!(parse(&text).unwrap(), obb);
        assert_eq!(text.iter().filter(|&&b| b == b'\n').count(), 9);
    }

    #[test]
    fn what_is_no_box_is_refused() {
        let (rotation, rest) = ("1 0 0 0 1 0 0 0 1", "0 0 0 1 1 1");
        assert!(message("").contains("0 numbers"));
        assert!(message(rotation).contains("9 numbers"));
        assert!(message(&format!("{rotation} {rest} 1")).contains("more than 15"));
        assert!(
            message(&format!("{rotation} 0 0 0 1 x 1")).contains("\"x\" is not a number in roi at byte 26")
        );
        assert!(message(&format!("{rotation} 0 0 0 1 nan 1")).contains("not a finite"));
        assert!(message(&format!("{rotation} 0 0 0 1 0 1")).contains("no box"));
        assert!(message(&format!("1 0 0 0 1 0 0 1 1 {rest}")).contains("no box"));
        let obb = Obb { half_extent: [0.0; 3], ..parse(format!("{rotation} {rest}").as_bytes()).unwrap() };
        assert!(write(Vec::new(), &obb).is_err());
    }

    #[test]
    fn long_files_are_not_read() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("scene_roi.txt");
        std::fs::write(&path, vec![b' '; 1 << 20]).unwrap();
        assert!(matches!(read(&path, &Limits::default()), Err(Error::Limits { .. })));
        std::fs::write(&path, "1 0 0 0 1 0 0 0 1 0 0 0 1 1 1").unwrap();
        assert_eq!(read(&path, &Limits::default()).unwrap().half_extent, [1.0; 3]);
    }
}
