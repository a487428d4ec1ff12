//! The command lines of programs that call DensifyPointCloud.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout, reason = "tests may")]

mod common;

use common::{DENSIFY, Scratch};
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
