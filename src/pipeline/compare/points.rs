//! The points of two clouds for the 3D view of a page, with their distances to the other cloud.

use super::super::page_parts::{bounding_box, middle, spacing};
use super::pictures::round_up;
use crate::geometry::NearestIndex;
use crate::report::{PageCloud, PageCloudClass, ViewerPoint, chosen, packed, shuffled};
use crate::scene::{PointCloud, PointSource};

/// Most points of each cloud.
const MOST_POINTS: u64 = 250_000;
/// Share of the points that the ramp's end leaves out.
const BEYOND: f64 = 0.001;
/// How many times its least distance the ramp's largest is.
const RANGE: f64 = 1000.0;
/// Colours of the two clouds.
const COLORS: [[u8; 3]; 2] = [[230, 159, 0], [86, 180, 233]];

/// Points of both clouds, packed, and what the ramp of distances means.
pub(super) struct ComparedPoints {
    pub(super) cloud: PageCloud,
    pub(super) packed: Vec<u8>,
    /// Least and largest distance of the ramp.
    pub(super) distance: [f64; 2],
}

/// Some points of each cloud, evenly chosen, coloured by their distance to the nearest of the other; `None` if one of them has
/// none.
pub(super) fn compared_points(a: &PointCloud, b: &PointCloud) -> Option<ComparedPoints> {
    let sides = [a, b].map(finite);
    if sides.iter().any(Vec::is_empty) {
        return None;
    }
    let indices = sides.each_ref().map(|points| {
        NearestIndex::new(&points.iter().map(|point| point.position).collect::<Vec<[f64; 3]>>())
    });
    let (mut points, mut labels, mut distances) = (Vec::new(), Vec::new(), Vec::new());
    for (side, from) in sides.iter().enumerate() {
        let len = from.len() as u64;
        let count = len.min(MOST_POINTS);
        let nearest = indices[side].nearest_in(&indices[1 - side], f64::INFINITY);
        for i in (0..count).map(|i| chosen(i, count, len) as usize) {
            let distance = nearest[i].map_or(0.0, |found| found.squared.sqrt());
            distances.push(distance);
            labels.push(side as u16);
            // Until the scale is known, the distance itself.
            points.push(ViewerPoint { confidence: distance as f32, class: side as u8, ..from[i] });
        }
    }
    let scale = scale_of(&mut distances);
    for point in &mut points {
        point.confidence = place(f64::from(point.confidence), scale);
    }
    let (min, extent) = bounding_box(&mut points, &mut labels);
    let points: Vec<ViewerPoint> = shuffled(points.len()).iter().map(|&i| points[i as usize]).collect();
    let (center, span) = middle(&points, min);
    let class = |side: usize| PageCloudClass {
        name: ["A", "B"][side].to_owned(),
        color: COLORS[side],
        points: points.iter().filter(|point| usize::from(point.class) == side).count() as u64,
        shown: true,
    };
    let layouts = [a.layout(), b.layout()];
    let cloud = PageCloud {
        count: points.len(),
        extent,
        center,
        span,
        spacing: spacing(&points),
        has_colors: layouts.iter().all(|layout| layout.colors),
        has_normals: layouts.iter().all(|layout| layout.normals),
        has_confidence: true,
        classes: vec![class(0), class(1)],
        ..PageCloud::default()
    };
    Some(ComparedPoints { cloud, packed: packed(&points, min, extent), distance: scale })
}

fn finite(cloud: &PointCloud) -> Vec<ViewerPoint> {
    let finite = cloud.iter().filter(|point| point.position.iter().all(|v| v.is_finite()));
    let point = |point: crate::scene::CloudPoint<'_>| ViewerPoint {
        position: point.position.map(f64::from),
        color: point.color,
        normal: point.normal,
        ..ViewerPoint::default()
    };
    finite.map(point).collect()
}

/// The distances at the ends of the ramp; zeros if no point is away from the other cloud. Sorts them.
fn scale_of(distances: &mut [f64]) -> [f64; 2] {
    distances.sort_unstable_by(f64::total_cmp);
    let away = &distances[distances.partition_point(|d| *d <= 0.0)..];
    let at = ((1.0 - BEYOND) * away.len() as f64) as usize;
    away.get(at).map_or([0.0; 2], |d| [round_up(*d) / RANGE, round_up(*d)])
}

/// Where a distance is on the ramp, 0 to 1: logarithmic, what is not above the least at 0.
fn place(distance: f64, [least, most]: [f64; 2]) -> f32 {
    match distance > least && least > 0.0 {
        true => ((distance / least).ln() / (most / least).ln()).min(1.0) as f32,
        false => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{CloudLayout, CloudPoint, PointSink};

    fn cloud(places: impl Iterator<Item = [f32; 3]>) -> PointCloud {
        let mut cloud = PointCloud::new(CloudLayout::default());
        places.for_each(|position| cloud.push(&CloudPoint { position, ..Default::default() }).unwrap());
        cloud
    }

    #[test]
    fn points_know_their_distance_to_the_other_cloud() {
        let grid = |z: f32| (0..400).map(move |i| [(i % 20) as f32, (i / 20) as f32, z]);
        let (a, b) = (cloud(grid(0.0)), cloud(grid(0.25).take(399)));
        let found = compared_points(&a, &b).unwrap();
        assert_eq!((found.cloud.count, found.packed.len()), (799, 799 * 16));
        let (classes, [least, most]) = (&found.cloud.classes, found.distance);
        assert_eq!((classes[0].points, classes[1].points), (400, 399));
        assert!((least - most / RANGE).abs() < 1e-12 && (0.25..=5.0).contains(&most), "{most}");
        let shares: Vec<u8> = found.packed.chunks(16).map(|point| point[11]).collect();
        let usual = (place(0.25, found.distance) * 255.0).round() as u8;
        assert_eq!(shares.iter().filter(|share| **share == usual).count(), 798);
        assert_eq!((place(0.0, [0.001, 1.0]), place(9.0, [0.001, 1.0])), (0.0, 1.0));
        assert!((place(0.1, [0.001, 1.0]) - 2.0 / 3.0).abs() < 1e-6);
        assert_eq!(compared_points(&a, &a).unwrap().distance, [0.0; 2]);
        assert!(compared_points(&a, &cloud(std::iter::empty())).is_none());
    }
}
