//! View-neighbour text files: which images an image is to be matched with.

use std::collections::HashSet;
use std::io::Write;
use std::path::Path;

use crate::text::{load, words};
use crate::{Limits, Result};

/// What a view-neighbour file says.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct NeighborsFile {
    /// The lists in file order; an image that is named again counts as it was named last.
    pub lists: Vec<NeighborList>,
    /// Images that stand alone in their line; their neighbours do not change.
    pub alone: Vec<u32>,
}

/// The neighbours of an image, local indices throughout.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct NeighborList {
    /// The image.
    pub image: u32,
    /// Its neighbours in decreasing quality, without the image itself and without repetitions.
    pub neighbors: Vec<u32>,
}

/// Longest line, per image of the scene, that is believed.
const BYTES_PER_ENTRY: u64 = 12;

/// Reads the view-neighbour file of a scene with `images` images.
///
/// # Errors
/// [`crate::Error::Io`], [`crate::Error::Limits`], and as [`parse`].
pub fn read(path: impl AsRef<Path>, images: usize, limits: &Limits) -> Result<NeighborsFile> {
    // Every image with every other one, and room for comments.
    let entries = (images as u64).saturating_mul(images as u64);
    let most = entries.saturating_mul(BYTES_PER_ENTRY).saturating_add(1 << 20);
    parse(&load(path.as_ref(), most, limits)?, images)
}

/// Parses a view-neighbour file: `<image> <neighbour> <neighbour> ...` per line; empty lines and lines that start with
/// `#` are skipped. The image itself and repetitions among its neighbours are dropped.
///
/// # Errors
/// [`crate::Error::Format`] for a word that is not an index of the scene, with the line.
pub fn parse(text: &[u8], images: usize) -> Result<NeighborsFile> {
    let mut file = NeighborsFile::default();
    let mut offset = 0;
    for (number, line) in text.split_inclusive(|&b| b == b'\n').enumerate() {
        if !line.trim_ascii_start().starts_with(b"#") {
            parse_line(line, offset, &format!("line {}", number + 1), images, &mut file)?;
        }
        offset += line.len() as u64;
        if file.lists.len() / 2 > images {
            keep_last(&mut file.lists);
        }
    }
    keep_last(&mut file.lists);
    Ok(file)
}

/// Of several lists of an image keeps the last.
fn keep_last(lists: &mut Vec<NeighborList>) {
    let mut seen = HashSet::new();
    lists.reverse();
    lists.retain(|list| seen.insert(list.image));
    lists.reverse();
}

fn parse_line(line: &[u8], offset: u64, place: &str, images: usize, file: &mut NeighborsFile) -> Result<()> {
    let (mut named, mut words_seen) = (None, 0);
    let (mut seen, mut neighbors) = (HashSet::new(), Vec::new());
    for word in words(line, offset) {
        let index: u32 = word.number(place, "the index of an image")?;
        if index as usize >= images {
            return Err(
                word.error(place, format!("index {index} is out of range, there are {images} images"))
            );
        }
        words_seen += 1;
        if seen.insert(index) && *named.get_or_insert(index) != index {
            neighbors.push(index);
        }
    }
    match named {
        None => {}
        Some(image) if words_seen == 1 => file.alone.push(image),
        Some(image) => file.lists.push(NeighborList { image, neighbors }),
    }
    Ok(())
}

/// Writes a view-neighbour file: a line per image, in order; an image without neighbours stands alone.
///
/// # Errors
/// [`crate::Error::Io`].
pub fn write<'a>(mut out: impl Write, neighbors: impl IntoIterator<Item = &'a [u32]>) -> Result<()> {
    for (image, list) in neighbors.into_iter().enumerate() {
        let line = list.iter().fold(image.to_string(), |line, index| format!("{line} {index}"));
        out.write_all(line.as_bytes())?;
        out.write_all(b"\n")?;
    }
    Ok(out.flush()?)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lists(text: &str) -> Vec<(u32, Vec<u32>)> {
        let file = parse(text.as_bytes(), 10).unwrap();
        file.lists.into_iter().map(|l| (l.image, l.neighbors)).collect()
    }

    #[test]
    fn neighbours_are_kept_in_order_without_repetitions() {
        assert_eq!(lists("# comment\n0 1 2\n2 0 1 1\n\n"), [(0, vec![1, 2]), (2, vec![0, 1])]);
        assert_eq!(lists("3 3 9\t8 9 3 7\r\n  # note\r\n1 2"), [(3, vec![9, 8, 7]), (1, vec![2])]);
        assert_eq!(lists("0 1\n1 0\n0 2\n"), [(1, vec![0]), (0, vec![2])]);
        assert_eq!(lists(""), []);
    }

    #[test]
    fn lone_images_are_reported() {
        let file = parse(b"4\n0 1\n", 5).unwrap();
        assert_eq!((file.alone, file.lists.len()), (vec![4], 1));
    }

    #[test]
    fn bad_indices_are_named_with_their_line() {
        let message = |text: &str| parse(text.as_bytes(), 10).unwrap_err().to_string();
        assert_eq!(message("0 1\n0 10"), "index 10 is out of range, there are 10 images in line 2 at byte 6");
        assert!(message("#\n\n0 x").contains("\"x\" is not the index of an image in line 3"));
        assert!(message("0 -1").contains("-1"));
        assert!(message("0 99999999999").contains("99999999999"));
        assert!(message("0 \u{ff}").contains("line 1"));
    }

    #[test]
    fn what_is_written_is_read() {
        let neighbors: [&[u32]; 4] = [&[1, 2], &[0], &[], &[2, 1, 0]];
        let mut text = Vec::new();
        write(&mut text, neighbors).unwrap();
        assert_eq!(text, b"0 1 2\n1 0\n2\n3 2 1 0\n");
        let file = parse(&text, 4).unwrap();
        assert_eq!(file.alone, [2]);
        assert_eq!(file.lists.iter().map(|l| l.image).collect::<Vec<_>>(), [0, 1, 3]);
    }
}
