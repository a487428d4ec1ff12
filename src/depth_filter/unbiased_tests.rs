use super::*;
use crate::scene::LabelMap;
use crate::scene::synthetic::{Plane, camera, row_of_views, view_of_plane};

/// Relative error of a neighbour's depth on the slanted test plane once it is read on the plane through its pixel:
/// single precision alone. To whole pixels it is up to 0.004.
const PLANE_ERROR: f32 = 2e-5;

fn slanted_views() -> Vec<DepthEstimate> {
    row_of_views(4, 64, 48, 0.25, Plane::slanted(8.0, 0.2, -0.1))
}

fn neighbors(views: &[DepthEstimate]) -> Vec<FilterView<'_>> {
    views[1..].iter().map(FilterView::new).collect()
}

fn filter(views: &[DepthEstimate], options: &UnbiasedFilterOptions) -> DepthEstimate {
    filter_unbiased(&FilterView::new(&views[0]), &neighbors(views), options)
}

const CENTRE: (usize, usize) = (32, 24);

#[test]
fn neighbours_confirm_a_slanted_plane_to_single_precision_and_nothing_changes() {
    let views = slanted_views();
    let votes = count_votes(&FilterView::new(&views[0]), &neighbors(&views), PLANE_ERROR);
    assert_eq!(votes[CENTRE], Votes { confirming: 3, occluding: 0, contradicting: 0 });
    assert!(votes.data().iter().all(|v| v.occluding == 0 && v.contradicting == 0));
    let filtered =
        filter(&views, &UnbiasedFilterOptions { max_depth_diff: PLANE_ERROR, ..Default::default() });
    assert_eq!(filtered.depth[CENTRE], views[0].depth[CENTRE]);
    let seen = votes.data().iter().filter(|v| v.confirming > 0).count();
    assert_eq!(filtered.depth.data().iter().filter(|&&d| d > 0.0).count(), seen);
    assert_eq!(filtered.confidence.as_ref().unwrap()[CENTRE], 0.9);
}

#[test]
fn without_normals_whole_pixels_are_compared() {
    let mut views = slanted_views();
    views.iter_mut().for_each(|v| v.normal = None);
    let reference = FilterView::new(&views[0]);
    let strict = count_votes(&reference, &neighbors(&views), PLANE_ERROR);
    let lenient = count_votes(&reference, &neighbors(&views), 0.005);
    let confirmed = |votes: &Grid<Votes>| votes.data().iter().filter(|v| v.confirming > 0).count();
    assert!(confirmed(&strict) * 4 < confirmed(&lenient));
}

#[test]
fn neighbours_see_through_a_floating_point_and_are_hidden_from_one_behind() {
    let mut views = slanted_views();
    views[0].depth[CENTRE] = 5.0;
    views[0].depth[(20, 24)] = 9.5;
    let votes = count_votes(&FilterView::new(&views[0]), &neighbors(&views), 0.01);
    assert_eq!(votes[CENTRE], Votes { confirming: 0, occluding: 0, contradicting: 3 });
    assert_eq!(votes[(20, 24)].contradicting, 0);
    assert!(votes[(20, 24)].occluding >= 2);
    let filtered = filter(&views, &UnbiasedFilterOptions::default());
    assert_eq!((filtered.depth[CENTRE], filtered.depth[(20, 24)]), (0.0, 0.0));
    assert_eq!(filtered.confidence.unwrap()[CENTRE], 0.0);
}

#[test]
fn contradictions_count_against_confirmations() {
    // One neighbour agrees, two see through.
    let mut views = slanted_views();
    for view in &mut views[2..] {
        view.depth.data_mut().iter_mut().for_each(|d| *d *= 1.3);
    }
    let balance = |c: f32| UnbiasedFilterOptions { contradictions_per_confirmation: c, ..Default::default() };
    assert_eq!(filter(&views, &balance(1.0)).depth[CENTRE], 0.0);
    assert!(filter(&views, &balance(2.0)).depth[CENTRE] > 0.0);
    // Occluders do not count.
    for view in &mut views[2..] {
        view.depth.data_mut().iter_mut().for_each(|d| *d *= 0.5);
    }
    assert!(filter(&views, &balance(0.0)).depth[CENTRE] > 0.0);
    let two = UnbiasedFilterOptions { min_confirming: 2, ..balance(0.0) };
    assert_eq!(filter(&views, &two).depth[CENTRE], 0.0);
}

#[test]
fn depths_that_nobody_sees_well_go() {
    let mut views = slanted_views();
    let sure = |view: &mut DepthEstimate, c: f32| {
        view.confidence = Some(Grid::filled(view.depth.size(), c));
    };
    // four views of a quarter each make one
    views.iter_mut().for_each(|view| sure(view, 0.25));
    let least = |e: f32| UnbiasedFilterOptions { min_evidence: e, ..Default::default() };
    assert!(filter(&views, &least(0.99)).depth[CENTRE] > 0.0);
    assert_eq!(filter(&views, &least(1.01)).depth[CENTRE], 0.0);
    // who does not confirm adds nothing
    views[3].depth.data_mut().iter_mut().for_each(|d| *d *= 0.5);
    assert_eq!(filter(&views, &least(0.99)).depth[CENTRE], 0.0);
    assert!(filter(&views, &least(0.74)).depth[CENTRE] > 0.0);
    // and who contradicts asks for as much again
    views[3].depth.data_mut().iter_mut().for_each(|d| *d *= 3.0);
    let seen_through = |e: f32| UnbiasedFilterOptions { contradictions_per_confirmation: 1.0, ..least(e) };
    assert_eq!(filter(&views, &seen_through(0.38)).depth[CENTRE], 0.0);
    assert!(filter(&views, &seen_through(0.37)).depth[CENTRE] > 0.0);
    // whoever confirms it, a depth must be good for something itself
    let own = |c: f32| UnbiasedFilterOptions { min_confidence: c, ..seen_through(0.37) };
    assert!(filter(&views, &own(0.25)).depth[CENTRE] > 0.0);
    assert_eq!(filter(&views, &own(0.26)).depth[CENTRE], 0.0);
    assert!(own(1.5).check().is_err() && own(-0.1).check().is_err() && own(0.0).check().is_ok());
    // without confidences there is nothing to add up
    views.iter_mut().for_each(|view| view.confidence = None);
    assert!(filter(&views, &least(0.99)).depth[CENTRE] > 0.0);
}

#[test]
fn a_neighbour_of_another_class_has_no_vote() {
    let views = slanted_views();
    let size = views[0].depth.size();
    let (wall, tree): (LabelMap, LabelMap) = (Grid::filled(size, 1), Grid::filled(size, 2));
    let reference = FilterView { estimate: &views[0], labels: Some(&wall) };
    let labelled = [
        FilterView { estimate: &views[1], labels: Some(&wall) },
        FilterView { estimate: &views[2], labels: Some(&tree) },
        FilterView { estimate: &views[3], labels: None },
    ];
    assert_eq!(count_votes(&reference, &labelled, 0.01)[CENTRE].confirming, 2);
}

#[test]
fn a_map_without_neighbours_and_views_from_behind_stay_as_they_are_or_silent() {
    let views = slanted_views();
    assert_eq!(filter(&views[..1], &UnbiasedFilterOptions::default()), views[0]);
    let mut looking_back = view_of_plane(
        9,
        camera(64, 48, [0.0, 0.0, 0.0], std::f64::consts::PI),
        Plane::slanted(8.0, 0.2, -0.1),
    );
    looking_back.depth.data_mut().fill(3.0);
    let votes = count_votes(&FilterView::new(&views[0]), &[FilterView::new(&looking_back)], 0.01);
    assert!(votes.data().iter().all(|v| *v == Votes::default()));
}
