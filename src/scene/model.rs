//! The scene as every stage sees it.

use super::{ImageId, ViewIndex};
use crate::geometry::{Camera, Roi, Size};
use nalgebra::{Matrix3, Vector3};

/// Views, sparse tracks and what relates them.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// Views in file order.
    pub views: Vec<View>,
    /// Sparse points.
    pub tracks: Tracks,
    /// Region of interest, if the scene has one.
    pub roi: Option<Roi>,
}

/// One photograph.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    /// Image path as the scene names it, `/` separators.
    pub name: String,
    /// Mask path as the scene names it.
    pub mask: Option<String>,
    /// Global ID.
    pub id: ImageId,
    /// `None` for an uncalibrated image: kept in the list, never processed.
    pub calibration: Option<Calibration>,
    /// Neighbour scores that came with the scene, best first; empty = not computed.
    pub neighbors: Vec<Neighbor>,
    /// Mean depth of the sparse points seen, 0 = unknown.
    pub avg_depth: f32,
}

/// Pose and resolution-free intrinsics of a view.
#[derive(Clone, Debug, PartialEq)]
pub struct Calibration {
    /// Intrinsics divided by the longer image side; see [`crate::geometry::normalized_k`].
    pub normalized_k: Matrix3<f64>,
    /// Rotation, camera from world.
    pub rotation: Matrix3<f64>,
    /// Centre in the world.
    pub center: Vector3<f64>,
    /// The image size that the scene states, if it does.
    pub size: Option<Size>,
}

impl Calibration {
    /// The camera at `size`: one factor `max(width, height)` for both axes, also where rounding changed the
    /// aspect; a normalised principal point of exactly (0, 0) becomes the image centre.
    pub fn camera_at(&self, size: Size) -> Camera {
        let n = &self.normalized_k;
        let s = f64::from(size.longest() as f32);
        let mut k = *n;
        k[(0, 0)] *= s;
        k[(1, 1)] *= s;
        if n[(0, 2)] == 0.0 && n[(1, 2)] == 0.0 {
            k[(0, 1)] = 0.0;
            k[(0, 2)] = (f64::from(size.width) - 1.0) / 2.0;
            k[(1, 2)] = (f64::from(size.height) - 1.0) / 2.0;
        } else {
            k[(0, 1)] *= s;
            k[(0, 2)] = (n[(0, 2)] + 0.5) * s - 0.5;
            k[(1, 2)] = (n[(1, 2)] + 0.5) * s - 0.5;
        }
        Camera::new(size, k, self.rotation, self.center)
    }
}

/// How well another view matches a view.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Neighbor {
    /// The other view.
    pub view: ViewIndex,
    /// Shared sparse points.
    pub points: u32,
    /// Mean footprint ratio reference : neighbour; resizing the neighbour by it equalises the footprints.
    pub scale: f32,
    /// Mean triangulation angle, radians.
    pub angle: f32,
    /// Share of the reference image covered by shared points, 0..1.
    pub area: f32,
    /// Larger is better.
    pub score: f32,
}

/// Sparse points with the sorted views that see them, stored back to back.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tracks {
    points: Vec<[f32; 3]>,
    offsets: Vec<usize>,
    views: Vec<ViewIndex>,
}

impl Tracks {
    /// Appends a point with the views that see it (sorted here). A view may observe a point twice; both count.
    pub fn push(&mut self, point: [f32; 3], visibility: impl IntoIterator<Item = ViewIndex>) {
        if self.offsets.is_empty() {
            self.offsets.push(0);
        }
        let start = self.views.len();
        self.views.extend(visibility);
        self.views[start..].sort_unstable();
        self.offsets.push(self.views.len());
        self.points.push(point);
    }

    /// Moves all points by `offset`, in doubles.
    pub fn shift(&mut self, offset: &Vector3<f64>) {
        for point in &mut self.points {
            let moved = Vector3::from(point.map(f64::from)) + offset;
            *point = [moved.x as f32, moved.y as f32, moved.z as f32];
        }
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Whether there is no point.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }

    /// World position of point `i`.
    pub fn point(&self, i: usize) -> [f32; 3] {
        self.points[i]
    }

    /// Views that see point `i`, ascending; a view that observed it twice is there twice.
    pub fn visibility(&self, i: usize) -> &[ViewIndex] {
        &self.views[self.offsets[i]..self.offsets[i + 1]]
    }

    /// Position and views of every point.
    pub fn iter(&self) -> impl Iterator<Item = ([f32; 3], &[ViewIndex])> {
        (0..self.len()).map(|i| (self.point(i), self.visibility(i)))
    }
}
