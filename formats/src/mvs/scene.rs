//! The one scene value that both `.mvs` containers convert to.

/// "No such index": an uncalibrated image's platform, camera or pose.
pub const NO_ID: u32 = u32::MAX;

/// Everything a `.mvs` file holds.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Scene {
    /// Rigs with their cameras and poses.
    pub platforms: Vec<Platform>,
    /// Images in file order; the position is the *local index* that views refer to.
    pub images: Vec<Image>,
    /// Sparse (or, in native archives, dense) points.
    pub points: PointCloud,
    /// 3D line segments (MVSI only; OpenMVS drops them).
    pub lines: Vec<Line>,
    /// Normals of `lines`: empty or one per line.
    pub line_normals: Vec<[f32; 3]>,
    /// Colours of `lines`, red-green-blue: empty or one per line.
    pub line_colors: Vec<[u8; 3]>,
    /// Row-major 4×4, meant to relate the file's frame to an absolute one; never applied to coordinates.
    pub transform: [f64; 16],
    /// Region of interest, if stored.
    pub obb: Option<Obb>,
}

/// A rig: cameras mounted on it and the poses it took.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Platform {
    /// Informative name.
    pub name: Vec<u8>,
    /// Cameras mounted on the rig.
    pub cameras: Vec<Camera>,
    /// Poses the rig took.
    pub poses: Vec<Pose>,
}

/// A camera mounted on a platform.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Camera {
    /// Informative name.
    pub name: Vec<u8>,
    /// Spectral band, may be empty.
    pub band: Vec<u8>,
    /// Image width that `k` refers to in pixels; 0 with `height` 0: `k` is normalised by `max(width, height)`.
    pub width: u32,
    /// Image height that `k` refers to; see `width`.
    pub height: u32,
    /// Intrinsics, row-major 3×3; pixel centres at integer coordinates.
    pub k: [f64; 9],
    /// Rotation from the platform to the camera, row-major 3×3.
    pub rotation: [f64; 9],
    /// Centre in the platform frame.
    pub center: [f64; 3],
}

/// A pose of a platform.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Pose {
    /// Rotation from the world to the platform, row-major 3×3.
    pub rotation: [f64; 9],
    /// Centre in the world.
    pub center: [f64; 3],
}

/// An image of the scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// Path as stored, bytes of undeclared encoding.
    pub name: Vec<u8>,
    /// Mask path as stored; empty = none.
    pub mask_name: Vec<u8>,
    /// Index into the scene's platforms, or [`NO_ID`].
    pub platform: u32,
    /// Index into that platform's cameras, or [`NO_ID`].
    pub camera: u32,
    /// Index into that platform's poses, or [`NO_ID`] for an uncalibrated image.
    pub pose: u32,
    /// Global ID, or [`NO_ID`]: then the local index is the ID.
    pub id: u32,
    /// Working width (native archives; 0 in MVSI).
    pub width: u32,
    /// Working height (native archives; 0 in MVSI).
    pub height: u32,
    /// Smallest depth of the points seen, 0 = unknown.
    pub min_depth: f32,
    /// Average depth of the points seen, 0 = unknown.
    pub avg_depth: f32,
    /// Largest depth of the points seen, 0 = unknown.
    pub max_depth: f32,
    /// Neighbour images, best first; empty = not computed.
    pub view_scores: Vec<ViewScore>,
}

/// How well another image matches an image.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ViewScore {
    /// Local index of the neighbour.
    pub image: u32,
    /// Shared points.
    pub points: u32,
    /// Factor that brings the neighbour to the reference's footprint.
    pub scale: f32,
    /// Mean triangulation angle, radians.
    pub angle: f32,
    /// Share of the image area covered in common, 0..1.
    pub area: f32,
    /// Larger is better.
    pub score: f32,
}

/// Points with optional attributes; every non-empty attribute has one entry per point.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PointCloud {
    /// World positions.
    pub positions: Vec<[f32; 3]>,
    /// Which images see each point (local indices); may be empty altogether.
    pub views: Visibility,
    /// World normals.
    pub normals: Vec<[f32; 3]>,
    /// Red, green, blue.
    pub colors: Vec<[u8; 3]>,
}

/// Lists of images per point, stored back to back.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Visibility {
    /// `offsets[i]..offsets[i + 1]` is point `i`'s part of `images`; empty when there are no lists at all.
    pub offsets: Vec<u64>,
    /// Local image indices.
    pub images: Vec<u32>,
    /// Confidence or weight of each entry of `images`; empty = not available.
    pub weights: Vec<f32>,
}

/// A line segment seen by images.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Line {
    /// First end, world.
    pub start: [f32; 3],
    /// Second end, world.
    pub end: [f32; 3],
    /// Local image index and confidence.
    pub views: Vec<(u32, f32)>,
}

/// Oriented bounding box, in the state OpenMVS uses it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Obb {
    /// Rows are the box axes in the world, row-major 3×3.
    pub rotation: [f64; 9],
    /// Box centre in the world.
    pub center: [f64; 3],
    /// Half sizes along the axes, all > 0.
    pub half_extent: [f64; 3],
}
