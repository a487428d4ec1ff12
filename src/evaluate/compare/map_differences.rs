//! Where two depth maps of the same view differ, and by how much.

use super::{angle_deg, relative};
use crate::scene::{DepthEstimate, Grid};

/// Which of two depth maps has a depth at a pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Presence {
    /// None of them.
    #[default]
    Neither,
    /// Both.
    Both,
    /// The first alone.
    OnlyA,
    /// The second alone.
    OnlyB,
}

/// The differences of two depth maps pixel by pixel; not a number where one of them has no value.
#[derive(Clone, Debug, PartialEq)]
pub struct MapDifferences {
    /// Which of them has a depth.
    pub presence: Grid<Presence>,
    /// `(a − b) / max(a, b)` of the depths: above 0 where the first is farther away.
    pub depth: Grid<f32>,
    /// Angles between the normals, degrees.
    pub normal: Option<Grid<f32>>,
    /// `a − b` of the confidences.
    pub confidence: Option<Grid<f32>>,
}

/// The differences of two depth maps of the same size; `None` for maps of different sizes.
pub fn map_differences(a: &DepthEstimate, b: &DepthEstimate) -> Option<MapDifferences> {
    let size = a.depth.size();
    if b.depth.size() != size {
        return None;
    }
    let valid = |depth: f32| depth.is_finite() && depth > 0.0;
    let depths = || a.depth.data().iter().zip(b.depth.data()).map(|(&a, &b)| (a, b));
    let presence: Vec<Presence> = depths()
        .map(|(a, b)| match (valid(a), valid(b)) {
            (true, true) => Presence::Both,
            (true, false) => Presence::OnlyA,
            (false, true) => Presence::OnlyB,
            (false, false) => Presence::Neither,
        })
        .collect();
    let in_both = |difference: &dyn Fn(usize) -> f32| -> Option<Grid<f32>> {
        let value = |(i, presence): (usize, &Presence)| match presence {
            Presence::Both => difference(i),
            _ => f32::NAN,
        };
        Grid::from_vec(size, presence.iter().enumerate().map(value).collect())
    };
    let depth = in_both(&|i| {
        let (a, b) = (a.depth.data()[i], b.depth.data()[i]);
        (relative(a, b) as f32).copysign(a - b)
    })?;
    let normals = a.normal.as_ref().zip(b.normal.as_ref());
    let normal = normals.and_then(|(a, b)| in_both(&|i| angle_deg(a.data()[i], b.data()[i]) as f32));
    let confidences = a.confidence.as_ref().zip(b.confidence.as_ref());
    let confidence = confidences.and_then(|(a, b)| in_both(&|i| a.data()[i] - b.data()[i]));
    Some(MapDifferences { presence: Grid::from_vec(size, presence)?, depth, normal, confidence })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Camera, Size};
    use crate::scene::ImageId;
    use nalgebra::{Matrix3, Vector3};

    fn estimate(depth: &[f32]) -> DepthEstimate {
        let size = Size::new(depth.len() as u32, 1);
        DepthEstimate {
            image_id: ImageId(0),
            image_name: String::new(),
            source_ids: Vec::new(),
            camera: Camera::new(size, Matrix3::identity(), Matrix3::identity(), Vector3::zeros()),
            depth_range: (0.0, 9.0),
            depth: Grid::from_vec(size, depth.to_vec()).unwrap(),
            normal: Some(Grid::filled(size, [0.0, 0.0, -1.0])),
            confidence: Some(Grid::filled(size, 0.5)),
        }
    }

    #[test]
    fn signs_say_which_is_farther() {
        let a = estimate(&[1.0, 2.0, 0.0, 4.0, 0.0]);
        let mut b = estimate(&[2.0, 1.0, 1.0, f32::NAN, 0.0]);
        b.normal.as_mut().unwrap()[(0, 0)] = [0.0, -1.0, 0.0];
        b.confidence.as_mut().unwrap()[(1, 0)] = 0.75;
        let d = map_differences(&a, &b).unwrap();
        use Presence::{Both, Neither, OnlyA, OnlyB};
        assert_eq!(d.presence.data(), [Both, Both, OnlyB, OnlyA, Neither]);
        assert_eq!(d.depth.data()[..2], [-0.5, 0.5]);
        assert!(d.depth.data()[2..].iter().all(|v| v.is_nan()));
        assert_eq!(d.normal.unwrap().data()[..2], [90.0, 0.0]);
        assert_eq!(d.confidence.unwrap().data()[..2], [0.0, -0.25]);
        b.normal = None;
        assert_eq!(map_differences(&a, &b).unwrap().normal, None);
        assert_eq!(map_differences(&a, &estimate(&[1.0])), None);
    }
}
