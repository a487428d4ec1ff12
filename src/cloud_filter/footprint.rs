//! How large a pixel is at each point of a cloud.

use super::visibility::PointViews;
use crate::geometry::Camera;
use rayon::prelude::*;

/// The size of a point and how sure it is, as surface reconstruction wants them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PointScale {
    /// Edge of a pixel at the point in world units; 0 if no camera sees it.
    pub size: f32,
    /// Number of views, or the weight of the view whose pixel it is.
    pub confidence: f32,
}

/// The scale of every point. Without `weights` its size is that of the smallest pixel of its views, and its confidence
/// the number of views; with weights, parallel to the views, both come from the view with the smallest ratio of pixel
/// size to weight. The pixel of a view at a point is its depth over the focal length; `cameras` has one entry per view, at
/// the size whose pixels are meant.
pub fn point_scales(cloud: PointViews<'_>, weights: &[f32], cameras: &[Option<Camera>]) -> Vec<PointScale> {
    let scale = |i: usize| {
        let position = cloud.positions[i];
        let views = cloud.of(i);
        let first = cloud.offsets[i] as usize;
        let mut best: Option<(f32, PointScale)> = None;
        for (k, &view) in views.iter().enumerate() {
            let Some(Some(camera)) = cameras.get(view as usize) else { continue };
            let size = (camera.depth_of(position) / camera.intrinsics().0) as f32;
            if size.is_nan() || size <= 0.0 {
                continue;
            }
            let (rank, confidence) = match weights.get(first + k) {
                Some(&weight) => (size / weight.max(f32::MIN_POSITIVE), weight),
                None => (size, views.len() as f32),
            };
            if best.is_none_or(|(least, _)| rank < least) {
                best = Some((rank, PointScale { size, confidence }));
            }
        }
        best.map_or_else(PointScale::default, |(_, scale)| scale)
    };
    (0..cloud.positions.len()).into_par_iter().map(scale).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::synthetic;

    #[test]
    fn the_smallest_pixel_counts_or_the_one_that_weighs_most_for_its_size() {
        // Focal length 100; the second camera stands 3 nearer.
        let cameras = [
            Some(synthetic::camera(100, 80, [0.0, 0.0, 0.0], 0.0)),
            Some(synthetic::camera(100, 80, [0.0, 0.0, 3.0], 0.0)),
            None,
        ];
        let positions = [[0.0, 0.0, 5.0], [0.0, 0.0, 5.0], [0.0, 0.0, -1.0]];
        let (offsets, views) = ([0, 2, 5, 6], [0, 1, 0, 1, 2, 0]);
        let cloud = PointViews { positions: &positions, offsets: &offsets, views: &views };
        let plain = point_scales(cloud, &[], &cameras);
        assert_eq!(plain[0], PointScale { size: 0.02, confidence: 2.0 });
        assert_eq!(plain[1], PointScale { size: 0.02, confidence: 3.0 });
        assert_eq!(plain[2], PointScale::default(), "behind the camera");
        let weighted = point_scales(cloud, &[1.0, 0.1, 0.1, 1.0, 9.0, 1.0], &cameras);
        assert_eq!(weighted[0], PointScale { size: 0.05, confidence: 1.0 });
        assert_eq!(weighted[1], PointScale { size: 0.02, confidence: 1.0 });
    }
}
