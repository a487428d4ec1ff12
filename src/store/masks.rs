//! Masks: which pixels of a photograph to ignore.

use super::images::decode;
use super::paths::clean_name;
use crate::error::{Error, Result};
use crate::geometry::Size;
use crate::scene::{Grid, resize_nearest};
use image::DynamicImage;
use std::path::{Path, PathBuf};

/// Name of the mask of an image without one: its last extension becomes `.mask.png`.
pub(crate) fn default_mask_name(image_name: &str) -> String {
    format!("{}.mask.png", without_extension(image_name))
}

/// Path in `folder` of the mask of an image: its base name with `.mask.png` for its extension.
pub(crate) fn mask_in_folder(folder: &Path, image_name: &str) -> PathBuf {
    let name = clean_name(image_name);
    let base = name.rsplit('/').next().unwrap_or(&name);
    folder.join(default_mask_name(base))
}

/// The mask at `path` with one value per pixel of a depth map of `size`, by the nearest value.
///
/// 8-bit values stay 0..255 and 16-bit ones 0..65535; colours become luma (0.299 R + 0.587 G + 0.114 B),
/// transparency is dropped.
///
/// # Errors
/// [`Error`] if the file cannot be read or decoded, or holds real numbers.
pub(crate) fn load_mask(path: &Path, size: Size) -> Result<Grid<u16>> {
    let image = decode(path)?;
    let from = Size::new(image.width(), image.height());
    let values: Vec<u16> = match image {
        DynamicImage::ImageLuma8(m) => m.into_raw().into_iter().map(u16::from).collect(),
        DynamicImage::ImageLuma16(m) => m.into_raw(),
        DynamicImage::ImageLumaA8(m) => m.pixels().map(|p| u16::from(p.0[0])).collect(),
        DynamicImage::ImageLumaA16(m) => m.pixels().map(|p| p.0[0]).collect(),
        DynamicImage::ImageRgb8(m) => {
            m.pixels().map(|p| luma(p.0[0].into(), p.0[1].into(), p.0[2].into())).collect()
        }
        DynamicImage::ImageRgba8(m) => {
            m.pixels().map(|p| luma(p.0[0].into(), p.0[1].into(), p.0[2].into())).collect()
        }
        DynamicImage::ImageRgb16(m) => m.pixels().map(|p| luma(p.0[0], p.0[1], p.0[2])).collect(),
        DynamicImage::ImageRgba16(m) => m.pixels().map(|p| luma(p.0[0], p.0[1], p.0[2])).collect(),
        _ => return Err(Error::content(path, "a mask of real numbers; save it with 8 or 16 bits per value")),
    };
    let mask =
        Grid::from_vec(from, values).ok_or_else(|| Error::content(path, "decoded to an impossible size"))?;
    Ok(resize_nearest(&mask, size))
}

/// Luma in 14-bit fixed point, rounded.
fn luma(r: u16, g: u16, b: u16) -> u16 {
    let sum = u32::from(r) * 4899 + u32::from(g) * 9617 + u32::from(b) * 1868;
    ((sum + (1 << 13)) >> 14) as u16
}

/// `name` without its last extension; a dot in a folder's name is none.
fn without_extension(name: &str) -> &str {
    let base = name.rfind(['/', '\\']).map_or(0, |i| i + 1);
    match name[base..].rfind('.') {
        Some(dot) if dot > 0 => &name[..base + dot],
        _ => name,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{ImageBuffer, Luma, Rgb, Rgba};

    #[test]
    fn names_follow_the_image() {
        assert_eq!(default_mask_name("images/a.b.jpg"), "images/a.b.mask.png");
        assert_eq!(default_mask_name("v1.2/a"), "v1.2/a.mask.png");
        assert_eq!(mask_in_folder(Path::new("m"), "sub\\a.b.jpg"), Path::new("m/a.b.mask.png"));
    }

    #[test]
    fn values_keep_their_depth_and_colours_become_luma() {
        let scratch = tempfile::tempdir().unwrap();
        let load = |name: &str| load_mask(&scratch.path().join(name), Size::new(1, 1)).unwrap().data()[0];
        let save = |name: &str| scratch.path().join(name);
        ImageBuffer::from_pixel(1, 1, Luma([200u8])).save(save("8.png")).unwrap();
        ImageBuffer::from_pixel(1, 1, Luma([40_000u16])).save(save("16.png")).unwrap();
        ImageBuffer::from_pixel(1, 1, Rgb([10u8, 20, 30])).save(save("rgb.png")).unwrap();
        ImageBuffer::from_pixel(1, 1, Rgba([7u8, 7, 7, 0])).save(save("rgba.png")).unwrap();
        assert_eq!([load("8.png"), load("16.png"), load("rgb.png"), load("rgba.png")], [200, 40_000, 18, 7]);
    }

    #[test]
    fn masks_take_the_size_of_the_map() {
        let scratch = tempfile::tempdir().unwrap();
        let path = scratch.path().join("m.png");
        ImageBuffer::from_fn(4, 2, |x, y| Luma([(x + 10 * y) as u8])).save(&path).unwrap();
        assert_eq!(load_mask(&path, Size::new(2, 1)).unwrap().data(), &[0, 2]);
        assert_eq!(load_mask(&path, Size::new(3, 2)).unwrap().data(), &[0, 1, 2, 10, 11, 12]);
        assert!(load_mask(&scratch.path().join("none.png"), Size::new(2, 1)).is_err());
    }
}
