//! A finished cloud with labels that the points around have voted on.

use crate::error::Result;
use crate::scene::{CloudLayout, CloudPoint, PointSource};
use crate::semantics::{LabelVote, smooth_labels};

/// A cloud whose labels went through a second vote.
pub struct WithSmoothLabels<'a> {
    cloud: &'a dyn PointSource,
    labels: Vec<LabelVote>,
}

impl<'a> WithSmoothLabels<'a> {
    /// Lets the `count` nearest points vote on the label of every point of `cloud`, see [`smooth_labels`]. Positions,
    /// normals and labels of all points are held in memory: about 100 bytes a point while it lasts, 8 afterwards.
    ///
    /// # Errors
    /// Those of `cloud`.
    pub fn vote(cloud: &'a dyn PointSource, count: usize) -> Result<Self> {
        let points = cloud.len() as usize;
        let mut positions: Vec<[f64; 3]> = Vec::with_capacity(points);
        let mut normals = Vec::with_capacity(if cloud.layout().normals { points } else { 0 });
        let mut labels = Vec::with_capacity(points);
        cloud.for_each(&mut |point| {
            positions.push(point.position.map(f64::from));
            if cloud.layout().normals {
                normals.push(point.normal);
            }
            labels.push(LabelVote { label: point.label.into(), confidence: point.label_confidence });
            Ok(())
        })?;
        Ok(WithSmoothLabels { cloud, labels: smooth_labels(&positions, &normals, &labels, count) })
    }
}

impl PointSource for WithSmoothLabels<'_> {
    fn layout(&self) -> CloudLayout {
        self.cloud.layout()
    }

    fn len(&self) -> u64 {
        self.cloud.len()
    }

    fn for_each(&self, visit: &mut dyn FnMut(&CloudPoint<'_>) -> Result<()>) -> Result<()> {
        let mut labels = self.labels.iter();
        self.cloud.for_each(&mut |point| {
            let vote = labels.next().copied().unwrap_or_default();
            visit(&CloudPoint { label: vote.label.0, label_confidence: vote.confidence, ..*point })
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{PointCloud, PointSink};

    #[test]
    fn only_labels_change() {
        let mut cloud =
            PointCloud::new(CloudLayout { normals: true, labels: true, ..CloudLayout::default() });
        for i in 0..25u16 {
            let label = if i == 12 { 3 } else { 1 };
            let position = [f32::from(i % 5), f32::from(i / 5), 0.0];
            let normal = [0.0, 0.0, 1.0];
            cloud
                .push(&CloudPoint { position, normal, label, label_confidence: 0.8, ..CloudPoint::default() })
                .unwrap();
        }
        let smooth = WithSmoothLabels::vote(&cloud, 8).unwrap();
        assert_eq!((smooth.len(), smooth.layout()), (25, cloud.layout()));
        let mut seen = Vec::new();
        smooth
            .for_each(&mut |p| {
                seen.push((p.position, p.normal, p.label));
                Ok(())
            })
            .unwrap();
        assert!(seen.iter().zip(cloud.iter()).all(|(a, b)| *a == (b.position, b.normal, 1)));
    }
}
