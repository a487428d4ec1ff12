//! OpenMVS depth maps (`.dmap`).

/// A depth map file: header and planes, row-major, top row first.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DepthMapFile {
    /// Image size that `k` refers to.
    pub image_width: u32,
    /// See `image_width`.
    pub image_height: u32,
    /// Size of every plane below.
    pub width: u32,
    /// See `width`.
    pub height: u32,
    /// Smallest depth allowed for this view.
    pub depth_min: f32,
    /// Largest depth allowed for this view.
    pub depth_max: f32,
    /// Path of the reference image as stored, relative to the folder of the depth map.
    pub image_name: Vec<u8>,
    /// Global IDs: the reference image first, then the neighbours used, best first.
    pub ids: Vec<u32>,
    /// Intrinsics in pixels of the image size, row-major 3×3.
    pub k: [f64; 9],
    /// Rotation, camera from world, row-major 3×3.
    pub rotation: [f64; 9],
    /// Camera centre in the world.
    pub center: [f64; 3],
    /// Depth along the optical axis; 0 = no estimate.
    pub depth: Vec<f32>,
    /// Unit normals in the camera frame, facing the camera; empty if absent.
    pub normal: Vec<[f32; 3]>,
    /// Confidence, larger is better, may exceed 1; empty if absent.
    pub confidence: Vec<f32>,
    /// Per pixel up to four indices into `ids[1..]`, 255 = empty slot; empty if absent.
    pub views: Vec<[u8; 4]>,
}
