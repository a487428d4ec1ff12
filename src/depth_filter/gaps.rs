//! Filling of short gaps along rows and columns.

use super::DepthFilterOptions;
use crate::geometry::is_similar_depth;
use crate::scene::DepthEstimate;

/// Relative depth difference of the two ends of a gap that is filled, in units of the threshold.
const END_FACTOR: f32 = 2.5;

/// Fills runs of at most `interpolate_gap_size` missing pixels whose two ends have similar depths, first along
/// all rows, then along all columns, which see what the rows filled; returns the number of pixels filled.
///
/// Depth grows linearly from end to end, the normal's azimuth and polar angle likewise (without regard to the
/// jump of the azimuth at ±180°, as in OpenMVS); the confidence is that of the worse end.
pub fn fill_gaps(estimate: &mut DepthEstimate, options: &DepthFilterOptions) -> usize {
    let (width, height) = (estimate.depth.width(), estimate.depth.height());
    let mut filled = 0;
    for y in 0..height {
        filled += fill_line(estimate, Line { first: y * width, step: 1, len: width }, options);
    }
    for x in 0..width {
        filled += fill_line(estimate, Line { first: x, step: width, len: height }, options);
    }
    filled
}

/// A row or column of a raster.
#[derive(Clone, Copy)]
struct Line {
    first: usize,
    step: usize,
    len: usize,
}

fn fill_line(estimate: &mut DepthEstimate, line: Line, options: &DepthFilterOptions) -> usize {
    let max_gap = options.interpolate_gap_size as usize;
    let max_diff = options.depth_diff_threshold * END_FACTOR;
    let mut filled = 0;
    let mut last_valid = None;
    for i in 0..line.len {
        let end = line.first + i * line.step;
        let depth = estimate.depth.data()[end];
        if depth <= 0.0 {
            continue;
        }
        if let Some(last) = last_valid {
            let gap = i - last - 1;
            let start = line.first + last * line.step;
            if (1..=max_gap).contains(&gap) && is_similar_depth(estimate.depth.data()[start], depth, max_diff)
            {
                fill_run(estimate, start, end, line.step, gap);
                filled += gap;
            }
        }
        last_valid = Some(i);
    }
    filled
}

/// Fills the `gap` pixels between the valid pixels `start` and `end`.
fn fill_run(estimate: &mut DepthEstimate, start: usize, end: usize, step: usize, gap: usize) {
    let parts = (gap + 1) as f32;
    let depth = estimate.depth.data_mut();
    let mut value = depth[start];
    let growth = (depth[end] - value) / parts;
    for k in 1..=gap {
        value += growth;
        depth[start + k * step] = value;
    }
    if let Some(confidence) = &mut estimate.confidence {
        let confidence = confidence.data_mut();
        let worse = confidence[start].min(confidence[end]);
        (1..=gap).for_each(|k| confidence[start + k * step] = worse);
    }
    if let Some(normal) = &mut estimate.normal {
        let normal = normal.data_mut();
        let (mut azimuth, mut polar) = angles(normal[start]);
        let (end_azimuth, end_polar) = angles(normal[end]);
        let (azimuth_growth, polar_growth) = ((end_azimuth - azimuth) / parts, (end_polar - polar) / parts);
        for k in 1..=gap {
            azimuth += azimuth_growth;
            polar += polar_growth;
            normal[start + k * step] = direction(azimuth, polar);
        }
    }
}

/// Azimuth and polar angle of a unit vector, radians.
fn angles([x, y, z]: [f32; 3]) -> (f32, f32) {
    (y.atan2(x), z.clamp(-1.0, 1.0).acos())
}

/// The unit vector of an azimuth and a polar angle.
fn direction(azimuth: f32, polar: f32) -> [f32; 3] {
    let sin_polar = polar.sin();
    [azimuth.cos() * sin_polar, azimuth.sin() * sin_polar, polar.cos()]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::synthetic::estimate_of_depths;

    /// Rounding of the angle coding.
    const NORMAL_TOLERANCE: f32 = 1e-6;

    #[test]
    fn a_short_gap_is_filled_linearly_and_a_long_one_is_not() {
        let mut one = estimate_of_depths(20, 1, |x, _| match x {
            2..=8 => 0.0,
            9..=10 => 10.08,
            11..=18 => 0.0,
            _ => 10.0,
        });
        one.confidence.as_mut().unwrap().data_mut()[9] = 0.25;
        assert_eq!(fill_gaps(&mut one, &DepthFilterOptions::default()), 7);
        assert!((one.depth[(2, 0)] - 10.01).abs() < 1e-5);
        assert!((one.depth[(8, 0)] - 10.07).abs() < 1e-5);
        assert_eq!(one.confidence.as_ref().unwrap()[(5, 0)], 0.25);
        let n = one.normal.as_ref().unwrap()[(5, 0)];
        assert!((n[2] + 1.0).abs() < NORMAL_TOLERANCE);
        assert!((11..=18).all(|x| one.depth[(x, 0)] == 0.0), "eight missing pixels are too many");
    }

    #[test]
    fn gaps_at_the_border_and_across_a_step_stay() {
        let mut map = estimate_of_depths(12, 1, |x, _| match x {
            0..=2 | 6 | 10..=11 => 0.0,
            3..=5 => 10.0,
            _ => 10.3,
        });
        let before = map.clone();
        assert_eq!(fill_gaps(&mut map, &DepthFilterOptions::default()), 0);
        assert_eq!(map, before);
    }

    #[test]
    fn columns_see_what_rows_filled() {
        // Row 1 has one missing pixel, row 0 and row 2 have none valid near it: only the row pass can fill it,
        // and the column pass then bridges rows 1 to 3.
        let mut map = estimate_of_depths(3, 4, |x, y| match (x, y) {
            (1, 1) | (1, 2) => 0.0,
            (0 | 2, 2) => 0.0,
            (1, 0) => 0.0,
            _ => 6.0,
        });
        let filled = fill_gaps(&mut map, &DepthFilterOptions::default());
        assert_eq!(filled, 5);
        assert!(map.depth.data().iter().all(|&d| d == 6.0));
    }
}
