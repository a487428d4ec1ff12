//! The command lines of programs that call DensifyPointCloud.

use crate::common::{DENSIFY, Scratch};
use semvs_formats::Limits;
use semvs_formats::mvs::{ArchiveKind, Container, SceneFile};

#[test]
fn opendronemaps_main_run() {
    let scratch = Scratch::facade6();
    scratch.write("Densify.ini", "Optimize = 7\nMin Views Filter = 1\n");
    let path = |name: &str| scratch.path(name).display().to_string();
    let words = format!(
        "{} --resolution-level 1 --dense-config-file {} --max-resolution 200 --min-resolution 640 --max-threads 2 \
         --number-views-fuse 2 --sub-resolution-levels 2 --archive-type 3 -w {} -v 0 --cuda-device -2 \
         --ignore-mask-label 0",
        path("scene.mvs"),
        path("Densify.ini"),
        path("depthmaps")
    );
    scratch.densify_point_cloud(&words).ok();
    let dense = SceneFile::read(scratch.path("scene_dense.mvs"), &Limits::default()).unwrap();
    assert_eq!(dense.container, Container::Project { kind: ArchiveKind::Zstd });
    assert!(dense.scene.points.positions.len() > 10_000);
    assert_eq!(dense.scene.points.views.len(), dense.scene.points.positions.len());
    assert!(scratch.has("scene_dense.ply") && scratch.has("depthmaps/depth0005.dmap"));
    let logs = scratch.files().into_iter().filter(|f| f.ends_with(".log"));
    assert!(logs.clone().count() == 1 && logs.into_iter().all(|f| f.starts_with("depthmaps/")));
    // Depth maps alone, as before tiling.
    scratch.densify_point_cloud(&format!("{words} --fusion-mode 1 --geometric-iters 0")).ok();
}

#[test]
fn mvg_mvs_pipeline_quotes_its_folder() {
    let scratch = Scratch::facade6();
    scratch.add_maps("post7", ".");
    let quoted = format!("\"{}\"", scratch.path("").display());
    let words =
        ["scene.mvs", "--dense-config-file", "Densify.ini", "--resolution-level", "1", "--number-views", "8"];
    let rest = ["-w", &quoted, "--min-resolution", "160", "--geometric-iters", "0"];
    scratch.run(DENSIFY, &[&words[..], &rest[..]].concat()).ok();
    assert!(scratch.has("scene_dense.ply") && scratch.has("scene_dense.mvs") && scratch.has("Densify.ini"));
}

#[test]
fn graphos_names_input_and_output() {
    let scratch = Scratch::facade6();
    scratch.add_maps("post7", ".");
    let folder = scratch.path("").display().to_string();
    let words = format!(
        "-w {folder} -i scene.mvs -o model_dense.mvs -v 2 --resolution-level 1 --min-resolution 160 \
         --max-resolution 2000 --number-views 5 --number-views-fuse 3 --cuda-device -1 --estimate-colors 0 \
         --estimate-normals 0 --geometric-iters 0"
    );
    scratch.densify_point_cloud(&words).ok();
    let header = scratch.read("model_dense.ply");
    let header = String::from_utf8_lossy(&header[..300]).into_owned();
    assert!(!header.contains("red") && !header.contains("nx") && header.contains("view_indices"), "{header}");
}

/// OpenDroneMap's way with too little memory: depth maps of the whole scene, parts, a cloud of each part, filtered.
#[test]
fn opendronemap_tiles_a_scene() {
    let scratch = Scratch::facade6();
    scratch.write("Densify.ini", "Optimize = 7\nMin Views Filter = 1\n");
    let path = |name: &str| scratch.path(name).display().to_string();
    let (scene, maps, ini) = (path("scene.mvs"), path("depthmaps"), path("Densify.ini"));
    // Its clouds are merged byte by byte and read by its point filter; a config file in the folder given by -w says so.
    std::fs::create_dir(scratch.path("depthmaps")).unwrap();
    scratch.write("depthmaps/DensifyPointCloud.cfg", "ply-layout = odm\n");
    let config = format!(
        "--resolution-level 1 --dense-config-file {ini} --max-resolution 2560 --max-threads 2 --number-views-fuse 2 \
         --sub-resolution-levels 2 --archive-type 3 -w {maps} -v 0 --cuda-device -2"
    );
    scratch.densify_point_cloud(&format!("{scene} {config} --min-resolution 160 --fusion-mode 1")).ok();
    assert!(scratch.has("depthmaps/depth0005.dmap") && !scratch.has("scene_dense_dense.ply"));

    // 660000 in earnest; this scene is small.
    let split = format!("{scene} --sub-scene-area 100 --max-threads 2 -w {maps} -v 0 --cuda-device -2");
    scratch.densify_point_cloud(&split).ok();
    let is_part = |f: &String| f.len() == "scene_0000.mvs".len() && f.starts_with("scene_0");
    let parts: Vec<String> = scratch.files().into_iter().filter(is_part).collect();
    assert!(parts.len() >= 2, "{:?}", scratch.files());
    let mut headers = Vec::new();
    for part in &parts {
        // Without --min-resolution the images would be used at another size than the maps have.
        let words = format!("{} {config} --postprocess-dmaps 0 --geometric-iters 0", path(part));
        let before = scratch.read("depthmaps/depth0003.dmap");
        let out = scratch.densify_point_cloud(&words).ok();
        assert!(out.stdout.contains(" depth maps are used as they are"), "{}", out.stdout);
        assert_eq!(scratch.read("depthmaps/depth0003.dmap"), before);
        let dense = part.replace(".mvs", "_dense.mvs");
        let filter =
            format!("{} --filter-point-cloud -20 -v 0 --archive-type 3 --cuda-device -2", path(&dense));
        scratch
            .run(DENSIFY, &[&filter.split(' ').collect::<Vec<_>>()[..], &["--ply-layout", "odm"]].concat())
            .ok();
        let cloud = scratch.read(&part.replace(".mvs", "_dense_dense_filtered.ply"));
        let end = cloud.windows(11).position(|w| w == b"end_header\n").unwrap();
        let header = String::from_utf8_lossy(&cloud[..end]).into_owned();
        headers.push(header.lines().filter(|l| !l.starts_with("element")).collect::<Vec<_>>().join("\n"));
        assert!(header.contains("property uint8 views"), "{header}");
    }
    assert!(headers.iter().all(|h| *h == headers[0]), "merged byte by byte");
}

#[test]
fn opendronemaps_last_filter_finds_the_dense_cloud_in_the_archive() {
    let scratch = Scratch::facade6();
    scratch.add_maps("post7", ".");
    let words = "--resolution-level 1 --min-resolution 160 --geometric-iters 0 --postprocess-dmaps 0 --archive-type 3";
    scratch.densify_point_cloud(&format!("scene.mvs {words} -v 0 --cuda-device -2")).ok();
    let dense = scratch.path("scene_dense.mvs").display().to_string();
    scratch
        .run(DENSIFY, &["--filter-point-cloud", "-20", "-i", &dense, "-v", "0", "--cuda-device", "-2"])
        .ok();
    assert!(scratch.has("scene_dense_dense_filtered.ply") && scratch.has("scene_dense_dense_filtered.mvs"));
}

#[test]
fn mvs_scalable_pipeline_fuses_part_by_part() {
    let scratch = Scratch::facade6();
    let size = "--resolution-level 1 --min-resolution 160";
    scratch.densify_point_cloud(&format!("scene.mvs --fusion-mode 1 {size}")).ok();
    scratch.densify_point_cloud(&format!("scene.mvs --sub-scene-area 100 {size}")).ok();
    let words = format!(
        "scene_0000.mvs --dense-config-file Densify.ini --geometric-iters 0 --postprocess-dmaps 0 {size}"
    );
    scratch.densify_point_cloud(&words).ok();
    assert!(
        scratch.has("scene_0000_dense.mvs")
            && scratch.has("scene_0000_dense.ply")
            && scratch.has("Densify.ini")
    );
}

#[test]
fn others_name_things_their_way() {
    for words in [
        "--input-file scene.mvs --working-folder . --output-file out.mvs --archive-type -1",
        "scene.mvs -o out",
        "scene.mvs -o out.ply --verbosity 2 --fusion-mode 0",
        "scene.mvs -o out.ply --remove-dmaps 1",
        "scene.mvs -o out.mvs --tower-mode 4 --mask-path masks --ignore-mask-label 0",
    ] {
        let scratch = Scratch::facade6();
        scratch.add_maps("post7", ".");
        std::fs::create_dir(scratch.path("masks")).unwrap();
        for name in ["0003", "0004", "0005", "0006", "0012", "0013"] {
            let mask = image::GrayImage::from_pixel(400, 300, image::Luma([1]));
            mask.save(scratch.path(&format!("masks/{name}.mask.png"))).unwrap();
        }
        let fuse = "--resolution-level 1 --min-resolution 160 --geometric-iters 0 --postprocess-dmaps 0";
        scratch.densify_point_cloud(&format!("{words} {fuse}")).ok();
        assert!(scratch.has("out.ply") && scratch.has("out.mvs"), "{words}");
        assert_eq!(scratch.has("depth0000.dmap"), !words.contains("remove-dmaps"));
    }
}
