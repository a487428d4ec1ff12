//! A cloud as PLY: what the file holds of every point, and the file while it is written.

use super::atomic::AtomicFile;
use super::cloud::{ClassPoints, CloudOptions, PlyLayout, WrittenCloud};
use super::cloud_output::POINTS_PER_CHUNK;
use crate::error::{Error, Result};
use crate::scene::{CloudLayout, CloudPoint};
use crate::semantics::ClassId;
use semvs_formats::ply::{self, Cloud, PlyWriter};
use std::collections::BTreeMap;
use std::path::PathBuf;

/// The columns and comments of a file of points that have `has`.
///
/// # Errors
/// The points lack what the layout needs; labels without classes.
pub(super) fn ply_layout(
    has: CloudLayout,
    options: &CloudOptions<'_>,
    label_colors: bool,
    classes: &BTreeMap<ClassId, ClassPoints>,
) -> Result<ply::Layout> {
    let colors = has.colors || label_colors;
    let mut layout = match options.layout {
        PlyLayout::Plain => ply::Layout::plain(colors, has.normals),
        PlyLayout::OpenMvsProject => {
            let plain = ply::Layout::plain(colors, has.normals);
            ply::Layout { type_names: ply::TypeNames::Sized, ..plain }
        }
        PlyLayout::Odm if options.doubles => {
            return Err(Error::invalid(
                "--ply-layout odm has no 64-bit coordinates; leave out --ply-doubles",
            ));
        }
        PlyLayout::Odm if has.views && colors && has.normals => return Ok(ply::Layout::odm()),
        PlyLayout::Odm => {
            return Err(Error::invalid("--ply-layout odm needs colours, normals and views; use plain"));
        }
        PlyLayout::OpenMvs if has.views => ply::Layout::openmvs(colors, has.normals, has.weights),
        PlyLayout::OpenMvs => {
            return Err(Error::invalid("these points have no views for --ply-layout openmvs; use plain"));
        }
    };
    if options.doubles {
        layout = layout.with_f64_positions();
    }
    if has.confidence {
        layout.fields.push(ply::Field::Confidence);
    }
    if has.labels {
        let table = options.table.ok_or_else(|| Error::invalid("labelled points without a class table"))?;
        let listed = table.classes().iter().map(|class| class.id);
        let wide = listed.chain(classes.keys().copied()).any(|id| id.0 > u16::from(u8::MAX));
        layout = layout.with_label(wide, true).with_comments(table.classes().iter().map(|class| {
            let [r, g, b] = table.color(class.id);
            // One word per name, so that every comment has the same number of words.
            let name = class.name.split_whitespace().collect::<Vec<_>>().join("_");
            format!("class {} {name} {r} {g} {b}", class.id)
        }));
    }
    Ok(layout)
}

/// A PLY file being written.
pub(super) struct PlyOutput {
    path: PathBuf,
    fields: Vec<ply::Field>,
    writer: PlyWriter<AtomicFile>,
    chunk: Cloud,
}

impl PlyOutput {
    /// Begins `file`.
    ///
    /// # Errors
    /// It cannot be written.
    pub(super) fn create(file: &WrittenCloud, layout: &ply::Layout) -> Result<Self> {
        let writer = PlyWriter::new(AtomicFile::create(&file.path)?, layout, file.points)
            .map_err(|e| Error::writing(&file.path, e))?;
        Ok(PlyOutput {
            path: file.path.clone(),
            fields: layout.fields.clone(),
            writer,
            chunk: Cloud::default(),
        })
    }

    /// Appends a point that goes to `place`.
    pub(super) fn take(&mut self, point: &CloudPoint<'_>, place: [f64; 3]) -> Result<()> {
        let chunk = &mut self.chunk;
        for field in &self.fields {
            match field {
                ply::Field::Position => chunk.positions.push(place.map(|v| v as f32)),
                ply::Field::PositionF64 => {
                    chunk.positions.push(place.map(|v| v as f32));
                    chunk.positions_f64.push(place);
                }
                ply::Field::Color => chunk.colors.push(point.color),
                ply::Field::Normal => chunk.normals.push(point.normal),
                ply::Field::LabelU8 | ply::Field::LabelU16 => chunk.labels.push(point.label),
                ply::Field::LabelConfidence => chunk.label_confidence.push(point.label_confidence),
                ply::Field::Confidence => chunk.confidence.push(point.confidence),
                ply::Field::ViewIndices => {
                    let views = &mut chunk.views;
                    if views.offsets.is_empty() {
                        views.offsets.push(0);
                    }
                    views.images.extend(point.views.iter().map(|view| view.0));
                    views.offsets.push(views.images.len() as u64);
                }
                ply::Field::ViewWeights => chunk.views.weights.extend_from_slice(point.weights),
                ply::Field::ViewCount => chunk.view_counts.push(point.views.len() as u32),
                ply::Field::Value => chunk.value.push(0.0),
            }
        }
        if chunk.positions.len() >= POINTS_PER_CHUNK { self.flush() } else { Ok(()) }
    }

    fn flush(&mut self) -> Result<()> {
        self.writer.write(&self.chunk).map_err(|e| Error::writing(&self.path, e))?;
        self.chunk.clear();
        Ok(())
    }

    /// The complete file, not yet under its name.
    pub(super) fn finish(mut self) -> Result<AtomicFile> {
        self.flush()?;
        self.writer.finish().map_err(|e| Error::writing(&self.path, e))
    }
}
