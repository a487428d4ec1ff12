//! What verbose runs leave for looking at: grey pictures of maps, clouds of single views, a MeshLab project.

use super::atomic::{AtomicFile, write_file};
use super::paths::name_relative_to;
use crate::error::{Error, Result};
use crate::geometry::Camera;
use crate::scene::{CloudPoint, Grid, PointSink};
use image::{GrayImage, ImageFormat};
use semvs_formats::ply::{Cloud, Encoding, Field, Layout, PlyWriter, TypeNames};
use std::fmt::Write as _;
use std::io::Cursor;
use std::path::Path;

/// Share of the values at either end of a map that do not count for its range.
const OUTLIERS: f64 = 0.01;
/// Grey value of the smallest value; 0 is for pixels without one.
const DARKEST: f32 = 32.0;

/// Writes the values above 0 of `plane` as an 8-bit grey PNG, the smallest dark or, with `near_is_bright`, bright; pixels
/// without a value are black.
///
/// # Errors
/// [`Error`] about `path` if it cannot be written.
pub fn write_picture(path: &Path, plane: &Grid<f32>, near_is_bright: bool) -> Result<()> {
    let mut values: Vec<f32> = plane.data().iter().copied().filter(|&v| v > 0.0 && v.is_finite()).collect();
    values.sort_unstable_by(f32::total_cmp);
    let at = |share: f64| values.get((share * values.len().saturating_sub(1) as f64) as usize).copied();
    let (least, most) = (at(OUTLIERS).unwrap_or(0.0), at(1.0 - OUTLIERS).unwrap_or(1.0));
    let grey = |&value: &f32| {
        if value <= 0.0 {
            return 0;
        }
        let share = ((value - least) / (most - least).max(f32::MIN_POSITIVE)).clamp(0.0, 1.0);
        let share = if near_is_bright { 1.0 - share } else { share };
        (DARKEST + share * (f32::from(u8::MAX) - DARKEST)).round() as u8
    };
    let size = plane.size();
    let image = GrayImage::from_raw(size.width, size.height, plane.data().iter().map(grey).collect())
        .ok_or_else(|| Error::content(path, "the values do not fill the map"))?;
    let mut bytes = Cursor::new(Vec::new());
    image.write_to(&mut bytes, ImageFormat::Png).map_err(|e| Error::content(path, format!("no PNG: {e}")))?;
    write_file(path, bytes.get_ref())
}

/// The points of one view on their way into a PLY file: position, normal, colour.
pub struct ViewCloud<'a> {
    path: &'a Path,
    writer: PlyWriter<AtomicFile>,
    chunk: Cloud,
}

impl<'a> ViewCloud<'a> {
    /// Starts the file at `path`, which will hold `points` points.
    ///
    /// # Errors
    /// [`Error`] about `path` if it cannot be written.
    pub fn create(path: &'a Path, points: u64) -> Result<Self> {
        let layout = Layout {
            encoding: Encoding::LittleEndian,
            type_names: TypeNames::Sized,
            fields: vec![Field::Position, Field::Normal, Field::Color],
            comments: Vec::new(),
        };
        let writer = PlyWriter::new(AtomicFile::create(path)?, &layout, points);
        Ok(ViewCloud { path, writer: writer.map_err(|e| Error::writing(path, e))?, chunk: Cloud::default() })
    }

    fn flush(&mut self) -> Result<()> {
        self.writer.write(&self.chunk).map_err(|e| Error::writing(self.path, e))?;
        self.chunk.clear();
        Ok(())
    }

    /// Completes the file.
    ///
    /// # Errors
    /// [`Error`] about the file, also when it did not get its points.
    pub fn finish(mut self) -> Result<()> {
        self.flush()?;
        self.writer.finish().map_err(|e| Error::writing(self.path, e))?.commit()
    }
}

impl PointSink for ViewCloud<'_> {
    fn push(&mut self, point: &CloudPoint<'_>) -> Result<()> {
        const CHUNK: usize = 4096;
        self.chunk.positions.push(point.position);
        self.chunk.normals.push(point.normal);
        self.chunk.colors.push(point.color);
        if self.chunk.positions.len() == CHUNK { self.flush() } else { Ok(()) }
    }
}

/// Writes a MeshLab project: the cloud at `cloud`, and every photograph with its camera. Names are relative to the project's
/// folder.
///
/// # Errors
/// [`Error`] about `path` if it cannot be written.
pub fn write_meshlab(path: &Path, cloud: &Path, photographs: &[(&Path, &Camera)]) -> Result<()> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let name = |file: &Path| escaped(&name_relative_to(file, folder));
    let mut text = String::from("<!DOCTYPE MeshLabDocument>\n<MeshLabProject>\n <MeshGroup>\n");
    let cloud = name(cloud);
    let identity = "1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n";
    // Writing to a string cannot fail.
    let _ = writeln!(
        text,
        "  <MLMesh label=\"{cloud}\" filename=\"{cloud}\">\n   <MLMatrix44>\n{identity}</MLMatrix44>\n  </MLMesh>"
    );
    text.push_str(" </MeshGroup>\n <RasterGroup>\n");
    for (file, camera) in photographs {
        let _ = writeln!(
            text,
            "  <MLRaster label=\"{0}\">\n   {1}\n   <Plane semantic=\"\" fileName=\"{0}\"/>\n  </MLRaster>",
            name(file),
            shot(camera)
        );
    }
    text.push_str(" </RasterGroup>\n</MeshLabProject>\n");
    write_file(path, text.as_bytes())
}

/// A camera as MeshLab has it: y up, looking along -z, the translation is the negative centre, whole pixels.
fn shot(camera: &Camera) -> String {
    let (size, k, r, c) = (camera.size(), camera.k(), camera.rotation(), camera.center());
    let row = |i: usize, sign: f64| {
        let [x, y, z] = [0, 1, 2].map(|j| sign * r[(i, j)]);
        format!("{x} {y} {z} 0")
    };
    format!(
        "<VCGCamera TranslationVector=\"{} {} {} 1\" LensDistortion=\"0 0\" ViewportPx=\"{} {}\" PixelSizeMm=\"1 1\" \
         CenterPx=\"{} {}\" FocalMm=\"{}\" RotationMatrix=\"{} {} {} 0 0 0 1\"/>",
        -c.x,
        -c.y,
        -c.z,
        size.width,
        size.height,
        (k[(0, 2)] + 0.5).round(),
        (f64::from(size.height) - k[(1, 2)] - 0.5).round(),
        k[(0, 0)],
        row(0, 1.0),
        row(1, -1.0),
        row(2, -1.0)
    )
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Size;
    use nalgebra::{Matrix3, Vector3};

    #[test]
    fn near_is_bright_and_nothing_is_black() {
        let scratch = tempfile::tempdir().unwrap();
        let path = scratch.path().join("a.png");
        let plane = Grid::from_vec(Size::new(4, 1), vec![0.0, 1.0, 2.0, 3.0]).unwrap();
        write_picture(&path, &plane, true).unwrap();
        let read = image::open(&path).unwrap().into_luma8().into_raw();
        assert!(read[0] == 0 && read[1] == 255 && read[2] < read[1] && read[3] < read[1] && read[3] >= 32);
        write_picture(&path, &plane, false).unwrap();
        assert_eq!(image::open(&path).unwrap().into_luma8().into_raw()[1], 32);
        write_picture(&path, &Grid::filled(Size::new(2, 2), 0.0), true).unwrap();
        assert_eq!(image::open(&path).unwrap().into_luma8().into_raw(), [0; 4]);
    }

    #[test]
    fn a_project_names_its_files_from_its_folder() {
        let scratch = tempfile::tempdir().unwrap();
        let at = |name: &str| scratch.path().join(name);
        let k = Matrix3::new(50.0, 0.0, 9.5, 0.0, 50.0, 4.5, 0.0, 0.0, 1.0);
        let camera = Camera::new(Size::new(20, 10), k, Matrix3::identity(), Vector3::new(1.0, 2.0, 3.0));
        let photograph = at("images/a&b.jpg");
        write_meshlab(&at("out/x.mlp"), &at("out/x.ply"), &[(&photograph, &camera)]).unwrap();
        let text = std::fs::read_to_string(at("out/x.mlp")).unwrap();
        assert!(text.contains("filename=\"x.ply\"") && text.contains("fileName=\"../images/a&amp;b.jpg\""));
        assert!(text.contains("TranslationVector=\"-1 -2 -3 1\"") && text.contains("CenterPx=\"10 5\""));
        assert!(text.contains("RotationMatrix=\"1 0 0 0 -0 -1 -0 0 -0 -0 -1 0 0 0 0 1\""), "{text}");
    }
}
