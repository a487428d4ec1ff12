//! Labels that are voted on, smoothed, checked and made from clouds.

use crate::common::{FUSE_ONLY, Scratch};
use image::{Rgb, RgbImage};
use semvs_formats::ply::Cloud;

const LABELS: &str = "--label-path labels --class-table 3dom-facade";
const NAMES: [&str; 6] = ["0003", "0004", "0005", "0006", "0012", "0013"];
const WINDOW: u16 = 4;
const BUILDING: Rgb<u8> = Rgb([0, 0, 255]);
const OBSTACLE: Rgb<u8> = Rgb([255, 0, 0]);

fn label_map(scratch: &Scratch, name: &str) -> RgbImage {
    image::open(scratch.path(&format!("labels/{name}_l.png"))).unwrap().to_rgb8()
}

/// Paints a blob of another class into every label map, each in a place of its own.
fn add_blobs(scratch: &Scratch) {
    for (i, name) in NAMES.iter().enumerate() {
        let mut map = label_map(scratch, name);
        let (left, top) = (map.width() * (1 + i as u32) / 8, map.height() / 3);
        for y in top..top + map.height() / 6 {
            for x in left..left + map.width() / 8 {
                map.put_pixel(x, y, Rgb([0, 255, 0]));
            }
        }
        map.save(scratch.path(&format!("labels/{name}_l.png"))).unwrap();
    }
}

fn fused(scratch: &Scratch, words: &str) -> Cloud {
    scratch.semvs(&format!("fuse scene.mvs --depth-maps . -o x.ply {LABELS} {words}")).ok();
    scratch.cloud("x.ply")
}

/// Share of the points of `cloud` that have the label that `truth` gives the point at the same place.
fn share_right(cloud: &Cloud, truth: &Cloud) -> f64 {
    let place = |p: &[f32; 3]| p.map(f32::to_bits);
    let right: std::collections::HashMap<[u32; 3], u16> =
        truth.positions.iter().map(place).zip(truth.labels.iter().copied()).collect();
    let known: Vec<bool> = cloud
        .positions
        .iter()
        .zip(&cloud.labels)
        .filter_map(|(p, label)| right.get(&place(p)).map(|r| r == label))
        .collect();
    assert!(known.len() > 20_000, "{}", known.len());
    known.iter().filter(|ok| **ok).count() as f64 / known.len() as f64
}

#[test]
fn all_views_together_see_through_blobs_in_each() {
    let scratch = Scratch::with_maps();
    // With labels that decide nothing all clouds have the same points.
    let off = "--label-consistency off";
    let truth = fused(&scratch, off);
    add_blobs(&scratch);
    let all = share_right(&fused(&scratch, off), &truth);
    let merged = share_right(&fused(&scratch, &format!("{off} --label-votes merged")), &truth);
    println!("right: {all:.4} by all views, {merged:.4} by merged pixels");
    assert!(all > 0.97 && all > merged + 0.005, "{all} {merged}");
    let confident = fused(&scratch, off);
    let sure: Vec<usize> = (0..confident.len()).filter(|&i| confident.label_confidence[i] > 0.9).collect();
    let part = Cloud {
        positions: sure.iter().map(|&i| confident.positions[i]).collect(),
        labels: sure.iter().map(|&i| confident.labels[i]).collect(),
        ..Cloud::default()
    };
    let right: f64 = {
        let place = |p: &[f32; 3]| p.map(f32::to_bits);
        let known: std::collections::HashMap<_, _> =
            truth.positions.iter().map(place).zip(&truth.labels).collect();
        let hits = part.positions.iter().zip(&part.labels).filter(|(p, l)| known[&place(p)] == *l).count();
        hits as f64 / part.len() as f64
    };
    assert!(right > 0.98 && right > all, "{right} of {} confident points", part.len());
}

#[test]
fn neighbouring_points_vote_once_more_when_asked() {
    let scratch = Scratch::with_maps();
    // Few votes per point, so that there are errors.
    let off = "--label-consistency off --label-votes merged --support unclaimed";
    let smooth = format!("{off} --label-smooth 8");
    let (truth, smooth_truth) = (fused(&scratch, off), fused(&scratch, &smooth));
    assert_eq!(truth.positions, smooth_truth.positions);
    assert_ne!(truth.labels, smooth_truth.labels);
    add_blobs(&scratch);
    let rough = share_right(&fused(&scratch, off), &truth);
    let smoothed = share_right(&fused(&scratch, &smooth), &smooth_truth);
    assert!(smoothed > rough, "errors of single points are outvoted: {smoothed} {rough}");
    let once = scratch.read("x.ply");
    fused(&scratch, &format!("{smooth} --max-threads 1"));
    assert_eq!(once, scratch.read("x.ply"), "for any number of threads");
}

#[test]
fn sky_makes_no_points_unless_it_is_asked_for() {
    let scratch = Scratch::with_maps();
    let sky = |words: &str| fused(&scratch, words).labels.iter().filter(|l| **l == 2).count();
    assert_eq!(sky(""), 0);
    assert!(sky("--label-consistency off") > 0);
    assert!(sky("--classes sky,building") > 0);
}

#[test]
fn rendered_maps_are_those_that_made_the_cloud_without_their_errors() {
    let scratch = Scratch::with_maps();
    let right: Vec<RgbImage> = NAMES.map(|name| label_map(&scratch, name)).into();
    add_blobs(&scratch);
    fused(&scratch, "");
    let out = scratch.semvs("labels render scene.mvs --cloud x.ply -o clean").ok();
    assert_eq!(out.stdout.lines().count(), 6, "{}", out.stdout);
    let (mut errors, mut corrected, mut right_after, mut pixels) = (0, 0, 0, 0);
    for (name, right) in NAMES.iter().zip(&right) {
        let noisy = label_map(&scratch, name);
        let clean = image::open(scratch.path(&format!("clean/{name}.png"))).unwrap().to_rgb8();
        assert_eq!(clean.dimensions(), (400, 300), "as large as the image");
        for (x, y, color) in clean.enumerate_pixels().filter(|(.., color)| color.0 != [0; 3]) {
            let at = |map: &RgbImage| *map.get_pixel(x * map.width() / 400, y * map.height() / 300);
            pixels += 1;
            let is_right = *color == at(right);
            right_after += u32::from(is_right);
            errors += u32::from(at(&noisy) != at(right));
            corrected += u32::from(at(&noisy) != at(right) && is_right);
        }
    }
    println!("{pixels} pixels, {right_after} right; {corrected} of {errors} errors corrected");
    assert!(pixels > 6 * 400 * 300 / 4);
    // The depth maps are half as large as the photographs, so that borders are coarse.
    assert!(right_after > pixels * 9 / 10, "{right_after} of {pixels}");
    assert!(errors > 5000 && corrected > errors * 7 / 10, "{corrected} of {errors}");
    // What was written can be given back.
    let again = "--label-path clean --class-table 3dom-facade";
    scratch.semvs(&format!("fuse scene.mvs --depth-maps . -o y.ply {again}")).ok();
    assert!(scratch.cloud("y.ply").labels.contains(&WINDOW));
    scratch.semvs("labels render scene.mvs --cloud x.ply -o ids --ids").ok();
    let ids = image::open(scratch.path("ids/0003.png")).unwrap();
    assert_eq!(ids.color(), image::ColorType::L8);
    let one = scratch.read("clean/0003.png");
    scratch.semvs("labels render scene.mvs --cloud x.ply -o clean --max-threads 1").ok();
    assert_eq!(one, scratch.read("clean/0003.png"));
}

#[test]
fn what_cannot_be_rendered_is_refused() {
    let scratch = Scratch::with_maps();
    scratch.semvs("fuse scene.mvs --depth-maps . -o plain.ply").ok();
    let render = |words: &str| scratch.semvs(&format!("labels render scene.mvs {words}"));
    render("--cloud plain.ply -o clean").fails_naming(&["plain.ply", "no labels"]);
    render("--cloud nothing.ply -o clean").fails_naming(&["nothing.ply"]);
    fused(&scratch, "");
    scratch.write("two.toml", "[[class]]\nid = 1\nname = \"wall\"\ncolor = [1, 2, 3]\n");
    render("--cloud x.ply -o clean --class-table two.toml").fails_naming(&["class", "two"]);
    render("--cloud x.ply -o clean --class-table facade").fails_naming(&["3dom-facade"]);
    assert!(!scratch.has("clean"), "nothing is written");
    scratch.write("broken.ply", "ply\nformat ascii 1.0\nelement vertex 9\n");
    render("--cloud broken.ply -o clean").fails_naming(&["broken.ply"]);
}

#[test]
fn the_check_names_the_view_that_is_at_odds() {
    let scratch = Scratch::with_maps();
    let mut map = label_map(&scratch, "0005");
    for pixel in map.pixels_mut().filter(|pixel| **pixel == BUILDING) {
        *pixel = OBSTACLE;
    }
    map.save(scratch.path("labels/0005_l.png")).unwrap();
    let check = |words: &str| {
        let out = scratch.semvs(&format!("labels check scene.mvs {LABELS} --json {words}")).ok();
        serde_json::from_str::<serde_json::Value>(&out.stdout).unwrap()
    };
    let worst = |json: &serde_json::Value| {
        let share = |v: &serde_json::Value| v["disagreement"].as_f64().unwrap();
        let views = json["views"].as_array().unwrap();
        let worst = views.iter().max_by(|a, b| share(a).total_cmp(&share(b))).unwrap();
        (worst["image"].as_str().unwrap().to_owned(), share(worst))
    };
    let by_depth = check("");
    assert_eq!(by_depth["compared_by"], "depth maps");
    let (image, share) = worst(&by_depth);
    assert!(image.contains("0005") && share > 0.3, "{image} {share}");
    let shares = by_depth["views"][0]["shares"].as_object().unwrap();
    let sum: f64 = shares.values().map(|v| v.as_f64().unwrap()).sum();
    assert!((sum - 1.0).abs() < 1e-9);
    std::fs::create_dir(scratch.path("empty")).unwrap();
    for i in 0..6 {
        std::fs::remove_file(scratch.path(&format!("depth{i:04}.dmap"))).unwrap();
    }
    let by_points = check("");
    assert_eq!(by_points["compared_by"], "sparse points");
    assert!(worst(&by_points).0.contains("0005"));
    scratch
        .semvs(&format!("labels check scene.mvs {LABELS} --depth-maps empty"))
        .fails_naming(&["empty", "depth maps"]);
}

#[test]
fn the_check_finds_missing_misshapen_and_unknown_maps_all_at_once() {
    let scratch = Scratch::facade6();
    std::fs::remove_file(scratch.path("labels/0003_l.png")).unwrap();
    RgbImage::from_pixel(100, 100, BUILDING).save(scratch.path("labels/0004_l.png")).unwrap();
    let mut map = label_map(&scratch, "0006");
    map.put_pixel(5, 7, Rgb([1, 2, 3]));
    map.save(scratch.path("labels/0006_l.png")).unwrap();
    scratch.write("labels/0012_l.png", "no picture");
    let check = |words: &str| scratch.semvs(&format!("labels check scene.mvs {LABELS} {words}"));
    let out = check("").fails_naming(&["4 of 6 label maps"]);
    for needle in ["no label map", "100×100", "(1, 2, 3)", "(5, 7)", "0012_l.png"] {
        assert!(out.stdout.contains(needle), "{needle}: {}", out.stdout);
    }
    let out = check("--json").fails_naming(&["4 of 6"]);
    let json: serde_json::Value = serde_json::from_str(&out.stdout).unwrap();
    assert_eq!(json["faults"], 4);
    check("--missing-labels void --unknown-label void").fails_naming(&["2 of 6"]);
    scratch.semvs("labels check scene.mvs --label-path nowhere").fails_naming(&["nowhere"]);
    scratch.semvs("labels check scene.mvs --class-table 3dom").fails_naming(&["3dom-facade"]);
    scratch.semvs("labels check none.mvs").fails_naming(&["none.mvs"]);
}

#[test]
fn options_about_votes_need_labels() {
    let scratch = Scratch::with_maps();
    for option in ["--label-votes all", "--label-smooth 8", "--label-filter on"] {
        let name = option.split(' ').next().unwrap();
        scratch
            .semvs(&format!("densify scene.mvs -o x.ply {FUSE_ONLY} {option}"))
            .fails_naming(&[name, "--label-path"]);
        scratch
            .semvs(&format!("convert depth0000.dmap -o x.ply {LABELS} {option}"))
            .fails_naming(&[name, "nothing is fused"]);
    }
}
