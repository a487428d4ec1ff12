//! Whether the cameras climbed along a line, as around a tower.

use super::Scene;
use nalgebra::{Matrix3, SymmetricEigen, Vector3};

/// Whether the camera centres lie about a line, spread evenly around it: at least 20 images, and of the eigenvalues
/// `e0 <= e1 <= e2` of their scatter matrix `e1 / e2 <= 0.6` and `e0 / e1 >= 0.8`. Exactly collinear centres are no
/// tower. Unless it may be `any_direction`, the line is within 45° of the z axis.
pub fn looks_like_tower(scene: &Scene, any_direction: bool) -> bool {
    const MIN_UPWARD: f64 = std::f64::consts::FRAC_1_SQRT_2;
    const MIN_IMAGES: usize = 20;
    const MAX_WIDTH: f64 = 0.6;
    const MIN_ROUNDNESS: f64 = 0.8;
    let centers: Vec<Vector3<f64>> =
        scene.views.iter().filter_map(|v| v.calibration.as_ref()).map(|c| c.center).collect();
    if scene.views.len() < MIN_IMAGES || centers.is_empty() {
        return false;
    }
    let mean = centers.iter().sum::<Vector3<f64>>() / centers.len() as f64;
    let scatter: Matrix3<f64> = centers.iter().map(|c| (c - mean) * (c - mean).transpose()).sum();
    let Some(eigen) = SymmetricEigen::try_new(scatter, f64::EPSILON, 1000) else { return false };
    let upward = eigen.eigenvectors[(2, eigen.eigenvalues.imax())].abs();
    let mut e: [f64; 3] = eigen.eigenvalues.into();
    e.sort_unstable_by(f64::total_cmp);
    let [e0, e1, e2] = e;
    let is_round = e1 > 0.0 && e1 / e2 <= MAX_WIDTH && e0 / e1 >= MIN_ROUNDNESS;
    is_round && (any_direction || upward >= MIN_UPWARD)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Calibration, ImageId, View};

    /// `count` cameras on a spiral of the given radii and height.
    fn spiral(count: u32, radii: [f64; 2], height: f64) -> Scene {
        let views = (0..count).map(|i| {
            let t = f64::from(i) / f64::from(count);
            let (s, c) = (t * 8.0 * std::f64::consts::TAU).sin_cos();
            let calibration = Calibration {
                normalized_k: Matrix3::identity(),
                rotation: Matrix3::identity(),
                center: Vector3::new(100.0 + radii[0] * c, radii[1] * s, height * t),
                size: None,
            };
            View {
                name: String::new(),
                mask: None,
                id: ImageId(i),
                calibration: Some(calibration),
                neighbors: Vec::new(),
                avg_depth: 0.0,
            }
        });
        Scene { views: views.collect(), ..Scene::default() }
    }

    #[test]
    fn only_a_tall_round_spiral_of_enough_images_is_one() {
        assert!(looks_like_tower(&spiral(64, [5.0, 5.0], 40.0), false));
        assert!(!looks_like_tower(&spiral(16, [5.0, 5.0], 40.0), false), "too few images");
        assert!(!looks_like_tower(&spiral(64, [5.0, 5.0], 10.0), false), "as wide as tall");
        assert!(!looks_like_tower(&spiral(64, [5.0, 2.0], 40.0), false), "flat");
        assert!(!looks_like_tower(&spiral(64, [0.0, 0.0], 40.0), false), "a line");
        assert!(!looks_like_tower(&Scene::default(), false));
        let mut lying = spiral(64, [5.0, 5.0], 40.0);
        for view in &mut lying.views {
            let center = &mut view.calibration.as_mut().unwrap().center;
            *center = Vector3::new(center.z, center.x, center.y);
        }
        assert!(!looks_like_tower(&lying, false) && looks_like_tower(&lying, true), "along x");
    }
}
