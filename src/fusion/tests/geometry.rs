use super::*;
use crate::scene::PointSource;
use crate::scene::synthetic::{camera, view_of_plane};
use nalgebra::Vector3;

/// Distance from the wall that single precision causes.
const ON_WALL: f64 = 1e-5;

fn distance_to_wall(position: [f32; 3]) -> f64 {
    let p = Vector3::from(position.map(f64::from));
    (wall().normal.dot(&p) - wall().offset).abs()
}

#[test]
fn points_lie_on_the_wall_and_use_every_pixel_once() {
    let scene = TestScene::wall(4);
    let (points, summary) = scene.fuse(&with_min_views(3));
    assert_eq!((summary.maps, summary.depths), (4, 4 * 48 * 36));
    assert_eq!(summary.points, points.len());
    assert!(points.len() > 1400, "{} points", points.len());
    let mut used = 0;
    for point in points.iter() {
        assert!(distance_to_wall(point.position) < ON_WALL, "{:?}", point.position);
        let facing: f64 = point.normal.iter().zip(wall().normal.iter()).map(|(&a, b)| f64::from(a) * b).sum();
        assert!((facing - 1.0).abs() < 1e-6);
        assert!(point.views.len() >= 3 && point.views.is_sorted());
        assert_eq!(point.views.len(), point.weights.len());
        let red: f32 = point.views.iter().zip(point.weights).map(|(v, w)| 10.0 * v.0 as f32 * w).sum::<f32>()
            / point.weights.iter().sum::<f32>();
        assert!((f32::from(point.color[0]) - red).abs() <= 0.501, "{:?} {red}", point.color);
        assert_eq!(point.color[1..], [100, 200]);
        used += point.views.len() as u64;
    }
    assert!(used <= summary.depths);
}

#[test]
fn claimed_depths_support_further_points_that_then_need_one_view_more() {
    let supporting = |n| FusionOptions { number_views_fuse: n, ..FusionOptions::supporting() };
    // Views of different resolution: a depth of the coarse ones falls on several of the fine one.
    let mut views = row_of_views(4, 48, 36, 0.2, wall());
    views[0] = view_of_plane(0, camera(96, 72, [0.0; 3], 0.0), wall());
    let scene = TestScene::of(views);
    let (few, _) = scene.fuse(&with_min_views(3));
    let (many, summary) = scene.fuse(&supporting(3));
    assert!(many.len() > few.len() * 2, "{} {}", many.len(), few.len());
    assert!(many.len() <= summary.depths, "every point has a depth of its own");
    assert!(many.iter().all(|p| distance_to_wall(p.position) < ON_WALL && p.views.len() >= 3));
    assert!(many.iter().any(|p| p.views.len() == 3) && many.iter().any(|p| p.views.len() == 4));
    let mut places: Vec<[u32; 3]> = many.iter().map(|p| p.position.map(f32::to_bits)).collect();
    places.sort_unstable();
    places.dedup();
    assert_eq!(places.len() as u64, many.len(), "no point twice");

    // Three views in all: what is claimed cannot help, as no fourth view is there.
    let mut views = row_of_views(3, 48, 36, 0.2, wall());
    views[0] = view_of_plane(0, camera(96, 72, [0.0; 3], 0.0), wall());
    let scene = TestScene::of(views);
    let (alone, _) = scene.fuse(&FusionOptions { support: Support::Unclaimed, ..supporting(3) });
    let (helped, _) = scene.fuse(&supporting(3));
    assert_eq!(helped, alone);
}

#[test]
fn a_depth_that_is_in_the_way_of_a_point_supports_none() {
    let mut scene = TestScene::wall(4);
    scene.estimate(3).depth.data_mut().iter_mut().for_each(|d| *d *= 1.2);
    let options = FusionOptions { number_views_fuse: 2, ..FusionOptions::supporting() };
    let (points, summary) = scene.fuse(&options);
    assert!(points.iter().all(|p| distance_to_wall(p.position) < ON_WALL || p.views == [ViewIndex(3)]));
    assert!(summary.depths < 4 * 48 * 36, "some were discarded before their turn");
}

#[test]
fn weights_fall_with_depth_and_rise_with_confidence() {
    let mut scene = TestScene::wall(3);
    scene.estimate(2).confidence.as_mut().unwrap().data_mut().fill(0.5);
    let (points, _) = scene.fuse(&with_min_views(3));
    let point = points.point(points.len() as usize / 2);
    // 1 − 0.9 against 1 − 0.5, at nearly the same depth.
    let ratio = point.weights[0] / point.weights[2];
    assert!((ratio / 5.0 - 1.0).abs() < 0.1, "{:?}", point.weights);
    let depth = 8.0_f32;
    assert!((point.weights[0] * 0.1 * depth * depth - 1.0).abs() < 0.4, "{:?}", point.weights);
}

#[test]
fn more_views_than_the_scene_has_cannot_be_asked_for() {
    let (points, _) = TestScene::wall(2).fuse(&with_min_views(3));
    assert!(points.len() > 1000);
    assert!(points.iter().all(|p| p.views.len() == 2));
}

#[test]
fn a_surface_that_the_points_would_hide_is_discarded() {
    let mut scene = TestScene::wall(4);
    scene.estimate(3).depth.data_mut().iter_mut().for_each(|d| *d *= 1.2);
    let (points, summary) = scene.fuse(&with_min_views(2));
    assert!(points.iter().all(|p| distance_to_wall(p.position) < ON_WALL));
    let visited = summary.depths;
    assert!(visited < 3 * 48 * 36 + 48 * 36 / 2, "the far surface was mostly discarded: {visited} depths");

    // One view alone with a nearer surface does not push the others away.
    let mut scene = TestScene::wall(4);
    scene.estimate(3).depth.data_mut().iter_mut().for_each(|d| *d *= 0.8);
    let (points, summary) = scene.fuse(&with_min_views(3));
    assert!(points.len() > 1300);
    assert_eq!(summary.depths, 4 * 48 * 36);
}

#[test]
fn pixels_that_face_another_way_are_not_merged() {
    let mut scene = TestScene::wall(3);
    for n in scene.estimate(1).normal.as_mut().unwrap().data_mut() {
        // Turned by 30° about y.
        let (s, c) = 30_f32.to_radians().sin_cos();
        *n = [c * n[0] + s * n[2], n[1], c * n[2] - s * n[0]];
    }
    assert_eq!(scene.fuse(&with_min_views(3)).0.len(), 0);
    let (points, _) = scene.fuse(&with_min_views(2));
    assert!(points.len() > 1000);
    assert!(points.iter().all(|p| p.views == [ViewIndex(0), ViewIndex(2)]));
    let lenient = FusionOptions { normal_diff_threshold_deg: 35.0, ..with_min_views(3) };
    assert!(scene.fuse(&lenient).0.len() > 1000);
}

#[test]
fn one_map_without_normals_takes_them_from_the_test_and_the_cloud() {
    let mut scene = TestScene::wall(3);
    let with_normals = scene.fuse(&with_min_views(3)).0;
    scene.estimate(1).normal = None;
    let without = scene.fuse(&with_min_views(3)).0;
    assert!(with_normals.layout().normals && !without.layout().normals);
    assert_eq!(without.len(), with_normals.len());
    assert_eq!(without.point(7).position, with_normals.point(7).position);
}

#[test]
fn fewer_than_two_views_merge_all_pixels_in_order() {
    let mut scene = TestScene::wall(2);
    scene.estimate(0).depth[(3, 0)] = 0.0;
    let (points, summary) = scene.fuse(&with_min_views(1));
    assert_eq!(points.len(), 2 * 48 * 36 - 1);
    assert_eq!((summary.maps, summary.depths, summary.points), (2, points.len(), points.len()));
    assert!(!points.layout().weights);
    let first_of_second = points.point(48 * 36 - 1);
    assert_eq!((first_of_second.views, first_of_second.color), (&[ViewIndex(1)][..], [10, 100, 200]));
    assert!(points.iter().all(|p| distance_to_wall(p.position) < ON_WALL));
    assert!((points.point(0).normal[2] - wall().normal.z as f32).abs() < 1e-6);
}

#[test]
fn colours_after_fusion_come_from_the_nearest_view() {
    let options = FusionOptions { estimate_colors: AttributeSource::AfterFusion, ..with_min_views(3) };
    let mut estimates = row_of_views(3, 48, 36, 0.2, wall());
    let near = crate::scene::synthetic::camera(48, 36, [0.0, 0.0, 0.5], 0.0);
    estimates.push(crate::scene::synthetic::view_of_plane(3, near, wall()));
    let scene = TestScene::of(estimates);
    let (points, _) = scene.fuse(&options);
    let seen_from_near =
        points.iter().filter(|p| p.views.contains(&ViewIndex(3))).map(|p| p.color).collect::<Vec<_>>();
    // 30, 100, 200 darkened by truncation, or white at the border of the image.
    let inner = seen_from_near.iter().filter(|c| **c != [255; 3]).count();
    assert!(inner * 10 > seen_from_near.len() * 7, "{inner} of {}", seen_from_near.len());
    for color in seen_from_near.iter().filter(|c| **c != [255; 3]) {
        assert!(color.iter().zip([30, 100, 200]).all(|(&a, b)| a <= b && b - a <= 3), "{color:?}");
    }
    let none = FusionOptions { estimate_colors: AttributeSource::None, ..options };
    assert!(!scene.fuse(&none).0.layout().colors);
}

#[test]
fn maps_that_do_not_fit_together_are_refused_with_both_sizes() {
    let mut scene = TestScene::wall(3);
    scene.maps[1].color = Some(Arc::new(Grid::filled(crate::geometry::Size::new(10, 9), [0; 3])));
    let message = scene.try_fuse(&with_min_views(3), None).unwrap_err().to_string();
    assert!(
        message.contains("view 1 (1.jpg)") && message.contains("48×36") && message.contains("10×9"),
        "{message}"
    );
    scene.maps[1].color = None;
    let message = scene.try_fuse(&with_min_views(1), None).unwrap_err().to_string();
    assert!(message.contains("--estimate-colors 0"), "{message}");
}
