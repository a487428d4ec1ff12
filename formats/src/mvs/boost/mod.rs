//! Boost.Serialization archives without header, as far as native projects need them: primitives, and the
//! class information that precedes the first object of each class.

mod binary;
mod text;

pub(super) use binary::{BinarySink, BinarySource};
pub(super) use text::{TextSink, TextSource};

use crate::Result;
use crate::wire::Place;

/// Names under which the objects of a project are known to an archive; two fields share their class information
/// exactly if they share a name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub(super) enum Class {
    Scene,
    PlatformList,
    Platform,
    String,
    CameraList,
    Camera,
    KMatrix,
    RMatrix,
    Matx33d,
    Point3d,
    CvPoint3d,
    PoseList,
    Pose,
    ImageList,
    Image,
    ViewScoreList,
    ViewScore,
    PointCloud,
    PointList,
    Point3f,
    CvPoint3f,
    ViewsList,
    ViewArr,
    WeightsList,
    WeightArr,
    ColorList,
    Pixel,
    Mesh,
    MeshPointList,
    FaceList,
    Point3u,
    CvPoint3u,
    IdxListList,
    IdxList,
    BoolList,
    TexCoordList,
    Point2f,
    CvPoint2f,
    TexIndexList,
    TextureList,
    Image8U3,
    DMatrix8U3,
    CvMat8U3,
    Obb,
    EMat33f,
    EVec3f,
}

/// The classes that an archive has met.
#[derive(Default)]
pub(super) struct Classes(u64);

impl Classes {
    /// Whether `class` is met for the first time; it is known from now on.
    fn is_new(&mut self, class: Class) -> bool {
        let bit = 1 << class as u8;
        let new = self.0 & bit == 0;
        self.0 |= bit;
        new
    }
}

/// What a project is read from: the primitives of an archive. Counts are checked and memory is charged by `room`
/// and by the methods that fill vectors.
pub(super) trait Source {
    fn classes(&mut self) -> &mut Classes;
    fn u8(&mut self, place: &Place<'_>) -> Result<u8>;
    fn u32(&mut self, place: &Place<'_>) -> Result<u32>;
    fn u64(&mut self, place: &Place<'_>) -> Result<u64>;
    fn f32(&mut self, place: &Place<'_>) -> Result<f32>;
    fn f64(&mut self, place: &Place<'_>) -> Result<f64>;
    /// Raw string: a name or a path.
    fn string(&mut self, place: &Place<'_>) -> Result<Vec<u8>>;
    /// Makes room for `count` elements that take at least `min_size` bytes in a binary archive.
    fn room<T>(&mut self, out: &mut Vec<T>, count: u64, min_size: u64, place: &Place<'_>) -> Result<usize>;
    /// Appends an element, for which `room` may not have made room yet.
    fn push<T>(&mut self, out: &mut Vec<T>, element: T, place: &Place<'_>) -> Result<()>;
    fn u8s(&mut self, out: &mut Vec<u8>, count: u64, place: &Place<'_>) -> Result<()>;
    fn u32s(&mut self, out: &mut Vec<u32>, count: u64, place: &Place<'_>) -> Result<()>;
    fn f32s(&mut self, out: &mut Vec<f32>, count: u64, place: &Place<'_>) -> Result<()>;
    fn vectors(&mut self, out: &mut Vec<[f32; 3]>, count: u64, place: &Place<'_>) -> Result<()>;
    fn triples(&mut self, out: &mut Vec<[u32; 3]>, count: u64, place: &Place<'_>) -> Result<()>;
    /// Colours, each with the constant 3 before it; on file blue, green, red.
    fn colors(&mut self, out: &mut Vec<[u8; 3]>, count: u64, place: &Place<'_>) -> Result<()>;
    /// An [`crate::Error::Format`] at the current offset.
    fn error(&self, place: &Place<'_>, what: String) -> crate::Error;

    /// Class information, if this is the first object of `class`.
    fn class(&mut self, class: Class, place: &Place<'_>) -> Result<()> {
        if !self.classes().is_new(class) {
            return Ok(());
        }
        let (tracking, version) = (self.u8(place)?, self.u32(place)?);
        if tracking != 0 || version != 0 {
            let what =
                format!("class {class:?} with tracking {tracking} and version {version}, both must be 0");
            return Err(self.error(place, what));
        }
        Ok(())
    }

    /// A number that every file stores as `expected`.
    fn constant(&mut self, expected: u64, place: &Place<'_>) -> Result<()> {
        match self.u64(place)? {
            found if found == expected => Ok(()),
            found => Err(self.error(place, format!("{found} where every file has {expected}"))),
        }
    }

    fn f32_array<const N: usize>(&mut self, place: &Place<'_>) -> Result<[f32; N]> {
        let mut out = [0.0; N];
        out.iter_mut().try_for_each(|v| self.f32(place).map(|f| *v = f))?;
        Ok(out)
    }

    fn f64_array<const N: usize>(&mut self, place: &Place<'_>) -> Result<[f64; N]> {
        let mut out = [0.0; N];
        out.iter_mut().try_for_each(|v| self.f64(place).map(|f| *v = f))?;
        Ok(out)
    }
}

/// What a project is written to.
pub(super) trait Sink {
    fn classes(&mut self) -> &mut Classes;
    fn u8(&mut self, value: u8) -> Result<()>;
    fn u32(&mut self, value: u32) -> Result<()>;
    fn u64(&mut self, value: u64) -> Result<()>;
    fn f32(&mut self, value: f32) -> Result<()>;
    fn f64(&mut self, value: f64) -> Result<()>;
    fn string(&mut self, value: &[u8]) -> Result<()>;

    /// Class information, if this is the first object of `class`.
    fn class(&mut self, class: Class) -> Result<()> {
        if self.classes().is_new(class) {
            self.u8(0)?;
            self.u32(0)?;
        }
        Ok(())
    }

    fn u32s(&mut self, values: &[u32]) -> Result<()> {
        values.iter().try_for_each(|&v| self.u32(v))
    }

    fn f32s(&mut self, values: &[f32]) -> Result<()> {
        values.iter().try_for_each(|&v| self.f32(v))
    }

    fn f64s(&mut self, values: &[f64]) -> Result<()> {
        values.iter().try_for_each(|&v| self.f64(v))
    }

    /// A colour with its constant; on file blue, green, red.
    fn color(&mut self, [r, g, b]: [u8; 3]) -> Result<()> {
        self.u64(3)?;
        [b, g, r].into_iter().try_for_each(|v| self.u8(v))
    }
}
