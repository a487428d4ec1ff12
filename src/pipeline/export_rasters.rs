//! Depth maps as PFM, NPY and PNG files.

use super::export::names_below_common_folder;
use super::import::row;
use crate::error::{Error, Result};
use crate::progress::Progress;
use crate::report::RunReport;
use crate::store::depth_store::{read_depth_header, read_depth_map};
use crate::store::rasters::{RasterFormat, write_normals, write_plane};
use rayon::prelude::*;
use semvs_formats::Limits;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// `export` of depth maps.
#[derive(Clone, Debug)]
pub struct ExportRastersJob {
    /// The depth maps (`.dmap`).
    pub depth_maps: Vec<PathBuf>,
    /// Folder to write.
    pub output: PathBuf,
    /// Kind of file.
    pub format: RasterFormat,
    /// Which maps.
    pub planes: Planes,
    /// Values of PNG files are depth times this.
    pub depth_scale: f32,
}

/// Which maps of a depth map file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Planes {
    /// `NAME.pfm`
    pub depth: bool,
    /// `NAME.normal.pfm`
    pub normal: bool,
    /// `NAME.confidence.pfm`
    pub confidence: bool,
}

/// Writes the maps, named like the images of the depth maps: `NAME.EXT`, `NAME.normal.EXT`, `NAME.confidence.EXT`.
///
/// # Errors
/// Unreadable files; two depth maps of images of one name; a plane that a depth map lacks; a place that cannot be
/// written.
pub fn export_rasters(job: &ExportRastersJob, progress: &Progress) -> Result<RunReport> {
    if !(job.depth_scale.is_finite() && job.depth_scale > 0.0) {
        return Err(Error::invalid("--depth-scale must be above 0"));
    }
    if job.format == RasterFormat::Png && (job.planes.normal || job.planes.confidence) {
        return Err(Error::invalid("--planes: PNG files hold depths only; use pfm or npy for the others"));
    }
    let names = stems(&job.depth_maps)?;
    let written = job.depth_maps.par_iter().zip(&names).map(|(path, name)| write(job, path, name, progress));
    let paths: Vec<PathBuf> = written.collect::<Result<Vec<_>>>()?.into_iter().flatten().collect();
    let outputs = paths.iter().map(|path| row(path, "map", None)).collect();
    Ok(RunReport { outputs, ..RunReport::default() })
}

/// The names of the maps' images, without extension.
fn stems(maps: &[PathBuf]) -> Result<Vec<String>> {
    let mut images = Vec::with_capacity(maps.len());
    for path in maps {
        let header = read_depth_header(path, Limits::default())?;
        let name = String::from_utf8_lossy(&header.image_name).into_owned();
        let image = path.parent().unwrap_or(Path::new("")).join(crate::store::paths::clean_name(&name));
        let absolute = std::path::absolute(&image).unwrap_or(image);
        images.push(
            PathBuf::from(crate::store::paths::clean_name(&absolute.to_string_lossy())).with_extension(""),
        );
    }
    let names = names_below_common_folder(&images);
    let mut taken: BTreeMap<&str, &Path> = BTreeMap::new();
    for (name, path) in names.iter().zip(maps) {
        if let Some(other) = taken.insert(name, path) {
            let what =
                format!("its image has the same name as that of {}; export them one by one", other.display());
            return Err(Error::content(path, what));
        }
    }
    Ok(names)
}

/// Writes one depth map; returns the files.
fn write(job: &ExportRastersJob, path: &Path, name: &str, progress: &Progress) -> Result<Vec<PathBuf>> {
    let estimate = read_depth_map(path, Limits::default())?;
    let file = |part: &str| job.output.join(format!("{name}{part}.{}", job.format.extension()));
    let lacks = |plane: &str| Error::content(path, format!("it has no {plane}; leave it out of --planes"));
    let mut files = Vec::new();
    if job.planes.depth {
        files.push(file(""));
        let lost = write_plane(&file(""), job.format, &estimate.depth, job.depth_scale)?;
        if lost > 0 {
            progress.warn(format!(
                "{}: {lost} depths do not fit into 16 bits times {} and are left out (--depth-scale)",
                file("").display(),
                job.depth_scale
            ));
        }
    }
    if job.planes.normal {
        let normals = estimate.normal.as_ref().ok_or_else(|| lacks("normals"))?;
        files.push(file(".normal"));
        write_normals(&file(".normal"), job.format, normals)?;
    }
    if job.planes.confidence {
        let confidence = estimate.confidence.as_ref().ok_or_else(|| lacks("confidence"))?;
        files.push(file(".confidence"));
        write_plane(&file(".confidence"), job.format, confidence, 1.0)?;
    }
    Ok(files)
}
