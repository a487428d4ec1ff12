//! What is in an image, mask, label map or class table.

use super::bytes_of;
use crate::error::{Error, Result};
use crate::scene::LabelMap;
use crate::semantics::{ClassId, ClassTable};
use crate::store::images::{image_size, load_color};
use crate::store::labels::{count_classes, grey_ids};
use semvs_formats::Limits;
use serde::Serialize;
use std::collections::HashMap;
use std::path::Path;

/// A photograph, a mask or a label map.
#[derive(Clone, Debug, Serialize)]
pub struct PictureFacts {
    /// The file.
    pub file: String,
    /// Its size in bytes.
    pub bytes: u64,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Distinct colours with their numbers of pixels, most frequent first, when there are few, as in label maps.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub colors: Vec<ColorShare>,
    /// Distinct values of a grey PNG with their numbers of pixels, most frequent first, when there are few.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub ids: Vec<IdShare>,
}

impl PictureFacts {
    /// Whether this looks like a label map: a PNG of few colours or values.
    pub fn is_label_map(&self) -> bool {
        is_png(Path::new(&self.file)) && !(self.colors.is_empty() && self.ids.is_empty())
    }
}

fn is_png(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("png"))
}

/// A value of a label map.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct IdShare {
    /// The value.
    pub id: u16,
    /// Pixels.
    pub pixels: u64,
    /// The same as a share of all pixels.
    pub share: f64,
}

/// A colour of a label map.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ColorShare {
    /// Red, green, blue.
    pub color: [u8; 3],
    /// Pixels.
    pub pixels: u64,
    /// The same as a share of all pixels.
    pub share: f64,
}

/// More distinct values make a grey photograph, if all are below 256.
const MAX_IDS: usize = 64;
/// More distinct colours make a photograph.
const MAX_COLORS: usize = 256;

pub(super) fn inspect(path: &Path) -> Result<PictureFacts> {
    let size = image_size(path)?;
    let ids = if is_png(path) { grey_ids(path, Limits::default())? } else { None };
    let (colors, ids) = match ids {
        Some(ids) => (Vec::new(), id_shares(&ids)),
        None => (color_shares(path)?, Vec::new()),
    };
    Ok(PictureFacts {
        file: path.display().to_string(),
        bytes: bytes_of(path)?,
        width: size.width,
        height: size.height,
        colors,
        ids,
    })
}

/// The values of a grey image, if they are few.
fn id_shares(map: &LabelMap) -> Vec<IdShare> {
    let counts = count_classes(map);
    let most = if counts.keys().any(|id| id.0 > u16::from(u8::MAX)) { MAX_COLORS } else { MAX_IDS };
    if counts.len() > most {
        return Vec::new();
    }
    let area = map.data().len().max(1) as f64;
    let share = |(id, pixels): (ClassId, u64)| IdShare { id: id.0, pixels, share: pixels as f64 / area };
    let mut shares: Vec<IdShare> = counts.into_iter().map(share).collect();
    shares.sort_by_key(|s| (std::cmp::Reverse(s.pixels), s.id));
    shares
}

/// The colours of an image, if they are few.
fn color_shares(path: &Path) -> Result<Vec<ColorShare>> {
    let image = load_color(path)?;
    let mut counts: HashMap<[u8; 3], u64> = HashMap::new();
    for color in image.data() {
        *counts.entry(*color).or_default() += 1;
        if counts.len() > MAX_COLORS {
            counts.clear();
            break;
        }
    }
    let area = image.data().len().max(1) as f64;
    let mut colors: Vec<ColorShare> = counts
        .into_iter()
        .map(|(color, pixels)| ColorShare { color, pixels, share: pixels as f64 / area })
        .collect();
    colors.sort_by_key(|c| (std::cmp::Reverse(c.pixels), c.color));
    Ok(colors)
}

/// A class table.
#[derive(Clone, Debug, Serialize)]
pub struct ClassTableFacts {
    /// The file.
    pub file: String,
    /// Name in the table.
    pub name: String,
    /// Its classes by id.
    pub classes: Vec<ClassFacts>,
}

/// A class.
#[derive(Clone, Debug, Serialize)]
pub struct ClassFacts {
    /// Id.
    pub id: u16,
    /// Name.
    pub name: String,
    /// Colour in label maps.
    pub color: Option<[u8; 3]>,
    /// Whether its points are kept.
    pub keep: bool,
    /// ASPRS LAS class.
    pub las: Option<u8>,
}

/// Longest class table that is read.
const MAX_TABLE_BYTES: u64 = 64 << 20;

pub(super) fn inspect_table(path: &Path) -> Result<ClassTableFacts> {
    if bytes_of(path)? > MAX_TABLE_BYTES {
        return Err(Error::content(path, "too long for a class table"));
    }
    let text = std::fs::read_to_string(path).map_err(|e| Error::io(path, "read", e))?;
    let table = ClassTable::from_toml(&text, path)?;
    let classes = table
        .classes()
        .iter()
        .map(|c| ClassFacts { id: c.id.0, name: c.name.clone(), color: c.color, keep: c.keep, las: c.las })
        .collect();
    Ok(ClassTableFacts { file: path.display().to_string(), name: table.name().to_owned(), classes })
}
