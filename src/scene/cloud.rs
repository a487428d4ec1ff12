//! Points of a dense cloud on their way from fusion to a file.

use super::ViewIndex;
use crate::error::Result;

/// Which attributes every point of a cloud carries; positions are always there.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CloudLayout {
    /// [`CloudPoint::normal`] holds unit normals.
    pub normals: bool,
    /// [`CloudPoint::color`] holds colours.
    pub colors: bool,
    /// [`CloudPoint::views`] is never empty.
    pub views: bool,
    /// [`CloudPoint::weights`] is parallel to the views.
    pub weights: bool,
    /// [`CloudPoint::confidence`] is known.
    pub confidence: bool,
    /// [`CloudPoint::label`] and [`CloudPoint::label_confidence`] are known.
    pub labels: bool,
}

/// One point of a dense cloud. Attributes that the [`CloudLayout`] lacks hold their default.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CloudPoint<'a> {
    /// World position, scene units.
    pub position: [f32; 3],
    /// Unit normal in the world frame, facing the cameras that saw it.
    pub normal: [f32; 3],
    /// Red, green, blue.
    pub color: [u8; 3],
    /// Views that see the point, ascending, no duplicates.
    pub views: &'a [ViewIndex],
    /// Fusion weight of each of `views`, > 0.
    pub weights: &'a [f32],
    /// Confidence of the depth, larger is better; clouds of unfused depth maps have it.
    pub confidence: f32,
    /// Class id, 0 = void.
    pub label: u16,
    /// Share of the label's votes, 0..1; 0 for void.
    pub label_confidence: f32,
}

/// Takes points one by one in their final order or, where a crop follows, in fusion's order.
pub trait PointSink {
    /// Takes the next point.
    ///
    /// # Errors
    /// Whatever the medium behind the sink refuses.
    fn push(&mut self, point: &CloudPoint<'_>) -> Result<()>;
}

/// A finished cloud that can be walked through any number of times.
pub trait PointSource {
    /// Attributes of every point.
    fn layout(&self) -> CloudLayout;

    /// Number of points.
    fn len(&self) -> u64;

    /// Whether there is no point.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Calls `visit` with every point in the cloud's order and stops at its first error.
    ///
    /// # Errors
    /// The first error of `visit` or of the medium behind the cloud.
    fn for_each(&self, visit: &mut dyn FnMut(&CloudPoint<'_>) -> Result<()>) -> Result<()>;
}

/// A cloud held in memory.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PointCloud {
    layout: CloudLayout,
    positions: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
    colors: Vec<[u8; 3]>,
    view_offsets: Vec<usize>,
    views: Vec<ViewIndex>,
    weights: Vec<f32>,
    confidences: Vec<f32>,
    labels: Vec<(u16, f32)>,
}

impl PointCloud {
    /// An empty cloud whose points will carry what `layout` says.
    pub fn new(layout: CloudLayout) -> Self {
        PointCloud { layout, ..PointCloud::default() }
    }

    /// Drops all points but keeps their memory; the next ones carry what `layout` says.
    pub fn reset(&mut self, layout: CloudLayout) {
        self.layout = layout;
        self.positions.clear();
        self.normals.clear();
        self.colors.clear();
        self.view_offsets.clear();
        self.views.clear();
        self.weights.clear();
        self.confidences.clear();
        self.labels.clear();
    }

    /// Point `i`.
    pub fn point(&self, i: usize) -> CloudPoint<'_> {
        let start = if i == 0 { 0 } else { self.view_offsets[i - 1] };
        let range = start..self.view_offsets[i];
        let (label, label_confidence) = self.labels.get(i).copied().unwrap_or_default();
        CloudPoint {
            position: self.positions[i],
            normal: self.normals.get(i).copied().unwrap_or_default(),
            color: self.colors.get(i).copied().unwrap_or_default(),
            views: &self.views[range.clone()],
            weights: if self.layout.weights { &self.weights[range] } else { &[] },
            confidence: self.confidences.get(i).copied().unwrap_or_default(),
            label,
            label_confidence,
        }
    }

    /// All points in order.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = CloudPoint<'_>> {
        (0..self.positions.len()).map(|i| self.point(i))
    }
}

impl PointSink for PointCloud {
    fn push(&mut self, point: &CloudPoint<'_>) -> Result<()> {
        let has = self.layout;
        self.positions.push(point.position);
        if has.normals {
            self.normals.push(point.normal);
        }
        if has.colors {
            self.colors.push(point.color);
        }
        if has.views {
            self.views.extend_from_slice(point.views);
        }
        self.view_offsets.push(self.views.len());
        if has.weights {
            self.weights.extend_from_slice(point.weights);
        }
        if has.confidence {
            self.confidences.push(point.confidence);
        }
        if has.labels {
            self.labels.push((point.label, point.label_confidence));
        }
        Ok(())
    }
}

impl PointSource for PointCloud {
    fn layout(&self) -> CloudLayout {
        self.layout
    }

    fn len(&self) -> u64 {
        self.positions.len() as u64
    }

    fn for_each(&self, visit: &mut dyn FnMut(&CloudPoint<'_>) -> Result<()>) -> Result<()> {
        self.iter().try_for_each(|point| visit(&point))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cloud_in_memory_returns_what_was_pushed() {
        let layout =
            CloudLayout { normals: true, views: true, weights: true, labels: true, ..Default::default() };
        let mut cloud = PointCloud::new(layout);
        let views = [ViewIndex(1), ViewIndex(4)];
        let first = CloudPoint {
            position: [1.0, 2.0, 3.0],
            normal: [0.0, 0.0, -1.0],
            views: &views,
            weights: &[0.5, 0.25],
            label: 7,
            label_confidence: 0.75,
            ..Default::default()
        };
        let second = CloudPoint { position: [4.0, 5.0, 6.0], views: &views[1..], weights: &[1.0], ..first };
        cloud.push(&first).unwrap();
        cloud.push(&second).unwrap();
        assert_eq!(cloud.len(), 2);
        let mut seen = Vec::new();
        cloud
            .for_each(&mut |p| {
                seen.push((p.position, p.views.to_vec(), p.weights.to_vec()));
                Ok(())
            })
            .unwrap();
        assert_eq!(seen[0], (first.position, views.to_vec(), vec![0.5, 0.25]));
        assert_eq!(seen[1], (second.position, vec![ViewIndex(4)], vec![1.0]));
        assert_eq!(cloud.point(0), first);
    }
}
