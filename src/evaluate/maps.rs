//! Scores of a depth map against another one or against true depths.

use super::round_to;
use crate::geometry::Size;
use crate::scene::{DepthMap, Grid};
use serde::{Serialize, Serializer, ser::SerializeMap};

/// Relative step between neighbouring depths that makes an edge.
const EDGE_STEP: f64 = 0.03;

/// What to score and how.
#[derive(Clone, Debug, PartialEq)]
pub struct MapScoreOptions {
    /// Bounds of the relative depth difference, each > 0. Default: 0.001, 0.002, 0.005, 0.01.
    pub relative: Vec<f64>,
    /// Width of the band along depth edges, pixels (4-connected steps). Default: 4.
    pub edge_band: u32,
}

impl Default for MapScoreOptions {
    fn default() -> Self {
        MapScoreOptions { relative: vec![0.001, 0.002, 0.005, 0.01], edge_band: 4 }
    }
}

/// Scores of map A against map B; serializes as `dmap_metrics.py` prints them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MapScores {
    /// Maps averaged: 1 for a pair, more from [`MapScores::mean`].
    pub maps: usize,
    /// Share of all pixels valid in A.
    pub valid_a: f64,
    /// Share of all pixels valid in B.
    pub valid_b: f64,
    /// Share of all pixels valid in both.
    pub both: f64,
    /// Share of all pixels valid in A alone.
    pub only_a: f64,
    /// Share of all pixels valid in B alone.
    pub only_b: f64,
    /// Median relative depth difference of the pixels valid in both; `None` if there are none.
    pub median_rel: Option<f64>,
    /// Share of the pixels valid in both with equal depths; `None` if there are none.
    pub identical: Option<f64>,
    /// One entry per bound.
    pub bounds: Vec<BoundScore>,
}

/// Scores at one bound of the relative depth difference `|a − b| / b`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BoundScore {
    /// The bound.
    pub t: f64,
    /// Share of the pixels valid in both that are within the bound.
    pub within: f64,
    /// Share of B's valid pixels that A has within the bound.
    pub good: f64,
    /// `good` over the band along B's depth edges.
    pub edge_good: f64,
    /// `within` over the band along B's depth edges.
    pub edge_within: f64,
}

/// Scores depth map `a` against `b`. A map of another size than `a` is sampled at the nearest pixel; depths that are
/// not finite and positive are invalid.
pub fn map_scores(a: &DepthMap, b: &DepthMap, options: &MapScoreOptions) -> MapScores {
    let (a, b) = (cleaned(a), resampled(&cleaned(b), a.size()));
    let edge = edge_band(&b, options.edge_band);
    let pixels = a.data().len();
    // relative difference and whether on an edge, of B's valid pixels
    let of_b: Vec<(f64, bool)> = a
        .data()
        .iter()
        .zip(b.data())
        .zip(edge.data())
        .filter(|((_, b), _)| **b > 0.0)
        .map(|((a, b), edge)| (if *a > 0.0 { (a - b).abs() / b } else { f64::INFINITY }, *edge))
        .collect();
    let mut both: Vec<f64> = of_b.iter().map(|v| v.0).filter(|d| d.is_finite()).collect();
    let on_edge: Vec<f64> = of_b.iter().filter(|v| v.1).map(|v| v.0).collect();
    let of_edge_both = on_edge.iter().filter(|d| d.is_finite()).count();
    let share = |n: usize, of: usize| if of > 0 { n as f64 / of as f64 } else { 0.0 };
    let below = |values: &[f64], t: f64| values.iter().filter(|d| **d < t).count();
    let bound = |&t: &f64| BoundScore {
        t,
        within: share(below(&both, t), both.len()),
        good: share(below(&both, t), of_b.len()),
        edge_good: share(below(&on_edge, t), on_edge.len()),
        edge_within: share(below(&on_edge, t), of_edge_both),
    };
    let bounds = options.relative.iter().map(bound).collect();
    let valid_a = a.data().iter().filter(|d| **d > 0.0).count();
    let identical = both.iter().filter(|d| **d == 0.0).count();
    MapScores {
        maps: 1,
        valid_a: share(valid_a, pixels),
        valid_b: share(of_b.len(), pixels),
        both: share(both.len(), pixels),
        only_a: share(valid_a - both.len(), pixels),
        only_b: share(of_b.len() - both.len(), pixels),
        identical: (!both.is_empty()).then(|| share(identical, both.len())),
        median_rel: median(&mut both),
        bounds,
    }
}

impl MapScores {
    /// The mean of every score over several maps scored with the same bounds.
    pub fn mean(scores: &[MapScores]) -> MapScores {
        let mean = |get: &dyn Fn(&MapScores) -> Option<f64>| {
            let values: Vec<f64> = scores.iter().filter_map(get).collect();
            (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
        };
        let all = |get: &dyn Fn(&MapScores) -> f64| mean(&|s| Some(get(s))).unwrap_or(0.0);
        let of_bound =
            |i: usize, get: &dyn Fn(&BoundScore) -> f64| mean(&|s| s.bounds.get(i).map(get)).unwrap_or(0.0);
        let bounds = scores.first().map_or(&[][..], |s| &s.bounds);
        let bounds = bounds.iter().enumerate().map(|(i, bound)| BoundScore {
            t: bound.t,
            within: of_bound(i, &|b| b.within),
            good: of_bound(i, &|b| b.good),
            edge_good: of_bound(i, &|b| b.edge_good),
            edge_within: of_bound(i, &|b| b.edge_within),
        });
        MapScores {
            maps: scores.len(),
            valid_a: all(&|s| s.valid_a),
            valid_b: all(&|s| s.valid_b),
            both: all(&|s| s.both),
            only_a: all(&|s| s.only_a),
            only_b: all(&|s| s.only_b),
            median_rel: mean(&|s| s.median_rel),
            identical: mean(&|s| s.identical),
            bounds: bounds.collect(),
        }
    }
}

impl Serialize for MapScores {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        map.serialize_entry("maps", &self.maps)?;
        let shares = [
            ("valid_a", Some(self.valid_a)),
            ("valid_b", Some(self.valid_b)),
            ("both", Some(self.both)),
            ("only_a", Some(self.only_a)),
            ("only_b", Some(self.only_b)),
            ("median_rel", self.median_rel),
            ("identical", self.identical),
        ];
        for (key, value) in shares {
            map.serialize_entry(key, &value.map(round_to::<6>))?;
        }
        for b in &self.bounds {
            map.serialize_entry(&format!("within_{:?}", b.t), &round_to::<6>(b.within))?;
            map.serialize_entry(&format!("good_{:?}", b.t), &round_to::<6>(b.good))?;
            map.serialize_entry(&format!("edge_good_{:?}", b.t), &round_to::<6>(b.edge_good))?;
            map.serialize_entry(&format!("edge_within_{:?}", b.t), &round_to::<6>(b.edge_within))?;
        }
        map.end()
    }
}

/// Depths in double precision, 0 where invalid.
fn cleaned(map: &DepthMap) -> Grid<f64> {
    let mut grid = Grid::filled(map.size(), 0.0);
    for (to, from) in grid.data_mut().iter_mut().zip(map.data()) {
        *to = if from.is_finite() { f64::from(*from).max(0.0) } else { 0.0 };
    }
    grid
}

/// The map at another size, nearest pixel.
fn resampled(map: &Grid<f64>, size: Size) -> Grid<f64> {
    if map.size() == size {
        return map.clone();
    }
    let mut grid = Grid::filled(size, 0.0);
    let scale = |i: usize, from: usize, to: usize| ((i as f64 + 0.5) * from as f64 / to as f64) as usize;
    let (width, height) = (grid.width(), grid.height());
    for y in 0..height {
        for x in 0..width {
            let from = map.get(scale(x, map.width(), width), scale(y, map.height(), height));
            grid[(x, y)] = from.copied().unwrap_or(0.0);
        }
    }
    grid
}

/// Valid pixels at most `band` 4-connected steps from a depth step or an invalid pixel.
fn edge_band(depth: &Grid<f64>, band: u32) -> Grid<bool> {
    let (width, height) = (depth.width(), depth.height());
    let mut near = Grid::filled(depth.size(), false);
    for (to, from) in near.data_mut().iter_mut().zip(depth.data()) {
        *to = *from <= 0.0;
    }
    let is_step = |a: f64, b: f64| (a - b).abs() > EDGE_STEP * a.min(b);
    for y in 0..height {
        for x in 0..width {
            for (x1, y1) in [(x + 1, y), (x, y + 1)] {
                if x1 < width && y1 < height && is_step(depth[(x, y)], depth[(x1, y1)]) {
                    near[(x, y)] = true;
                    near[(x1, y1)] = true;
                }
            }
        }
    }
    for _ in 0..band {
        let before = near.clone();
        let set = |x: usize, y: usize| before.get(x, y).copied().unwrap_or(false);
        for y in 0..height {
            for x in 0..width {
                near[(x, y)] |=
                    set(x.wrapping_sub(1), y) || set(x + 1, y) || set(x, y.wrapping_sub(1)) || set(x, y + 1);
            }
        }
    }
    for (to, from) in near.data_mut().iter_mut().zip(depth.data()) {
        *to &= *from > 0.0;
    }
    near
}

/// The middle value, or the mean of the two middle ones.
fn median(values: &mut [f64]) -> Option<f64> {
    let even = values.len().is_multiple_of(2);
    if values.is_empty() {
        return None;
    }
    let (below, upper, _) = values.select_nth_unstable_by(values.len() / 2, f64::total_cmp);
    let upper = *upper;
    let lower = if even { below.iter().copied().fold(0.0, f64::max) } else { upper };
    Some((lower + upper) / 2.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map(width: u32, height: u32, depth: impl Fn(usize, usize) -> f32) -> DepthMap {
        let mut map = Grid::filled(Size { width, height }, 0.0);
        for y in 0..map.height() {
            for x in 0..map.width() {
                map[(x, y)] = depth(x, y);
            }
        }
        map
    }

    #[test]
    fn shares_are_of_the_right_pixels() {
        // columns 0..5 valid in A, 2..8 in B; A is 0.5 % off in column 2
        let a = map(10, 4, |x, _| if x < 5 { if x == 2 { 2.01 } else { 2.0 } } else { f32::NAN });
        let b = map(10, 4, |x, _| if (2..8).contains(&x) { 2.0 } else { 0.0 });
        let s = map_scores(&a, &b, &MapScoreOptions { relative: vec![0.004, 0.01], edge_band: 0 });
        assert_eq!((s.valid_a, s.valid_b, s.both, s.only_a, s.only_b), (0.5, 0.6, 0.3, 0.2, 0.3));
        assert_eq!((s.median_rel, s.identical), (Some(0.0), Some(2.0 / 3.0)));
        assert_eq!((s.bounds[0].within, s.bounds[0].good), (2.0 / 3.0, 2.0 / 6.0));
        assert_eq!((s.bounds[1].within, s.bounds[1].good), (1.0, 0.5));
        // columns 2 and 7 touch invalid pixels; A has column 2 alone
        assert_eq!((s.bounds[0].edge_good, s.bounds[0].edge_within), (0.0, 0.0));
        assert_eq!((s.bounds[1].edge_good, s.bounds[1].edge_within), (0.5, 1.0));
    }

    #[test]
    fn the_band_grows_by_four_connected_steps_from_steps_and_holes() {
        let b = map(9, 9, |x, y| if (x, y) == (4, 4) { 0.0 } else { 1.0 + 0.01 * y as f32 });
        let band = edge_band(&cleaned(&b), 1);
        let marked = |x: usize, y: usize| x.abs_diff(4) + y.abs_diff(4) <= 2 && (x, y) != (4, 4);
        for y in 0..9 {
            for x in 0..9 {
                assert_eq!(band[(x, y)], marked(x, y), "{x} {y}");
            }
        }
        let step = edge_band(&cleaned(&map(8, 1, |x, _| if x < 4 { 1.0 } else { 1.031 })), 1);
        assert_eq!(step.data(), [false, false, true, true, true, true, false, false]);
    }

    #[test]
    fn maps_of_other_sizes_are_sampled_at_the_nearest_pixel() {
        let b = resampled(&cleaned(&map(4, 2, |x, y| (1 + x + 10 * y) as f32)), Size { width: 2, height: 4 });
        assert_eq!(b.data(), [2.0, 4.0, 2.0, 4.0, 12.0, 14.0, 12.0, 14.0]);
    }

    #[test]
    fn means_leave_out_what_is_not_known() {
        let (a, b) = (map(2, 1, |_, _| 1.0), map(2, 1, |_, _| 0.0));
        let options = MapScoreOptions { relative: vec![0.5], edge_band: 1 };
        let scores = [map_scores(&a, &a, &options), map_scores(&a, &b, &options)];
        let mean = MapScores::mean(&scores);
        assert_eq!((mean.maps, mean.both, mean.median_rel), (2, 0.5, Some(0.0)));
        let json = serde_json::to_string(&mean).unwrap();
        assert!(json.starts_with("{\"maps\":2,\"valid_a\":1.0,"), "{json}");
        assert!(json.contains("\"within_0.5\":0.5,\"good_0.5\":0.5,\"edge_good_0.5\":0.0"), "{json}");
    }

    #[test]
    fn the_median_of_an_even_number_is_between_the_middle_two() {
        assert_eq!(median(&mut [4.0, 1.0, 3.0, 2.0]), Some(2.5));
        assert_eq!(median(&mut [3.0, 1.0, 2.0]), Some(2.0));
        assert_eq!(median(&mut []), None);
    }
}
