//! Samples of all depth maps to boxes of about the same content.

use super::boxes::{Part, around, share_of};
use super::views::{Content, assign_views};
use crate::geometry::Roi;
use crate::scene::ViewIndex;
use rayon::prelude::*;

/// A part with so few samples is not split further.
const LEAF: usize = 128;
/// A part may be this much larger than asked for.
const SLACK: f64 = 1.01;
/// A side is halved if it is at least this part of the longest one: to cut along a thin layer would separate what the
/// same views see.
const MIN_SIDE: f64 = 0.5;
/// A part is not halved more often than this along an axis.
const MAX_DEPTH: u32 = 16;

/// A depth that stands for the pixels around it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// World position.
    pub position: [f32; 3],
    /// What it counts, > 0.
    pub area: f32,
    /// The view whose depth it is.
    pub view: ViewIndex,
}

/// A part of the scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Chunk {
    /// Its views, ascending.
    pub views: Vec<ViewIndex>,
    /// Its box.
    pub roi: Roi,
    /// Sum of the areas of the samples in it.
    pub area: f64,
}

/// Divides `roi`, or a box around all samples, into parts whose samples have a summed area below `max_area`, and finds
/// the views of each. Fewer than two chunks: the scene need not be split.
///
/// The box is halved along its longer axes at once, again and again, where its parts are too large; of the up to eight
/// parts as many neighbouring ones stay together, a half or a quarter, as are small enough, the largest first. The result
/// does not depend on threads.
pub fn split(mut samples: Vec<Sample>, roi: Option<&Roi>, max_area: f32) -> Vec<Chunk> {
    if let Some(roi) = roi {
        samples.retain(|sample| roi.contains(sample.position));
    }
    let Some(whole) = roi.cloned().or_else(|| around(&samples)) else { return Vec::new() };
    let shares: Vec<[f64; 3]> = samples.par_iter().map(|s| share_of(s.position, &whole)).collect();
    let mut splitter = Splitter {
        samples: &samples,
        shares: &shares,
        max_area: f64::from(max_area) * SLACK,
        half_extent: whole.half_extent.into(),
        found: Vec::new(),
    };
    let all: Vec<u32> = (0..samples.len() as u32).collect();
    splitter.divide(Part::WHOLE, all, 0);
    let mut totals = vec![0u64; samples.iter().map(|s| s.view.index() + 1).max().unwrap_or(0)];
    samples.iter().for_each(|s| totals[s.view.index()] += 1);
    let contents = splitter.found.iter().map(|(part, inside)| content(*part, inside, &samples)).collect();
    let chunks = assign_views(contents, &totals);
    chunks
        .into_iter()
        .map(|content| Chunk {
            views: content.counts.keys().map(|&v| ViewIndex(v)).collect(),
            roi: content.part.of(&whole),
            area: content.area,
        })
        .collect()
}

fn content(part: Part, inside: &[u32], samples: &[Sample]) -> Content {
    let mut content = Content { part, ..Content::default() };
    for &i in inside {
        let sample = &samples[i as usize];
        *content.counts.entry(sample.view.0).or_default() += 1;
        content.area += f64::from(sample.area);
    }
    content
}

struct Splitter<'a> {
    samples: &'a [Sample],
    shares: &'a [[f64; 3]],
    max_area: f64,
    /// Of the whole box.
    half_extent: [f64; 3],
    found: Vec<(Part, Vec<u32>)>,
}

/// One of the eight parts of a part, with its samples.
struct Octant {
    inside: Vec<u32>,
    area: f64,
}

impl Splitter<'_> {
    fn area(&self, inside: &[u32]) -> f64 {
        inside.iter().map(|&i| f64::from(self.samples[i as usize].area)).sum()
    }

    /// Finds the chunks of `part`, which holds the samples `inside`.
    fn divide(&mut self, part: Part, inside: Vec<u32>, depth: u32) {
        if inside.is_empty() {
            return;
        }
        if self.area(&inside) < self.max_area || inside.len() <= LEAF || depth == MAX_DEPTH {
            self.found.push((part, inside));
            return;
        }
        let middle: [f64; 3] = std::array::from_fn(|i| part.middle(i));
        let sides: [f64; 3] = std::array::from_fn(|i| (part.high[i] - part.low[i]) * self.half_extent[i]);
        let longest = sides.into_iter().fold(0.0, f64::max);
        let halved = sides.map(|side| side >= MIN_SIDE * longest);
        let mut octants: Vec<Octant> = (0..8).map(|_| Octant { inside: Vec::new(), area: 0.0 }).collect();
        for i in inside {
            let share = self.shares[i as usize];
            let octant =
                (0..3).filter(|&k| halved[k] && share[k] >= middle[k]).map(|k| 1 << k).sum::<usize>();
            octants[octant].area += f64::from(self.samples[i as usize].area);
            octants[octant].inside.push(i);
        }
        self.group(part, &mut octants, halved, [None; 3], depth);
    }

    /// Keeps the octants of `part` together as far as they are small enough; `sides` says on which side of each axis
    /// those in question are, `None` for both.
    fn group(
        &mut self,
        part: Part,
        octants: &mut [Octant],
        halved: [bool; 3],
        sides: [Option<bool>; 3],
        depth: u32,
    ) {
        let is_in = |octant: usize, sides: &[Option<bool>; 3]| {
            (0..3).all(|k| sides[k].is_none_or(|upper| upper == (octant >> k & 1 == 1)))
        };
        let members: Vec<usize> = (0..8).filter(|&o| is_in(o, &sides)).collect();
        let area = |members: &mut dyn Iterator<Item = usize>| members.map(|o| octants[o].area).sum::<f64>();
        let all = area(&mut members.iter().copied());
        let open: Vec<usize> = (0..3).filter(|&k| halved[k] && sides[k].is_none()).collect();
        if members.len() < 8 && (all < self.max_area || open.is_empty()) {
            let part = side_of(&part, &sides);
            let inside = members.iter().flat_map(|&o| std::mem::take(&mut octants[o].inside)).collect();
            return self.divide(part, inside, depth + 1);
        }
        // Along which axis is the larger half that is small enough the largest? Without one, along the first.
        let mut best: Option<(f64, usize)> = None;
        for axis in open {
            let half =
                |upper: bool| area(&mut members.iter().copied().filter(|o| (o >> axis & 1 == 1) == upper));
            let fitting = [half(false), half(true)].into_iter().filter(|&a| a < self.max_area);
            let largest = fitting.fold(0.0, f64::max);
            if best.is_none_or(|(area, _)| largest > area) {
                best = Some((largest, axis));
            }
        }
        let Some((_, axis)) = best else { return };
        for upper in [false, true] {
            let mut half = sides;
            half[axis] = Some(upper);
            self.group(part, octants, halved, half, depth);
        }
    }
}

/// The half, quarter or eighth of `part` on the given sides.
fn side_of(part: &Part, sides: &[Option<bool>; 3]) -> Part {
    let mut out = *part;
    for (axis, side) in sides.iter().enumerate() {
        match side {
            Some(true) => out.low[axis] = part.middle(axis),
            Some(false) => out.high[axis] = part.middle(axis),
            None => {}
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix3, Vector3};

    /// `views` views along x, each with 40×40 samples on a floor 2 wide around it; steps of 1.
    fn floor(views: u32) -> Vec<Sample> {
        let mut samples = Vec::new();
        for view in 0..views {
            for i in 0..1600 {
                let (x, y) = ((i % 40) as f32 / 20.0 - 1.0, (i / 40) as f32 / 20.0 - 1.0);
                let z = 0.05 * (x * 3.0).sin();
                let position = [view as f32 + x, y, z];
                samples.push(Sample { position, area: 1.0, view: ViewIndex(view) });
            }
        }
        samples
    }

    fn contains(chunk: &Chunk, sample: &Sample) -> bool {
        chunk.roi.contains(sample.position)
    }

    #[test]
    fn chunks_are_small_enough_and_cover_everything() {
        let samples = floor(24);
        for max_area in [3000.0, 8000.0, 20_000.0] {
            let chunks = split(samples.clone(), None, max_area);
            assert!(chunks.len() >= 2, "{max_area}");
            for sample in &samples {
                assert!(chunks.iter().any(|c| contains(c, sample)), "{sample:?}");
            }
            let total: f64 = chunks.iter().map(|c| c.area).sum();
            assert!((total - samples.len() as f64).abs() < 1e-6, "every sample is in one chunk");
            for chunk in &chunks {
                assert!(chunk.views.is_sorted() && chunk.views.len() > 4, "{chunk:?}");
                assert!(chunk.roi.half_extent.min() > 0.0);
            }
        }
        // Where no chunk had to be merged for its lack of views, none is too large.
        let chunks = split(samples, None, 20_000.0);
        assert!(chunks.iter().all(|c| c.area < 20_000.0 * SLACK), "{chunks:?}");
        assert!(chunks.iter().all(|c| c.views.len() < 24));
    }

    #[test]
    fn a_small_scene_is_one_chunk() {
        let chunks = split(floor(5), None, 1e9);
        assert_eq!(chunks.len(), 1);
        assert_eq!(chunks[0].views.len(), 5);
        assert!(split(Vec::new(), None, 10.0).is_empty());
    }

    #[test]
    fn chunks_stay_in_the_region_of_interest_and_in_its_frame() {
        let rotation = *nalgebra::Rotation3::from_euler_angles(0.0, 0.0, 0.5).matrix();
        let roi =
            Roi { rotation, center: Vector3::new(12.0, 0.0, 0.0), half_extent: Vector3::new(8.0, 0.8, 1.0) };
        let samples = floor(24);
        let chunks = split(samples.clone(), Some(&roi), 1500.0);
        assert!(chunks.len() >= 2);
        for chunk in &chunks {
            assert_eq!(chunk.roi.rotation, rotation);
            let local = rotation * (chunk.roi.center - roi.center);
            assert!((0..3).all(|i| local[i].abs() + chunk.roi.half_extent[i] <= roi.half_extent[i] + 1e-9));
        }
        for sample in samples.iter().filter(|s| roi.contains(s.position)) {
            assert!(chunks.iter().any(|c| contains(c, sample)), "{sample:?}");
        }
    }

    #[test]
    fn parts_turn_with_the_box() {
        let rotation = Matrix3::new(0.0, 1.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 1.0);
        let whole =
            Roi { rotation, center: Vector3::new(5.0, 5.0, 5.0), half_extent: Vector3::new(1.0, 2.0, 4.0) };
        let part = Part { low: [0.5, 0.0, 0.0], high: [1.0, 1.0, 0.25] };
        let roi = part.of(&whole);
        assert_eq!(roi.half_extent, Vector3::new(0.5, 2.0, 1.0));
        // Box x is world y, box z is world z.
        assert!((roi.center - Vector3::new(5.0, 5.5, 2.0)).norm() < 1e-12, "{}", roi.center);
        let share = share_of([5.0, 5.5, 2.0], &whole);
        assert!((share[0] - 0.75).abs() < 1e-9 && (share[2] - 0.125).abs() < 1e-9, "{share:?}");
    }
}
