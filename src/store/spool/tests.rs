use super::*;
use crate::scene::ViewIndex;
use nalgebra::{Matrix3, Vector3};

const EVERYTHING: CloudLayout =
    CloudLayout { normals: true, colors: true, views: true, weights: true, confidence: true, labels: true };

/// Calls `visit` with a made-up point whose views vary in number.
fn with_point<R>(i: u32, visit: impl FnOnce(&CloudPoint<'_>) -> R) -> R {
    let views: Vec<ViewIndex> = (0..=i % 5).map(|k| ViewIndex(k * 70_000 + i)).collect();
    let weights: Vec<f32> = views.iter().map(|v| v.0 as f32 + 0.5).collect();
    visit(&CloudPoint {
        position: [i as f32, -(i as f32), 0.25],
        normal: [0.0, 0.6, -0.8],
        color: [i as u8, 1, 2],
        views: &views,
        weights: &weights,
        confidence: 0.75,
        label: i as u16,
        label_confidence: 0.5,
    })
}

fn spooled(layout: CloudLayout, crop: Option<Roi>, count: u32, memory: u64) -> SpooledCloud {
    let folder = tempfile::tempdir().unwrap();
    let mut spool = PointSpool::new(layout, crop, folder.path(), memory);
    for i in 0..count {
        with_point(i, |point| spool.push(point)).unwrap();
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "the temporary file has no name");
    spool.finish().unwrap()
}

fn numbers(cloud: &SpooledCloud) -> Vec<u32> {
    let mut numbers = Vec::new();
    cloud
        .for_each(&mut |point| {
            let i = point.position[0] as u32;
            with_point(i, |expected| assert_eq!(point, expected));
            numbers.push(i);
            Ok(())
        })
        .unwrap();
    numbers
}

#[test]
fn points_come_back_as_they_went_in_from_memory_and_from_file() {
    let all: Vec<u32> = (0..60_000).collect();
    for memory in [u64::MAX, 2 << 20, 0] {
        let cloud = spooled(EVERYTHING, None, 60_000, memory);
        assert_eq!(cloud.len(), 60_000);
        assert_eq!(numbers(&cloud), all, "memory {memory}");
        assert_eq!(numbers(&cloud), all, "a second time");
    }
}

#[test]
fn attributes_outside_the_layout_are_not_kept() {
    let layout = CloudLayout { colors: true, views: true, ..CloudLayout::default() };
    let cloud = spooled(layout, None, 3, u64::MAX);
    assert_eq!(cloud.layout(), layout);
    cloud
        .for_each(&mut |point| {
            let i = point.position[0] as u32;
            with_point(i, |full| {
                let expected = CloudPoint {
                    position: full.position,
                    color: full.color,
                    views: full.views,
                    ..CloudPoint::default()
                };
                assert_eq!(*point, expected);
            });
            Ok(())
        })
        .unwrap();
}

#[test]
fn a_crop_moves_the_last_points_into_the_holes() {
    // Inside: 10 000 ..= 29 999 of 60 000.
    let roi = Roi {
        rotation: Matrix3::identity(),
        center: Vector3::new(19_999.5, -19_999.5, 0.0),
        half_extent: Vector3::new(9_999.5, 9_999.5, 0.25),
    };
    let expected: Vec<u32> = {
        let mut points: Vec<u32> = (0..60_000).collect();
        for i in (0..points.len()).rev() {
            if !(10_000..30_000).contains(&points[i]) {
                points.swap_remove(i);
            }
        }
        points
    };
    for memory in [u64::MAX, 0] {
        let cloud = spooled(EVERYTHING, Some(roi.clone()), 60_000, memory);
        assert_eq!((cloud.len(), cloud.cropped()), (20_000, 40_000));
        assert_eq!(numbers(&cloud), expected);
    }
}

#[test]
fn an_empty_spool_is_an_empty_cloud() {
    assert!(spooled(EVERYTHING, None, 0, 0).is_empty());
    assert_eq!(numbers(&spooled(EVERYTHING, None, 0, 0)), [0; 0]);
}

#[test]
fn a_folder_that_cannot_be_written_is_named() {
    let mut spool = PointSpool::new(EVERYTHING, None, Path::new("/no/such/folder"), 0);
    let mut result = Ok(());
    for i in 0..60_000 {
        result = result.and_then(|()| with_point(i, |point| spool.push(point)));
    }
    let message = result.unwrap_err().to_string();
    assert!(message.starts_with("/no/such/folder: cannot write a temporary file in"), "{message}");
}
