//! Pictures of two depth maps and of where they differ, on scales that all pairs share.

use super::super::page_parts::{map_address, picture_size};
use crate::error::Result;
use crate::evaluate::{MapDifferences, Presence, map_differences};
use crate::geometry::Size;
use crate::report::{
    ComparisonScales, PairLayers, amount_picture, data_address, depth_picture, depth_scale, presence_picture,
    signed_picture,
};
use crate::scene::{ColorImage, DepthEstimate, DepthMap, Grid, resize_nearest};
use crate::store::drawing::png_bytes;
use rayon::prelude::*;

/// Pixels of all pictures of one kind together.
const MOST_PIXELS: f64 = 6e6;
/// Share of the differing pixels that the ends of a scale leave out.
const BEYOND: f64 = 0.05;
/// Depths of a map that the common scale is taken from.
const SCALE_SAMPLE: usize = 4096;

/// A pair of depth maps at the size of its pictures.
pub(super) struct SmallPair {
    /// Size of the maps.
    pub(super) full: Size,
    a: DepthMap,
    b: DepthMap,
    differences: MapDifferences,
}

impl SmallPair {
    /// Two maps of the same size, one pair of `count`; `None` if their sizes differ.
    pub(super) fn new(a: &DepthEstimate, b: &DepthEstimate, count: usize) -> Option<Self> {
        let full = a.depth.size();
        let size = picture_size(full, count, MOST_PIXELS);
        let found = map_differences(a, b)?;
        let largest = |grid: &Grid<f32>| reduced(grid, size, f32::NAN, |one, other| one.abs() > other.abs());
        let differences = MapDifferences {
            presence: reduced(&found.presence, size, Presence::Neither, |one, other| {
                rank(*one) > rank(*other)
            }),
            depth: largest(&found.depth),
            normal: found.normal.as_ref().map(largest),
            confidence: found.confidence.as_ref().map(largest),
        };
        let [a, b] = [a, b].map(|map| resize_nearest(&map.depth, size));
        Some(SmallPair { full, a, b, differences })
    }

    fn draw(&self, scales: &ComparisonScales) -> Result<PairLayers> {
        let depths = (scales.depth[0], scales.depth[1]);
        let found = &self.differences;
        let normal = found.normal.as_ref().map(|n| sharp_address(&amount_picture(n, scales.normal)));
        let confidence =
            found.confidence.as_ref().map(|c| sharp_address(&signed_picture(c, scales.confidence)));
        Ok(PairLayers {
            a: map_address(&depth_picture(&self.a, depths))?,
            b: map_address(&depth_picture(&self.b, depths))?,
            depth: sharp_address(&signed_picture(&found.depth, scales.difference))?,
            presence: sharp_address(&presence_picture(&found.presence))?,
            normal: normal.transpose()?,
            confidence: confidence.transpose()?,
        })
    }
}

/// What a picture shows where several pixels fall on one of its own: what only one map has, before what both have.
fn rank(presence: Presence) -> u8 {
    match presence {
        Presence::Neither => 0,
        Presence::Both => 1,
        Presence::OnlyB => 2,
        Presence::OnlyA => 3,
    }
}

/// `grid` at a size not above its own: of the values that fall on a pixel the one that is `more` than all others, `nothing`
/// being less than any.
fn reduced<T: Copy>(grid: &Grid<T>, to: Size, nothing: T, more: impl Fn(&T, &T) -> bool) -> Grid<T> {
    let (width, height) = (grid.width().max(1), grid.height().max(1));
    let mut out: Grid<Option<T>> = Grid::filled(to, None);
    for (i, value) in grid.data().iter().enumerate() {
        let (x, y) = (i % width * to.width as usize / width, i / width * to.height as usize / height);
        let kept = &mut out[(x, y)];
        // A value that is not a number is not less than `value` either, and gives way.
        if kept.is_none_or(|kept| more(value, &kept) || !more(&kept, value) && !more(&kept, &nothing)) {
            *kept = Some(*value);
        }
    }
    let values = out.into_vec().into_iter().map(|value| value.unwrap_or(nothing)).collect();
    Grid::from_vec(to, values).unwrap_or_else(|| Grid::filled(to, nothing))
}

/// The pictures of all pairs, and what their colours mean.
///
/// # Errors
/// Maps without pixels.
pub(super) fn pictures(pairs: &[SmallPair]) -> Result<(Vec<PairLayers>, ComparisonScales)> {
    let mut depths: Vec<f32> = Vec::new();
    for grid in pairs.iter().flat_map(|pair| [&pair.a, &pair.b]) {
        let step = grid.data().len().div_ceil(SCALE_SAMPLE).max(1);
        depths.extend(grid.data().iter().step_by(step).filter(|d| **d > 0.0 && d.is_finite()));
    }
    let depth = depth_scale(&mut depths);
    let largest = |grid: fn(&MapDifferences) -> Option<&Grid<f32>>| {
        let grids = pairs.iter().filter_map(|pair| grid(&pair.differences));
        scale_of(grids.flat_map(|grid| grid.data()).copied())
    };
    let scales = ComparisonScales {
        depth: [depth.0, depth.1],
        difference: largest(|d| Some(&d.depth)),
        normal: largest(|d| d.normal.as_ref()).min(180.0),
        confidence: largest(|d| d.confidence.as_ref()),
        ..ComparisonScales::default()
    };
    let layers = pairs.par_iter().map(|pair| pair.draw(&scales)).collect::<Result<_>>()?;
    Ok((layers, scales))
}

/// The end of a scale for differences: a round number that few of those that are not 0 exceed; 0 without any.
fn scale_of(differences: impl Iterator<Item = f32>) -> f32 {
    let mut sizes: Vec<f32> = differences.map(f32::abs).filter(|d| *d > 0.0 && d.is_finite()).collect();
    sizes.sort_unstable_by(f32::total_cmp);
    let at = ((1.0 - BEYOND) * sizes.len() as f64) as usize;
    sizes.get(at).map_or(0.0, |d| round_up(f64::from(*d)) as f32)
}

/// The next of 1, 2 and 5 times a power of ten.
pub(super) fn round_up(value: f64) -> f64 {
    let power = 10f64.powf(value.log10().floor());
    let steps = [1.0, 2.0, 5.0, 10.0].map(|step| step * power);
    steps.into_iter().find(|step| *step >= value * (1.0 - 1e-6)).unwrap_or(value)
}

fn sharp_address(picture: &ColorImage) -> Result<String> {
    Ok(data_address("image/png", &png_bytes(picture)?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_difference_is_lost_where_a_picture_is_small() {
        let mut values = vec![0.0f32; 40 * 30];
        values[17 * 40 + 23] = -0.5;
        values[17 * 40 + 22] = 0.25;
        values[0] = f32::NAN;
        values[29 * 40 + 39] = f32::INFINITY;
        let grid = Grid::from_vec(Size::new(40, 30), values).unwrap();
        let more = |one: &f32, other: &f32| one.abs() > other.abs();
        let small = reduced(&grid, Size::new(10, 10), f32::NAN, more);
        assert_eq!((small[(5, 5)], small[(9, 9)], small[(0, 0)]), (-0.5, f32::INFINITY, 0.0));
        assert_eq!(small.data().iter().filter(|v| **v != 0.0).count(), 2);
        let same = reduced(&grid, grid.size(), f32::NAN, more);
        assert!(same.data()[0].is_nan() && same.data()[1..] == grid.data()[1..]);
        let presence = [Presence::Both, Presence::OnlyB, Presence::Neither, Presence::Neither];
        let grid = Grid::from_vec(Size::new(4, 1), presence.to_vec()).unwrap();
        let more = |one: &Presence, other: &Presence| rank(*one) > rank(*other);
        let small = reduced(&grid, Size::new(2, 1), Presence::Neither, more);
        assert_eq!(small.data(), [Presence::OnlyB, Presence::Neither]);
    }

    #[test]
    fn scales_end_at_round_numbers_that_few_exceed() {
        let shown = [0.03, 1.0, 1.1, 4.2, 7e-8, 0.5].map(round_up);
        for (value, expected) in shown.iter().zip([0.05, 1.0, 2.0, 5.0, 1e-7, 0.5]) {
            assert!((value / expected - 1.0).abs() < 1e-9, "{value} {expected}");
        }
        let mut values = vec![0.0; 5000];
        values.extend((0..100).map(|i| if i == 50 { 1e9 } else { -0.03 }));
        values.push(f32::NAN);
        assert_eq!(scale_of(values.into_iter()), 0.05);
        assert_eq!(scale_of([0.0, f32::NAN].into_iter()), 0.0);
    }
}
