//! Photographs: their size, and their pixels at the working size.

use super::jpeg;
use crate::error::{Error, Result};
use crate::geometry::Size;
use crate::scene::{ColorImage, Grid, ResolutionOptions, area_rgb};
use image::{DynamicImage, ImageFormat, ImageReader};
use std::fs::File;
use std::io::{BufReader, Cursor};
use std::path::Path;

/// Longest side of a photograph in pixels.
const MAX_SIDE: u32 = 65_535;
/// Most bytes that a decoder may allocate.
const MAX_DECODED: u64 = 4 << 30;
/// Most pixels that one byte of a compressed file may stand for; real photographs stay below 200.
const MAX_PIXELS_PER_BYTE: u64 = 16_384;

/// Width and height of the photograph at `path`, from its header. EXIF orientation is ignored, here and below.
///
/// # Errors
/// [`Error`] if the file cannot be read, is of no known kind, or is larger than 65,535 pixels a side.
pub fn image_size(path: &Path) -> Result<Size> {
    let file = File::open(path).map_err(|e| Error::io(path, "open", e))?;
    let length = file.metadata().map_err(|e| Error::io(path, "read", e))?.len();
    let mut reader = BufReader::new(file);
    let (width, height) = match jpeg::dimensions(&mut reader) {
        Ok(Some(size)) => size,
        _ => {
            let reader = ImageReader::open(path).map_err(|e| Error::io(path, "open", e))?;
            let reader = reader.with_guessed_format().map_err(|e| Error::io(path, "read", e))?;
            reader.into_dimensions().map_err(|e| undecodable(path, &e))?
        }
    };
    let size = Size::new(width, height);
    check_size(path, size, length)?;
    Ok(size)
}

/// The photograph at `path` in 8-bit colour. Grey is spread over the channels, 16-bit values are scaled to 8 bits,
/// transparency is dropped.
///
/// # Errors
/// As [`image_size`], and [`Error::Content`] if the pixels are damaged or the file is cut short.
pub fn load_color(path: &Path) -> Result<ColorImage> {
    let (bytes, size) = decode_rgb(path)?;
    let pixels = bytes.as_chunks::<3>().0.to_vec();
    Grid::from_vec(size, pixels).ok_or_else(|| Error::content(path, "decoded to an impossible size"))
}

/// The photograph at `path` in 8-bit colour, reduced to the working size of `resolution` by area means.
///
/// # Errors
/// As [`load_color`].
pub fn load_working_color(path: &Path, resolution: &ResolutionOptions) -> Result<ColorImage> {
    let (bytes, size) = decode_rgb(path)?;
    let factor = resolution.factor(size);
    if factor < 1.0 {
        return Ok(area_rgb(&bytes, size, factor));
    }
    let pixels = bytes.as_chunks::<3>().0.to_vec();
    Grid::from_vec(size, pixels).ok_or_else(|| Error::content(path, "decoded to an impossible size"))
}

/// Interleaved red, green, blue bytes of the photograph at `path`.
fn decode_rgb(path: &Path) -> Result<(Vec<u8>, Size)> {
    let image = decode(path)?;
    let size = Size::new(image.width(), image.height());
    Ok((image.into_rgb8().into_raw(), size))
}

/// The image at `path` with the channels and the depth it is stored with.
pub(super) fn decode(path: &Path) -> Result<DynamicImage> {
    let bytes = std::fs::read(path).map_err(|e| Error::io(path, "read", e))?;
    let open = || {
        let mut reader = ImageReader::new(Cursor::new(&bytes));
        if let Ok(format) = ImageFormat::from_path(path) {
            reader.set_format(format);
        }
        reader.with_guessed_format().map_err(|e| Error::io(path, "read", e))
    };
    let mut reader = open()?;
    let is_jpeg = reader.format() == Some(ImageFormat::Jpeg);
    let (width, height) = match jpeg::dimensions(&mut Cursor::new(&bytes)) {
        Ok(Some(size)) if is_jpeg => size,
        _ => open()?.into_dimensions().map_err(|e| undecodable(path, &e))?,
    };
    check_size(path, Size::new(width, height), bytes.len() as u64)?;
    if is_jpeg && !jpeg::is_complete(&bytes) {
        return Err(Error::content(
            path,
            "the JPEG ends before its end-of-image marker; copy the file again",
        ));
    }
    let mut limits = image::Limits::default();
    limits.max_image_width = Some(MAX_SIDE);
    limits.max_image_height = Some(MAX_SIDE);
    limits.max_alloc = Some(MAX_DECODED);
    reader.limits(limits);
    reader.decode().map_err(|e| undecodable(path, &e))
}

/// Refuses empty images and sizes that a file of `length` bytes cannot hold.
fn check_size(path: &Path, size: Size, length: u64) -> Result<()> {
    if size.area() == 0 {
        return Err(Error::content(path, format!("an image of {size} pixels")));
    }
    let pixels = u64::from(size.width) * u64::from(size.height);
    if size.longest() > MAX_SIDE {
        return Err(Error::content(path, format!("{size} pixels: the longest side allowed is {MAX_SIDE}")));
    }
    if pixels > length.saturating_mul(MAX_PIXELS_PER_BYTE) || pixels.saturating_mul(3) > MAX_DECODED {
        let what = format!("its header claims {size} pixels, implausible for a file of {length} bytes");
        return Err(Error::content(path, what));
    }
    Ok(())
}

/// What a decoder said, in one line.
fn undecodable(path: &Path, error: &image::ImageError) -> Error {
    let said = error.to_string().split_whitespace().collect::<Vec<_>>().join(" ");
    Error::content(
        path,
        match error {
            image::ImageError::Unsupported(_) => {
                format!("not an image that can be decoded ({said}); use JPEG, PNG or TIFF")
            }
            _ => format!("the image is damaged or cut short ({said})"),
        },
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{GrayImage, ImageBuffer, Luma, Rgba};
    use std::path::PathBuf;

    fn photograph() -> PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("compat-fixtures/facade6/images/0003.jpg")
    }

    #[test]
    fn photographs_load_at_both_sizes() {
        let path = photograph();
        assert_eq!(image_size(&path).unwrap(), Size::new(400, 300));
        let full = load_color(&path).unwrap();
        assert_eq!(full.size(), Size::new(400, 300));
        let options = ResolutionOptions { level: 1, min: 160, max: 2560 };
        let half = load_working_color(&path, &options).unwrap();
        assert_eq!(half, crate::scene::area_color(&full, 0.5));
        assert_eq!(load_working_color(&path, &ResolutionOptions::default()).unwrap(), full);
    }

    #[test]
    fn grey_deep_and_transparent_pictures_become_colour() {
        let scratch = tempfile::tempdir().unwrap();
        let at = |name: &str| scratch.path().join(name);
        GrayImage::from_pixel(3, 2, Luma([77])).save(at("grey.png")).unwrap();
        ImageBuffer::from_pixel(3, 2, Luma([0x8000u16])).save(at("deep.tif")).unwrap();
        ImageBuffer::from_pixel(3, 2, Rgba([9u8, 8, 7, 0])).save(at("clear.png")).unwrap();
        for (name, pixel) in [("grey.png", [77; 3]), ("deep.tif", [128; 3]), ("clear.png", [9, 8, 7])] {
            let image = load_color(&at(name)).unwrap();
            assert_eq!((image.size(), image.data()[0]), (Size::new(3, 2), pixel), "{name}");
            assert_eq!(image_size(&at(name)).unwrap(), Size::new(3, 2));
        }
    }

    #[test]
    fn content_counts_and_not_the_extension() {
        let scratch = tempfile::tempdir().unwrap();
        let path = scratch.path().join("really_a_jpeg.png");
        std::fs::copy(photograph(), &path).unwrap();
        assert_eq!(load_color(&path).unwrap(), load_color(&photograph()).unwrap());
    }

    #[test]
    fn damage_is_reported_in_one_line() {
        let scratch = tempfile::tempdir().unwrap();
        let jpeg = std::fs::read(photograph()).unwrap();
        let path = scratch.path().join("cut.jpg");
        for length in [0, 1, 3, 200, jpeg.len() / 2, jpeg.len() - 2] {
            std::fs::write(&path, &jpeg[..length]).unwrap();
            let error = load_color(&path).unwrap_err().to_string();
            assert!(error.contains("cut.jpg") && !error.contains('\n'), "{length} bytes: {error}");
        }
        let png = scratch.path().join("cut.png");
        GrayImage::from_fn(60, 60, |x, y| Luma([(x * y) as u8])).save(&png).unwrap();
        let whole = std::fs::read(&png).unwrap();
        for length in [7, 20, 40, whole.len() / 2, whole.len() - 20] {
            std::fs::write(&png, &whole[..length]).unwrap();
            assert!(load_color(&png).is_err(), "{length} bytes");
        }
        let error = load_color(&scratch.path().join("absent.jpg")).unwrap_err().to_string();
        assert!(error.contains("absent.jpg: cannot read"), "{error}");
    }

    #[test]
    fn a_header_cannot_claim_more_than_the_file_can_hold() {
        let scratch = tempfile::tempdir().unwrap();
        let path = scratch.path().join("bomb.jpg");
        let mut jpeg = std::fs::read(photograph()).unwrap();
        let frame = jpeg.windows(2).position(|w| w[0] == 0xFF && matches!(w[1], 0xC0..=0xC2)).unwrap();
        jpeg[frame + 5..frame + 9].fill(0xFF);
        std::fs::write(&path, &jpeg).unwrap();
        for error in [load_color(&path).map(drop), image_size(&path).map(drop)] {
            let error = error.unwrap_err().to_string();
            assert!(error.contains("65535×65535"), "{error}");
        }
    }
}
