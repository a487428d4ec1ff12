//! What pages about runs and about comparisons share: the size of pictures, and where points of the 3D view lie.

use crate::error::Result;
use crate::geometry::{NearestIndex, Size};
use crate::report::{ViewerPoint, data_address};
use crate::scene::ColorImage;
use crate::store::drawing::jpeg_bytes;
use rayon::prelude::*;

/// Longest side of a picture.
const MOST_SIDE: f64 = 480.0;
/// Share of a picture's longest side that the other is taken to have.
const USUAL_SHAPE: f64 = 0.75;
/// Quality of the pictures of maps.
const QUALITY: u8 = 60;
/// Share of the points at either end of each axis that may be far away.
const OUTLIERS: f64 = 0.01;
/// What the box holds beyond the others, as a share of their extent.
const MARGIN: f64 = 0.5;
/// Points that the distance between neighbours is taken from.
const SPACING_SAMPLE: usize = 4096;
/// Neighbours that tell it.
const SPACING_NEIGHBORS: usize = 4;

/// Size of the pictures of a map that is one of `count`: not above [`MOST_SIDE`], nor above its share of `pixels`, nor above
/// its own.
pub(super) fn picture_size(map: Size, count: usize, pixels: f64) -> Size {
    let share = (pixels / count.max(1) as f64 / USUAL_SHAPE).sqrt();
    let longest = MOST_SIDE.min(share).max(64.0);
    let factor = (longest / f64::from(map.longest().max(1))).min(1.0);
    let side = |n: u32| ((f64::from(n) * factor).round() as u32).max(1);
    Size::new(side(map.width), side(map.height))
}

/// A map's picture as a JPEG.
pub(super) fn map_address(picture: &ColorImage) -> Result<String> {
    Ok(data_address("image/jpeg", &jpeg_bytes(picture, QUALITY)?))
}

/// Values of one axis, sorted.
fn sorted_axis(points: &[ViewerPoint], axis: usize) -> Vec<f64> {
    let mut values: Vec<f64> = points.iter().map(|p| p.position[axis]).collect();
    values.par_sort_unstable_by(f64::total_cmp);
    values
}

fn at_share(sorted: &[f64], share: f64) -> f64 {
    sorted.get((share * sorted.len().saturating_sub(1) as f64).round() as usize).copied().unwrap_or(0.0)
}

/// Least corner and size of a box about the points, those that lie far from all others left out of it and of the points.
pub(super) fn bounding_box(points: &mut Vec<ViewerPoint>, labels: &mut Vec<u16>) -> ([f64; 3], [f64; 3]) {
    let (mut min, mut max) = ([0.0f64; 3], [0.0f64; 3]);
    for axis in 0..3 {
        let values = sorted_axis(points, axis);
        let (low, high) = (at_share(&values, OUTLIERS), at_share(&values, 1.0 - OUTLIERS));
        let margin = MARGIN * (high - low);
        (min[axis], max[axis]) = (low - margin, high + margin);
    }
    // A flat cloud has no extent along an axis, but points a little beside the others all the same.
    let most = (0..3).map(|k| max[k] - min[k]).fold(0.0, f64::max);
    for axis in 0..3 {
        let (low, high) = (min[axis], max[axis]);
        let missing = (0.1 * most - (high - low)).max(0.0) / 2.0;
        (min[axis], max[axis]) = (low - missing, high + missing);
    }
    let inside = |p: &ViewerPoint| (0..3).all(|k| (min[k]..=max[k]).contains(&p.position[k]));
    let keep: Vec<bool> = points.iter().map(inside).collect();
    let mut kept = keep.iter();
    points.retain(|_| *kept.next().unwrap_or(&false));
    let mut kept = keep.iter();
    labels.retain(|_| *kept.next().unwrap_or(&false));
    // As tight as the points allow.
    for axis in 0..3 {
        let coordinate = |p: &ViewerPoint| p.position[axis];
        min[axis] = points.iter().map(coordinate).fold(f64::INFINITY, f64::min);
        max[axis] = points.iter().map(coordinate).fold(f64::NEG_INFINITY, f64::max);
    }
    if points.is_empty() {
        return ([0.0; 3], [0.0; 3]);
    }
    (min, std::array::from_fn(|k| max[k] - min[k]))
}

/// Median coordinates relative to `min`, and the length across most of the points.
pub(super) fn middle(points: &[ViewerPoint], min: [f64; 3]) -> ([f64; 3], f64) {
    let mut center = [0.0; 3];
    let mut squared = 0.0;
    for axis in 0..3 {
        let values = sorted_axis(points, axis);
        let (low, high) = (at_share(&values, 0.02), at_share(&values, 0.98));
        center[axis] = (low + high) / 2.0 - min[axis];
        squared += (high - low).powi(2);
    }
    (center, squared.sqrt())
}

/// Median distance of a point to its fourth neighbour.
pub(super) fn spacing(points: &[ViewerPoint]) -> f64 {
    let positions: Vec<[f64; 3]> = points.iter().map(|p| p.position).collect();
    if positions.len() <= SPACING_NEIGHBORS {
        return 0.0;
    }
    let index = NearestIndex::new(&positions);
    let step = positions.len().div_ceil(SPACING_SAMPLE);
    let sample: Vec<&[f64; 3]> = positions.iter().step_by(step).collect();
    let mut distances: Vec<f64> = sample
        .par_iter()
        .filter_map(|p| index.nearest_n(p, SPACING_NEIGHBORS + 1).last().map(|n| n.squared.sqrt()))
        .collect();
    distances.sort_unstable_by(f64::total_cmp);
    at_share(&distances, 0.5)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_of_many_views_are_smaller() {
        let map = Size::new(1600, 1200);
        assert_eq!(picture_size(map, 6, 10e6), Size::new(480, 360));
        let many = picture_size(map, 200, 10e6);
        assert!((240..270).contains(&many.width), "{many}");
        assert_eq!(
            picture_size(Size::new(200, 150), 6, 10e6),
            Size::new(200, 150),
            "never larger than the map"
        );
        assert_eq!(picture_size(map, 1_000_000, 10e6).width, 64);
        assert_eq!(picture_size(Size::new(5000, 1), 1, 10e6).height, 1);
    }

    fn at(x: f64, y: f64, z: f64) -> ViewerPoint {
        ViewerPoint { position: [x, y, z], ..ViewerPoint::default() }
    }

    #[test]
    fn stray_points_do_not_blow_up_the_box() {
        let mut points: Vec<ViewerPoint> = (0..1000)
            .map(|i| at(f64::from(i % 40), f64::from(i / 40), 5.0 + 0.001 * f64::from(i % 7)))
            .collect();
        points[17] = at(1e6, 0.0, 0.0);
        let mut labels: Vec<u16> = (0..1000).collect();
        let (min, extent) = bounding_box(&mut points, &mut labels);
        assert_eq!((points.len(), labels.len()), (999, 999));
        assert!(!labels.contains(&17) && labels[17] == 18);
        assert_eq!((min[0], extent[0], min[1], extent[1]), (0.0, 39.0, 0.0, 24.0));
        let (center, span) = middle(&points, min);
        assert!((center[0] - 19.5).abs() < 1.0 && (40.0..46.0).contains(&span), "{center:?} {span}");
        assert!((0.9..1.5).contains(&spacing(&points)));
        assert_eq!(bounding_box(&mut Vec::new(), &mut Vec::new()), ([0.0; 3], [0.0; 3]));
    }
}
