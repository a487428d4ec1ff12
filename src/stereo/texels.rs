//! A source image as it is matched: grey levels in bytes at every resolution, made once for all views matched with it.

use crate::geometry::Size;
use crate::scene::{GrayImage, resize_gray};
use std::sync::Arc;

/// A grey image at full resolution and halved again and again, in the form in which others are matched with it.
#[derive(Clone, Debug)]
pub struct SourceTexels(Vec<Texels>);

/// One resolution of it.
#[derive(Clone, Debug)]
pub(crate) struct Texels {
    pub(crate) size: Size,
    /// Per pixel the grey levels, signed, from mid-grey, of itself, the next one, the one below it and the one next to
    /// that, from the low byte up.
    pub(crate) quads: Arc<[u32]>,
    /// The grey levels alone, and [`SPARE_ROWS`] rows and a few bytes more.
    pub(crate) bytes: Arc<[u8]>,
}

/// Rows behind the last one, and bytes behind those, which kernels may read.
const SPARE_ROWS: usize = 8;
const SPARE_BYTES: usize = 16;

impl SourceTexels {
    /// `gray` (0 black .. 1 white) at full resolution, and halved up to `halvings` times.
    pub fn new(gray: &GrayImage, halvings: u32) -> Self {
        let shrunk = (1..=halvings.min(16)).map(|n| Texels::new(&halved(gray, n)));
        SourceTexels(std::iter::once(Texels::new(gray)).chain(shrunk).collect())
    }

    /// The size at full resolution.
    pub fn size(&self) -> Size {
        self.0.first().map_or(Size::new(0, 0), |full| full.size)
    }

    /// How often it is halved at most.
    pub fn halvings(&self) -> u32 {
        self.0.len().saturating_sub(1) as u32
    }

    /// Bytes that it takes in memory.
    pub fn bytes(&self) -> usize {
        self.0.iter().map(|texels| size_of_val(&*texels.quads) + texels.bytes.len()).sum()
    }

    /// The image halved `halvings` times, or as often as it is.
    pub(crate) fn halved(&self, halvings: u32) -> Option<&Texels> {
        self.0.get(halvings as usize).or(self.0.last())
    }
}

/// `gray` divided by `2^halvings`.
pub(crate) fn halved(gray: &GrayImage, halvings: u32) -> GrayImage {
    resize_gray(gray, 1.0 / f64::from(1u32 << halvings.min(16)))
}

impl Texels {
    fn new(gray: &GrayImage) -> Self {
        let bytes = bytes(gray);
        let quads = quads(&bytes, gray.width(), gray.height());
        Texels { size: gray.size(), quads: quads.into(), bytes: bytes.into() }
    }
}

/// Grey level from mid-grey, as the bits of a signed byte.
fn level_byte(v: f32) -> u8 {
    ((v.clamp(0.0, 1.0) * 255.0 + 0.5) as i32 ^ 0x80) as u8
}

fn bytes(gray: &GrayImage) -> Vec<u8> {
    let all = gray.width() * (gray.height() + SPARE_ROWS) + SPARE_BYTES;
    let mut out = Vec::with_capacity(all);
    out.extend(gray.data().iter().map(|&v| level_byte(v)));
    out.resize(all, 0);
    out
}

/// Packs every pixel's grey level with those of the three pixels next to and below it.
fn quads(bytes: &[u8], width: usize, height: usize) -> Vec<u32> {
    let mut out = Vec::with_capacity(width * height);
    let row = |y: usize| &bytes[y * width..][..width];
    for y in 0..height {
        let (top, bottom) = (row(y), row((y + 1).min(height - 1)));
        let pair = |(&top, &bottom): (&u8, &u8)| u32::from(top) | u32::from(bottom) << 16;
        let here = top.iter().zip(bottom).map(pair);
        let next = top[1..].iter().zip(&bottom[1..]).map(pair);
        out.extend(here.zip(next).map(|(here, next)| here | next << 8));
        out.extend(top.last().zip(bottom.last()).map(pair).map(|edge| edge | edge << 8));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Grid;

    #[test]
    fn a_quad_holds_a_pixel_and_those_after_and_below_it() {
        let level = |v: u32| (v as f32) / 255.0;
        let gray =
            Grid::from_vec(Size::new(2, 2), vec![level(0), level(128), level(255), level(129)]).unwrap();
        let texels = SourceTexels::new(&gray, 1);
        let full = texels.halved(0).unwrap();
        let signed = |quad: u32| quad.to_le_bytes().map(|b| b as i8);
        assert_eq!(
            full.quads.iter().map(|&q| signed(q)).collect::<Vec<_>>(),
            [[-128, 0, 127, 1], [0, 0, 1, 1], [127, 1, 127, 1], [1, 1, 1, 1],]
        );
        assert_eq!(full.bytes[..4], [0x80, 0, 127, 1]);
        assert_eq!((texels.size(), texels.halvings()), (Size::new(2, 2), 1));
        assert_eq!(texels.halved(1).unwrap().size, Size::new(1, 1));
        let of = |pixels: usize, width: usize| 5 * pixels + SPARE_ROWS * width + SPARE_BYTES;
        assert_eq!(texels.bytes(), of(4, 2) + of(1, 1));
    }
}
