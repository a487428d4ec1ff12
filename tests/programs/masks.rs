//! Masks do what a label map with an excluded class does.

use crate::common::{FUSE_ONLY, SMALL, Scratch};
use image::{GrayImage, Luma};

const NAMES: [&str; 6] = ["0003", "0004", "0005", "0006", "0012", "0013"];
/// Few iterations: what is compared is which pixels take part.
const QUICK: &str = "--number-views 2 --iters 1 --geometric-iters 1";
const MASKED: u8 = 7;

/// One grey picture for every image: `value` left of a slanted line, 1 right of it.
fn pictures(scratch: &Scratch, folder: &str, suffix: &str, size: (u32, u32), value: u8) {
    std::fs::create_dir(scratch.path(folder)).unwrap();
    let edge = |y: u32| size.0 * (100 + y * 300 / size.1 / 4) / 400;
    let picture = GrayImage::from_fn(size.0, size.1, |x, y| Luma([if x < edge(y) { value } else { 1 }]));
    for name in NAMES {
        picture.save(scratch.path(&format!("{folder}/{name}{suffix}"))).unwrap();
    }
}

#[test]
fn masks_and_labels_give_the_same_depths_and_points() {
    let scratch = Scratch::facade6();
    pictures(&scratch, "masks", ".mask.png", (400, 300), MASKED);
    pictures(&scratch, "ids", ".png", (400, 300), MASKED);
    let run = |name: &str, words: &str| {
        let all = format!(
            "densify scene.mvs -o {name}/x.ply -w {name} --number-views-fuse 3 {SMALL} {QUICK} {words}"
        );
        scratch.semvs(&all).ok();
    };
    run("m", &format!("--mask-path masks --ignore-mask-label {MASKED}"));
    run("l", &format!("--label-path ids --class-table ids --exclude-classes {MASKED}"));
    for i in 0..6 {
        let name = format!("depth{i:04}.dmap");
        assert_eq!(scratch.read(&format!("m/{name}")), scratch.read(&format!("l/{name}")), "{name}");
    }
    let (masks, labels) = (scratch.cloud("m/x.ply"), scratch.cloud("l/x.ply"));
    assert!(masks.len() > 500);
    assert_eq!(masks.positions, labels.positions);
    assert!(masks.labels.is_empty(), "masks do not label points");
    assert!(!scratch.has("m/x.legend.png"));
}

#[test]
fn masks_count_for_maps_that_exist_in_every_command() {
    let scratch = Scratch::with_maps();
    pictures(&scratch, "masks", ".mask.png", (400, 300), MASKED);
    let masked = format!("--mask-path masks --ignore-mask-label {MASKED}");
    let points = |words: &str| {
        scratch.semvs(&format!("{words} -o x.ply")).ok();
        scratch.cloud("x.ply").len()
    };
    let fuse = "fuse scene.mvs --depth-maps .";
    assert!(points(&format!("{fuse} {masked}")) < points(fuse) * 9 / 10);
    let convert = "convert depth0000.dmap depth0001.dmap";
    assert!(points(&format!("{convert} {masked}")) < points(convert) * 9 / 10);
    let labels = "--label-path labels --class-table 3dom-facade";
    assert!(
        points(&format!("{convert} {masked} {labels}")) < points(&format!("{convert} {labels}")) * 9 / 10
    );
    scratch
        .semvs(&format!("{convert} -o x.ply --mask-path none --ignore-mask-label 0"))
        .fails_naming(&["none"]);
    // Beside the images, as OpenMVS looks for them.
    for name in NAMES {
        let there = scratch.path(&format!("images/{name}.mask.png"));
        std::fs::copy(scratch.path(&format!("masks/{name}.mask.png")), there).unwrap();
    }
    let beside = format!("--ignore-mask-label {MASKED}");
    assert_eq!(points(&format!("{convert} {beside}")), points(&format!("{convert} {masked}")));
}

#[test]
fn masks_and_labels_together_drop_what_either_drops() {
    let scratch = Scratch::with_maps();
    pictures(&scratch, "masks", ".mask.png", (400, 300), MASKED);
    let fuse = |name: &str, words: &str| {
        let out = format!("fuse scene.mvs --depth-maps . -o {name}.ply {words}");
        scratch.semvs(&out).ok();
        scratch.cloud(&format!("{name}.ply"))
    };
    let masked = format!("--mask-path masks --ignore-mask-label {MASKED}");
    let labels = "--label-path labels --class-table 3dom-facade --exclude-classes obstacle";
    let (a, b) = (fuse("a", labels), fuse("b", &format!("{labels} {masked}")));
    assert!(b.len() < a.len() * 9 / 10);
    let text = String::from_utf8_lossy(&scratch.read("b.ply")[..600]).into_owned();
    assert!(!text.contains("65535"), "the class of what is masked is nobody's business: {text}");
}

#[test]
fn masks_and_labels_of_different_sizes_are_refused() {
    let scratch = Scratch::facade6();
    pictures(&scratch, "masks", ".mask.png", (200, 150), MASKED);
    let words = format!(
        "--mask-path masks --ignore-mask-label 0 --label-path labels --class-table 3dom-facade {SMALL}"
    );
    let needles = ["0003.mask.png", "200×150", "0003_l.png", "400×300"];
    scratch.semvs(&format!("densify scene.mvs -o x.ply {words}")).fails_naming(&needles);
    scratch.densify_point_cloud(&format!("scene.mvs {words}")).fails_naming(&needles);
    assert!(!scratch.files().iter().any(|f| f.ends_with(".dmap")));
}

#[test]
fn a_mask_that_cannot_be_read_is_said_once() {
    let scratch = Scratch::with_maps();
    pictures(&scratch, "masks", ".mask.png", (100, 300), MASKED);
    scratch.write("masks/0005.mask.png", "no picture");
    let words = format!("scene.mvs {FUSE_ONLY} --mask-path masks --ignore-mask-label {MASKED}");
    let out = scratch.densify_point_cloud(&words).ok();
    let lines = |needle: &str| out.stdout.lines().filter(|line| line.contains(needle)).count();
    assert_eq!(lines("0005.mask.png"), 1, "{}", out.stdout);
    assert_eq!(lines("it is stretched"), 5, "{}", out.stdout);
}
