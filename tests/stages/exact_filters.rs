//! The depth filters reproduce OpenMVS 2.3.0 from its own raw maps.

use crate::common::facade6;
use crate::openmvs_maps::{depth_maps, neighbor_lists, scene};
use semvs::internals::depth_filter::{
    DepthFilterOptions, FilterView, fill_gaps, filter_consistency, remove_speckles,
};
use semvs::internals::scene::DepthEstimate;

/// Largest relative difference of a depth or confidence: OpenMVS's f32 arithmetic is reproduced, and only
/// rounding inside maths libraries may differ.
const MAX_RELATIVE: f32 = 1e-6;
/// Largest angle between normals, degrees: those of filled gaps go through sines and arc tangents.
const MAX_NORMAL_DEG: f32 = 0.05;
/// Share of the pixels that must be within these limits.
const MIN_SHARE: f64 = 0.9999;

fn speckles_and_gaps(maps: &mut [DepthEstimate]) {
    let options = DepthFilterOptions::default();
    for map in maps {
        remove_speckles(map, &options);
        fill_gaps(map, &options);
    }
}

fn adjusted(maps: &[DepthEstimate]) -> Vec<DepthEstimate> {
    let lists = neighbor_lists(&scene(&facade6().join("openmvs-2.3.0/post7/scene_dense.mvs")));
    assert_eq!(lists.len(), maps.len());
    let options = DepthFilterOptions::default();
    maps.iter()
        .zip(&lists)
        .map(|(map, list)| {
            let neighbors: Vec<_> = list.iter().map(|v| FilterView::new(&maps[v.index()])).collect();
            filter_consistency(&FilterView::new(map), &neighbors, maps.len(), &options)
        })
        .collect()
}

fn share(total: usize, bad: usize) -> f64 {
    1.0 - bad as f64 / total as f64
}

fn close(a: f32, b: f32) -> bool {
    a == b || (a - b).abs() <= MAX_RELATIVE * b.abs()
}

fn assert_same_maps(ours: &[DepthEstimate], theirs: &[DepthEstimate]) {
    assert_eq!(ours.len(), theirs.len());
    let min_cos = MAX_NORMAL_DEG.to_radians().cos();
    for (a, b) in ours.iter().zip(theirs) {
        let total = b.depth.data().len();
        let depths = a.depth.data().iter().zip(b.depth.data());
        let invalid = depths.clone().filter(|(a, b)| (**a > 0.0) != (**b > 0.0)).count();
        let depth = depths.filter(|(a, b)| !close(**a, **b)).count();
        let confidences = a.confidence.as_ref().unwrap().data().iter();
        let confidence =
            confidences.zip(b.confidence.as_ref().unwrap().data()).filter(|(a, b)| !close(**a, **b)).count();
        let normals = a.normal.as_ref().unwrap().data().iter().zip(b.normal.as_ref().unwrap().data());
        let normal =
            normals.filter(|(a, b)| a != b && (0..3).map(|i| a[i] * b[i]).sum::<f32>() < min_cos).count();
        println!(
            "view {}: of {total} pixels {invalid} differ in validity, {depth} in depth, {confidence} in \
             confidence, {normal} in normal",
            b.image_id
        );
        for (what, bad) in
            [("validity", invalid), ("depth", depth), ("confidence", confidence), ("normal", normal)]
        {
            assert!(share(total, bad) >= MIN_SHARE, "view {}: {bad} pixels differ in {what}", b.image_id);
        }
    }
}

#[test]
fn speckles_and_gaps_are_those_of_openmvs() {
    let folder = facade6().join("openmvs-2.3.0");
    let mut maps = depth_maps(&folder.join("raw"));
    assert_eq!(maps.len(), 6);
    speckles_and_gaps(&mut maps);
    assert_same_maps(&maps, &depth_maps(&folder.join("post3")));
}

#[test]
fn the_adjust_filter_is_that_of_openmvs() {
    let folder = facade6().join("openmvs-2.3.0");
    let mut maps = depth_maps(&folder.join("raw"));
    speckles_and_gaps(&mut maps);
    assert_same_maps(&adjusted(&maps), &depth_maps(&folder.join("post7")));
}
