//! An origin near the cameras, for scenes that are far from their own.

use nalgebra::Vector3;

/// Distance from the origin, in extents of the scene, from which on single precision is too coarse.
const FAR: f64 = 84.0;
/// A coordinate is moved only if it is this many extents from 0: then moving it loses no digit, forth or back.
const LEAST: f64 = 4.0;

/// The point that becomes the origin, in doubles, before anything is computed in single precision: zero unless the cameras
/// with these centres are farther from the origin than 84 times their extent, where neighbouring numbers of 32 bits are a
/// hundred-thousandth of the extent apart.
///
/// Its coordinates are multiples of a power of two no larger than the extent, so that subtracting them from the centres, and
/// adding them again, is exact (Sterbenz 1974).
pub fn local_origin(centers: impl IntoIterator<Item = Vector3<f64>>) -> Vector3<f64> {
    let mut centers = centers.into_iter();
    let Some(first) = centers.next() else { return Vector3::zeros() };
    let (low, high) = centers.fold((first, first), |(low, high), c| (low.inf(&c), high.sup(&c)));
    let extent = (high - low).amax();
    let farthest = low.amax().max(high.amax());
    if !(extent > 0.0 && farthest.is_finite() && farthest > FAR * extent) {
        return Vector3::zeros();
    }
    let step = extent.log2().floor().exp2();
    let middle = low + (high - low) / 2.0;
    middle.map(|m| if m.abs() < (LEAST + 1.0) * extent { 0.0 } else { (m / step).round() * step })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn centers(offset: f64, scale: f64) -> Vec<Vector3<f64>> {
        let center = |i: i32| {
            let x = f64::from(i) / 3.0;
            Vector3::new(x, 7.0 - x / 7.0, x.sin()) * scale + Vector3::new(offset, -0.3 * offset, 0.0)
        };
        (0..20).map(center).collect()
    }

    #[test]
    fn only_scenes_that_are_far_away_are_moved() {
        for (offset, scale, moved) in [
            (0.0, 1.0, false),
            (100.0, 1.0, false),
            (1e4, 1.0, true),
            (5e6, 1.0, true),
            (1.0, 1e-4, true),
            (1e4, 1e4, false),
        ] {
            assert_eq!(local_origin(centers(offset, scale)) != Vector3::zeros(), moved, "{offset} {scale}");
        }
        assert_eq!(local_origin([]), Vector3::zeros());
        assert_eq!(local_origin([Vector3::new(1e9, 0.0, 0.0); 2]), Vector3::zeros());
        assert_eq!(local_origin([Vector3::new(f64::INFINITY, 0.0, 0.0), Vector3::zeros()]), Vector3::zeros());
    }

    #[test]
    fn moving_there_and_back_is_exact() {
        for (offset, scale) in [(1e4, 1.0), (5e6, 1.0), (-5e6, 12.3), (1.0, 1e-4), (4e5, 0.03)] {
            let centers = centers(offset, scale);
            let origin = local_origin(centers.iter().copied());
            for center in centers {
                let local = center - origin;
                assert_eq!(local + origin, center);
                assert!(local.amax() < 20.0 * scale);
            }
        }
    }
}
