//! A cloud of points in memory.

use super::ClassTable;
use crate::error::{Error, Result};
use crate::geometry::Placement;
use crate::progress::Progress;
use crate::scene::{CloudLayout, CloudPoint, PointCloud, PointSink, PointSource};
use crate::store::cloud::{CloudFormat, CloudOptions, write_clouds};
use crate::store::ply_source::PlySource;
use semvs_formats::Limits;
use std::path::Path;

/// Points with what is known of each.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cloud {
    pub(super) points: PointCloud,
    /// Where the origin of `points` is.
    pub(super) origin: [f64; 3],
    /// What the labels mean.
    pub(super) classes: Option<ClassTable>,
}

/// A point of a [`Cloud`].
#[derive(Clone, Copy, Debug)]
pub struct Point<'a> {
    point: CloudPoint<'a>,
    has: CloudLayout,
    origin: [f64; 3],
}

impl Cloud {
    /// Reads a PLY file with whatever attributes of points this crate knows.
    ///
    /// # Errors
    /// [`Error`]: not there, not a PLY file of points, damaged.
    pub fn read(path: impl AsRef<Path>) -> Result<Self> {
        let source = PlySource::open(path.as_ref(), Limits::default())?;
        let mut points = PointCloud::new(source.layout());
        source.for_each(&mut |point| points.push(point))?;
        let classes = source.listed_classes()?.map(ClassTable);
        Ok(Cloud { points, origin: source.origin(), classes })
    }

    /// Writes a `.ply`, `.las` or `.laz` file, as the name says, whole or not at all. A labelled cloud gets a picture of its
    /// classes beside it. PLY files have single precision near the origin of the scene and doubles far from it.
    ///
    /// # Errors
    /// [`Error`]: another extension, no points, a place that cannot be written.
    pub fn write(&self, path: impl AsRef<Path>) -> Result<()> {
        let path = path.as_ref();
        if CloudFormat::named(path).is_none() {
            let what = "clouds are written as .ply, .las or .laz; end the name so";
            return Err(Error::content(path, what));
        }
        if self.is_empty() {
            return Err(Error::content(path, "not written, the cloud has no points"));
        }
        let unnamed = ClassTable(crate::semantics::ClassTable::ids());
        let options = CloudOptions {
            table: self.points.layout().labels.then(|| &self.classes.as_ref().unwrap_or(&unnamed).0),
            doubles: CloudFormat::of(path) == CloudFormat::Ply && !self.fits_singles(),
            placement: Placement::shift(self.origin),
            ..CloudOptions::default()
        };
        write_clouds(&self.points, path, &options, &Progress::silent()).map(drop)
    }

    /// Whether single precision does for the coordinates in the scene.
    fn fits_singles(&self) -> bool {
        /// Coordinates that are not larger cost less than they carry.
        const NEAR: f64 = 1000.0;
        self.origin.iter().all(|v| v.abs() <= NEAR)
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.points.iter().len()
    }

    /// Whether there is no point.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// All points in order.
    pub fn points(&self) -> impl ExactSizeIterator<Item = Point<'_>> {
        let (has, origin) = (self.points.layout(), self.origin);
        self.points.iter().map(move |point| Point { point, has, origin })
    }

    /// What the labels mean, if the points have labels whose classes are known.
    pub fn classes(&self) -> Option<&ClassTable> {
        self.classes.as_ref()
    }
}

impl Point<'_> {
    /// Position in the world, scene units.
    pub fn position(&self) -> [f64; 3] {
        std::array::from_fn(|i| self.origin[i] + f64::from(self.point.position[i]))
    }

    /// Unit normal in the world, facing the cameras.
    pub fn normal(&self) -> Option<[f32; 3]> {
        self.has.normals.then_some(self.point.normal)
    }

    /// Red, green, blue.
    pub fn color(&self) -> Option<[u8; 3]> {
        self.has.colors.then_some(self.point.color)
    }

    /// The views that the point was made from, as positions in what was fused, ascending.
    pub fn views(&self) -> impl ExactSizeIterator<Item = u32> {
        self.point.views.iter().map(|view| view.0)
    }

    /// Confidence of the depth; points straight from a depth map have it.
    pub fn confidence(&self) -> Option<f32> {
        self.has.confidence.then_some(self.point.confidence)
    }

    /// Number of the class, 0 for void.
    pub fn label(&self) -> Option<u16> {
        self.has.labels.then_some(self.point.label)
    }

    /// How certain the class is, 0 to 1.
    pub fn label_confidence(&self) -> Option<f32> {
        self.has.labels.then_some(self.point.label_confidence)
    }
}
