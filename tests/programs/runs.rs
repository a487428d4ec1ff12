//! Whole runs on the bundled scene: the same bytes for any number of threads, labels, resuming, companions.

use crate::common::{FUSE_ONLY, SMALL, Scratch};
use semvs_formats::Limits;
use semvs_formats::dmap::DepthMapFile;
use semvs_formats::ply::Cloud;
use serde_json::json;
use std::collections::BTreeMap;

const LABELS: &str = "--label-path labels --class-table 3dom-facade";

/// All files below `folder` but logs.
fn outputs(scratch: &Scratch, folder: &str) -> BTreeMap<String, Vec<u8>> {
    scratch
        .files()
        .into_iter()
        .filter(|f| f.starts_with(&format!("{folder}/")) && !f.ends_with(".log"))
        .map(|f| (f[folder.len() + 1..].to_owned(), scratch.read(&f)))
        .collect()
}

#[test]
fn every_byte_is_the_same_for_any_number_of_threads() {
    let scratch = Scratch::facade6();
    let runs = [("a", 1), ("b", 2), ("c", 5), ("d", 2)];
    for (folder, threads) in runs {
        let out = format!(
            "-w {folder} -o {folder}/x.ply --max-threads {threads} --split-by-class --color-by-label"
        );
        scratch.semvs(&format!("densify scene.mvs {out} {SMALL} {LABELS} --exclude-classes sky")).ok();
    }
    let first = outputs(&scratch, "a");
    assert_eq!(first.keys().filter(|f| f.ends_with(".dmap")).count(), 6);
    assert!(first.contains_key("x.ply") && first.contains_key("x.mvs") && first.contains_key("x.labels.ply"));
    for (folder, threads) in &runs[1..] {
        let other = outputs(&scratch, folder);
        assert_eq!(first.keys().collect::<Vec<_>>(), other.keys().collect::<Vec<_>>());
        for (name, bytes) in &first {
            assert!(*bytes == other[name], "{name} differs with {threads} threads");
        }
    }
    let points = scratch.cloud("a/x.ply").len();
    assert!(points > 10_000, "{points}");
}

#[test]
fn labels_that_decide_nothing_change_no_geometry() {
    let scratch = Scratch::facade6();
    scratch.semvs(&format!("densify scene.mvs -w plain -o plain/x.ply {SMALL}")).ok();
    let off = "--label-consistency off";
    scratch.semvs(&format!("densify scene.mvs -w labelled -o labelled/x.ply {SMALL} {LABELS} {off}")).ok();
    let (plain, labelled) = (scratch.cloud("plain/x.ply"), scratch.cloud("labelled/x.ply"));
    assert_eq!(labelled.labels.len(), plain.len());
    assert_eq!(
        plain,
        Cloud {
            labels: Vec::new(),
            label_confidence: Vec::new(),
            comments: plain.comments.clone(),
            ..labelled
        }
    );
    for i in 0..6 {
        let name = format!("depth{i:04}.dmap");
        assert_eq!(scratch.read(&format!("plain/{name}")), scratch.read(&format!("labelled/{name}")));
    }
}

#[test]
fn classes_are_kept_and_dropped_as_asked() {
    let scratch = Scratch::facade6();
    scratch.add_maps("post7", ".");
    let report = "--report run.json --split-by-class --color-by-label";
    let run = |words: &str| scratch.semvs(&format!("densify scene.mvs {FUSE_ONLY} {LABELS} {words}")).ok();
    let out = run(&format!("-o kept.ply --exclude-classes sky,obstacle {report}"));
    let kept = scratch.cloud("kept.ply");
    assert!(kept.labels.iter().all(|l| ![2, 3].contains(l)));
    for class in [1, 4, 5] {
        assert!(kept.labels.contains(&class), "class {class}");
    }
    assert!(kept.comments.iter().any(|c| c == "class 1 building 0 0 255"), "{:?}", kept.comments);
    let parts = ["building", "window", "door", "void"].map(|c| format!("kept.{c}.ply"));
    let parts: usize = parts.iter().filter(|p| scratch.has(p)).map(|p| scratch.cloud(p).len()).sum();
    assert_eq!(parts, kept.len());
    let colored = scratch.cloud("kept.labels.ply");
    let window = colored.labels.iter().position(|&l| l == 4).unwrap();
    assert_eq!(colored.colors[window], [0, 255, 0]);
    assert!(out.stdout.contains("building"), "{}", out.stdout);

    let json: serde_json::Value = serde_json::from_slice(&scratch.read("run.json")).unwrap();
    assert_eq!(json["points"], kept.len());
    assert_eq!(json["program"], "semvs densify");
    assert_eq!(json["options"]["exclude-classes"], "sky,obstacle");
    assert_eq!(json["views"].as_array().unwrap().len(), 6);
    assert_eq!(json["views"][0]["reused"], true);
    let building = json["classes"].as_array().unwrap().iter().find(|c| c["name"] == "building").unwrap();
    assert_eq!(building["points"], kept.labels.iter().filter(|&&l| l == 1).count());

    let options = json["options"].as_object().unwrap();
    assert!(options.keys().all(|name| !name.contains(char::is_uppercase)), "{options:?}");
    for (name, value) in [
        ("iters", serde_json::json!(3)),
        ("output", serde_json::json!("kept.ply")),
        ("working-folder", serde_json::json!(".")),
        ("label-consistency", serde_json::json!("support")),
        ("number-views-fuse", serde_json::json!(2)),
        ("ply-layout", serde_json::json!("plain")),
        ("split-by-class", serde_json::json!(true)),
        ("roi-border", serde_json::json!(0.0)),
        ("mask-path", serde_json::Value::Null),
    ] {
        assert_eq!(options[name], value, "{name}");
    }
    if cfg!(unix) {
        assert!(json["cpu_seconds"].as_f64().unwrap() > 0.0);
        assert!(json["stages"].as_array().unwrap().iter().all(|stage| stage["cpu_seconds"].is_f64()));
    }

    let out = run("-o kept.ply --classes building,sky,window --exclude-classes sky,window");
    assert!(scratch.cloud("kept.ply").labels.iter().all(|&l| l == 1));
    let stale = ["earlier run", "kept.building.ply", "kept.labels.ply", "kept.window.ply"];
    assert!(stale.iter().all(|name| out.stderr.contains(name)), "{}", out.stderr);
    assert!(scratch.has("kept.window.ply"));

    run("-o only.ply --classes window --label-consistency strict");
    assert!(scratch.cloud("only.ply").labels.iter().all(|&l| l == 4));
    // Each mode is stricter than the one before.
    let points = |mode: &str| {
        run(&format!("-o counted.ply --label-consistency {mode}"));
        scratch.cloud("counted.ply").len()
    };
    // Two images are enough where they must agree on the class.
    let [off, support, strict] = ["off", "support", "strict"].map(points);
    let [loose, tight] = ["off --number-views-fuse 2", "support --number-views-fuse 3"].map(points);
    assert!(loose >= support && support > strict && off >= tight, "{off} {support} {strict} {loose} {tight}");
    assert!(support > off, "{support} {off}");
}

#[test]
fn pixels_of_unwanted_classes_and_masked_ones_get_no_depth() {
    let scratch = Scratch::facade6();
    let quick = "--number-views 2 --iters 1 --geometric-iters 0 --postprocess-dmaps 0";
    let run = |words: &str| {
        scratch.semvs(&format!("densify scene.mvs -w d -o d/x.ply {SMALL} {quick} {words}")).ok();
        let map = DepthMapFile::from_bytes(&scratch.read("d/depth0000.dmap"), &Limits::default()).unwrap();
        std::fs::remove_dir_all(scratch.path("d")).unwrap();
        map.depth
    };
    let valid = |depth: &[f32]| depth.iter().filter(|&&d| d > 0.0).count();
    let all = run("");
    let some = run(&format!("{LABELS} --exclude-classes obstacle"));
    assert!(valid(&some) < valid(&all));
    // A mask over the left half.
    let pixels: Vec<u8> = (0..300).flat_map(|_| (0..400).map(|x| if x < 200 { 0 } else { 255 })).collect();
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, 400, 300);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.write_header().unwrap().write_image_data(&pixels).unwrap();
    std::fs::create_dir(scratch.path("masks")).unwrap();
    for name in ["0003", "0004", "0005", "0006", "0012", "0013"] {
        scratch.write(&format!("masks/{name}.mask.png"), &bytes);
    }
    let masked = run("--ignore-mask-label 0 --mask-path masks");
    let left = |depth: &[f32]| (0..150).map(|y| valid(&depth[y * 200..y * 200 + 100])).sum::<usize>();
    assert!(left(&all) > 1000);
    assert_eq!(left(&masked), 0);
    assert!(valid(&masked) > 1000);
}

#[test]
fn existing_maps_are_used_only_when_asked() {
    let scratch = Scratch::facade6();
    scratch.add_maps("post7", ".");
    let theirs = scratch.read("depth0003.dmap");
    let quick = "--number-views 2 --iters 1 --geometric-iters 1 --postprocess-dmaps 0";
    scratch.semvs(&format!("densify scene.mvs -o kept.ply {FUSE_ONLY}")).ok();
    assert_eq!(scratch.read("depth0003.dmap"), theirs);
    // A map of another size is estimated again, with a line that names it.
    scratch.write("depth0003.dmap", &theirs[..100]);
    let out = scratch.semvs(&format!("densify scene.mvs -o kept.ply {FUSE_ONLY} --iters 1")).ok();
    assert!(
        out.stderr.contains("depth0003.dmap") && out.stderr.contains("estimated again"),
        "{}",
        out.stderr
    );
    scratch.write("depth0003.dmap", &theirs);
    let out = scratch.semvs(&format!("densify scene.mvs -o new.ply {SMALL} {quick}")).ok();
    assert!(
        out.stderr.contains("6 depth maps exist") && out.stderr.contains("estimated again"),
        "{}",
        out.stderr
    );
    assert_ne!(scratch.read("depth0003.dmap"), theirs);
    let out = scratch.semvs(&format!("densify scene.mvs -o gone.ply {FUSE_ONLY} --remove-dmaps 1")).ok();
    assert!(!out.stdout.contains("depth maps"), "{}", out.stdout);
    assert!(!scratch.files().iter().any(|f| f.ends_with(".dmap")));
}

#[test]
fn a_run_leaves_its_results_and_nothing_else() {
    let scratch = Scratch::facade6();
    let before = scratch.files();
    let quick = "--number-views 2 --iters 1 --geometric-iters 1";
    let scene = scratch.path("scene.mvs");
    scratch.densify_point_cloud(&format!("{} -w depthmaps {SMALL} {quick}", scene.display())).ok();
    let mut expected = before;
    expected.extend((0..6).map(|i| format!("depthmaps/depth{i:04}.dmap")));
    expected.extend(["depthmaps/depthmaps.semvs", "scene_dense.mvs", "scene_dense.ply"].map(str::to_owned));
    expected.sort();
    let after: Vec<String> = scratch.files().into_iter().filter(|f| !f.ends_with(".log")).collect();
    assert_eq!(after, expected);
    let dense = scratch.cloud("scene_dense.ply");
    assert!(dense.has_views() && dense.len() > 1000);
}

#[test]
fn sparse_points_and_neighbours_come_from_files_when_given() {
    let scratch = Scratch::facade6();
    scratch.add_maps("post7", ".");
    scratch.densify_point_cloud(&format!("scene.mvs {FUSE_ONLY}")).ok();
    let given = format!("scene.mvs -p scene_dense.ply --fusion-mode 1 {FUSE_ONLY} -o given");
    let out = scratch.densify_point_cloud(&given).ok();
    assert!(out.stdout.contains("\t24171 points"), "{}", out.stdout);
    scratch.semvs(&format!("densify scene.mvs {FUSE_ONLY} -o plain.ply")).ok();
    let plain = scratch.densify_point_cloud(&given.replace("scene_dense.ply", "plain.ply"));
    plain.fails_naming(&["plain.ply", "view_indices"]);

    scratch.write("nb.txt", "0 3\n1 2 0\n");
    let out = scratch
        .semvs(&format!("densify scene.mvs {FUSE_ONLY} -o nb.ply --view-neighbors-file nb.txt -vv"))
        .ok();
    assert!(out.stderr.contains("Image 0000 is matched with 0003\n"), "{}", out.stderr);
    assert!(out.stderr.contains("Image 0001 is matched with 0002 0000\n"), "{}", out.stderr);
    scratch.write("nb.txt", "0 77\n");
    scratch
        .semvs(&format!("densify scene.mvs {FUSE_ONLY} -o nb.ply --view-neighbors-file nb.txt"))
        .fails_naming(&["nb.txt", "77"]);
}

#[test]
fn the_written_scene_finds_its_images_from_anywhere() {
    let scratch = Scratch::facade6();
    scratch.add_maps("post7", "maps/deep");
    let keep = "--resolution-level 1 --min-resolution 160 --estimate-roi 0 --geometric-iters 0 --postprocess-dmaps 0";
    scratch.semvs(&format!("densify scene.mvs -o out/cloud.ply -w maps/deep {keep}")).ok();
    scratch.semvs("fuse out/cloud.mvs --depth-maps maps/deep -o again.ply").ok();
    assert_eq!(scratch.read("out/cloud.ply"), scratch.read("again.ply"));
}

#[test]
fn each_program_has_its_own_filter_and_fusion() {
    let scratch = Scratch::facade6();
    let options = |file: &str| -> [serde_json::Value; 3] {
        let json: serde_json::Value = serde_json::from_slice(&scratch.read(file)).unwrap();
        ["filter", "postprocess-dmaps", "support"].map(|name| json["options"][name].clone())
    };
    let semvs = |folder: &str, words: &str| {
        let out = format!("-w {folder} -o {folder}/x.ply --report {folder}.json");
        scratch.semvs(&format!("densify scene.mvs {out} {SMALL} {words}")).ok();
        (options(&format!("{folder}.json")), scratch.read(&format!("{folder}/x.ply")))
    };
    let (own, cloud) = semvs("own", "");
    assert_eq!(own, [json!("unbiased"), json!(4), json!("all")]);
    assert_eq!(semvs("openmvs", "--filter openmvs").0, [json!("openmvs"), json!(7), json!("all")]);
    scratch.densify_point_cloud(&format!("scene.mvs -o x --report drop.json {SMALL}")).ok();
    assert_eq!(options("drop.json"), [json!("openmvs"), json!(7), json!("unclaimed")]);
    // A dense config file that was written with OpenMVS's defaults asks for nothing.
    for folder in ["written", "read"] {
        assert!(semvs(folder, "--dense-config-file Densify.ini").1 == cloud, "{folder}");
    }
}

#[test]
fn a_class_that_the_table_drops_is_as_good_as_excluded() {
    let scratch = Scratch::facade6();
    let class = |id: u32, name: &str, color: &str, more: &str| {
        format!("[[class]]\nid = {id}\nname = \"{name}\"\ncolor = [{color}]\n{more}\n")
    };
    let table = |more: &str| {
        "name = \"facade\"\nvoid-colors = [[0, 0, 0]]\n".to_owned()
            + &class(1, "building", "0, 0, 255", "")
            + &class(2, "sky", "255, 255, 0", more)
            + &class(3, "obstacle", "255, 0, 0", more)
            + &class(4, "window", "0, 255, 0", "")
            + &class(5, "door", "255, 0, 255", "")
    };
    std::fs::write(scratch.path("all.toml"), table("")).unwrap();
    std::fs::write(scratch.path("some.toml"), table("keep = false")).unwrap();
    let cloud = |folder: &str, words: &str| {
        let out = format!("-w {folder} -o {folder}/x.ply --label-path labels");
        scratch.semvs(&format!("densify scene.mvs {out} {SMALL} {words}")).ok();
        scratch.cloud(&format!("{folder}/x.ply"))
    };
    let excluded = cloud("excluded", "--class-table all.toml --exclude-classes sky,obstacle");
    assert_eq!(cloud("dropped", "--class-table some.toml"), excluded);
    assert!(excluded.len() > 5000);
}
