use super::*;
use crate::scene::LabelMap;
use crate::scene::synthetic::{Plane, row_of_views};

/// Relative depth error that the warp to whole pixels causes on the slanted test plane.
const WARP_ERROR: f32 = 0.004;

fn slanted_views() -> Vec<DepthEstimate> {
    row_of_views(4, 64, 48, 0.25, Plane::slanted(8.0, 0.2, -0.1))
}

fn filter(views: &[DepthEstimate], options: &DepthFilterOptions) -> DepthEstimate {
    let neighbors: Vec<_> = views[1..].iter().map(FilterView::new).collect();
    filter_consistency(&FilterView::new(&views[0]), &neighbors, views.len(), options)
}

#[test]
fn depths_that_agree_stay_and_gain_confidence() {
    let views = slanted_views();
    let filtered = filter(&views, &DepthFilterOptions::default());
    let centre = (32, 24);
    assert!((filtered.depth[centre] / views[0].depth[centre] - 1.0).abs() < WARP_ERROR);
    assert!((filtered.confidence.as_ref().unwrap()[centre] - 4.0 * 0.9).abs() < 1e-5);
    let kept = filtered.depth.data().iter().filter(|&&d| d > 0.0).count();
    assert!(kept * 10 > filtered.depth.data().len() * 8, "{kept} kept");
    assert_eq!(filtered.normal, views[0].normal);
}

#[test]
fn a_floating_point_that_neighbours_see_through_goes() {
    let mut views = slanted_views();
    views[0].depth[(32, 24)] = 5.0;
    let filtered = filter(&views, &DepthFilterOptions::default());
    assert_eq!(filtered.depth[(32, 24)], 0.0);
    assert_eq!(filtered.confidence.unwrap()[(32, 24)], 0.0);
}

#[test]
fn a_point_behind_the_surface_of_others_goes() {
    let mut views = slanted_views();
    views[0].depth[(32, 24)] = 9.5;
    assert_eq!(filter(&views, &DepthFilterOptions::default()).depth[(32, 24)], 0.0);
}

#[test]
fn confident_support_outweighs_weak_contradiction() {
    // Neighbour 1 agrees with 0.9, neighbours 2 and 3 contradict with 0.2 each.
    let mut views = slanted_views();
    for view in &mut views[2..] {
        view.depth.data_mut().iter_mut().for_each(|d| *d *= 0.8);
        view.confidence.as_mut().unwrap().data_mut().fill(0.2);
    }
    let filtered = filter(&views, &DepthFilterOptions::default());
    assert!(filtered.depth[(32, 24)] > 0.0);
    assert!((filtered.confidence.unwrap()[(32, 24)] - (1.8 - 0.4)).abs() < 1e-5);
}

#[test]
fn a_pixel_that_fewer_views_see_than_required_goes() {
    let mut views = slanted_views();
    views.truncate(3);
    views[2].depth.data_mut().fill(0.0);
    let options = DepthFilterOptions::default();
    assert!(filter(&views, &options).depth.data().iter().all(|&d| d == 0.0));
    let lenient = DepthFilterOptions { min_views_filter: 1, ..options };
    assert!(filter(&views, &lenient).depth[(32, 24)] > 0.0);
}

#[test]
fn too_few_neighbours_leave_the_map_as_it_is() {
    let views = slanted_views();
    let neighbors = [FilterView::new(&views[1])];
    let options = DepthFilterOptions::default();
    let reference = FilterView::new(&views[0]);
    assert_eq!(filter_consistency(&reference, &neighbors, 4, &options), views[0]);
    assert_ne!(filter_consistency(&reference, &neighbors, 2, &options), views[0]);
}

#[test]
fn the_strict_variant_keeps_values_and_drops_outliers() {
    let mut views = slanted_views();
    views[0].depth[(32, 24)] *= 1.02;
    let options = DepthFilterOptions { filter_adjust: false, ..Default::default() };
    let filtered = filter(&views, &options);
    assert_eq!(filtered.depth[(32, 24)], 0.0);
    assert_eq!(filtered.depth[(30, 24)], views[0].depth[(30, 24)]);
    assert_eq!(filtered.confidence.unwrap()[(30, 24)], 0.9);
}

#[test]
fn a_neighbour_of_another_class_neither_confirms_nor_refutes() {
    let views = slanted_views();
    let size = views[0].depth.size();
    let (wall, tree): (LabelMap, LabelMap) = (Grid::filled(size, 1), Grid::filled(size, 2));
    let label = |estimate, labels| FilterView { estimate, labels: Some(labels) };
    let reference = label(&views[0], &wall);
    let options = DepthFilterOptions::default();
    let same = [label(&views[1], &wall), label(&views[2], &wall), label(&views[3], &tree)];
    let filtered = filter_consistency(&reference, &same, 4, &options);
    assert!((filtered.confidence.unwrap()[(32, 24)] - 3.0 * 0.9).abs() < 1e-5);
    let other = [label(&views[1], &wall), label(&views[2], &tree), label(&views[3], &tree)];
    assert_eq!(filter_consistency(&reference, &other, 4, &options).depth[(32, 24)], 0.0);
}
