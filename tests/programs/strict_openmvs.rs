//! Where OpenMVS is wrong: the right thing by default, its own with --strict-openmvs. And the options of its later
//! release.

use crate::common::{self, FUSE_ONLY, SMALL, Scratch};
use semvs_formats::Limits;
use semvs_formats::mvs::{self, SceneFile};

#[test]
fn an_unknown_archive_type_is_refused_or_leaves_a_bare_header() {
    let scratch = Scratch::with_maps();
    scratch
        .densify_point_cloud(&format!("scene.mvs --archive-type 7 {FUSE_ONLY}"))
        .fails_naming(&["--archive-type"]);
    scratch.densify_point_cloud(&format!("scene.mvs --archive-type 7 --strict-openmvs {FUSE_ONLY}")).ok();
    let bytes = scratch.read("scene_dense.mvs");
    assert_eq!((bytes.len(), &bytes[8..12]), (20, &[7u8, 0, 0, 0][..]));
    assert!(scratch.has("scene_dense.ply"));
}

#[test]
fn a_project_is_densified_or_only_its_cloud_exported() {
    let scratch = Scratch::with_maps();
    let dense = common::facade6().join("openmvs-2.3.0/archive3/scene_dense.mvs");
    std::fs::copy(dense, scratch.path("project.mvs")).unwrap();
    let stored = SceneFile::read(scratch.path("project.mvs"), &Limits::default()).unwrap().scene;
    scratch.densify_point_cloud("project.mvs --strict-openmvs").ok();
    assert_eq!(scratch.cloud("project_dense.ply").positions, stored.points.positions);
    let scene = SceneFile::read(scratch.path("project_dense.mvs"), &Limits::default()).unwrap().scene;
    assert!(scene.points.positions.is_empty() && scene.images.len() == 6);
    let out = scratch.densify_point_cloud(&format!("project.mvs {FUSE_ONLY}")).ok();
    assert!(out.stdout.contains("Fused depth-maps"), "{}", out.stdout);
}

#[test]
fn optimize_in_the_config_counts_or_not() {
    let scratch = Scratch::with_maps();
    let untouched = scratch.read("depth0000.dmap");
    scratch.write("Densify.ini", "Optimize = 0\n");
    let words = format!("scene.mvs {SMALL} --geometric-iters 0 --dense-config-file Densify.ini");
    scratch.densify_point_cloud(&words).ok();
    assert_eq!(scratch.read("depth0000.dmap"), untouched);
    scratch.densify_point_cloud(&format!("{words} --strict-openmvs")).ok();
    assert_ne!(scratch.read("depth0000.dmap"), untouched);
}

#[test]
fn maps_that_exist_are_made_again_or_refined() {
    let scratch = Scratch::with_maps();
    let words = format!("scene.mvs {SMALL} --geometric-iters 1 --postprocess-dmaps 0 -v 2");
    let out = scratch.densify_point_cloud(&format!("{words} --strict-openmvs")).ok();
    let log = scratch.files().into_iter().find(|f| f.ends_with(".log")).unwrap();
    let log = String::from_utf8(scratch.read(&log)).unwrap();
    assert!(!log.contains("Depth-map for image"), "{log}");
    assert!(out.stdout.contains("Geometric-consistent estimated depth-maps 6 (100%"), "{}", out.stdout);
    let out = scratch.densify_point_cloud(&words).ok();
    assert!(out.stdout.contains("they are estimated again"), "{}", out.stdout);
}

#[test]
fn an_image_that_cannot_be_read_costs_one_view_or_the_run() {
    let scratch = Scratch::facade6();
    scratch.write("images/0004.jpg", "no image");
    let words = format!("scene.mvs {SMALL} --geometric-iters 0 --iters 1");
    scratch.densify_point_cloud(&words).ok();
    scratch.densify_point_cloud(&format!("{words} --strict-openmvs")).fails_naming(&["0004.jpg"]);
    // Depth maps alone: a failure there has no exit code of its own.
    let out = scratch.densify_point_cloud(&format!("{words} --strict-openmvs --fusion-mode 1")).ok();
    assert!(out.stdout.contains("Depth-maps estimated ("), "{}", out.stdout);
    scratch
        .densify_point_cloud("missing.mvs --strict-openmvs --fusion-mode 1")
        .fails_naming(&["missing.mvs"]);
}

#[test]
fn a_cloud_without_points_is_an_error_or_not() {
    let scratch = Scratch::with_maps();
    let words = format!("scene.mvs {FUSE_ONLY} --import-roi-file far.txt -o far.mvs");
    scratch.write("far.txt", "1 0 0 0 1 0 0 0 1  9999 9999 9999  1 1 1");
    scratch.densify_point_cloud(&words).ok();
    scratch.densify_point_cloud(&format!("far.mvs {FUSE_ONLY}")).fails_naming(&["nothing is written"]);
    scratch.densify_point_cloud(&format!("far.mvs {FUSE_ONLY} --strict-openmvs")).ok();
    assert!(scratch.has("far_dense.mvs") && !scratch.has("far_dense.ply"));
}

#[test]
fn too_little_memory_is_said_before_work_with_the_exit_code_of_a_killed_process() {
    let scratch = Scratch::facade6();
    let output = std::process::Command::new(common::DENSIFY)
        .args(["scene.mvs", "--resolution-level", "0"])
        .current_dir(scratch.path(""))
        .env("SEMVS_MEMORY_MIB", "1")
        .output()
        .unwrap();
    let error = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(137), "{error}");
    assert!(error.contains("out of memory") && error.contains("--sub-scene-area"), "{error}");
    assert!(!scratch.has("depth0000.dmap") && !scratch.has("scene_dense.ply"));
}

#[test]
fn the_size_of_the_process_ends_the_output() {
    let scratch = Scratch::with_maps();
    let out = scratch.densify_point_cloud(&format!("scene.mvs -v 0 --process-priority -3 {FUSE_ONLY}")).ok();
    if cfg!(target_os = "linux") {
        let end: Vec<&str> = out.stdout.lines().rev().take(4).map(|l| &l[l.len().min(20)..]).collect();
        assert!(end[0].contains("} ENDINFO") && end[3].contains("MEMORYINFO: {"), "{end:?}");
        assert!(end[2].contains("\tVmPeak:") && end[1].contains("\tVmSize:"), "{end:?}");
    }
}

#[test]
fn segmentation_of_openmvs_2_4_labels_points_by_the_masks() {
    let scratch = Scratch::with_maps();
    std::fs::create_dir(scratch.path("masks")).unwrap();
    for name in ["0003", "0004", "0005", "0006", "0012", "0013"] {
        let mask = image::GrayImage::from_fn(400, 300, |x, _| image::Luma([if x < 200 { 2 } else { 5 }]));
        mask.save(scratch.path(&format!("masks/{name}.mask.png"))).unwrap();
    }
    scratch.densify_point_cloud(&format!("scene.mvs -o plain.mvs {FUSE_ONLY}")).ok();
    scratch.densify_point_cloud(&format!("scene.mvs -m masks --estimate-segmentation 2 {FUSE_ONLY}")).ok();
    let (plain, labelled) = (scratch.cloud("plain.ply"), scratch.cloud("scene_dense.ply"));
    assert_eq!(labelled.positions, plain.positions, "fusion is not changed");
    assert!(
        labelled.labels.iter().all(|l| [2, 5].contains(l))
            && labelled.comments.iter().any(|c| c.contains("building"))
    );
    scratch.write("masks/labels.json", r#"{"0": "unclassified", "2": "left", "5": "right"}"#);
    scratch.densify_point_cloud(&format!("scene.mvs -m masks --estimate-segmentation 1 {FUSE_ONLY}")).ok();
    assert!(scratch.cloud("scene_dense.ply").comments.iter().any(|c| c.contains("left")));
    scratch.densify_point_cloud(&format!("scene.mvs -m masks --estimate-segmentation 0 {FUSE_ONLY}")).ok();
    assert!(scratch.cloud("scene_dense.ply").labels.is_empty());
}

/// A scene of 30 cameras that climb around a tower of radius 2, with noise for images.
fn tower() -> Scratch {
    let scratch = Scratch::new();
    std::fs::create_dir(scratch.path("images")).unwrap();
    let mut platform = mvs::Platform::default();
    platform.cameras.push(mvs::Camera {
        width: 64,
        height: 48,
        k: [50.0, 0.0, 31.5, 0.0, 50.0, 23.5, 0.0, 0.0, 1.0],
        rotation: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        ..mvs::Camera::default()
    });
    let mut scene = mvs::Scene::default();
    let mut state = 1u32;
    for i in 0..30u32 {
        let (s, c) = (f64::from(i) * std::f64::consts::TAU / 6.0).sin_cos();
        // Rows: right, down, forward.
        platform.poses.push(mvs::Pose {
            rotation: [-s, c, 0.0, 0.0, 0.0, -1.0, -c, -s, 0.0],
            center: [8.0 * c, 8.0 * s, f64::from(i) * 1.2],
        });
        let name = format!("images/{i}.png");
        let noise = image::GrayImage::from_fn(64, 48, |_, _| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            image::Luma([(state >> 24) as u8])
        });
        noise.save(scratch.path(&name)).unwrap();
        let name = name.into_bytes();
        scene.images.push(mvs::Image { name, platform: 0, camera: 0, pose: i, id: i, ..Default::default() });
    }
    scene.platforms.push(platform);
    for i in 0..60u32 {
        let (s, c) = (i as f32 * 0.5).sin_cos();
        scene.points.positions.push([2.0 * c, 2.0 * s, i as f32 * 0.6]);
        scene.points.views.push(&[i % 29, 29], &[]);
    }
    let mut bytes = Vec::new();
    mvs::write_interface(&mut bytes, &scene, 7).unwrap();
    scratch.write("tower.mvs", bytes);
    scratch
}

#[test]
fn cameras_that_climb_a_tower_get_points_on_it() {
    let scratch = tower();
    let none = scratch.densify_point_cloud("tower.mvs --tower-mode 0 --output-view-neighbors-file nb.txt");
    none.fails_naming(&["neighbours"]);
    assert!(!scratch.has("tower.ply"));
    std::fs::create_dir(scratch.path("work")).unwrap();
    let words = "-w work --output-view-neighbors-file nb.txt";
    scratch.densify_point_cloud(&format!("../tower.mvs {words}")).ok();
    let points = scratch.cloud("work/tower.ply");
    assert!(points.len() > 5000 && points.positions.iter().all(|p| p[0].hypot(p[1]) < 2.6));
    let lists = String::from_utf8(scratch.read("work/nb.txt")).unwrap();
    assert_eq!(lists.lines().filter(|l| l.split_whitespace().count() > 2).count(), 30, "{lists}");
    // The same every time; where OpenMVS puts it with --strict-openmvs.
    scratch.densify_point_cloud(&format!("../tower.mvs --strict-openmvs {words}")).ok();
    assert_eq!(scratch.read("tower.ply"), scratch.read("work/tower.ply"));
    let expected = points.len();
    for (mode, appended, kept) in
        [("1", true, false), ("2", true, true), ("3", false, true), ("-4", true, true)]
    {
        let words = "--fusion-mode 1 --geometric-iters 0 --iters 1 --sub-resolution-levels 0";
        scratch.densify_point_cloud(&format!("tower.mvs -o t{mode}.mvs --tower-mode {mode} {words}")).ok();
        let scene = SceneFile::read(scratch.path(&format!("t{mode}.mvs")), &Limits::default()).unwrap().scene;
        let count = if appended { expected } else { 0 } + if kept { 60 } else { 0 };
        assert_eq!(scene.points.positions.len(), count, "mode {mode}");
        assert!(scene.images.iter().filter(|i| !i.view_scores.is_empty()).count() > 20, "mode {mode}");
    }
}
