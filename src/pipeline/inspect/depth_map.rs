//! What is in a depth map file.

use super::bytes_of;
use super::values::{Bar, Range, RangeOf, histogram};
use crate::error::{Error, Result};
use semvs_formats::Limits;
use semvs_formats::dmap::{DepthMapFile, read_header};
use serde::Serialize;
use std::path::Path;

/// A `.dmap` file.
#[derive(Clone, Debug, Serialize)]
pub struct DepthMapFacts {
    /// The file.
    pub file: String,
    /// Its size in bytes.
    pub bytes: u64,
    /// `DR`, or `D2` with quantised values.
    pub version: &'static str,
    /// Reference image as stored.
    pub image: String,
    /// Columns and rows of the image that the camera refers to.
    pub image_size: [u32; 2],
    /// Columns and rows of the maps.
    pub size: [u32; 2],
    /// Global ID of the reference image.
    pub id: Option<u32>,
    /// Global IDs of the images it was matched with, best first.
    pub sources: Vec<u32>,
    /// Focal lengths in pixels of the image size.
    pub focal: [f64; 2],
    /// Principal point.
    pub principal_point: [f64; 2],
    /// Camera centre in the world.
    pub center: [f64; 3],
    /// Depths allowed.
    pub depth_range: [f32; 2],
    /// Pixels with a depth.
    pub valid: u64,
    /// The same as a share of all pixels.
    pub valid_share: f64,
    /// Depths.
    pub depth: Option<Range>,
    /// How many pixels have which depth.
    pub depth_histogram: Vec<Bar>,
    /// Whether there are normals.
    pub normals: bool,
    /// Confidences of the pixels with a depth.
    pub confidence: Option<Range>,
    /// How many of them have which.
    pub confidence_histogram: Vec<Bar>,
    /// Whether the images of every pixel are stored.
    pub views: bool,
}

pub(super) fn inspect(path: &Path) -> Result<DepthMapFacts> {
    let limits = Limits::default();
    let header = read_header(path, &limits).map_err(|e| Error::format(path, e))?;
    let map = DepthMapFile::read(path, &limits).map_err(|e| Error::format(path, e))?;
    let (mut depth, mut confidence) = (RangeOf::new(), RangeOf::new());
    let mut valid = 0;
    for (i, &d) in map.depth.iter().enumerate() {
        if d > 0.0 {
            valid += 1;
            depth.add(f64::from(d));
            map.confidence.get(i).into_iter().for_each(|&c| confidence.add(f64::from(c)));
        }
    }
    let with_depth = || map.depth.iter().copied().enumerate().filter(|(_, d)| *d > 0.0);
    let bars = depth.range().map(|range| histogram(with_depth().map(|(_, d)| d), range.min, range.max));
    let confidences = with_depth().filter_map(|(i, _)| map.confidence.get(i).copied());
    let k = &header.k;
    Ok(DepthMapFacts {
        file: path.display().to_string(),
        bytes: bytes_of(path)?,
        version: if header.quantized { "D2" } else { "DR" },
        image: String::from_utf8_lossy(&header.image_name).into_owned(),
        image_size: [header.image_width, header.image_height],
        size: [header.width, header.height],
        id: header.ids.first().copied(),
        sources: header.ids.iter().skip(1).copied().collect(),
        focal: [k[0], k[4]],
        principal_point: [k[2], k[5]],
        center: header.center,
        depth_range: [header.depth_min, header.depth_max],
        valid,
        valid_share: valid as f64 / map.depth.len().max(1) as f64,
        depth: depth.range(),
        depth_histogram: bars.unwrap_or_default(),
        normals: header.has_normal,
        confidence: confidence.range(),
        confidence_histogram: histogram(confidences, 0.0, 1.0),
        views: header.has_views,
    })
}
