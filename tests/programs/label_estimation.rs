//! Labels in estimation: what is estimated, what classes of views mean to each other, planes of regions; and how sure labels
//! are.

use crate::common::{SMALL, Scratch, facade6};
use semvs_formats::Limits;
use semvs_formats::dmap::DepthMapFile;

const LABELS: &str = "--label-path labels --class-table 3dom-facade";
const QUICK: &str = "--number-views 3 --iters 1 --geometric-iters 1";
const PLANES: &str = "[[class]]\nid = 1\nname = \"building\"\ncolor = [0, 0, 255]\n[[class]]\nid = 2\nname = \"sky\"\n\
                      color = [255, 255, 0]\nsurface = false\n[[class]]\nid = 3\nname = \"obstacle\"\ncolor = [255, 0, 0]\n\
                      [[class]]\nid = 4\nname = \"window\"\ncolor = [0, 255, 0]\n[[class]]\nid = 5\nname = \"door\"\n\
                      color = [255, 0, 255]\n";

/// Runs into the folder `name`; the depth maps as they were before the filters across views.
fn maps(scratch: &Scratch, name: &str, words: &str) -> Vec<Vec<u8>> {
    let all =
        format!("densify scene.mvs -o {name}/x.ply -w {name} --postprocess-dmaps 0 {SMALL} {QUICK} {words}");
    scratch.semvs(&all).ok();
    (0..6).map(|i| scratch.read(&format!("{name}/depth{i:04}.dmap"))).collect()
}

fn depths(maps: &[Vec<u8>]) -> usize {
    let depths = |bytes: &Vec<u8>| DepthMapFile::from_bytes(bytes, &Limits::default()).unwrap().depth;
    maps.iter().flat_map(depths).filter(|&d| d > 0.0).count()
}

#[test]
fn unwanted_classes_are_estimated_only_when_asked_for() {
    let scratch = Scratch::facade6();
    let excluded = format!("{LABELS} --exclude-classes obstacle,sky");
    let none = maps(&scratch, "none", "");
    let off = maps(&scratch, "off", &format!("{excluded} --label-estimation off"));
    assert!(none == off, "labels that decide nothing changed depth maps");
    let skip = maps(&scratch, "skip", &excluded);
    assert!(skip == maps(&scratch, "named", &format!("{excluded} --label-estimation skip")));
    assert!(depths(&skip) < depths(&off) * 9 / 10, "{} {}", depths(&skip), depths(&off));
    let labels = scratch.cloud("off/x.ply").labels;
    assert!(!labels.is_empty() && labels.iter().all(|&l| l != 3 && l != 2));
}

#[test]
fn aware_estimation_heeds_the_classes_of_all_views() {
    let scratch = Scratch::facade6();
    let plain = maps(&scratch, "plain", LABELS);
    let words = format!("{LABELS} --label-estimation aware --report aware.json");
    let aware = maps(&scratch, "aware", &words);
    assert!(aware != plain);
    let ratio = depths(&aware) as f64 / depths(&plain) as f64;
    assert!((0.9..1.1).contains(&ratio), "{ratio}");
    assert!(aware != maps(&scratch, "dear", &format!("{LABELS} --label-estimation aware --label-cost 1")));
    let json: serde_json::Value = serde_json::from_slice(&scratch.read("aware.json")).unwrap();
    assert_eq!(json["options"]["label-estimation"], "aware");
    assert_eq!(json["options"]["label-filter"], "on");
    assert!((json["options"]["label-cost"].as_f64().unwrap() - 0.2).abs() < 1e-6);
    // Where no view has a class, nothing is compared and nothing kept apart.
    for name in ["0003", "0004", "0005", "0006", "0012", "0013"] {
        image::RgbImage::new(400, 300).save(scratch.path(&format!("labels/{name}_l.png"))).unwrap();
    }
    assert!(maps(&scratch, "void", &format!("{LABELS} --label-estimation aware")) == plain);
}

#[test]
fn aware_estimation_is_the_same_on_every_processor() {
    let scratch = Scratch::facade6();
    let words = format!("{LABELS} --label-estimation aware --class-table planes.toml");
    let words = words.replace("--class-table 3dom-facade ", "");
    scratch.write("planes.toml", PLANES.replace("name = \"window\"", "name = \"window\"\nprior = \"plane\""));
    let run = |level: &str| {
        let all = format!("densify scene.mvs -o x.ply -w . --postprocess-dmaps 0 {SMALL} {QUICK} {words}");
        let words: Vec<&str> = all.split_whitespace().collect();
        scratch.run_with(crate::common::SEMVS, &words, &[("SEMVS_CPU", level)]).ok();
        (0..6).map(|i| scratch.read(&format!("depth{i:04}.dmap"))).collect::<Vec<_>>()
    };
    let scalar = run("scalar");
    for level in ["avx2", "avx512"] {
        let level_is_there = level.parse::<semvs::internals::stereo::CpuLevel>().is_ok();
        assert!(!level_is_there || run(level) == scalar, "{level}");
    }
}

#[test]
fn windows_are_drawn_to_planes_where_the_table_says_so() {
    let scratch = Scratch::facade6();
    scratch.write("none.toml", PLANES);
    scratch.write("planes.toml", PLANES.replace("name = \"window\"", "name = \"window\"\nprior = \"plane\""));
    let with = |table: &str| format!("--label-path labels --class-table {table}.toml");
    let (none, planes) = (maps(&scratch, "n", &with("none")), maps(&scratch, "p", &with("planes")));
    assert!(depths(&planes) > depths(&none), "{} {}", depths(&planes), depths(&none));
    assert!(maps(&scratch, "b", LABELS) == none);
    let bad = PLANES.replace("name = \"window\"", "name = \"window\"\nprior = \"cube\"");
    scratch.write("bad.toml", bad);
    scratch.semvs(&format!("densify scene.mvs -o x.ply {}", with("bad"))).fails_naming(&[
        "bad.toml",
        "line 17",
        "key class.prior",
        "\"plane\"",
    ]);
}

#[test]
fn costs_of_labels_are_checked() {
    let scratch = Scratch::facade6();
    let run = |words: &str| scratch.semvs(&format!("densify scene.mvs -o x.ply {words}"));
    run(&format!("{LABELS} --label-estimation aware --label-cost 2.5"))
        .fails_naming(&["--label-cost 2.5", "0 to 2"]);
    run(&format!("{LABELS} --label-estimation aware --label-cost nan")).fails_naming(&["--label-cost"]);
    run(&format!("{LABELS} --label-cost 0.1")).fails_naming(&["--label-cost", "--label-estimation aware"]);
    run("--label-estimation aware").fails_naming(&["--label-estimation", "--label-path"]);
}

#[test]
fn evaluate_says_what_confidences_are_worth() {
    let scratch = Scratch::with_maps();
    scratch.semvs(&format!("fuse scene.mvs --depth-maps . -o x.ply {LABELS}")).ok();
    let truth = facade6().join("truth/truth.ply");
    let judge = |cloud: &str, words: &str| {
        scratch.semvs(&format!("evaluate {cloud} --truth {} --thresholds 0.1 {words}", truth.display()))
    };
    let out = judge("x.ply", "--reliability-diagram r.png").ok();
    assert!(out.stdout.contains("label_confidence") && out.stdout.contains("0.98 to 1.00"), "{}", out.stdout);
    assert_eq!(image::open(scratch.path("r.png")).unwrap().width(), 620);
    let json: serde_json::Value = serde_json::from_str(&judge("x.ply", "--json").ok().stdout).unwrap();
    let bins = json["labels"]["reliability"].as_array().unwrap();
    assert_eq!(bins.len(), 10);
    let share: f64 = bins.iter().map(|bin| bin["share"].as_f64().unwrap()).sum();
    assert!((share - 1.0).abs() < 1e-3, "{share}");
    assert!(bins[9]["right"].as_f64().unwrap() > 0.97);
    scratch.semvs("fuse scene.mvs --depth-maps . -o plain.ply").ok();
    judge("plain.ply", "--reliability-diagram r.png").fails_naming(&["plain.ply", "label_confidence"]);
}
