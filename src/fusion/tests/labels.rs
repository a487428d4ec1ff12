use super::*;
use crate::scene::PointSource;
use crate::semantics::{ClassRules, ClassTable, Consistency};

const BUILDING: u16 = 1;
const SKY: u16 = 2;
const WINDOW: u16 = 4;

fn policy(consistency: Consistency, exclude: &[&str]) -> ClassPolicy {
    let rules = ClassRules {
        exclude: exclude.iter().map(|s| (*s).to_owned()).collect(),
        consistency,
        ..ClassRules::default()
    };
    ClassPolicy::new(&ClassTable::builtin("3dom-facade").unwrap(), &rules).unwrap()
}

/// Four views; all pixels of view `i` have `labels[i]`.
fn labelled_wall(labels: [u16; 4]) -> TestScene {
    let mut scene = TestScene::wall(4);
    for (i, label) in labels.into_iter().enumerate() {
        scene.label(i, |_, _| label);
    }
    scene
}

fn class(summary: &FusionSummary, id: u16) -> ClassCounts {
    summary.classes.iter().copied().find(|c| c.id == id).unwrap_or_default()
}

#[test]
fn without_a_check_and_with_all_classes_kept_labels_change_no_geometry() {
    let scene = labelled_wall([BUILDING, WINDOW, 0, WINDOW]);
    let (plain, _) = scene.fuse(&with_min_views(3));
    let (labelled, summary) =
        scene.try_fuse(&with_min_views(3), Some(&policy(Consistency::Off, &[]))).unwrap();
    assert!(!plain.layout().labels && labelled.layout().labels);
    assert_eq!(plain.len(), labelled.len());
    for (a, b) in plain.iter().zip(labelled.iter()) {
        assert_eq!((a.position, a.normal, a.color), (b.position, b.normal, b.color));
        assert_eq!((a.views, a.weights), (b.views, b.weights));
    }
    assert_eq!(class(&summary, BUILDING).pixels, 48 * 36);
    assert_eq!(class(&summary, WINDOW).depths, 2 * 48 * 36);
    assert_eq!(summary.classes.iter().map(|c| c.points).sum::<u64>(), labelled.len());
}

#[test]
fn the_label_is_voted_with_fusion_weights() {
    let mut scene = labelled_wall([BUILDING, WINDOW, WINDOW, 0]);
    let options = with_min_views(4);
    let off = policy(Consistency::Off, &[]);
    let (points, summary) = scene.try_fuse(&options, Some(&off)).unwrap();
    assert!(points.len() > 500);
    assert!(points.iter().all(|p| p.label == WINDOW && (p.label_confidence - 2.0 / 3.0).abs() < 0.1));
    let mean = class(&summary, WINDOW).mean_label_confidence();
    assert!((mean - 2.0 / 3.0).abs() < 0.05, "{mean}");
    // A confident view outvotes two that are not.
    for i in [1, 2] {
        scene.estimate(i).confidence.as_mut().unwrap().data_mut().fill(0.1);
    }
    let (points, _) = scene.try_fuse(&options, Some(&off)).unwrap();
    assert!(points.iter().all(|p| p.label == BUILDING && p.label_confidence > 0.75));
}

#[test]
fn another_class_neither_joins_nor_is_consumed_or_invalidated() {
    // Views 0 and 1 say building, 2 and 3 window: with two views each pair makes its own points.
    let scene = labelled_wall([BUILDING, BUILDING, WINDOW, WINDOW]);
    let support = policy(Consistency::Support, &[]);
    let (points, summary) = scene.try_fuse(&with_min_views(2), Some(&support)).unwrap();
    assert!(points.iter().all(|p| p.views.len() == 2));
    let of = |label| points.iter().filter(|p| p.label == label).count();
    assert!(of(BUILDING) > 1000 && of(WINDOW) > 1000);
    assert!(points.iter().all(|p| (p.views[0].0 < 2) == (p.label == BUILDING)));
    assert_eq!(summary.depths, 4 * 48 * 36, "nothing was invalidated");
    // Disagreement shows in the confidence where the dissenters were still free: in the first view's turn.
    assert!((points.point(500).label_confidence - 0.5).abs() < 0.1);

    // With three views required, no pair is enough and the check is to blame.
    let (points, summary) = scene.try_fuse(&with_min_views(3), Some(&support)).unwrap();
    assert_eq!(points.len(), 0);
    assert!(class(&summary, BUILDING).rejected_by_consistency > 1000);
}

#[test]
fn claimed_depths_support_and_dissent_by_their_class() {
    let all = |n| FusionOptions { number_views_fuse: n, ..FusionOptions::supporting() };
    // Classes in turn by columns of the finest view: a claimed depth of the others supports what has its class.
    let mut views = crate::scene::synthetic::row_of_views(4, 48, 36, 0.2, wall());
    let fine = crate::scene::synthetic::camera(96, 72, [0.0; 3], 0.0);
    views[0] = crate::scene::synthetic::view_of_plane(0, fine, wall());
    let mut scene = TestScene::of(views);
    scene.label(0, |x, _| if x % 2 == 0 { BUILDING } else { WINDOW });
    (1..4).for_each(|i| scene.label(i, |_, _| BUILDING));
    let (points, summary) = scene.try_fuse(&all(3), Some(&policy(Consistency::Support, &[]))).unwrap();
    let (exclusive, _) = scene
        .try_fuse(
            &FusionOptions { support: Support::Unclaimed, ..all(3) },
            Some(&policy(Consistency::Support, &[])),
        )
        .unwrap();
    assert!(points.len() > exclusive.len() * 3 / 2, "{} {}", points.len(), exclusive.len());
    assert!(points.iter().all(|p| p.label == BUILDING));
    assert!(class(&summary, WINDOW).points == 0 && class(&summary, WINDOW).rejected_by_consistency > 1000);
    let (strict, _) = scene.try_fuse(&all(3), Some(&policy(Consistency::Strict, &[]))).unwrap();
    assert!(strict.len() <= points.len() && strict.iter().all(|p| p.label == BUILDING));

    // Two pairs of views with a class each: all four views, if they agreed on it, would make points.
    let scene = labelled_wall([BUILDING, BUILDING, WINDOW, WINDOW]);
    let (points, summary) = scene.try_fuse(&all(4), Some(&policy(Consistency::Support, &[]))).unwrap();
    assert_eq!(points.len(), 0);
    assert!(class(&summary, BUILDING).rejected_by_consistency > 1000);
    // Four of three views cannot be asked for, and three of which two agree would do, too.
    let (_, summary) = labelled_wall([BUILDING, BUILDING, BUILDING, WINDOW])
        .try_fuse(&all(3), Some(&policy(Consistency::Support, &[])))
        .unwrap();
    assert!(class(&summary, BUILDING).points > 1000 && class(&summary, WINDOW).points == 0);
}

#[test]
fn void_supports_every_class() {
    let scene = labelled_wall([0, BUILDING, 0, BUILDING]);
    let support = policy(Consistency::Support, &[]);
    let (points, _) = scene.try_fuse(&with_min_views(4), Some(&support)).unwrap();
    assert!(points.len() > 500);
    assert!(points.iter().all(|p| p.label == BUILDING && p.label_confidence == 1.0));
    let (points, _) = labelled_wall([0; 4]).try_fuse(&with_min_views(4), Some(&support)).unwrap();
    assert!(points.iter().all(|p| p.label == 0 && p.label_confidence == 0.0));
}

#[test]
fn one_other_class_rejects_a_point_in_the_strict_check() {
    let scene = labelled_wall([BUILDING, BUILDING, BUILDING, WINDOW]);
    let (support, _) = scene.try_fuse(&with_min_views(3), Some(&policy(Consistency::Support, &[]))).unwrap();
    let (strict, summary) =
        scene.try_fuse(&with_min_views(3), Some(&policy(Consistency::Strict, &[]))).unwrap();
    assert!(support.len() > 1000);
    assert!(strict.len() < support.len() / 4, "only what view 3 does not see is left: {}", strict.len());
    assert!(class(&summary, BUILDING).rejected_by_consistency > 1000);
    assert!(strict.iter().all(|p| p.label == BUILDING && p.label_confidence == 1.0));
}

#[test]
fn excluded_classes_start_no_points() {
    let mut scene = TestScene::wall(4);
    for i in 0..4 {
        scene.label(i, |_, y| if y < 18 { SKY } else { BUILDING });
    }
    let (points, summary) =
        scene.try_fuse(&with_min_views(3), Some(&policy(Consistency::Support, &["sky"]))).unwrap();
    assert!(points.len() > 500 && points.iter().all(|p| p.label == BUILDING));
    assert_eq!(class(&summary, SKY).rejected_by_class, 4 * 48 * 18);
    assert_eq!(class(&summary, SKY).points, 0);
}

#[test]
fn a_void_pixel_voted_into_an_excluded_class_makes_no_point() {
    let scene = labelled_wall([0, SKY, SKY, SKY]);
    let (points, summary) =
        scene.try_fuse(&with_min_views(3), Some(&policy(Consistency::Support, &["sky"]))).unwrap();
    assert_eq!(points.len(), 0);
    assert!(class(&summary, 0).rejected_by_class > 1000);
}

#[test]
fn the_check_reads_other_labels_than_the_vote_where_borders_are_void() {
    let mut scene = labelled_wall([BUILDING, BUILDING, BUILDING, WINDOW]);
    let size = scene.maps[3].size();
    scene.maps[3].checked_labels = Some(Arc::new(Grid::filled(size, 0)));
    let (points, _) = scene.try_fuse(&with_min_views(4), Some(&policy(Consistency::Strict, &[]))).unwrap();
    assert!(points.len() > 500);
    assert!(points.iter().all(|p| p.label == BUILDING && (p.label_confidence - 0.75).abs() < 0.1));
}

#[test]
fn labels_are_voted_in_a_plain_merge_too() {
    let scene = labelled_wall([BUILDING, SKY, 0, WINDOW]);
    let (points, _) =
        scene.try_fuse(&with_min_views(1), Some(&policy(Consistency::Support, &["sky"]))).unwrap();
    assert_eq!(points.len(), 3 * 48 * 36);
    assert_eq!((points.point(0).label, points.point(0).label_confidence), (BUILDING, 1.0));
    assert_eq!(points.point(48 * 36).label_confidence, 0.0);
}
