//! A cloud as LAS or LAZ: what the file holds of every point, and the file while it is written.

use super::atomic::AtomicFile;
use super::cloud::{CloudFormat, CloudOptions, WrittenCloud};
use super::cloud_output::POINTS_PER_CHUNK;
use super::survey::Survey;
use crate::error::{Error, Result};
use crate::scene::{CloudLayout, CloudPoint};
use crate::semantics::{ClassId, ClassTable};
use semvs_formats::las::{Extra, Frame, Header, LasPoint, LasWriter, Layout};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Refuses a table with a kept class for which there is no classification code.
///
/// # Errors
/// [`Error::Invalid`] naming the first.
pub(super) fn check_codes(table: &ClassTable, is_kept: impl Fn(&ClassId) -> bool) -> Result<()> {
    let mut kept = table.classes().iter().map(|class| class.id).filter(is_kept);
    match kept.find(|&id| table.las_code(id).is_none()) {
        Some(id) => Err(no_code(table, id)),
        None => Ok(()),
    }
}

fn no_code(table: &ClassTable, id: ClassId) -> Error {
    Error::invalid(format!(
        "class {id} {:?} of class table {} has no LAS code, and 64 + {id} does not fit in 0..=255: give it `las = CODE` in \
         the table, exclude it, or write .ply",
        table.class_name(id),
        table.name()
    ))
}

/// What a file holds of every point, and what it says of itself.
pub(super) struct LasColumns {
    layout: Layout,
    header: Header,
    codes: BTreeMap<u16, u8>,
}

impl LasColumns {
    /// The columns of the file at `path`, of points that have `has`; those of `class` alone, if one is given.
    ///
    /// # Errors
    /// Labels without a class table, a class without a code, coordinates that do not fit.
    pub(super) fn new(
        path: &Path,
        has: CloudLayout,
        options: &CloudOptions<'_>,
        class: Option<ClassId>,
        survey: &Survey,
    ) -> Result<Self> {
        let extras = [
            (has.normals && !options.las_without_normals, Extra::Normal),
            (has.labels, Extra::Label),
            (has.labels, Extra::LabelConfidence),
            (has.confidence, Extra::Confidence),
            (has.views, Extra::Views),
        ];
        let mut codes = BTreeMap::new();
        let mut class_names = Vec::new();
        if has.labels {
            let table =
                options.table.ok_or_else(|| Error::invalid("labelled points without a class table"))?;
            for &id in survey.classes.keys() {
                let code = table.las_code(id).ok_or_else(|| no_code(table, id))?;
                codes.insert(id.0, code);
                class_names.push((code, table.class_name(id).into_owned()));
            }
        }
        let fitted = |e| Error::format(path, e);
        // All parts of a cloud are on one grid.
        let frame = Frame::fitting(survey.bounds(None).unwrap_or_default()).map_err(fitted)?;
        let points = match class {
            Some(class) => survey.classes.get(&class).map_or(0, |class| class.points),
            None => survey.points,
        };
        Ok(LasColumns {
            layout: Layout {
                compressed: CloudFormat::of(path) == CloudFormat::Laz,
                colors: has.colors,
                extras: extras.into_iter().filter(|(has, _)| *has).map(|(_, extra)| extra).collect(),
                class_names,
            },
            header: Header {
                frame,
                bounds: survey.bounds(class).unwrap_or_default(),
                points,
                software: concat!("semvs ", env!("CARGO_PKG_VERSION")).to_owned(),
            },
            codes,
        })
    }
}

/// A LAS or LAZ file being written.
pub(super) struct LasOutput {
    path: PathBuf,
    writer: LasWriter<AtomicFile>,
    codes: BTreeMap<u16, u8>,
    chunk: Vec<LasPoint>,
}

impl LasOutput {
    /// Begins `file`.
    ///
    /// # Errors
    /// It cannot be written.
    pub(super) fn create(file: &WrittenCloud, columns: &LasColumns) -> Result<Self> {
        let writer = LasWriter::new(AtomicFile::create(&file.path)?, &columns.layout, &columns.header)
            .map_err(|e| Error::writing(&file.path, e))?;
        let (path, codes) = (file.path.clone(), columns.codes.clone());
        Ok(LasOutput { path, writer, codes, chunk: Vec::with_capacity(POINTS_PER_CHUNK) })
    }

    /// Appends a point that goes to `place`.
    pub(super) fn take(&mut self, point: &CloudPoint<'_>, place: [f64; 3]) -> Result<()> {
        self.chunk.push(LasPoint {
            position: place,
            // Without labels no point has ever been classified: code 0.
            classification: self.codes.get(&point.label).copied().unwrap_or_default(),
            color: point.color,
            normal: point.normal,
            label: point.label,
            label_confidence: point.label_confidence,
            confidence: point.confidence,
            views: u16::try_from(point.views.len()).unwrap_or(u16::MAX),
        });
        if self.chunk.len() >= POINTS_PER_CHUNK { self.flush() } else { Ok(()) }
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
