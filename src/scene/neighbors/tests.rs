use super::*;
use crate::geometry::Size;
use crate::scene::{Calibration, ImageId, Tracks, View};
use nalgebra::{Matrix3, Vector3};

/// Cameras in a row, one unit apart, looking along z at a plane of points at depth 10.
fn row(count: u32) -> (Scene, Vec<Option<Camera>>) {
    let size = Size::new(100, 80);
    let k = Matrix3::new(100.0, 0.0, 49.5, 0.0, 100.0, 39.5, 0.0, 0.0, 1.0);
    let mut scene = Scene::default();
    let mut cameras = Vec::new();
    for i in 0..count {
        let center = Vector3::new(f64::from(i), 0.0, 0.0);
        let camera = Camera::new(size, k, Matrix3::identity(), center);
        let calibration = Calibration {
            normalized_k: crate::geometry::normalized_k(&k, size),
            rotation: Matrix3::identity(),
            center,
            size: Some(size),
        };
        scene.views.push(View {
            name: format!("{i}.jpg"),
            mask: None,
            id: ImageId(i),
            calibration: Some(calibration),
            neighbors: Vec::new(),
            avg_depth: 0.0,
        });
        cameras.push(Some(camera));
    }
    let mut tracks = Tracks::default();
    for y in -6..=6 {
        for x in -6..=(2 * count as i32 + 4) {
            let point = [x as f32 * 0.5, y as f32 * 0.5, 10.0];
            let sees = |v: &u32| (point[0] - *v as f32).abs() < 4.5;
            let views: Vec<_> = (0..count).filter(sees).map(ViewIndex).collect();
            if views.len() > 1 {
                tracks.push(point, views);
            }
        }
    }
    scene.tracks = tracks;
    (scene, cameras)
}

fn neighbor(view: u32, score: f32) -> Neighbor {
    Neighbor { view: ViewIndex(view), points: 100, scale: 1.0, angle: 0.2, area: 0.5, score }
}

fn order(neighbors: &[Neighbor]) -> Vec<u32> {
    neighbors.iter().map(|n| n.view.0).collect()
}

#[test]
fn the_best_angle_wins_and_mirrored_views_agree() {
    let (scene, cameras) = row(5);
    let views = select_neighbors(&scene, &cameras, &NeighborOptions::default()).unwrap();
    // Two units apart at depth 10 is nearly 12 degrees.
    assert_eq!(views[0].all[0].view, ViewIndex(2));
    let mirrored: Vec<u32> = order(&views[4].all).iter().map(|v| 4 - v).collect();
    assert_eq!(order(&views[0].all), mirrored);
    for (a, b) in views[0].all.iter().zip(&views[4].all) {
        assert_eq!(a.points, b.points);
        assert!((a.angle - b.angle).abs() < 1e-6 && a.scale == 1.0 && b.scale == 1.0);
    }
    for view in &views {
        assert_eq!(view.avg_depth, 10.0);
        assert_eq!(view.retained, view.all);
        assert_eq!(view.matching().len(), 4);
        assert!(view.tracks.is_sorted());
    }
}

#[test]
fn the_number_of_threads_changes_nothing() {
    let (scene, cameras) = row(7);
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| select_neighbors(&scene, &cameras, &NeighborOptions::default()).unwrap())
    };
    assert_eq!(run(1), run(5));
}

#[test]
fn a_view_that_observed_a_point_twice_counts_twice_for_others() {
    let (mut scene, cameras) = row(2);
    let mut tracks = Tracks::default();
    for (i, (point, views)) in scene.tracks.iter().enumerate() {
        let extra = (i == 0).then_some(ViewIndex(1));
        tracks.push(point, views.iter().copied().chain(extra));
    }
    scene.tracks = tracks;
    let views = select_neighbors(&scene, &cameras, &NeighborOptions::default()).unwrap();
    assert_eq!(views[0].all[0].points, views[1].all[0].points + 1);
    assert_eq!(views[0].tracks, views[1].tracks);
}

#[test]
fn points_outside_the_region_count_less_or_nothing() {
    let (mut scene, cameras) = row(3);
    let select = |scene: &Scene, outside_roi| {
        let options = NeighborOptions { outside_roi, ..Default::default() };
        select_neighbors(scene, &cameras, &options).unwrap()[1].clone()
    };
    let all = select(&scene, OutsideRoi::Drop);
    scene.roi = crate::geometry::Roi::axis_aligned([0.3, -9.0, 0.0], [9.0, 9.0, 20.0], 0.0);
    let counted = select(&scene, OutsideRoi::Count);
    let discounted = select(&scene, OutsideRoi::Discount);
    let dropped = select(&scene, OutsideRoi::Drop);
    assert_eq!(counted, all);
    assert_eq!(discounted.all[0].points, counted.all[0].points);
    assert!(discounted.all[0].score < counted.all[0].score);
    assert!(dropped.all[0].points < counted.all[0].points && dropped.tracks.len() < counted.tracks.len());
}

#[test]
fn points_outside_the_region_weigh_seven_tenths() {
    /// Sums of products in `f32`.
    const ROUNDING: f32 = 1e-5;
    let (mut scene, cameras) = row(3);
    let select = |scene: &Scene, outside_roi| {
        let options = NeighborOptions { outside_roi, ..Default::default() };
        select_neighbors(scene, &cameras, &options).unwrap()
    };
    let counted = select(&scene, OutsideRoi::Count);
    // A region without any point in it.
    scene.roi = crate::geometry::Roi::axis_aligned([-9.0, -9.0, 50.0], [9.0, 9.0, 60.0], 0.0);
    assert_eq!(select(&scene, OutsideRoi::Count), counted);
    for (all, less) in counted.iter().zip(select(&scene, OutsideRoi::Discount)) {
        for (n, m) in all.all.iter().zip(&less.all) {
            assert!((m.score / n.score - 0.7).abs() < ROUNDING, "{m:?} {n:?}");
            assert_eq!(Neighbor { score: 0.0, ..*n }, Neighbor { score: 0.0, ..*m });
        }
    }
    assert!(select(&scene, OutsideRoi::Drop).iter().all(|v| v.all.is_empty() && v.tracks.is_empty()));
    // A region with all points in it.
    scene.roi = crate::geometry::Roi::axis_aligned([-99.0; 3], [99.0; 3], 0.0);
    for outside in [OutsideRoi::Count, OutsideRoi::Discount, OutsideRoi::Drop] {
        assert_eq!(select(&scene, outside), counted);
    }
}

#[test]
fn views_without_a_camera_take_no_part() {
    let (scene, mut cameras) = row(4);
    cameras[1] = None;
    let views = select_neighbors(&scene, &cameras, &NeighborOptions::default()).unwrap();
    assert_eq!(views[1], ViewNeighbors::default());
    assert_eq!(order(&views[0].all), [2, 3]);
}

#[test]
fn stored_neighbours_stay_and_tracks_are_collected_all_the_same() {
    let (mut scene, cameras) = row(4);
    let fresh = select_neighbors(&scene, &cameras, &NeighborOptions::default()).unwrap();
    scene.views[0].neighbors = vec![neighbor(3, 9.0), neighbor(1, 1.0)];
    scene.views[0].avg_depth = 7.0;
    let views = select_neighbors(&scene, &cameras, &NeighborOptions::default()).unwrap();
    assert_eq!(views[0].all, scene.views[0].neighbors);
    assert_eq!((views[0].avg_depth, &views[0].tracks), (7.0, &fresh[0].tracks));
    assert_eq!(order(views[0].matching()), [3], "a score of 1 is too low to be matched");
    assert_eq!(views[1..], fresh[1..]);
}

#[test]
fn given_neighbours_replace_what_is_there() {
    let (mut scene, cameras) = row(3);
    let lists = [(ViewIndex(0), vec![ViewIndex(2), ViewIndex(0), ViewIndex(2), ViewIndex(1)])];
    override_neighbors(&mut scene, &lists).unwrap();
    assert_eq!(order(&scene.views[0].neighbors), [2, 1]);
    scene.tracks = Tracks::default();
    let views = select_neighbors(&scene, &cameras, &NeighborOptions::default()).unwrap();
    assert_eq!(order(views[0].matching()), [2, 1]);
    assert!(views[0].tracks.is_empty() && views[1].all.is_empty());
    assert!(override_neighbors(&mut scene, &[(ViewIndex(3), vec![])]).is_err());
    assert!(override_neighbors(&mut scene, &[(ViewIndex(0), vec![ViewIndex(9)])]).is_err());
}

#[test]
fn without_points_and_lists_the_error_says_what_to_do() {
    let (mut scene, cameras) = row(3);
    scene.tracks = Tracks::default();
    let error = select_neighbors(&scene, &cameras, &NeighborOptions::default()).unwrap_err().to_string();
    assert!(error.contains("no sparse points") && error.contains("--view-neighbors-file"), "{error}");
}

#[test]
fn poor_neighbours_go_from_the_worst_on_until_enough_are_left() {
    let options = NeighborOptions::default();
    let mut list: Vec<_> = (0..14).map(|i| neighbor(i, 100.0 - i as f32)).collect();
    for (i, flaw) in [2, 5, 8, 11, 13].into_iter().enumerate() {
        let n = &mut list[flaw];
        match i {
            0 => n.area = 0.049,
            1 => n.scale = 3.2,
            2 => n.scale = 0.19,
            3 => n.angle = 65.1_f32.to_radians(),
            _ => n.angle = 2.9_f32.to_radians(),
        }
    }
    let mut kept = list.clone();
    retain_neighbors(&mut kept, &options);
    // 14 entries, 9 are enough: the five flawed ones go, 13 first and 2 last.
    assert_eq!(order(&kept), [0, 1, 3, 4, 6, 7, 9, 10, 12]);
    let mut kept = list[..10].to_vec();
    retain_neighbors(&mut kept, &options);
    assert_eq!(order(&kept), [0, 1, 2, 3, 4, 5, 6, 7, 9], "only one can go");
    let mut kept = vec![neighbor(0, 9.0); 20];
    retain_neighbors(&mut kept, &options);
    assert_eq!(kept.len(), 12);
}

#[test]
fn matching_stops_at_the_first_low_score() {
    let options = NeighborOptions::default();
    let count = |scores: &[f32], number_views| {
        let list: Vec<_> = scores.iter().map(|&s| neighbor(0, s)).collect();
        count_matching(&list, &NeighborOptions { number_views, ..options })
    };
    assert_eq!(count(&[100.0, 90.0, 80.0, 70.0, 60.0, 50.0], 5), 5);
    assert_eq!(count(&[100.0, 90.0, 80.0, 70.0, 60.0, 50.0], 0), 6);
    assert_eq!(count(&[100.0, 90.0], 1), 1);
    assert_eq!(count(&[100.0, 3.0, 2.9, 50.0], 0), 2, "less than 3 % of the best");
    assert_eq!(count(&[10.0, 2.0, 1.9], 0), 2);
    assert_eq!(count(&[], 0), 0);
}

#[test]
fn options_are_checked() {
    let bad = |change: fn(&mut NeighborOptions)| {
        let mut options = NeighborOptions::default();
        change(&mut options);
        options.check().is_err()
    };
    assert!(bad(|o| o.max_views = 0));
    assert!(bad(|o| o.best_angle_deg = 0.0));
    assert!(bad(|o| o.min_angle_deg = f32::NAN));
    assert!(bad(|o| o.min_area = 1.5));
    assert!(NeighborOptions::default().check().is_ok());
}
