//! The frame of a JPEG file: its size without decoding, and whether it is all there.

use std::io::{self, Read, Seek, SeekFrom};

const START_OF_IMAGE: [u8; 2] = [0xFF, 0xD8];
const END_OF_IMAGE: u8 = 0xD9;
const START_OF_SCAN: u8 = 0xDA;

/// Width and height in the first frame header; `None` if this is no JPEG or it has none.
pub(super) fn dimensions(reader: &mut (impl Read + Seek)) -> io::Result<Option<(u32, u32)>> {
    let mut bytes = [0; 2];
    reader.read_exact(&mut bytes)?;
    if bytes != START_OF_IMAGE {
        return Ok(None);
    }
    loop {
        let marker = next_marker(reader)?;
        if is_bare(marker) {
            continue;
        }
        if marker == END_OF_IMAGE || marker == START_OF_SCAN {
            return Ok(None);
        }
        reader.read_exact(&mut bytes)?;
        let length = u16::from_be_bytes(bytes);
        if is_frame_header(marker) {
            let mut frame = [0; 5];
            reader.read_exact(&mut frame)?;
            let side = |i: usize| u32::from(u16::from_be_bytes([frame[i], frame[i + 1]]));
            return Ok(Some((side(3), side(1))));
        }
        reader.seek(SeekFrom::Current(i64::from(length.saturating_sub(2))))?;
    }
}

/// Whether `file` reaches its end-of-image marker; decoders fill what is missing with grey and say nothing.
pub(super) fn is_complete(file: &[u8]) -> bool {
    let mut at = START_OF_IMAGE.len();
    // Header segments are skipped by their length, the coded data between them byte by byte: there 0xFF is followed
    // by 0 or a restart marker.
    while let Some(found) = file.get(at..).and_then(|rest| rest.iter().position(|&b| b == 0xFF)) {
        at += found + 1;
        let Some(&marker) = file.get(at) else { return false };
        if marker == END_OF_IMAGE {
            return true;
        }
        if marker == 0xFF || marker == 0 || is_bare(marker) {
            at += usize::from(marker != 0xFF);
            continue;
        }
        let Some(&[high, low]) = file.get(at + 1..at + 3) else { return false };
        at += 1 + usize::from(u16::from_be_bytes([high, low]));
    }
    false
}

/// The next marker code; bytes before its 0xFF are skipped.
fn next_marker(reader: &mut impl Read) -> io::Result<u8> {
    let mut byte = [0];
    loop {
        while byte[0] != 0xFF {
            reader.read_exact(&mut byte)?;
        }
        while byte[0] == 0xFF {
            reader.read_exact(&mut byte)?;
        }
        if byte[0] != 0 {
            return Ok(byte[0]);
        }
    }
}

/// Markers without a segment: restarts, start of image, TEM.
fn is_bare(marker: u8) -> bool {
    matches!(marker, 0x01 | 0xD0..=0xD8)
}

/// SOF0..SOF15 without DHT, JPG and DAC.
fn is_frame_header(marker: u8) -> bool {
    matches!(marker, 0xC0..=0xCF) && !matches!(marker, 0xC4 | 0xC8 | 0xCC)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Cursor;

    fn photograph() -> Vec<u8> {
        std::fs::read(concat!(env!("CARGO_MANIFEST_DIR"), "/compat-fixtures/facade6/images/0003.jpg"))
            .unwrap()
    }

    #[test]
    fn finds_the_frame() {
        assert_eq!(dimensions(&mut Cursor::new(photograph())).unwrap(), Some((400, 300)));
        assert_eq!(dimensions(&mut Cursor::new(b"\x89PNG\r\n")).unwrap(), None);
        assert!(dimensions(&mut Cursor::new(&photograph()[..20])).is_err());
    }

    #[test]
    fn only_whole_files_are_complete() {
        let file = photograph();
        assert!(is_complete(&file));
        let end = file.iter().rposition(|&b| b == END_OF_IMAGE).unwrap();
        for length in [2, 3, 100, end / 2, end - 1, end] {
            assert!(!is_complete(&file[..length]), "{length} bytes");
        }
        let mut trailing = file;
        trailing.extend_from_slice(b"appended by a camera");
        assert!(is_complete(&trailing));
    }
}
