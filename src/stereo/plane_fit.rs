//! The few planes that most of a region lies in, found by drawing (Fischler and Bolles 1981) and refined by least squares.

use super::level::Level;
use super::plane::InversePlane;
use super::rng::Rng;
use crate::scene::DepthEstimate;
use crate::semantics::PlanarRegion;

/// Most planes of a region.
const MAX_PLANES: usize = 3;
/// Planes drawn for each.
const DRAWS: usize = 96;
/// Most pixels that a drawn plane is held against.
const MAX_JUDGES: usize = 512;
/// Distance, in pixels of shift in the most distant source, up to which a pixel lies in a plane.
const GATE: f32 = 0.3;
/// Pixels nearer than so many gates to a plane take no part in finding the next.
const SPENT: f32 = 2.0;
/// Least confidence of a pixel that takes part.
const MIN_CONFIDENCE: f32 = 0.02;
/// Share of a region's pixels that must lie in a plane, and their least number.
const MIN_SHARE: f32 = 0.1;
const MIN_PIXELS: f32 = 30.0;
/// Rounds of least squares.
const ROUNDS: usize = 4;
/// Twice the area of the smallest triangle that a plane is drawn through, in pixels.
const MIN_AREA: f32 = 20.0;

/// A plane that a good part of a region lies in.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct RegionPlane {
    /// The plane anchored at pixel (0, 0).
    pub(crate) plane: InversePlane,
    /// Share, 0..1, of the region's confident pixels that lie in it.
    pub(crate) share: f32,
}

/// A confident pixel.
#[derive(Clone, Copy, Debug)]
struct Sample {
    x: f32,
    y: f32,
    w: f32,
    normal: [f32; 3],
    weight: f32,
}

/// The planes of a region, the one with most pixels first; none without confidences.
pub(crate) fn fit(
    region: &PlanarRegion,
    level: &Level,
    estimate: &DepthEstimate,
    rng: &mut Rng,
) -> Vec<RegionPlane> {
    let mut samples = confident(region, estimate);
    let all = samples.len() as f32;
    let needed = (MIN_SHARE * region.pixels.len() as f32).max(MIN_PIXELS);
    let search = Search { level, min_cos: region.prior.max_normal_deviation.to_radians().cos() };
    let mut planes = Vec::new();
    while samples.len() as f32 >= needed && planes.len() < MAX_PLANES {
        let Some(plane) = search.draw(&samples, rng).map(|drawn| search.refine(drawn, &samples)) else {
            break;
        };
        let count = samples.iter().filter(|s| search.holds(plane, s)).count() as f32;
        if count < needed {
            break;
        }
        planes.push(RegionPlane { plane, share: count / all });
        samples.retain(|s| search.distance(plane, s) >= SPENT);
    }
    planes
}

/// The confident pixels of a region.
fn confident(region: &PlanarRegion, estimate: &DepthEstimate) -> Vec<Sample> {
    let (Some(normals), Some(confidences)) = (&estimate.normal, &estimate.confidence) else {
        return Vec::new();
    };
    let width = estimate.depth.width();
    let sample = |&at: &u32| {
        let at = at as usize;
        let (depth, confidence) = (estimate.depth.data()[at], confidences.data()[at]);
        (depth > 0.0 && confidence >= MIN_CONFIDENCE).then(|| Sample {
            x: (at % width) as f32,
            y: (at / width) as f32,
            w: 1.0 / depth,
            normal: normals.data()[at],
            weight: confidence.sqrt(),
        })
    };
    region.pixels.iter().filter_map(sample).collect()
}

/// What lies in a plane.
struct Search<'a> {
    level: &'a Level,
    min_cos: f32,
}

impl Search<'_> {
    /// Distance of a pixel from a plane, in gates.
    fn distance(&self, plane: InversePlane, s: &Sample) -> f32 {
        (plane.moved(s.x, s.y).w - s.w).abs() * self.level.pixels_per_w / GATE
    }

    /// Whether a pixel lies in a plane and faces its way.
    fn holds(&self, plane: InversePlane, s: &Sample) -> bool {
        if self.distance(plane, s) >= 1.0 {
            return false;
        }
        let n = self.level.pinhole.normal(plane.moved(s.x, s.y), s.x, s.y);
        n[0] * s.normal[0] + n[1] * s.normal[1] + n[2] * s.normal[2] >= self.min_cos
    }

    /// The best of a number of planes through three pixels each.
    fn draw(&self, samples: &[Sample], rng: &mut Rng) -> Option<InversePlane> {
        let step = samples.len().div_ceil(MAX_JUDGES);
        let mut best: Option<(f32, InversePlane)> = None;
        for _ in 0..DRAWS {
            let three = [0; 3].map(|_| samples[rng.below(samples.len())]);
            let Some(plane) = through(three) else { continue };
            let judges = samples.iter().step_by(step).filter(|s| self.holds(plane, s));
            let score: f32 = judges.map(|s| s.weight).sum();
            if best.is_none_or(|(most, _)| score > most) {
                best = Some((score, plane));
            }
        }
        best.map(|(_, plane)| plane)
    }

    /// The plane fitted to the pixels that lie in `plane`, again and again.
    fn refine(&self, mut plane: InversePlane, samples: &[Sample]) -> InversePlane {
        for _ in 0..ROUNDS {
            match least_squares(samples.iter().filter(|s| self.holds(plane, s))) {
                Some(better) => plane = better,
                None => break,
            }
        }
        plane
    }
}

/// The plane through three pixels, anchored at pixel (0, 0); `None` if they lie nearly on a line.
fn through([a, b, c]: [Sample; 3]) -> Option<InversePlane> {
    let (bx, by, bw) = (b.x - a.x, b.y - a.y, b.w - a.w);
    let (cx, cy, cw) = (c.x - a.x, c.y - a.y, c.w - a.w);
    let det = bx * cy - cx * by;
    if det.abs() < MIN_AREA {
        return None;
    }
    let (wx, wy) = ((bw * cy - cw * by) / det, (bx * cw - cx * bw) / det);
    Some(InversePlane { w: a.w, wx, wy }.moved(-a.x, -a.y))
}

/// The plane with the smallest weighted squares of differences, anchored at pixel (0, 0); `None` if the pixels lie nearly
/// on a line.
fn least_squares<'a>(samples: impl Iterator<Item = &'a Sample> + Clone) -> Option<InversePlane> {
    /// Smallest determinant of the pixels' covariance.
    const MIN_DETERMINANT: f64 = 1e-3;
    let (mut n, mut x, mut y, mut w) = (0.0f64, 0.0, 0.0, 0.0);
    for s in samples.clone() {
        let k = f64::from(s.weight);
        (n, x, y, w) = (n + k, x + k * f64::from(s.x), y + k * f64::from(s.y), w + k * f64::from(s.w));
    }
    let (x, y, w) = (x / n, y / n, w / n);
    let [mut xx, mut xy, mut yy, mut xw, mut yw] = [0.0f64; 5];
    for s in samples {
        let k = f64::from(s.weight) / n;
        let (dx, dy, dw) = (f64::from(s.x) - x, f64::from(s.y) - y, f64::from(s.w) - w);
        (xx, xy, yy) = (xx + k * dx * dx, xy + k * dx * dy, yy + k * dy * dy);
        (xw, yw) = (xw + k * dx * dw, yw + k * dy * dw);
    }
    let det = xx * yy - xy * xy;
    if det.is_nan() || det < MIN_DETERMINANT {
        return None;
    }
    let (wx, wy) = ((xw * yy - yw * xy) / det, (yw * xx - xw * xy) / det);
    Some(InversePlane { w: (w - wx * x - wy * y) as f32, wx: wx as f32, wy: wy as f32 })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Grid;
    use crate::semantics::PlanePrior;
    use crate::stereo::tests::{problem, slanted};
    use crate::stereo::{StereoProblem, confidence, state::State};

    const NEAR: InversePlane = InversePlane { w: 0.25, wx: 2e-4, wy: -1e-4 };
    const FAR: InversePlane = InversePlane { w: 0.2, wx: -1e-4, wy: 3e-4 };

    fn region(pixels: impl Iterator<Item = u32>) -> PlanarRegion {
        PlanarRegion { pixels: pixels.collect(), prior: PlanePrior::default() }
    }

    /// An estimate whose pixels lie in the planes that `plane_of` says.
    fn estimate(
        problem: &StereoProblem,
        level: &Level,
        plane_of: impl Fn(usize) -> Option<InversePlane>,
    ) -> DepthEstimate {
        let state = State::random(level, problem, 0, 0);
        let mut made = confidence::finish(problem, level, &state, 1.0);
        made.confidence = Some(Grid::filled(level.size, 1.0));
        let width = level.size.width as usize;
        for at in 0..level.size.area() {
            let (x, y) = ((at % width) as f32, (at / width) as f32);
            let plane = plane_of(at).map(|plane| plane.moved(x, y));
            made.depth.data_mut()[at] = plane.map_or(0.0, |plane| 1.0 / plane.w);
            if let (Some(plane), Some(normals)) = (plane, &mut made.normal) {
                normals.data_mut()[at] = level.pinhole.normal(plane, x, y);
            }
        }
        made
    }

    fn close(a: InversePlane, b: InversePlane) -> bool {
        [(0.0, 0.0), (111.0, 0.0), (0.0, 79.0)]
            .iter()
            .all(|&(x, y)| (a.moved(x, y).w - b.moved(x, y).w).abs() < 1e-4)
    }

    #[test]
    fn both_planes_of_a_region_are_found_the_larger_first_whatever_the_outliers() {
        let (problem, _) = problem(slanted, 0);
        let level = Level::new(&problem, 0);
        let of = |at: usize| match at % 10 {
            0..=5 => Some(NEAR),
            6..=8 => Some(FAR),
            _ => Some(InversePlane { w: 0.12 + (at * 37 % 101) as f32 * 0.003, wx: 0.0, wy: 0.0 }),
        };
        let made = estimate(&problem, &level, of);
        let planes = fit(&region(0..4000), &level, &made, &mut Rng::keyed(0, 0, 0, 0));
        assert_eq!(planes.len(), 2, "{planes:?}");
        assert!(close(planes[0].plane, NEAR) && close(planes[1].plane, FAR), "{planes:?}");
        assert!((0.58..0.68).contains(&planes[0].share) && (0.28..0.36).contains(&planes[1].share));
        let again = fit(&region(0..4000), &level, &made, &mut Rng::keyed(0, 0, 0, 0));
        assert_eq!(again, planes);
    }

    #[test]
    fn too_few_confident_pixels_make_no_plane() {
        let (problem, _) = problem(slanted, 0);
        let level = Level::new(&problem, 0);
        let few = estimate(&problem, &level, |at| (at % 20 == 0).then_some(NEAR));
        assert!(fit(&region(0..4000), &level, &few, &mut Rng::keyed(0, 0, 0, 0)).is_empty());
        let mut unsure = estimate(&problem, &level, |_| Some(NEAR));
        unsure.confidence = Some(Grid::filled(level.size, 0.5 * MIN_CONFIDENCE));
        assert!(fit(&region(0..4000), &level, &unsure, &mut Rng::keyed(0, 0, 0, 0)).is_empty());
    }

    #[test]
    fn pixels_that_face_another_way_do_not_count() {
        let (problem, _) = problem(slanted, 0);
        let level = Level::new(&problem, 0);
        let mut made = estimate(&problem, &level, |_| Some(NEAR));
        made.normal = Some(Grid::filled(level.size, [0.8, 0.0, -0.6]));
        assert!(fit(&region(0..4000), &level, &made, &mut Rng::keyed(0, 0, 0, 0)).is_empty());
    }
}
