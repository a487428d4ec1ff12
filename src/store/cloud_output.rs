//! A file of a cloud while it is written.

use super::atomic::AtomicFile;
use super::cloud::{CloudOptions, Job};
use super::las_cloud::{LasColumns, LasOutput};
use super::ply_cloud::PlyOutput;
use crate::error::Result;
use crate::geometry::Placement;
use crate::scene::CloudPoint;
use crate::semantics::{ClassId, ClassTable};
use semvs_formats::ply;

/// What a file holds of every point, and how.
pub(super) enum Columns {
    /// As PLY.
    Ply(ply::Layout),
    /// As LAS or LAZ.
    Las(LasColumns),
}

/// Points that a file's columns hold before they are encoded.
pub(super) const POINTS_PER_CHUNK: usize = 4096;

/// A file being written.
pub(super) struct Output<'a> {
    /// The only class in it.
    class: Option<ClassId>,
    /// The classes whose colours its points get.
    colors: Option<&'a ClassTable>,
    placement: Placement,
    file: Format,
}

enum Format {
    Ply(Box<PlyOutput>),
    Las(Box<LasOutput>),
}

impl<'a> Output<'a> {
    /// Begins the file of `job`.
    ///
    /// # Errors
    /// It cannot be written.
    pub(super) fn create(job: &Job, options: &CloudOptions<'a>) -> Result<Self> {
        let file = match &job.columns {
            Columns::Ply(layout) => Format::Ply(Box::new(PlyOutput::create(&job.file, layout)?)),
            Columns::Las(columns) => Format::Las(Box::new(LasOutput::create(&job.file, columns)?)),
        };
        let colors = options.table.filter(|_| job.file.label_colors);
        Ok(Output { class: job.file.class, colors, placement: options.placement, file })
    }

    /// Appends a point if it belongs in this file.
    ///
    /// # Errors
    /// The file cannot be written.
    pub(super) fn take(&mut self, point: &CloudPoint<'_>) -> Result<()> {
        if self.class.is_some_and(|class| class.0 != point.label) {
            return Ok(());
        }
        let color = self.colors.map_or(point.color, |table| table.color(ClassId(point.label)));
        let normal = self.placement.turn(point.normal);
        let point = CloudPoint { color, normal, ..*point };
        let place = self.placement.place(point.position);
        match &mut self.file {
            Format::Ply(file) => file.take(&point, place),
            Format::Las(file) => file.take(&point, place),
        }
    }

    /// The complete file, not yet under its name.
    ///
    /// # Errors
    /// The file cannot be written, or it got fewer points than it should.
    pub(super) fn finish(self) -> Result<AtomicFile> {
        match self.file {
            Format::Ply(file) => file.finish(),
            Format::Las(file) => file.finish(),
        }
    }
}
