//! What is in a file, told from its content.

mod cloud;
mod depth_map;
mod las;
mod picture;
mod scene;
mod values;

pub use cloud::CloudFacts;
pub use depth_map::DepthMapFacts;
pub use las::LasFacts;
pub use picture::{ClassFacts, ClassTableFacts, ColorShare, IdShare, PictureFacts};
pub use scene::{CameraFacts, ImageFacts, PointFacts, RoiFacts, SceneFacts};
pub use values::{Bar, Bounds, Range};

use crate::error::{Error, Result};
use serde::Serialize;
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// What a file holds.
#[derive(Clone, Debug, Serialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum Inspection {
    /// `.mvs`
    Scene(SceneFacts),
    /// `.dmap`
    DepthMap(DepthMapFacts),
    /// `.ply`
    Cloud(CloudFacts),
    /// `.las`, `.laz`
    LasCloud(LasFacts),
    /// A photograph.
    Image(PictureFacts),
    /// A PNG of few colours or values: label maps and masks look so.
    LabelMap(PictureFacts),
    /// `.toml`
    ClassTable(ClassTableFacts),
}

/// Finds out what `path` holds.
///
/// # Errors
/// The file is unreadable, damaged, or of no known kind.
pub fn inspect(path: &Path) -> Result<Inspection> {
    let mut head = Vec::new();
    let file = File::open(path).map_err(|e| Error::io(path, "open", e))?;
    file.take(8).read_to_end(&mut head).map_err(|e| Error::io(path, "read", e))?;
    let extension = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
    match head.as_slice() {
        [b'M', b'V', b'S', b'I' | 0, ..] => scene::inspect(path).map(Inspection::Scene),
        [b'D', b'R' | b'2', ..] => depth_map::inspect(path).map(Inspection::DepthMap),
        [b'p', b'l', b'y', b'\n' | b'\r', ..] => cloud::inspect(path).map(Inspection::Cloud),
        [b'L', b'A', b'S', b'F', ..] => las::inspect(path).map(Inspection::LasCloud),
        _ => match extension.as_str() {
            "mvs" => scene::inspect(path).map(Inspection::Scene),
            "dmap" => depth_map::inspect(path).map(Inspection::DepthMap),
            "ply" => cloud::inspect(path).map(Inspection::Cloud),
            "las" | "laz" => las::inspect(path).map(Inspection::LasCloud),
            "toml" => picture::inspect_table(path).map(Inspection::ClassTable),
            "png" | "jpg" | "jpeg" | "tif" | "tiff" | "bmp" | "pgm" | "ppm" | "pnm" => picture::inspect(path)
                .map(|facts| match facts.is_label_map() {
                    true => Inspection::LabelMap(facts),
                    false => Inspection::Image(facts),
                }),
            _ => Err(Error::content(
                path,
                "not a kind of file known here: scene (.mvs), depth map (.dmap), cloud (.ply, .las, .laz), image, class \
                 table (.toml)",
            )),
        },
    }
}

/// Size of a file in bytes.
fn bytes_of(path: &Path) -> Result<u64> {
    Ok(std::fs::metadata(path).map_err(|e| Error::io(path, "read", e))?.len())
}
