//! Points grouped by place, so that most of them can be passed over at once.

use nalgebra::Vector3;
use rayon::prelude::*;

/// Points in a block.
const BLOCK: usize = 256;
/// Bits per coordinate of the curve that puts near points side by side.
const BITS: u32 = 21;

/// All points of a cloud in blocks of near ones.
#[derive(Debug)]
pub(super) struct Blocks {
    /// Positions of points in the cloud, in the order of the curve.
    order: Vec<u32>,
    spheres: Vec<Sphere>,
}

/// A ball around the points of a block.
#[derive(Clone, Copy, Debug)]
struct Sphere {
    center: Vector3<f64>,
    radius: f64,
}

/// Everything within an angle of a direction, up to a distance.
#[derive(Clone, Copy, Debug)]
pub(super) struct Beam {
    pub(super) apex: Vector3<f64>,
    /// Unit vector.
    pub(super) axis: Vector3<f64>,
    /// Radians.
    pub(super) half_angle: f64,
    pub(super) reach: f64,
}

impl Beam {
    /// Whether some point of the ball may be inside; errs towards yes.
    fn may_meet(&self, sphere: &Sphere) -> bool {
        /// What rounding may hide, in radians.
        const SLACK: f64 = 1e-9;
        let to_center = sphere.center - self.apex;
        let distance = to_center.norm();
        if distance <= sphere.radius {
            return true;
        }
        if distance - sphere.radius > self.reach {
            return false;
        }
        let angle = to_center.dot(&self.axis) / distance;
        let angle = angle.clamp(-1.0, 1.0).acos();
        angle <= self.half_angle + (sphere.radius / distance).min(1.0).asin() + SLACK
    }
}

impl Blocks {
    /// Groups `positions`, which are finite.
    pub(super) fn new(positions: &[[f32; 3]]) -> Self {
        let (mut min, mut max) = ([f32::MAX; 3], [f32::MIN; 3]);
        for point in positions {
            for i in 0..3 {
                min[i] = min[i].min(point[i]);
                max[i] = max[i].max(point[i]);
            }
        }
        let edge = (0..3).map(|i| f64::from(max[i]) - f64::from(min[i])).fold(f64::MIN_POSITIVE, f64::max);
        let scale = f64::from((1u32 << BITS) - 1) / edge;
        let mut keyed: Vec<(u64, u32)> = positions
            .par_iter()
            .enumerate()
            .map(|(i, point)| {
                let cell = |k: usize| ((f64::from(point[k]) - f64::from(min[k])) * scale) as u64;
                (spread(cell(0)) | spread(cell(1)) << 1 | spread(cell(2)) << 2, i as u32)
            })
            .collect();
        keyed.par_sort_unstable();
        let order: Vec<u32> = keyed.into_iter().map(|(_, i)| i).collect();
        let spheres = order.par_chunks(BLOCK).map(|block| sphere_of(block, positions)).collect();
        Blocks { order, spheres }
    }

    /// The points of all blocks that may have points in `beam`.
    pub(super) fn near<'a>(&'a self, beam: &'a Beam) -> impl ParallelIterator<Item = u32> + 'a {
        self.order
            .par_chunks(BLOCK)
            .zip(self.spheres.par_iter())
            .filter(|(_, sphere)| beam.may_meet(sphere))
            .flat_map_iter(|(block, _)| block.iter().copied())
    }
}

fn sphere_of(block: &[u32], positions: &[[f32; 3]]) -> Sphere {
    let point = |i: &u32| Vector3::from(positions[*i as usize].map(f64::from));
    let low = block.iter().map(point).reduce(|a, b| a.inf(&b)).unwrap_or_default();
    let high = block.iter().map(point).reduce(|a, b| a.sup(&b)).unwrap_or_default();
    let center = (low + high) / 2.0;
    Sphere { center, radius: (high - center).norm() * (1.0 + 1e-12) }
}

/// Puts two zero bits after each of the lowest 21 bits.
fn spread(value: u64) -> u64 {
    let mut v = value & 0x1f_ffff;
    v = (v | v << 32) & 0x001f_0000_0000_ffff;
    v = (v | v << 16) & 0x001f_0000_ff00_00ff;
    v = (v | v << 8) & 0x100f_00f0_0f00_f00f;
    v = (v | v << 4) & 0x10c3_0c30_c30c_30c3;
    (v | v << 2) & 0x1249_2492_4924_9249
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_are_spread_by_three() {
        assert_eq!(spread(0b1011), 0b1_000_001_001);
        assert_eq!(spread(0x1f_ffff), 0x1249_2492_4924_9249);
    }

    #[test]
    fn no_point_of_a_beam_is_passed_over() {
        let positions: Vec<[f32; 3]> = (0..4000)
            .map(|i| {
                let t = i as f32;
                [(t * 0.37).sin() * 9.0, (t * 0.73).cos() * 9.0, (t * 1.31).sin() * 9.0]
            })
            .collect();
        let blocks = Blocks::new(&positions);
        let beam = Beam {
            apex: Vector3::new(0.5, -20.0, 1.0),
            axis: Vector3::new(0.1, 1.0, 0.0).normalize(),
            half_angle: 0.1,
            reach: 18.0,
        };
        let near: std::collections::BTreeSet<u32> = blocks.near(&beam).collect();
        let inside = |p: &[f32; 3]| {
            let d = Vector3::from(p.map(f64::from)) - beam.apex;
            d.norm() <= beam.reach && (d.dot(&beam.axis) / d.norm()).acos() <= beam.half_angle
        };
        let wanted: Vec<u32> = (0..4000).filter(|&i| inside(&positions[i as usize])).collect();
        assert!(!wanted.is_empty() && near.len() < positions.len());
        assert!(wanted.iter().all(|i| near.contains(i)));
    }
}
