//! What a LAS or LAZ file says of itself.

use super::bytes_of;
use super::values::Bounds;
use crate::error::{Error, Result};
use semvs_formats::Limits;
use semvs_formats::las::LasInfo;
use serde::Serialize;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufReader;
use std::path::Path;

/// A `.las` or `.laz` file.
#[derive(Clone, Debug, Serialize)]
pub struct LasFacts {
    /// The file.
    pub file: String,
    /// Its size in bytes.
    pub bytes: u64,
    /// Version of the format, such as `1.4`.
    pub version: String,
    /// Point record format.
    pub point_format: u8,
    /// Whether the points are compressed.
    pub compressed: bool,
    /// Points.
    pub points: u64,
    /// Steps of the coordinates.
    pub scale: [f64; 3],
    /// Coordinates of the integers 0.
    pub offset: [f64; 3],
    /// Box around the points, by the header's word.
    pub bounds: Option<Bounds>,
    /// Extra bytes of a point: type and name.
    pub extra_bytes: Vec<String>,
    /// Names of classification codes.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub classes: BTreeMap<u8, String>,
    /// Program that made it.
    pub software: String,
}

pub(super) fn inspect(path: &Path) -> Result<LasFacts> {
    let file = File::open(path).map_err(|e| Error::io(path, "open", e))?;
    let info = LasInfo::read(BufReader::new(file), &Limits::default()).map_err(|e| Error::format(path, e))?;
    Ok(LasFacts {
        file: path.display().to_string(),
        bytes: bytes_of(path)?,
        version: format!("{}.{}", info.version.0, info.version.1),
        point_format: info.format,
        compressed: info.compressed,
        points: info.points,
        scale: info.scale,
        offset: info.offset,
        bounds: Bounds::of(info.bounds),
        extra_bytes: info.extras,
        classes: info.class_names.into_iter().collect(),
        software: info.software,
    })
}
