//! What DensifyPointCloud does besides densification: filters and exports of finished clouds, scenes in parts.

use crate::common::{self, FUSE_ONLY, Scratch};
use semvs_formats::Limits;
use semvs_formats::mvs::{Container, Scene, SceneFile};
use semvs_formats::ply;
use std::collections::{BTreeMap, HashSet};

/// The dense project archive that OpenMVS wrote, with the images it names.
fn with_dense_archive() -> Scratch {
    let scratch = Scratch::facade6();
    let dense = common::facade6().join("openmvs-2.3.0/archive3/scene_dense.mvs");
    std::fs::copy(dense, scratch.path("scene_dense.mvs")).unwrap();
    scratch
}

fn scene(scratch: &Scratch, name: &str) -> Scene {
    SceneFile::read(scratch.path(name), &Limits::default()).unwrap().scene
}

fn write(scratch: &Scratch, name: &str, scene: &Scene) {
    let mut bytes = Vec::new();
    semvs_formats::mvs::write_interface(&mut bytes, scene, 7).unwrap();
    scratch.write(name, bytes);
}

#[test]
fn points_that_are_seen_through_are_removed() {
    let scratch = with_dense_archive();
    scratch.densify_point_cloud("scene_dense.mvs --filter-point-cloud -20 --archive-type 3 -v 0").ok();
    let before = scene(&scratch, "scene_dense.mvs");
    let after = scene(&scratch, "scene_dense_dense_filtered.mvs");
    let ply = scratch.cloud("scene_dense_dense_filtered.ply");
    assert_eq!(ply.positions, after.points.positions);
    assert!(!ply.has_views() && !ply.colors.is_empty() && !ply.normals.is_empty());
    let (all, kept) = (before.points.positions.len(), after.points.positions.len());
    assert!(kept < all && kept > all * 9 / 10, "{kept} of {all}");
    assert_eq!((after.points.views.len(), after.points.normals.len()), (kept, kept));
    assert_eq!(after.images, before.images);
    assert_eq!(after.platforms, before.platforms);
    // Points that stay keep their views.
    let views_at: BTreeMap<[u32; 3], &[u32]> = (0..all)
        .map(|i| (before.points.positions[i].map(f32::to_bits), before.points.views.images_of(i)))
        .collect();
    for i in 0..kept {
        assert_eq!(after.points.views.images_of(i), views_at[&after.points.positions[i].map(f32::to_bits)]);
    }
    // The same for any number of threads, and as an interface archive.
    let expected = scratch.read("scene_dense_dense_filtered.ply");
    scratch.densify_point_cloud("--filter-point-cloud -20 -i scene_dense.mvs -v 0 --max-threads 1").ok();
    let file = SceneFile::read(scratch.path("scene_dense_dense_filtered.mvs"), &Limits::default()).unwrap();
    assert!(matches!(file.container, Container::Interface { .. }));
    assert_eq!(file.scene.points.positions, after.points.positions);
    let with_views = scratch.cloud("scene_dense_dense_filtered.ply");
    assert!(with_views.has_views() && with_views.positions == after.points.positions);
    scratch
        .densify_point_cloud("scene_dense.mvs --filter-point-cloud -20 --archive-type 3 --max-threads 1")
        .ok();
    assert_eq!(scratch.read("scene_dense_dense_filtered.ply"), expected);
    // A milder limit removes more, one that nothing survives is an error.
    scratch.densify_point_cloud("scene_dense.mvs --filter-point-cloud -1 --archive-type 3").ok();
    assert!(scratch.cloud("scene_dense_dense_filtered.ply").len() < kept);
}

#[test]
fn a_cloud_beside_the_scene_can_be_filtered_too() {
    let scratch = Scratch::with_maps();
    scratch.densify_point_cloud(&format!("scene.mvs {FUSE_ONLY}")).ok();
    let words = "scene_dense.mvs -p scene_dense.ply -o clean.mvs --filter-point-cloud -20";
    scratch.densify_point_cloud(words).ok();
    let (before, after) = (scratch.cloud("scene_dense.ply"), scratch.cloud("clean_filtered.ply"));
    assert!(after.len() < before.len() && after.len() > before.len() * 9 / 10);
    assert!(!after.views.weights.is_empty());
}

#[test]
fn well_seen_points_are_exported() {
    let scratch = with_dense_archive();
    let before = scene(&scratch, "scene_dense.mvs");
    let well_seen = (0..before.points.positions.len())
        .filter(|&i| before.points.views.images_of(i).len() >= 5)
        .map(|i| before.points.positions[i])
        .collect::<Vec<_>>();
    scratch.densify_point_cloud("scene_dense.mvs --export-number-views 5").ok();
    let ply = scratch.cloud("scene_dense_dense_5views.ply");
    assert_eq!(ply.positions, well_seen);
    assert!(!ply.has_views() && !ply.colors.is_empty());
    assert!(!scratch.has("scene_dense_dense_5views.mvs"));
    scratch.densify_point_cloud("scene_dense.mvs --export-number-views -5 --archive-type 1").ok();
    assert_eq!(scene(&scratch, "scene_dense_dense_5views.mvs").points.positions, well_seen);
    // Points without colours are white.
    let mut plain = scene(&scratch, "scene.mvs");
    plain.points.colors.clear();
    write(&scratch, "scene.mvs", &plain);
    scratch.densify_point_cloud("scene.mvs --export-number-views 2").ok();
    let sparse = scratch.cloud("scene_dense_2views.ply");
    assert!(sparse.colors.iter().all(|c| *c == [255; 3]) && sparse.colors.len() == sparse.len());
    scratch.densify_point_cloud("scene.mvs --export-number-views 99").fails_naming(&["scene.mvs"]);
}

#[test]
fn the_scale_of_points_is_the_size_of_a_pixel() {
    let scratch = with_dense_archive();
    scratch.densify_point_cloud("scene_dense.mvs --estimate-scale 2").ok();
    let ply = scratch.cloud("scene_dense_dense_scale.ply");
    let before = scene(&scratch, "scene_dense.mvs");
    assert_eq!(ply.positions, before.points.positions);
    assert_eq!(ply.normals, before.points.normals);
    assert_eq!((ply.value.len(), ply.confidence.len()), (ply.len(), ply.len()));
    // Focal length: 0.833 of 200 pixels; the camera with the heaviest view is some units away.
    let mean = ply.value.iter().sum::<f32>() / ply.len() as f32;
    assert!(ply.value.iter().all(|v| *v > 0.0) && (0.02..1.0).contains(&mean), "{mean}");
    assert!((0..ply.len()).all(|i| before.points.views.weights_of(i).contains(&ply.confidence[i])));
    // Sparse points have neither weights nor normals: the number of views, and normals from the points around.
    scratch.densify_point_cloud("scene.mvs --estimate-scale 1").ok();
    let sparse = scratch.cloud("scene_dense_scale.ply");
    let scene = scene(&scratch, "scene.mvs");
    for i in 0..sparse.len() {
        assert_eq!(sparse.confidence[i], scene.points.views.images_of(i).len() as f32);
        let length: f32 = sparse.normals[i].iter().map(|v| v * v).sum();
        assert!((length - 1.0).abs() < 1e-3, "{:?}", sparse.normals[i]);
    }
}

#[test]
fn clouds_that_do_not_know_their_views_are_refused() {
    let scratch = Scratch::with_maps();
    let mut bare = scene(&scratch, "scene.mvs");
    bare.points = Default::default();
    write(&scratch, "bare.mvs", &bare);
    for words in ["--filter-point-cloud -20", "--export-number-views 3", "--estimate-scale 1"] {
        scratch.densify_point_cloud(&format!("bare.mvs {words}")).fails_naming(&["bare.mvs", "views"]);
    }
}

/// Share of the whole cloud's points that may be missing from the parts: views that matter little to a part are left
/// out of it, so points that hang on them are lost.
const MAX_LOST: f64 = 0.02;
/// Edge of the cells in which the clouds are compared, about two pixels.
const CELL: f32 = 0.2;

fn cells(cloud: &ply::Cloud) -> HashSet<[i32; 3]> {
    cloud.positions.iter().map(|p| p.map(|v| (v / CELL).floor() as i32)).collect()
}

#[test]
fn parts_of_a_scene_together_give_the_whole_cloud() {
    let scratch = Scratch::with_maps();
    scratch.densify_point_cloud(&format!("scene.mvs -o whole.mvs --number-views-fuse 2 {FUSE_ONLY}")).ok();
    let whole = scratch.cloud("whole.ply");
    let parent = scene(&scratch, "scene.mvs");
    // The maps have 3 000 samples of about 0.1 each.
    for area in ["120", "60"] {
        for old in scratch.files().iter().filter(|f| f.starts_with("scene_0")) {
            std::fs::remove_file(scratch.path(old)).unwrap();
        }
        let out = scratch
            .densify_point_cloud(&format!("scene.mvs --estimate-roi 0 --sub-scene-area {area} -v 0"))
            .ok();
        let parts: Vec<String> =
            scratch.files().into_iter().filter(|f| f.starts_with("scene_0") && f.ends_with(".mvs")).collect();
        assert!(parts.len() >= 2, "{area}: {}", out.stdout);
        let mut together = HashSet::new();
        for (i, part) in parts.iter().enumerate() {
            assert_eq!(*part, format!("scene_{i:04}.mvs"));
            let scene = scene(&scratch, part);
            assert!(scene.obb.as_ref().is_some_and(semvs_formats::mvs::Obb::is_valid));
            assert!(scene.images.len() >= 2 && scene.points.positions.len() > 100, "{part}");
            for image in &scene.images {
                assert_eq!(image.name, parent.images[image.id as usize].name, "IDs lead to the depth maps");
            }
            for point in 0..scene.points.positions.len() {
                let views = scene.points.views.images_of(point);
                assert!(views.len() >= 2 && views.iter().all(|&v| (v as usize) < scene.images.len()));
            }
            let out = scratch.densify_point_cloud(&format!("{part} {FUSE_ONLY} --number-views-fuse 2")).ok();
            assert!(!out.stdout.contains("estimated again"), "{}", out.stdout);
            let fused = scratch.cloud(&part.replace(".mvs", "_dense.ply"));
            assert!(fused.len() < whole.len() * 3 / 2 && !fused.is_empty());
            together.extend(cells(&fused));
        }
        let wanted = cells(&whole);
        let lost = wanted.difference(&together).count() as f64 / wanted.len() as f64;
        println!("area {area}: {} parts, {:.2} % lost", parts.len(), lost * 100.0);
        assert!(lost < MAX_LOST, "{area}: {lost}");
    }
}

#[test]
fn a_scene_that_is_small_enough_is_not_split() {
    let scratch = Scratch::with_maps();
    let before = scratch.files().len();
    scratch.densify_point_cloud("scene.mvs --sub-scene-area 660000").ok();
    assert_eq!(scratch.files().len(), before + 1, "but for the log");
    let scratch = Scratch::facade6();
    scratch.densify_point_cloud("scene.mvs --sub-scene-area 100").fails_naming(&["--fusion-mode 1"]);
}

#[test]
fn one_neighbour_each_is_chosen_for_all_images_together() {
    let scratch = Scratch::facade6();
    let words = "scene.mvs --resolution-level 2 --min-resolution 100 --estimate-roi 0 --number-views 1 \
                 --geometric-iters 0 --number-views-fuse 2 -v 2";
    let out = scratch.densify_point_cloud(&format!("{words} --max-threads 2")).ok();
    assert!(out.stdout.contains("paired with 1 views") && !out.stdout.contains("paired with 2 views"));
    let first = scratch.read("scene_dense.ply");
    assert!(scratch.cloud("scene_dense.ply").len() > 1000);
    for old in scratch.files().iter().filter(|f| f.ends_with(".dmap")) {
        std::fs::remove_file(scratch.path(old)).unwrap();
    }
    // Free of cost for what others choose, every image takes its best neighbour: another choice.
    scratch.write("Densify.ini", "Pairwise Mul = 0\n");
    let free = scratch.densify_point_cloud(&format!("{words} --dense-config-file Densify.ini")).ok();
    assert!(!free.stdout.contains("no effect"), "{}", free.stdout);
    assert_ne!(scratch.read("scene_dense.ply"), first);
}
