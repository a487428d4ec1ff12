//! Pictures that explain results: text in them, and their bytes as PNG and JPEG.

use super::atomic::AtomicFile;
use crate::error::{Error, Result};
use crate::scene::ColorImage;
use image::ExtendedColorType;
use image::codecs::jpeg::JpegEncoder;
use noto_sans_mono_bitmap::{FontWeight, RasterHeight, get_raster, get_raster_width};
use std::collections::HashMap;
use std::io::Write;
use std::path::Path;

const FONT: RasterHeight = RasterHeight::Size20;

/// Writes `image` to `path` as PNG.
///
/// # Errors
/// The file cannot be written.
pub(crate) fn write_picture(path: &Path, image: &ColorImage) -> Result<()> {
    let failed = |e: png::EncodingError| match e {
        png::EncodingError::IoError(e) => Error::io(path, "write", e),
        e => Error::content(path, format!("cannot write: {e}")),
    };
    let mut file = AtomicFile::create(path)?;
    encode_png(&mut file, image).map_err(failed)?;
    file.commit()
}

/// The bytes of a PNG file of `image`: for pictures of few colours with sharp borders.
///
/// # Errors
/// An image without pixels.
pub(crate) fn png_bytes(image: &ColorImage) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let written = match palette(image) {
        Some((colors, indices)) => encode_palette(&mut bytes, image, &colors, &indices),
        None => encode_png(&mut bytes, image),
    };
    written.map_err(|e| Error::invalid(format!("no PNG: {e}")))?;
    Ok(bytes)
}

/// The bytes of a JPEG file of `image`; `quality`: 1 to 100.
///
/// # Errors
/// An image without pixels.
pub(crate) fn jpeg_bytes(image: &ColorImage, quality: u8) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let (width, height) = (image.size().width, image.size().height);
    JpegEncoder::new_with_quality(&mut bytes, quality)
        .encode(image.data().as_flattened(), width, height, ExtendedColorType::Rgb8)
        .map_err(|e| Error::invalid(format!("no JPEG: {e}")))?;
    Ok(bytes)
}

/// The colours of an image, and which of them every pixel has; `None` if there are more than a byte can tell.
fn palette(image: &ColorImage) -> Option<(Vec<[u8; 3]>, Vec<u8>)> {
    let (mut places, mut colors) = (HashMap::new(), Vec::new());
    let mut indices = Vec::with_capacity(image.data().len());
    for &color in image.data() {
        let place = *places.entry(color).or_insert_with(|| {
            colors.push(color);
            colors.len() - 1
        });
        indices.push(u8::try_from(place).ok()?);
    }
    Some((colors, indices))
}

fn encode_palette(
    to: impl Write,
    image: &ColorImage,
    colors: &[[u8; 3]],
    indices: &[u8],
) -> std::result::Result<(), png::EncodingError> {
    let mut encoder = png::Encoder::new(to, image.size().width, image.size().height);
    encoder.set_color(png::ColorType::Indexed);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_palette(colors.as_flattened().to_vec());
    let mut writer = encoder.write_header()?;
    writer.write_image_data(indices)?;
    writer.finish()
}

fn encode_png(to: impl Write, image: &ColorImage) -> std::result::Result<(), png::EncodingError> {
    let mut encoder = png::Encoder::new(to, image.size().width, image.size().height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(image.data().as_flattened())?;
    writer.finish()
}

/// Pixels that `text` is wide; it is 20 high.
pub(crate) fn text_width(text: &str) -> usize {
    text.chars().count() * get_raster_width(FontWeight::Regular, FONT)
}

/// `text` in black with its upper left corner at (`x`, `y`); a character that the font lacks is shown as `?`.
pub(crate) fn put_text(image: &mut ColorImage, x: usize, y: usize, text: &str) {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Size;

    #[test]
    fn bytes_are_what_decoders_read() {
        let mut picture = ColorImage::filled(Size::new(40, 30), [200, 30, 60]);
        picture.data_mut()[0] = [1, 2, 3];
        let png = image::load_from_memory(&png_bytes(&picture).unwrap()).unwrap().into_rgb8();
        assert_eq!(png.as_raw(), picture.data().as_flattened());
        // More colours than a palette holds.
        let many = (0..300u32).map(|i| [(i / 2) as u8, (i % 7) as u8, i as u8]).collect();
        let many = ColorImage::from_vec(Size::new(20, 15), many).unwrap();
        let png = image::load_from_memory(&png_bytes(&many).unwrap()).unwrap().into_rgb8();
        assert_eq!(png.as_raw(), many.data().as_flattened());
        let jpeg = image::load_from_memory(&jpeg_bytes(&picture, 85).unwrap()).unwrap().into_rgb8();
        assert_eq!(jpeg.dimensions(), (40, 30));
        assert!(jpeg.get_pixel(30, 20).0.iter().zip([200, 30, 60]).all(|(&a, b)| a.abs_diff(b) < 6));
        assert!(png_bytes(&ColorImage::filled(Size::new(0, 3), [0; 3])).is_err());
    }
}
