//! Pictures with every kind of damage: a value or an error of one line, never a panic, never much memory.
//!
//! `SEMVS_FUZZ_RUNS` says how many pictures of each kind are tried.

use super::images::{image_size, load_color};
use super::label_png::{LabelReader, UnknownLabel};
use crate::error::Result;
use crate::semantics::ClassTable;
use image::{DynamicImage, ImageFormat};
use semvs_formats::Limits;
use std::io::Cursor;
use std::path::Path;

/// How many pictures of each kind are tried by default.
const RUNS: u64 = 4000;

/// Xorshift numbers (Marsaglia 2003).
struct Rng(u64);

impl Rng {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }
    fn below(&mut self, bound: usize) -> usize {
        (self.next() % bound.max(1) as u64) as usize
    }
}

fn picture(deep: bool) -> DynamicImage {
    let rgb =
        image::RgbImage::from_fn(23, 17, |x, y| image::Rgb([(x * 11) as u8, (y * 13) as u8, (x * y) as u8]));
    let rgb = DynamicImage::from(rgb);
    if deep { rgb.into_rgb16().into() } else { rgb }
}

fn encoded(image: &DynamicImage, format: ImageFormat) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    image.write_to(&mut bytes, format).unwrap();
    bytes.into_inner()
}

/// Label maps of all kinds of pixels.
fn label_maps() -> Vec<Vec<u8>> {
    let png = |color, depth, palette: Option<&[u8]>, data: &[u8]| {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, 8, 4);
        encoder.set_color(color);
        encoder.set_depth(depth);
        palette.into_iter().for_each(|palette| encoder.set_palette(palette.to_vec()));
        encoder.write_header().unwrap().write_image_data(data).unwrap();
        bytes
    };
    use png::{BitDepth, ColorType};
    vec![
        png(ColorType::Grayscale, BitDepth::Eight, None, &[3; 32]),
        png(ColorType::Grayscale, BitDepth::Sixteen, None, &[1; 64]),
        png(ColorType::Grayscale, BitDepth::One, None, &[0xA5; 4]),
        png(ColorType::GrayscaleAlpha, BitDepth::Eight, None, &[2; 64]),
        png(ColorType::Rgb, BitDepth::Eight, None, &[0; 96]),
        png(ColorType::Rgba, BitDepth::Eight, None, &[0; 128]),
        png(ColorType::Indexed, BitDepth::Eight, Some(&[0, 0, 0, 128, 0, 0]), &[1; 32]),
        png(ColorType::Indexed, BitDepth::Two, Some(&[0, 0, 0, 128, 0, 0]), &[0x44; 8]),
    ]
}

fn photographs() -> Vec<Vec<u8>> {
    let (plain, deep) = (picture(false), picture(true));
    let mut all: Vec<Vec<u8>> =
        [ImageFormat::Jpeg, ImageFormat::Png, ImageFormat::Tiff, ImageFormat::Bmp, ImageFormat::Pnm]
            .into_iter()
            .map(|format| encoded(&plain, format))
            .collect();
    all.extend([ImageFormat::Png, ImageFormat::Tiff].map(|format| encoded(&deep, format)));
    all.push(encoded(&plain.into_luma8().into(), ImageFormat::Jpeg));
    all
}

fn damage(bytes: &mut Vec<u8>, other: &[u8], rng: &mut Rng) {
    for _ in 0..1 + rng.below(4) {
        let at = rng.below(bytes.len());
        match rng.below(7) {
            _ if bytes.is_empty() => bytes.push(rng.next() as u8),
            0 => bytes[at] ^= 1 << rng.below(8),
            1 => bytes[at] = [0, 1, 0x7F, 0x80, 0xFF][rng.below(5)],
            2 => bytes[at] = rng.next() as u8,
            3 => bytes.truncate(at),
            4 => {
                let absurd = [0u32, 1, 0xFF, 0xFFFF, 0x7FFF_FFFF, 0x8000_0000, u32::MAX][rng.below(7)];
                let new = if rng.below(2) == 0 { absurd.to_be_bytes() } else { absurd.to_le_bytes() };
                bytes.iter_mut().skip(at).zip(new).for_each(|(old, new)| *old = new);
            }
            5 => {
                let end = (at + 1 + rng.below(16)).min(bytes.len());
                let part = bytes[at..end].to_vec();
                let to = rng.below(bytes.len());
                bytes.splice(to..to, part);
            }
            _ => {
                let from = rng.below(other.len());
                bytes.truncate(at);
                bytes.extend(&other[from..]);
            }
        }
    }
}

/// Makes the checksums of the chunks of a PNG right, so that damage gets past them.
fn mend(bytes: &mut [u8]) {
    let mut at = 8;
    while at + 12 <= bytes.len() {
        let length = u32::from_be_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]) as usize;
        let Some(end) = at.checked_add(8).and_then(|start| start.checked_add(length)) else { return };
        if end + 4 > bytes.len() {
            return;
        }
        let crc = bytes[at + 4..end].iter().fold(u32::MAX, |crc, &byte| {
            (0..8).fold(crc ^ u32::from(byte), |crc, _| (crc >> 1) ^ (0xEDB8_8320 & (crc & 1).wrapping_neg()))
        });
        bytes[end..end + 4].copy_from_slice(&(!crc).to_be_bytes());
        at = end + 4;
    }
}

/// Reads many damaged variants of `seeds`; returns how many could be read all the same.
fn survive(seeds: &[Vec<u8>], read: impl Fn(&Path) -> Result<()>) -> u64 {
    let runs = std::env::var("SEMVS_FUZZ_RUNS").ok().and_then(|runs| runs.parse().ok()).unwrap_or(RUNS);
    let scratch = tempfile::tempdir().unwrap();
    let path = scratch.path().join("picture");
    let mut rng = Rng(0x9E37_79B9_7F4A_7C15);
    let mut fine = 0;
    for run in 0..runs {
        let mut bytes = seeds[rng.below(seeds.len())].clone();
        let other = &seeds[rng.below(seeds.len())];
        damage(&mut bytes, other, &mut rng);
        if bytes.starts_with(b"\x89PNG") && rng.below(4) > 0 {
            mend(&mut bytes);
        }
        std::fs::write(&path, &bytes).unwrap();
        match read(&path) {
            Ok(()) => fine += 1,
            Err(error) => {
                let said = error.to_string();
                assert!(said.contains("picture") && !said.contains('\n'), "run {run}: {said}");
            }
        }
    }
    println!("{runs} damaged pictures, of which {fine} could be read");
    fine
}

#[test]
fn damaged_label_maps_are_refused_or_read() {
    let tables = [ClassTable::ids(), ClassTable::builtin("3dom-facade").unwrap()];
    let readers = tables.map(|table| {
        let colors = table.colors();
        LabelReader {
            table,
            colors,
            table_is_assumed: false,
            unknown: UnknownLabel::Void,
            limits: Limits::default(),
        }
    });
    let fine = survive(&label_maps(), |path| {
        readers.iter().try_for_each(|reader| reader.read(path, |_| Ok(())).map(drop))
    });
    assert!(fine > 0);
}

#[test]
fn damaged_photographs_are_refused_or_read() {
    let fine = survive(&photographs(), |path| {
        let size = image_size(path);
        let image = load_color(path)?;
        assert_eq!(size?, image.size());
        Ok(())
    });
    assert!(fine > 0);
}
