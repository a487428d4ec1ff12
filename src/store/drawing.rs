//! Small pictures that explain results: text, and the PNG file.

use super::atomic::AtomicFile;
use crate::error::{Error, Result};
use crate::scene::ColorImage;
use noto_sans_mono_bitmap::{FontWeight, RasterHeight, get_raster, get_raster_width};
use std::path::Path;

const FONT: RasterHeight = RasterHeight::Size20;

/// Writes `image` to `path` as PNG.
///
/// # Errors
/// The file cannot be written.
pub(super) fn write_picture(path: &Path, image: &ColorImage) -> Result<()> {
    let failed = |e: png::EncodingError| match e {
        png::EncodingError::IoError(e) => Error::io(path, "write", e),
        e => Error::content(path, format!("cannot write: {e}")),
    };
    let mut file = AtomicFile::create(path)?;
    let mut encoder = png::Encoder::new(&mut file, image.size().width, image.size().height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    let mut writer = encoder.write_header().map_err(failed)?;
    writer.write_image_data(image.data().as_flattened()).map_err(failed)?;
    writer.finish().map_err(failed)?;
    file.commit()
}

/// Pixels that `text` is wide; it is 20 high.
pub(super) fn text_width(text: &str) -> usize {
    text.chars().count() * get_raster_width(FontWeight::Regular, FONT)
}

/// `text` in black with its upper left corner at (`x`, `y`); a character that the font lacks is shown as `?`.
pub(super) fn put_text(image: &mut ColorImage, x: usize, y: usize, text: &str) {
    let raster = |c| get_raster(c, FontWeight::Regular, FONT);
    let width = get_raster_width(FontWeight::Regular, FONT);
    for (i, raster) in text.chars().filter_map(|c| raster(c).or_else(|| raster('?'))).enumerate() {
        let left = x + i * width;
        for (dy, row) in raster.rows().enumerate() {
            for (dx, ink) in row.iter().enumerate() {
                image[(left + dx, y + dy)] = [255 - ink; 3];
            }
        }
    }
}
