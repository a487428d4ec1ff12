//! The sparse model: cameras, posed images, points with their tracks, rigs.

use crate::{Error, Result};
use std::collections::HashSet;

/// "No 3D point": the id in an [`Observation`] that belongs to none.
pub const NO_POINT: u64 = u64::MAX;

/// A sparse model, every list in file order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Model {
    /// Intrinsics.
    pub cameras: Vec<Camera>,
    /// Registered images.
    pub images: Vec<Image>,
    /// Triangulated points.
    pub points: Points,
    /// Rigs; empty in models of programs that do not know them.
    pub rigs: Vec<Rig>,
    /// Rig poses; empty like `rigs`.
    pub frames: Vec<Frame>,
}

/// Intrinsics of one or more images.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    /// Unique id.
    pub id: u32,
    /// Meaning of `params`.
    pub model: CameraModel,
    /// Image width, pixels.
    pub width: u64,
    /// Image height, pixels.
    pub height: u64,
    /// As many as [`CameraModel::params`] names; focal lengths and principal point in pixels.
    pub params: Vec<f64>,
}

impl Camera {
    /// `[fx, fy, cx, cy]` of a camera without distortion, `None` for the others.
    pub fn pinhole(&self) -> Option<[f64; 4]> {
        match (self.model, self.params.as_slice()) {
            (CameraModel::SimplePinhole, &[f, cx, cy]) => Some([f, f, cx, cy]),
            (CameraModel::Pinhole, &[fx, fy, cx, cy]) => Some([fx, fy, cx, cy]),
            _ => None,
        }
    }
}

macro_rules! camera_models {
    ($($variant:ident $name:literal $params:literal)*) => {
        /// How a camera projects and distorts.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[non_exhaustive]
        pub enum CameraModel {
            $(#[doc = concat!("`", $name, "`: ", $params)] $variant,)*
        }

        impl CameraModel {
            /// All models; the position is the id.
            pub const ALL: &[CameraModel] = &[$(CameraModel::$variant),*];

            /// The name in text files.
            pub fn name(self) -> &'static str {
                match self { $(CameraModel::$variant => $name),* }
            }

            /// The names of the parameters, separated by spaces.
            pub fn params(self) -> &'static str {
                match self { $(CameraModel::$variant => $params),* }
            }
        }
    };
}

camera_models! {
    SimplePinhole "SIMPLE_PINHOLE" "f cx cy"
    Pinhole "PINHOLE" "fx fy cx cy"
    SimpleRadial "SIMPLE_RADIAL" "f cx cy k"
    Radial "RADIAL" "f cx cy k1 k2"
    Opencv "OPENCV" "fx fy cx cy k1 k2 p1 p2"
    OpencvFisheye "OPENCV_FISHEYE" "fx fy cx cy k1 k2 k3 k4"
    FullOpencv "FULL_OPENCV" "fx fy cx cy k1 k2 p1 p2 k3 k4 k5 k6"
    Fov "FOV" "fx fy cx cy omega"
    SimpleRadialFisheye "SIMPLE_RADIAL_FISHEYE" "f cx cy k"
    RadialFisheye "RADIAL_FISHEYE" "f cx cy k1 k2"
    ThinPrismFisheye "THIN_PRISM_FISHEYE" "fx fy cx cy k1 k2 p1 p2 k3 k4 sx1 sy1"
    RadTanThinPrismFisheye "RAD_TAN_THIN_PRISM_FISHEYE" "fx fy cx cy k0 k1 k2 k3 k4 k5 p0 p1 s0 s1 s2 s3"
    SimpleDivision "SIMPLE_DIVISION" "f cx cy k"
    Division "DIVISION" "fx fy cx cy k"
    SimpleFisheye "SIMPLE_FISHEYE" "f cx cy"
    Fisheye "FISHEYE" "fx fy cx cy"
    Eucm "EUCM" "fx fy cx cy alpha beta"
    Equirectangular "EQUIRECTANGULAR" "width height"
}

impl CameraModel {
    /// The id in binary files.
    pub fn id(self) -> i32 {
        self as i32
    }

    /// The model with this id.
    pub fn from_id(id: i32) -> Option<Self> {
        Self::ALL.get(usize::try_from(id).ok()?).copied()
    }

    /// The model with this name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.iter().copied().find(|m| m.name() == name)
    }

    /// Number of parameters.
    pub fn param_count(self) -> usize {
        self.params().split(' ').count()
    }
}

/// A rotation and translation: `x' = R(q) x + t`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Quaternion w, x, y, z as stored (Hamilton); normalise before use.
    pub rotation: [f64; 4],
    /// Translation.
    pub translation: [f64; 3],
}

impl Pose {
    /// Row-major rotation matrix of the normalised quaternion.
    pub fn rotation_matrix(&self) -> [f64; 9] {
        let length = self.rotation.iter().map(|v| v * v).sum::<f64>().sqrt();
        let [w, x, y, z] = self.rotation.map(|v| v / length);
        [
            1.0 - 2.0 * (y * y + z * z),
            2.0 * (x * y - z * w),
            2.0 * (x * z + y * w),
            2.0 * (x * y + z * w),
            1.0 - 2.0 * (x * x + z * z),
            2.0 * (y * z - x * w),
            2.0 * (x * z - y * w),
            2.0 * (y * z + x * w),
            1.0 - 2.0 * (x * x + y * y),
        ]
    }

    fn is_usable(&self) -> bool {
        let finite = self.rotation.iter().chain(&self.translation).all(|v| v.is_finite());
        finite && self.rotation.iter().map(|v| v * v).sum::<f64>() > 1e-12
    }
}

/// A registered image.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// Unique id.
    pub id: u32,
    /// Camera from world.
    pub pose: Pose,
    /// Id of its camera.
    pub camera_id: u32,
    /// Path relative to the image folder, `/` separators, bytes of undeclared encoding.
    pub name: Vec<u8>,
    /// Key points.
    pub observations: Vec<Observation>,
}

/// A key point of an image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observation {
    /// Position, pixels; the centre of the first pixel is (0.5, 0.5).
    pub position: [f64; 2],
    /// Id of the 3D point, or [`NO_POINT`].
    pub point_id: u64,
}

/// Triangulated points, column by column.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Points {
    /// Unique ids.
    pub ids: Vec<u64>,
    /// World positions.
    pub positions: Vec<[f64; 3]>,
    /// Red, green, blue.
    pub colors: Vec<[u8; 3]>,
    /// Mean reprojection errors, pixels; negative = unknown.
    pub errors: Vec<f64>,
    /// Where each point's track ends in `tracks`.
    pub track_ends: Vec<u64>,
    /// Tracks back to back.
    pub tracks: Vec<TrackElement>,
}

impl Points {
    /// Number of points.
    pub fn len(&self) -> usize {
        self.ids.len()
    }

    /// Whether there are no points.
    pub fn is_empty(&self) -> bool {
        self.ids.is_empty()
    }

    /// Where point `index` was seen, in file order; an image may occur twice.
    pub fn track(&self, index: usize) -> &[TrackElement] {
        let start = if index == 0 { 0 } else { self.track_ends[index - 1] };
        &self.tracks[start as usize..self.track_ends[index] as usize]
    }
}

/// One sighting of a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TrackElement {
    /// Id of the image.
    pub image_id: u32,
    /// Index into the image's observations; OpenMVS's exporter writes it one too large, so do not trust it.
    pub observation: u32,
}

/// Kind of a sensor on a rig.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SensorKind {
    /// Unknown.
    Invalid,
    /// A camera; the sensor id is a camera id.
    Camera,
    /// An inertial measurement unit.
    Imu,
}

impl SensorKind {
    const ALL: [(SensorKind, i32, &'static str); 3] = [
        (SensorKind::Invalid, -1, "INVALID"),
        (SensorKind::Camera, 0, "CAMERA"),
        (SensorKind::Imu, 1, "IMU"),
    ];

    /// The id in binary files.
    pub fn id(self) -> i32 {
        Self::ALL[self as usize].1
    }

    /// The name in text files.
    pub fn name(self) -> &'static str {
        Self::ALL[self as usize].2
    }

    /// The kind with this id.
    pub fn from_id(id: i32) -> Option<Self> {
        Self::ALL.iter().find(|k| k.1 == id).map(|k| k.0)
    }

    /// The kind with this name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.iter().find(|k| k.2 == name).map(|k| k.0)
    }
}

/// A sensor on a rig.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sensor {
    /// Its kind.
    pub kind: SensorKind,
    /// Its id among sensors of its kind.
    pub id: u32,
}

/// Sensors mounted together.
#[derive(Clone, Debug, PartialEq)]
pub struct Rig {
    /// Unique id.
    pub id: u32,
    /// The sensor whose frame is the rig's.
    pub reference: Option<Sensor>,
    /// The other sensors; empty without a reference.
    pub others: Vec<RigSensor>,
}

/// A sensor that is not the reference of its rig.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RigSensor {
    /// The sensor.
    pub sensor: Sensor,
    /// Sensor from rig, if known.
    pub pose: Option<Pose>,
}

/// A rig at one moment.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// Unique id.
    pub id: u32,
    /// Id of the rig.
    pub rig_id: u32,
    /// Rig from world.
    pub pose: Pose,
    /// What its sensors recorded.
    pub data: Vec<FrameData>,
}

/// What one sensor recorded in a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrameData {
    /// The sensor.
    pub sensor: Sensor,
    /// Id of the recording; of cameras the image id.
    pub data_id: u64,
}

impl Model {
    /// Checks what every user of the model relies on: unique ids, usable poses and intrinsics, cameras that exist.
    /// Observations and tracks are not checked.
    ///
    /// # Errors
    /// [`Error::Format`], offset 0, naming the first item that breaks a rule.
    pub fn check(&self) -> Result<()> {
        let broken = |field: String, what: String| Err(Error::Format { offset: 0, field, what });
        let mut cameras = HashSet::new();
        for camera in &self.cameras {
            let field = format!("camera {}", camera.id);
            if !cameras.insert(camera.id) {
                return broken(field, "the id occurs twice".into());
            }
            if !(1..=u64::from(u16::MAX)).contains(&camera.width.min(camera.height))
                || camera.width.max(camera.height) > u64::from(u16::MAX)
            {
                let what = format!("image size {} x {} is not in 1..=65535", camera.width, camera.height);
                return broken(field, what);
            }
            let focal_is_usable = camera.pinhole().is_none_or(|[fx, fy, _, _]| fx > 0.0 && fy > 0.0);
            if !(focal_is_usable && camera.params.iter().all(|p| p.is_finite())) {
                return broken(field, format!("unusable parameters {:?}", camera.params));
            }
        }
        let mut images = HashSet::new();
        for image in &self.images {
            let field = format!("image {}", image.id);
            if !images.insert(image.id) {
                return broken(field, "the id occurs twice".into());
            }
            if !cameras.contains(&image.camera_id) {
                return broken(field, format!("its camera {} does not exist", image.camera_id));
            }
            if !image.pose.is_usable() {
                return broken(field, "its pose is not finite or has a zero quaternion".into());
            }
        }
        Ok(())
    }
}
