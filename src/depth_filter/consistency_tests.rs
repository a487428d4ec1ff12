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

/// The pixel that the hand-computed cases are about, in maps of 16 × 16 pixels.
const PIXEL: (usize, usize) = (5, 6);

/// Depth 10 with confidence 0.9 everywhere. All maps of this size have the same camera, of focal length 16, in which
/// such depths are projected without rounding: every pixel is warped to itself alone.
fn reference() -> DepthEstimate {
    crate::scene::synthetic::estimate_of_depths(16, 16, |_, _| 10.0)
}

/// Another view with `here` at the pixel and `around` everywhere else, of one confidence.
fn other(here: f32, around: f32, confidence: f32) -> DepthEstimate {
    let depth = |x, y| if (x, y) == PIXEL { here } else { around };
    let mut estimate = crate::scene::synthetic::estimate_of_depths(16, 16, depth);
    estimate.confidence.as_mut().unwrap().data_mut().fill(confidence);
    estimate
}

/// Depth and confidence of the pixel after filtering by `others`, best first, in a scene of ten views.
fn filtered(others: &[DepthEstimate], options: &DepthFilterOptions) -> (f32, f32) {
    let neighbors: Vec<_> = others.iter().map(FilterView::new).collect();
    let result = filter_consistency(&FilterView::new(&reference()), &neighbors, 10, options);
    (result.depth[PIXEL], result.confidence.unwrap()[PIXEL])
}

#[test]
fn the_adjust_variant_gives_hand_computed_means() {
    let options = DepthFilterOptions::default();
    // The last neighbour comes first: ((10 · 0.9 + 10.05 · 0.5) + 9.95 · 0.25) / ((0.9 + 0.5) + 0.25).
    let agreeing = [other(9.95, 9.95, 0.25), other(10.05, 10.05, 0.5)];
    let mean = (10.0_f32 * 0.9 + 10.05 * 0.5 + 9.95 * 0.25) / (0.9_f32 + 0.5 + 0.25);
    assert_eq!(filtered(&agreeing, &options), (mean, 0.9 + 0.5 + 0.25));
    // 1.2 % is no longer similar: 10.13 contradicts from behind, 9.5 from before.
    let contradicted = [other(10.05, 10.05, 0.5), other(10.13, 10.13, 0.25), other(9.5, 9.5, 0.125)];
    let mean = (10.0_f32 * 0.9 + 10.05 * 0.5) / (0.9_f32 + 0.5);
    assert_eq!(filtered(&contradicted, &options), (mean, (0.9_f32 + 0.5) - (0.125 + 0.25)));
    assert_eq!(filtered(&[other(10.11, 10.11, 0.5), other(10.11, 10.11, 0.5)], &options).1, 0.9 + 0.5 + 0.5);
    // Support must be above contradiction, not equal to it.
    let even = [other(10.0, 10.0, 0.5), other(9.0, 9.0, 1.4)];
    assert_eq!(filtered(&even, &options), (0.0, 0.0));
    let nearly = [other(10.0, 10.0, 0.5), other(9.0, 9.0, 1.39)];
    assert_eq!(filtered(&nearly, &options).0, 10.0);
}

#[test]
fn required_views_are_counted_as_by_hand() {
    let hole = || other(0.0, 10.0, 0.5);
    let agrees = || other(10.0, 10.0, 0.5);
    let contradicts = || other(12.0, 12.0, 0.1);
    let kept = |others: &[DepthEstimate], min_views_filter, min_views_filter_adjust| {
        let options = DepthFilterOptions { min_views_filter, min_views_filter_adjust, ..Default::default() };
        filtered(others, &options).0 > 0.0
    };
    // One of three sees the pixel: enough for one required view only, wherever it is in the list.
    for others in [[agrees(), hole(), hole()], [hole(), agrees(), hole()], [hole(), hole(), agrees()]] {
        assert!(!kept(&others, 2, 1) && kept(&others, 1, 1));
    }
    // Two see it, one of them contradicts: two for the first rule, one for the second.
    let others = [agrees(), contradicts(), hole()];
    assert!(kept(&others, 2, 1) && !kept(&others, 2, 2) && !kept(&others, 3, 1));
    // None agrees: only without the second rule, and the support is the pixel's own.
    let others = [contradicts(), contradicts()];
    assert!(!kept(&others, 2, 1) && kept(&others, 2, 0));
    // Fewer neighbours than required leave the map as it is, whatever they say.
    assert!(kept(&others, 3, 1) && kept(&others, 2, 3));
}

#[test]
fn the_strict_variant_decides_as_by_hand() {
    let options = DepthFilterOptions { filter_adjust: false, ..Default::default() };
    let kept = |others: &[DepthEstimate]| {
        let (depth, confidence) = filtered(others, &options);
        assert!((depth, confidence) == (10.0, 0.9) || (depth, confidence) == (0.0, 0.0));
        depth > 0.0
    };
    let of = |here: &[f32], around: &[f32]| -> Vec<DepthEstimate> {
        here.iter().zip(around).map(|(&here, &around)| other(here, around, 0.5)).collect()
    };
    let ten = [10.0; 4];
    // At the pixel: three of four are 75 %, two are not; 0.8 % is the limit.
    assert!(kept(&of(&[10.0, 10.0, 10.0, 11.0], &ten)));
    assert!(!kept(&of(&[10.0, 10.0, 11.0, 11.0], &ten)));
    assert!(kept(&of(&[10.07, 9.93, 10.07, 11.0], &ten)));
    assert!(!kept(&of(&[10.07, 10.07, 10.09, 11.0], &ten)));
    // Views that see nothing do not count; two that agree are enough, one is not.
    assert!(kept(&of(&[10.0, 10.0, 0.0, 0.0], &ten)));
    assert!(!kept(&of(&[10.0, 0.0, 0.0, 0.0], &ten)));
    // Around it: of 16 depths 12 are 75 %, 8 are 50 %; 1.2 % is the limit.
    assert!(kept(&of(&ten, &[10.11, 9.89, 10.0, 11.0])));
    assert!(!kept(&of(&ten, &[10.0, 10.0, 11.0, 11.0])));
    assert!(!kept(&of(&ten, &[10.0, 10.0, 10.13, 11.0])));
    // Around it at least twice the required views must agree: one view's four do, none's do not.
    assert!(kept(&of(&ten, &[10.0, 0.0, 0.0, 0.0])));
    assert!(!kept(&of(&ten, &[0.0; 4])));
    let three = DepthFilterOptions { min_views_filter: 3, ..options };
    assert_eq!(filtered(&of(&ten, &[10.0, 0.0, 0.0, 0.0]), &three).0, 0.0, "six are needed, four are there");
    assert_eq!(filtered(&of(&ten, &[10.0, 10.0, 0.0, 0.0]), &three).0, 10.0);
    // Eleven of 16 are 68.75 %, ten are 62.5 %: 65 % is the limit.
    let mut others = of(&ten, &[10.0, 10.0, 11.0, 11.0]);
    others[2].depth[(PIXEL.0 - 1, PIXEL.1)] = 10.0;
    others[2].depth[(PIXEL.0, PIXEL.1 + 1)] = 10.0;
    assert!(!kept(&others));
    others[3].depth[(PIXEL.0 + 1, PIXEL.1)] = 10.0;
    assert!(kept(&others));
}
