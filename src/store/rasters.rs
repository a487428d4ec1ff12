//! Maps of depths, normals and confidences as PFM, NPY and 16-bit PNG.

use super::atomic::{AtomicFile, write_file};
use super::images::decode;
use crate::error::{Error, Result};
use crate::geometry::Size;
use crate::scene::{DepthMap, Grid, NormalMap};
use image::{DynamicImage, ImageBuffer, ImageFormat, Luma};
use semvs_formats::Limits;
use semvs_formats::npy::{self, FloatArray};
use semvs_formats::pfm::{self, FloatMap};
use std::fs::File;
use std::io::Cursor;
use std::path::Path;

/// Kind of a raster file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RasterFormat {
    /// Portable float map.
    Pfm,
    /// NumPy array: (rows, columns), normals (rows, columns, 3).
    Npy,
    /// 16-bit grey PNG of depth times a scale; depths only.
    Png,
}

impl RasterFormat {
    /// All kinds, in the order in which files are looked for.
    pub const ALL: [RasterFormat; 3] = [RasterFormat::Pfm, RasterFormat::Npy, RasterFormat::Png];

    /// Extension of file names.
    pub fn extension(self) -> &'static str {
        match self {
            RasterFormat::Pfm => "pfm",
            RasterFormat::Npy => "npy",
            RasterFormat::Png => "png",
        }
    }
}

/// Reads a depth map of the kind that the extension of `path` says. In PNG files a value stands for value / `scale`.
/// What is not a depth above 0 becomes 0.
///
/// # Errors
/// [`Error`] about `path` if it cannot be read, is damaged, or holds no map of one value per pixel.
pub fn read_depth(path: &Path, scale: f32, limits: &Limits) -> Result<DepthMap> {
    let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    let mut depth = match extension.as_str() {
        "pfm" => {
            let map = pfm::read(open(path)?, length(path)?, limits).map_err(|e| Error::format(path, e))?;
            if map.channels != 1 {
                return Err(Error::content(path, "three values per pixel; a depth map has one"));
            }
            raster(path, map.width.into(), map.height.into(), map.data)?
        }
        "npy" => {
            let array = npy::read(open(path)?, length(path)?, limits).map_err(|e| Error::format(path, e))?;
            match *array.shape {
                [rows, columns] | [rows, columns, 1] => raster(path, columns, rows, array.data)?,
                _ => {
                    let what = format!("an array of shape {:?}; depths are (rows, columns)", array.shape);
                    return Err(Error::content(path, what));
                }
            }
        }
        "png" => read_png(path, scale)?,
        _ => return Err(Error::content(path, "depths are read from .pfm, .npy and 16-bit .png files")),
    };
    for value in depth.data_mut() {
        if !(value.is_finite() && *value > 0.0) {
            *value = 0.0;
        }
    }
    Ok(depth)
}

/// Writes one value per pixel, whole or not at all. Returns how many depths a PNG cannot hold: they are nearer than
/// half a step or further than 65,535 / `scale`, and become 0.
///
/// # Errors
/// The place cannot be written.
pub fn write_plane(path: &Path, format: RasterFormat, plane: &Grid<f32>, scale: f32) -> Result<u64> {
    let size = plane.size();
    match format {
        RasterFormat::Png => return write_png(path, plane, scale),
        RasterFormat::Pfm => write_pfm(path, size, 1, plane.data().to_vec())?,
        RasterFormat::Npy => {
            write_npy(path, vec![size.height.into(), size.width.into()], plane.data().to_vec())?
        }
    }
    Ok(0)
}

/// Writes normals, whole or not at all.
///
/// # Errors
/// The place cannot be written; PNG files hold depths only.
pub fn write_normals(path: &Path, format: RasterFormat, normals: &NormalMap) -> Result<()> {
    let size = normals.size();
    let values = normals.data().as_flattened().to_vec();
    match format {
        RasterFormat::Png => Err(Error::content(path, "PNG files hold depths only; use pfm or npy")),
        RasterFormat::Pfm => write_pfm(path, size, 3, values),
        RasterFormat::Npy => write_npy(path, vec![size.height.into(), size.width.into(), 3], values),
    }
}

fn open(path: &Path) -> Result<File> {
    File::open(path).map_err(|e| Error::io(path, "open", e))
}

fn length(path: &Path) -> Result<Option<u64>> {
    let metadata = std::fs::metadata(path).map_err(|e| Error::io(path, "read", e))?;
    Ok(metadata.is_file().then_some(metadata.len()))
}

fn raster(path: &Path, width: u64, height: u64, values: Vec<f32>) -> Result<DepthMap> {
    let side = |n: u64| u32::try_from(n).ok().filter(|n| (1..=u32::from(u16::MAX)).contains(n));
    let size = side(width).zip(side(height)).map(|(width, height)| Size::new(width, height));
    size.and_then(|size| Grid::from_vec(size, values))
        .ok_or_else(|| Error::content(path, format!("{width}×{height} pixels: sides go from 1 to 65535")))
}

fn read_png(path: &Path, scale: f32) -> Result<DepthMap> {
    let DynamicImage::ImageLuma16(image) = decode(path)? else {
        return Err(Error::content(path, "not a 16-bit grey PNG, which depths are read from"));
    };
    let (width, height) = image.dimensions();
    let values = image.into_raw().into_iter().map(|v| (f64::from(v) / f64::from(scale)) as f32).collect();
    raster(path, width.into(), height.into(), values)
}

fn write_png(path: &Path, plane: &Grid<f32>, scale: f32) -> Result<u64> {
    let mut lost = 0;
    let stored = |&depth: &f32| {
        let value = (f64::from(depth) * f64::from(scale)).round();
        if (1.0..=f64::from(u16::MAX)).contains(&value) {
            return value as u16;
        }
        lost += u64::from(depth > 0.0);
        0
    };
    let values: Vec<u16> = plane.data().iter().map(stored).collect();
    let size = plane.size();
    let image: ImageBuffer<Luma<u16>, _> = ImageBuffer::from_raw(size.width, size.height, values)
        .ok_or_else(|| Error::content(path, "the depths do not fill the map"))?;
    let mut bytes = Cursor::new(Vec::new());
    image.write_to(&mut bytes, ImageFormat::Png).map_err(|e| Error::content(path, format!("no PNG: {e}")))?;
    write_file(path, bytes.get_ref())?;
    Ok(lost)
}

fn write_pfm(path: &Path, size: Size, channels: u32, data: Vec<f32>) -> Result<()> {
    let map = FloatMap { width: size.width, height: size.height, channels, data };
    write_with(path, |file| pfm::write(&map, file))
}

fn write_npy(path: &Path, shape: Vec<u64>, data: Vec<f32>) -> Result<()> {
    let array = FloatArray { shape, data };
    write_with(path, |file| npy::write(&array, file))
}

fn write_with(path: &Path, write: impl FnOnce(&mut AtomicFile) -> semvs_formats::Result<()>) -> Result<()> {
    let mut file = AtomicFile::create(path)?;
    write(&mut file).map_err(|e| Error::format(path, e))?;
    file.commit()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn depths() -> DepthMap {
        Grid::from_vec(Size::new(3, 2), vec![0.0, 1.2345, 2.0, 65.535, 70.0, 0.0001]).unwrap()
    }

    #[test]
    fn depths_survive_every_kind() {
        let scratch = tempfile::tempdir().unwrap();
        for format in RasterFormat::ALL {
            let path = scratch.path().join(format!("a.{}", format.extension()));
            let lost = write_plane(&path, format, &depths(), 1000.0).unwrap();
            let read = read_depth(&path, 1000.0, &Limits::default()).unwrap();
            if format == RasterFormat::Png {
                // Steps of a millimetre; 70 m and 0.1 mm cannot be said.
                assert_eq!(
                    (lost, read.data()),
                    (2, &[0.0, 1.235, 2.0, 65.535, 0.0, 0.0][..]),
                    "1.2345 rounds up"
                );
            } else {
                assert_eq!((lost, read), (0, depths()));
            }
        }
    }

    #[test]
    fn normals_go_into_float_files_only() {
        let scratch = tempfile::tempdir().unwrap();
        let normals = Grid::from_vec(Size::new(2, 1), vec![[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]).unwrap();
        let at = |name: &str| scratch.path().join(name);
        write_normals(&at("n.npy"), RasterFormat::Npy, &normals).unwrap();
        let array = npy::read(open(&at("n.npy")).unwrap(), None, &Limits::default()).unwrap();
        assert_eq!((array.shape, array.data), (vec![1, 2, 3], vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0]));
        write_normals(&at("n.pfm"), RasterFormat::Pfm, &normals).unwrap();
        let refused = read_depth(&at("n.pfm"), 1.0, &Limits::default()).unwrap_err().to_string();
        assert!(refused.contains("three values per pixel"), "{refused}");
        assert!(read_depth(&at("n.npy"), 1.0, &Limits::default()).is_err());
        assert!(write_normals(&at("n.png"), RasterFormat::Png, &normals).is_err());
    }

    #[test]
    fn what_is_no_depth_becomes_0_and_what_is_no_map_is_refused() {
        let scratch = tempfile::tempdir().unwrap();
        let path = scratch.path().join("a.npy");
        let odd = Grid::from_vec(Size::new(2, 2), vec![f32::NAN, f32::INFINITY, -1.0, 3.0]).unwrap();
        write_plane(&path, RasterFormat::Npy, &odd, 1.0).unwrap();
        assert_eq!(read_depth(&path, 1.0, &Limits::default()).unwrap().data(), [0.0, 0.0, 0.0, 3.0]);
        let grey = scratch.path().join("a.png");
        image::GrayImage::new(2, 2).save(&grey).unwrap();
        assert!(read_depth(&grey, 1.0, &Limits::default()).unwrap_err().to_string().contains("16-bit"));
        let other = scratch.path().join("a.tif");
        assert!(read_depth(&other, 1.0, &Limits::default()).unwrap_err().to_string().contains(".pfm"));
    }
}
