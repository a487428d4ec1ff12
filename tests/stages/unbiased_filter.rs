//! The unbiased filter against exact depths, on OpenMVS's own raw maps of the bundled scene.

use crate::common::{bytes, facade6};
use crate::openmvs_maps::{depth_maps, neighbor_lists, scene};
use semvs::internals::depth_filter::{FilterView, UnbiasedFilterOptions, filter_unbiased};
use semvs::internals::scene::DepthEstimate;

/// Relative error of a good depth.
const GOOD: f32 = 0.005;
/// Relative error of a gross one.
const GROSS: f32 = 0.05;

/// The exact depths of a view at half the image size: the lower right of four pixels.
fn truth(view: usize) -> Vec<f32> {
    let npy = bytes(&facade6().join(format!("truth/{view:04}.npy.zst")));
    let header = 10 + usize::from(u16::from_le_bytes([npy[8], npy[9]]));
    let full: Vec<f32> = npy[header..].as_chunks::<4>().0.iter().map(|c| f32::from_le_bytes(*c)).collect();
    (0..150).flat_map(|y| (0..200).map(move |x| (2 * y + 1) * 400 + 2 * x + 1)).map(|i| full[i]).collect()
}

/// Good depths, and the shares of good and gross ones among all depths.
fn quality(maps: &[DepthEstimate]) -> (f64, f64, f64) {
    let (mut all, mut good, mut gross) = (0.0, 0.0, 0.0);
    for (view, map) in maps.iter().enumerate() {
        let depths = map.depth.data().iter().zip(truth(view));
        for (depth, exact) in depths.filter(|(depth, exact)| **depth > 0.0 && *exact > 0.0) {
            let error = (depth - exact).abs() / exact;
            all += 1.0;
            good += f64::from(u8::from(error < GOOD));
            gross += f64::from(u8::from(error > GROSS));
        }
    }
    println!("{all} depths, {:.4} good, {:.4} gross", good / all, gross / all);
    (good, good / all, gross / all)
}

#[test]
fn it_keeps_the_good_depths_that_the_adjust_filter_loses() {
    let folder = facade6().join("openmvs-2.3.0");
    let raw = depth_maps(&folder.join("raw"));
    let lists = neighbor_lists(&scene(&folder.join("post7/scene_dense.mvs")));
    let filtered: Vec<_> = raw
        .iter()
        .zip(lists)
        .map(|(map, list)| {
            let neighbors: Vec<_> = list.iter().map(|v| FilterView::new(&raw[v.index()])).collect();
            filter_unbiased(&FilterView::new(map), &neighbors, &UnbiasedFilterOptions::default())
        })
        .collect();
    let (good_before, share_before, gross_before) = quality(&raw);
    let (good, share, gross) = quality(&filtered);
    let (good_adjusted, share_adjusted, _) = quality(&depth_maps(&folder.join("post7")));
    assert!(good > 0.95 * good_before, "{good} of {good_before} good depths are left");
    assert!(gross < 0.75 * gross_before, "gross errors fall from {gross_before} to {gross} only");
    assert!(share > share_before && share > share_adjusted && good > 1.08 * good_adjusted);
}
