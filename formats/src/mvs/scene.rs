//! The one scene value that both `.mvs` containers convert to.

use super::boxes::{Obb, StoredBox};
use super::mesh::Mesh;

/// "No such index": an uncalibrated image's platform, camera or pose.
pub const NO_ID: u32 = u32::MAX;

/// Row-major 3×3 identity.
pub(crate) const IDENTITY3: [f64; 9] = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
/// Row-major 4×4 identity.
pub(crate) const IDENTITY4: [f64; 16] =
    [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0];

/// Everything a `.mvs` file holds.
#[derive(Clone, Debug, PartialEq)]
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
    /// Region of interest; `None` if there is none or the stored one has no volume or no rotation.
    pub obb: Option<Obb>,
    /// The region's bytes as the file had them, where `obb` does not say them all; else `None`. Writers use it
    /// while `obb` is still what it means; leave it `None` in a new scene.
    pub stored_box: Option<StoredBox>,
    /// Surface (native archives only).
    pub mesh: Mesh,
}

impl Default for Scene {
    fn default() -> Self {
        Scene {
            platforms: Vec::new(),
            images: Vec::new(),
            points: PointCloud::default(),
            lines: Vec::new(),
            line_normals: Vec::new(),
            line_colors: Vec::new(),
            transform: IDENTITY4,
            obb: None,
            stored_box: None,
            mesh: Mesh::default(),
        }
    }
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

impl Camera {
    /// `k` as files without a resolution hold it: divided by `max(width, height)`, with the principal point
    /// measured from the outer corner of the image: `(c + 0.5) / max - 0.5`. As it is if `width` is 0.
    pub fn normalized_k(&self) -> [f64; 9] {
        let mut k = self.k;
        if self.width > 0 && self.height > 0 {
            let scale = 1.0 / f64::from(self.width.max(self.height));
            for i in [0, 1, 4] {
                k[i] *= scale;
            }
            for i in [2, 5] {
                k[i] = (k[i] + 0.5) * scale - 0.5;
            }
        }
        k
    }
}

/// A pose of a platform.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Pose {
    /// Rotation from the world to the platform, row-major 3×3.
    pub rotation: [f64; 9],
    /// Centre in the world.
    pub center: [f64; 3],
}

impl Default for Image {
    /// An uncalibrated image without a name.
    fn default() -> Self {
        Image {
            name: Vec::new(),
            mask_name: Vec::new(),
            platform: NO_ID,
            camera: NO_ID,
            pose: NO_ID,
            id: NO_ID,
            width: 0,
            height: 0,
            min_depth: 0.0,
            avg_depth: 0.0,
            max_depth: 0.0,
            view_scores: Vec::new(),
        }
    }
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

impl Image {
    /// The global ID of the image at position `index`: `id`, or the position if that is [`NO_ID`].
    pub fn id_at(&self, index: usize) -> u32 {
        if self.id == NO_ID { index as u32 } else { self.id }
    }
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

impl Visibility {
    /// Number of lists.
    pub fn len(&self) -> usize {
        self.offsets.len().saturating_sub(1)
    }

    /// Whether there are no lists at all.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Where list `index` lies in `images` and `weights`; empty if there is no such list.
    pub fn range(&self, index: usize) -> std::ops::Range<usize> {
        match (self.offsets.get(index), self.offsets.get(index + 1)) {
            (Some(&start), Some(&end)) => start as usize..end as usize,
            _ => 0..0,
        }
    }

    /// Images of list `index`; empty if there is no such list.
    pub fn images_of(&self, index: usize) -> &[u32] {
        self.images.get(self.range(index)).unwrap_or_default()
    }

    /// Weights of list `index`; empty if there are none.
    pub fn weights_of(&self, index: usize) -> &[f32] {
        self.weights.get(self.range(index)).unwrap_or_default()
    }

    /// Appends a list. `weights` has one entry per image, or none in all lists.
    pub fn push(&mut self, images: &[u32], weights: &[f32]) {
        if self.offsets.is_empty() {
            self.offsets.push(0);
        }
        self.images.extend_from_slice(images);
        self.weights.extend_from_slice(weights);
        self.offsets.push(self.images.len() as u64);
    }
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
