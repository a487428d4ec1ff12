//! Loading, view selection and regions of interest against OpenMVS's own outputs.

use crate::common::{bytes, facade6, shared};
use semvs::internals::geometry::Camera;
use semvs::internals::progress::Progress;
use semvs::internals::scene::{NeighborOptions, ResolutionOptions, ViewNeighbors, select_neighbors};
use semvs::internals::store::cameras::working_cameras;
use semvs::internals::store::import::{LoadedScene, load_scene};
use semvs_formats::Limits;
use std::path::Path;

/// Largest relative difference of a score, scale, angle or area: exp and acos differ between libraries.
const SCORE_TOLERANCE: f32 = 1e-6;

fn load(path: &Path) -> LoadedScene {
    load_scene(path, Path::new(""), &Limits::default(), &Progress::silent()).unwrap()
}

fn select(loaded: &LoadedScene, resolution: &ResolutionOptions) -> (Vec<Option<Camera>>, Vec<ViewNeighbors>) {
    let cameras = working_cameras(loaded, resolution, true, &Progress::silent()).unwrap();
    let neighbors = select_neighbors(&loaded.scene, &cameras, &NeighborOptions::default()).unwrap();
    (cameras, neighbors)
}

/// Compares view selection on `scene` with what OpenMVS stored in `reference`.
fn assert_same_neighbors(scene: &Path, reference: &Path, resolution: &ResolutionOptions) {
    let (_, views) = select(&load(scene), resolution);
    let expected = load(reference);
    let close = |a: f32, b: f32| (a - b).abs() <= SCORE_TOLERANCE * b.abs();
    let mut worst = 0.0f32;
    for (i, (view, stored)) in views.iter().zip(&expected.scene.views).enumerate() {
        let order = |n: &[semvs::internals::scene::Neighbor]| {
            n.iter().map(|n| (n.view, n.points)).collect::<Vec<_>>()
        };
        assert_eq!(order(&view.all), order(&stored.neighbors), "view {i}");
        assert!(close(view.avg_depth, stored.avg_depth), "view {i}: {} {}", view.avg_depth, stored.avg_depth);
        for (a, b) in view.all.iter().zip(&stored.neighbors) {
            for (x, y) in [(a.scale, b.scale), (a.angle, b.angle), (a.area, b.area), (a.score, b.score)] {
                worst = worst.max((x - y).abs() / y.abs());
                assert!(close(x, y), "view {i}: {a:?} is not {b:?}");
            }
        }
    }
    println!("{}: worst relative difference {worst:e}", scene.display());
}

fn resolution(level: u32, min: u32) -> ResolutionOptions {
    ResolutionOptions { level, min, max: 2560 }
}

#[test]
fn view_selection_equals_openmvs_on_the_bundled_scene() {
    let folder = facade6();
    let reference = folder.join("openmvs-2.3.0/post7/scene_dense.mvs");
    assert_same_neighbors(&folder.join("scene.mvs"), &reference, &resolution(1, 160));
}

#[test]
fn view_selection_equals_openmvs_on_larger_scenes() {
    for name in ["facade16", "fountain_p11"] {
        let scene = shared(&format!("datasets/{name}/scene.mvs"));
        let reference = shared(&format!("reference/{name}/scene_dense.mvs"));
        if let (Some(scene), Some(reference)) = (scene, reference) {
            assert_same_neighbors(&scene, &reference, &resolution(1, 320));
        }
    }
    if let Some(folder) = shared("reference/tests4") {
        let reference = folder.join("fuse_fuse3/scene_dense.mvs");
        assert_same_neighbors(&folder.join("scene.mvs"), &reference, &ResolutionOptions::default());
    }
}

#[test]
fn densified_scenes_equal_openmvs_to_the_byte() {
    use semvs::internals::store::export::{interface_archive, write_interface};
    let scratch = tempfile::tempdir().unwrap();
    for name in ["facade16", "fountain_p11"] {
        let scene = shared(&format!("datasets/{name}/scene.mvs"));
        let Some((scene, reference)) = scene.zip(shared(&format!("reference/{name}/scene_dense.mvs"))) else {
            return;
        };
        let mut loaded = load(&scene);
        loaded.search.working_folder = scene.parent().unwrap().to_owned();
        let (cameras, neighbors) = select(&loaded, &resolution(1, 320));
        let path = scratch.path().join(name);
        write_interface(&path, &interface_archive(&loaded, &cameras, &neighbors)).unwrap();
        assert!(std::fs::read(path).unwrap() == std::fs::read(reference).unwrap(), "{name}: bytes differ");
    }
}

#[test]
fn a_densified_scene_keeps_its_neighbours_and_gets_its_tracks() {
    let folder = facade6();
    let (_, fresh) = select(&load(&folder.join("scene.mvs")), &resolution(1, 160));
    let mut again = load(&folder.join("openmvs-2.3.0/post7/scene_dense.mvs"));
    again.search.scene_folder = folder;
    let (_, views) = select(&again, &resolution(1, 160));
    for ((view, fresh), stored) in views.iter().zip(&fresh).zip(&again.scene.views) {
        assert_eq!(view.all, stored.neighbors);
        assert_eq!(view.tracks, fresh.tracks);
        assert_eq!(view.matching_count, fresh.matching_count);
    }
}

#[test]
fn one_bad_photograph_drops_its_view_and_strictness_makes_it_an_error() {
    let scratch = tempfile::tempdir().unwrap();
    let folder = facade6();
    std::fs::create_dir(scratch.path().join("images")).unwrap();
    let mut loaded = load(&folder.join("scene.mvs"));
    loaded.search.working_folder = scratch.path().to_owned();
    loaded.search.scene_folder = scratch.path().to_owned();
    let image = |i: usize| loaded.scene.views[i].name.clone();
    for i in 0..6 {
        std::fs::copy(folder.join(image(i)), scratch.path().join(image(i))).unwrap();
    }
    std::fs::remove_file(scratch.path().join(image(1))).unwrap();
    std::fs::write(scratch.path().join(image(2)), b"no image").unwrap();
    let cameras = working_cameras(&loaded, &resolution(1, 160), false, &Progress::silent()).unwrap();
    let usable: Vec<bool> = cameras.iter().map(Option::is_some).collect();
    assert_eq!(usable, [true, false, false, true, true, true]);
    let error =
        working_cameras(&loaded, &resolution(1, 160), true, &Progress::silent()).unwrap_err().to_string();
    assert!(error.contains("0004.jpg"), "{error}");
    let neighbors = select_neighbors(&loaded.scene, &cameras, &NeighborOptions::default()).unwrap();
    assert_eq!(neighbors[1], ViewNeighbors::default());
    assert!(neighbors[0].all.iter().all(|n| usable[n.view.index()]));
    for i in [3, 4, 5] {
        std::fs::remove_file(scratch.path().join(image(i))).unwrap();
    }
    let error =
        working_cameras(&loaded, &resolution(1, 160), false, &Progress::silent()).unwrap_err().to_string();
    assert!(error.contains("1 of its 6 images") && error.contains("working folder"), "{error}");
}

#[test]
fn the_estimated_region_equals_openmvs() {
    use semvs::internals::scene::{RoiEstimation, estimate_roi};
    // Printed by OpenMVS with six decimals.
    const TOLERANCE: f64 = 1e-6;
    let Some(folder) = shared("reference/tests4") else { return };
    let scene = load(&folder.join("scene.mvs")).scene;
    assert_eq!(estimate_roi(&scene, RoiEstimation::ObjectScan), None, "the cameras look the same way");
    let roi = estimate_roi(&scene, RoiEstimation::Always).unwrap();
    let close = |got: &nalgebra::Vector3<f64>, want: [f64; 3]| {
        got.iter().zip(want).all(|(g, w)| (g - w).abs() <= TOLERANCE)
    };
    assert!(close(&roi.center, [0.569575, -0.991925, -3.074815]), "{}", roi.center);
    assert!(close(&roi.half_extent, [5.386892, 3.184098, 4.547450]), "{}", roi.half_extent);
}

#[test]
fn depth_ranges_equal_those_of_openmvs_maps() {
    use semvs::internals::scene::SparseInit;
    let folder = facade6();
    let loaded = load(&folder.join("scene.mvs"));
    let (cameras, views) = select(&loaded, &resolution(1, 160));
    for (i, (camera, view)) in cameras.iter().zip(&views).enumerate() {
        let file = folder.join(format!("openmvs-2.3.0/raw/depth{i:04}.dmap.zst"));
        let bytes = bytes(&file);
        let f32_at = |at: usize| f32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
        let init = SparseInit::new(&loaded.scene.tracks, &view.tracks, camera.as_ref().unwrap());
        assert_eq!(init.range, (f32_at(20), f32_at(24)), "view {i}");
        let with_normal = init.points.iter().filter(|p| p.normal.is_some()).count();
        assert!(with_normal > init.points.len() * 9 / 10);
    }
}
