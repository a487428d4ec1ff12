//! Label maps as PNG files.

use super::atomic::AtomicFile;
use crate::error::{Error, Result};
use crate::scene::LabelMap;
use crate::semantics::{ClassId, ClassTable};
use std::collections::HashMap;
use std::path::Path;

/// What the pixels of a written label map hold.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LabelEncoding {
    /// The colours of the class table.
    #[default]
    Colors,
    /// The ids, as grey values of 8 bits, or 16 where an id needs them.
    Ids,
}

/// Writes a label map as PNG, whole or not at all, in a form that reading with the same table gives back. Colours need a
/// table in which every class that occurs has its own.
///
/// # Errors
/// A class without a colour of its own; the file cannot be written.
pub fn write_label_map(
    path: &Path,
    labels: &LabelMap,
    table: &ClassTable,
    encoding: LabelEncoding,
) -> Result<()> {
    let bytes = match encoding {
        LabelEncoding::Colors => color_bytes(path, labels, table)?,
        LabelEncoding::Ids if labels.data().iter().all(|&id| id <= u16::from(u8::MAX)) => {
            labels.data().iter().map(|&id| id as u8).collect()
        }
        LabelEncoding::Ids => labels.data().iter().flat_map(|id| id.to_be_bytes()).collect(),
    };
    let (color, depth) = match (encoding, bytes.len() / labels.size().area().max(1)) {
        (LabelEncoding::Colors, _) => (png::ColorType::Rgb, png::BitDepth::Eight),
        (LabelEncoding::Ids, 2) => (png::ColorType::Grayscale, png::BitDepth::Sixteen),
        (LabelEncoding::Ids, _) => (png::ColorType::Grayscale, png::BitDepth::Eight),
    };
    let failed = |e: png::EncodingError| match e {
        png::EncodingError::IoError(e) => Error::io(path, "write", e),
        e => Error::content(path, format!("cannot write: {e}")),
    };
    let mut file = AtomicFile::create(path)?;
    let mut encoder = png::Encoder::new(&mut file, labels.size().width, labels.size().height);
    encoder.set_color(color);
    encoder.set_depth(depth);
    let mut writer = encoder.write_header().map_err(failed)?;
    writer.write_image_data(&bytes).map_err(failed)?;
    writer.finish().map_err(failed)?;
    file.commit()
}

/// [`ClassTable::colors`].
type Colors = HashMap<[u8; 3], ClassId>;

/// The colour by which a map of `table` tells class `id`.
fn color_of(table: &ClassTable, colors: &Colors, id: ClassId) -> Option<[u8; 3]> {
    if id.is_void() {
        return colors.iter().filter(|(_, id)| id.is_void()).map(|(color, _)| *color).min();
    }
    let color = table.get(id)?.color?;
    (colors.get(&color) == Some(&id)).then_some(color)
}

fn color_bytes(path: &Path, labels: &LabelMap, table: &ClassTable) -> Result<Vec<u8>> {
    let colors = table.colors();
    let mut bytes = Vec::with_capacity(labels.size().area() * 3);
    for run in labels.data().chunk_by(|a, b| a == b) {
        let id = ClassId(run[0]);
        let color = color_of(table, &colors, id).ok_or_else(|| {
            let what = format!(
                "class {id} has no colour of its own in class table {}; write ids (--ids)",
                table.name()
            );
            Error::content(path, what)
        })?;
        run.iter().for_each(|_| bytes.extend(color));
    }
    Ok(bytes)
}

/// Whether every class of `table` can be told by its colour, void included.
pub fn has_colors(table: &ClassTable) -> bool {
    let colors = table.colors();
    let ids = table.classes().iter().map(|class| class.id);
    ids.chain([ClassId::VOID]).all(|id| color_of(table, &colors, id).is_some())
}
