//! The columns of a point cloud.

use crate::mvs::Visibility;

/// Points with optional attributes; every attribute is empty or has one entry per point.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cloud {
    /// Header comments, without the keyword.
    pub comments: Vec<String>,
    /// World positions.
    pub positions: Vec<[f32; 3]>,
    /// The positions before rounding; empty unless the file stores coordinates wider than `f32`.
    pub positions_f64: Vec<[f64; 3]>,
    /// Red, green, blue.
    pub colors: Vec<[u8; 3]>,
    /// World normals.
    pub normals: Vec<[f32; 3]>,
    /// Class ids; 0 = void.
    pub labels: Vec<u16>,
    /// How sure the label is, 0 worst .. 1 best.
    pub label_confidence: Vec<f32>,
    /// Property `confidence` of a scale export.
    pub confidence: Vec<f32>,
    /// Property `value` of a scale export: footprint in world units.
    pub value: Vec<f32>,
    /// Property `views`: how many images see the point.
    pub view_counts: Vec<u32>,
    /// Which images see each point (local indices) and how much each weighs.
    pub views: Visibility,
}

impl Cloud {
    /// Number of points.
    pub fn len(&self) -> usize {
        self.positions.len()
    }

    /// Whether there are no points.
    pub fn is_empty(&self) -> bool {
        self.positions.is_empty()
    }

    /// Whether there are lists of views, be they empty.
    pub fn has_views(&self) -> bool {
        !self.views.offsets.is_empty()
    }

    /// The images that see point `index`; empty if there are no lists.
    pub fn images_of(&self, index: usize) -> &[u32] {
        self.views.images.get(self.views_range(index)).unwrap_or(&[])
    }

    /// The weight of each of [`Cloud::images_of`]; empty if there are none.
    pub fn weights_of(&self, index: usize) -> &[f32] {
        self.views.weights.get(self.views_range(index)).unwrap_or(&[])
    }

    fn views_range(&self, index: usize) -> std::ops::Range<usize> {
        match (self.views.offsets.get(index), self.views.offsets.get(index + 1)) {
            (Some(&start), Some(&end)) => start as usize..end as usize,
            _ => 0..0,
        }
    }

    /// Removes all points and comments, keeping the memory.
    pub fn clear(&mut self) {
        let Cloud {
            comments,
            positions,
            positions_f64,
            colors,
            normals,
            labels,
            label_confidence,
            confidence,
            value,
            view_counts,
            views,
        } = self;
        comments.clear();
        positions.clear();
        positions_f64.clear();
        colors.clear();
        normals.clear();
        labels.clear();
        label_confidence.clear();
        confidence.clear();
        value.clear();
        view_counts.clear();
        views.offsets.clear();
        views.images.clear();
        views.weights.clear();
    }

    /// The first attribute whose length is neither 0 nor that of `positions`, or view lists that do not fit together.
    pub(crate) fn inconsistency(&self) -> Option<&'static str> {
        let n = self.len();
        let lengths = [
            ("positions_f64", self.positions_f64.len()),
            ("colors", self.colors.len()),
            ("normals", self.normals.len()),
            ("labels", self.labels.len()),
            ("label_confidence", self.label_confidence.len()),
            ("confidence", self.confidence.len()),
            ("value", self.value.len()),
            ("view_counts", self.view_counts.len()),
            ("views.offsets", self.views.offsets.len().saturating_sub(1)),
        ];
        if let Some((name, _)) = lengths.iter().find(|(_, length)| *length != 0 && *length != n) {
            return Some(name);
        }
        let offsets = &self.views.offsets;
        let ordered = offsets.is_sorted() && offsets.first().is_none_or(|&first| first == 0);
        if !ordered || offsets.last().is_some_and(|&last| last != self.views.images.len() as u64) {
            return Some("views.offsets");
        }
        let weights = self.views.weights.len();
        (weights != 0 && weights != self.views.images.len()).then_some("views.weights")
    }

    /// Bytes in use.
    pub(crate) fn bytes(&self) -> u64 {
        let per_point = 12 * (self.positions.len() + self.normals.len())
            + 24 * self.positions_f64.len()
            + 3 * self.colors.len()
            + 2 * self.labels.len()
            + 4 * (self.label_confidence.len() + self.confidence.len() + self.value.len())
            + 4 * self.view_counts.len()
            + 8 * self.views.offsets.len();
        per_point as u64 + 4 * (self.views.images.len() + self.views.weights.len()) as u64
    }
}
