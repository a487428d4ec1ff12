//! What a newcomer types and what is answered: the right file in the wrong place, slips, and how long it will take.

use crate::common::{SMALL, Scratch, facade6};

/// A folder with a scene, its depth maps, a cloud, a text, and a COLMAP model with distortion and no images.
fn things() -> Scratch {
    let scratch = Scratch::with_maps();
    std::fs::copy(facade6().join("truth/truth.ply"), scratch.path("cloud.ply")).unwrap();
    std::fs::create_dir(scratch.path("empty")).unwrap();
    std::fs::create_dir_all(scratch.path("colmap/sfm/sparse")).unwrap();
    scratch.write("colmap/sfm/sparse/cameras.txt", "1 SIMPLE_RADIAL 400 300 350 200 150 0.1\n");
    let images = "1 1 0 0 0 0 0 0 1 0003.jpg\n\n2 1 0 0 0 1 0 0 1 0004.jpg\n\n";
    scratch.write("colmap/sfm/sparse/images.txt", images);
    scratch.write("colmap/sfm/sparse/points3D.txt", "");
    scratch.write("notes.txt", "hello\n");
    scratch
}

/// The error line of `words`, which end with `code`; nothing is written.
#[track_caller]
fn refused(scratch: &Scratch, words: &str, code: i32) -> String {
    let before = scratch.files();
    let out = scratch.semvs(words);
    assert_eq!(out.code, Some(code), "{words}\n{}\n{}", out.stdout, out.stderr);
    let errors: Vec<&str> = out.stderr.lines().filter(|line| line.starts_with("error: ")).collect();
    assert_eq!(errors.len(), 1, "{words}: one line expected:\n{}", out.stderr);
    assert!(
        !out.stderr.contains("Images ready") && !out.stderr.contains("os error"),
        "{words}: {}",
        out.stderr
    );
    assert_eq!(scratch.files(), before, "{words}");
    errors[0].to_owned()
}

#[track_caller]
fn all_refused(scratch: &Scratch, cases: &[(&str, &[&str])]) {
    for (words, needles) in cases {
        let error = refused(scratch, words, 1);
        for needle in *needles {
            assert!(error.contains(needle), "{words}\n{needle:?} not in: {error}");
        }
    }
}

#[test]
fn the_right_file_in_the_wrong_place_is_named_for_what_it_is() {
    let scratch = things();
    all_refused(
        &scratch,
        &[
            ("densify cloud.ply", &["cloud.ply: this is a PLY file", ".mvs file", "undistorted workspace"]),
            ("densify depth0000.dmap", &["this is a depth map"]),
            ("densify images/0003.jpg", &["this is a picture", ".mvs"]),
            ("densify .", &["this is a folder; give the scene in it: scene.mvs"]),
            ("densify empty", &["no COLMAP workspace", "colmap image_undistorter", ".mvs file"]),
            ("fuse cloud.ply", &["this is a PLY file"]),
            (
                "fuse scene.mvs --depth-maps depth0000.dmap",
                &["this is a depth map; --depth-maps takes the folder"],
            ),
            (
                "densify scene.mvs -p images/0003.jpg",
                &["this is a picture; --pointcloud-file takes a PLY file"],
            ),
            (
                "densify scene.mvs --label-path labels/0003_l.png",
                &["this is a file; --label-path takes the folder"],
            ),
            ("convert scene.mvs -o x.ply", &["this is an OpenMVS scene; give depth maps, DIR/depth*.dmap"]),
            ("convert . -o x.ply", &["this is a folder", "DIR/depth*.dmap"]),
            ("inspect images", &["this is a folder; give a file in it", "semvs preview DIR"]),
            (
                "evaluate scene.mvs --truth cloud.ply --thresholds 1",
                &["scene.mvs: this is an OpenMVS scene", "PLY"],
            ),
            ("evaluate cloud.ply --truth images --thresholds 1", &["images: this is a folder", "PLY"]),
            (
                "labels render scene.mvs --cloud scene.mvs -o out",
                &["this is an OpenMVS scene; --cloud takes"],
            ),
            ("export cloud.ply --to mvs -o y.mvs", &["cloud.ply: this is a PLY file; give the scene"]),
            (
                "export scene.mvs --to png -o y",
                &["this is an OpenMVS scene; --to pfm, npy and png take depth maps"],
            ),
            ("import scene.mvs -o y.mvs", &["this is an OpenMVS scene; give a folder"]),
            ("preview cloud.ply", &["this is a PLY file; give a depth map"]),
            ("report scene.mvs", &["this is an OpenMVS scene; give the folder that a run has left"]),
        ],
    );
}

#[test]
fn what_is_not_there_is_told_with_what_is() {
    let scratch = things();
    scratch.write("packed.ply", [0x28, 0xB5, 0x2F, 0xFD, 0, 0, 0, 0]);
    all_refused(
        &scratch,
        &[
            ("densify scen.mvs", &["scen.mvs: there is no such file or folder; did you mean scene.mvs?"]),
            ("densify project.mvs", &["there is no such file or folder; there is scene.mvs"]),
            ("densify there/scene.mvs", &["there/scene.mvs: not there, nor is the folder there"]),
            ("fuse scene.mvs --depth-maps map", &["map: there is no such file or folder"]),
            ("convert depth00000.dmap -o x.ply", &["did you mean depth0000.dmap?"]),
            (
                "convert x.dmap -o x.ply",
                &["there is depth0000.dmap, depth0001.dmap, depth0002.dmap and 3 more"],
            ),
            ("evaluate clod.ply --truth cloud.ply --thresholds 1", &["did you mean cloud.ply?"]),
            ("evaluate packed.ply --truth cloud.ply --thresholds 1", &["a compressed file; unpack it first"]),
            ("inspect nothing", &["nothing: there is no such file or folder"]),
            ("preview imagess", &["did you mean images?"]),
            ("labels check scen.mvs", &["did you mean scene.mvs?"]),
            (
                "densify scene.mvs --view-neighbors-file n.txt",
                &["n.txt: there is no such file", "there is notes.txt"],
            ),
        ],
    );
    // 1 is an answer of compare.
    let error = refused(&scratch, "compare cloud.ply clod.ply", 2);
    assert!(error.contains("clod.ply: there is no such file or folder; did you mean cloud.ply?"), "{error}");
}

#[test]
fn colmap_models_that_cannot_be_used_say_what_to_run() {
    let scratch = things();
    let error = refused(&scratch, "densify colmap/sfm", 1);
    for needle in ["no images/ folder", "colmap image_undistorter", "--image-path"] {
        assert!(error.contains(needle), "{needle}: {error}");
    }
    std::fs::create_dir(scratch.path("colmap/sfm/images")).unwrap();
    let error = refused(&scratch, "densify colmap/sfm -w out -o out/x.ply", 1);
    for needle in ["SIMPLE_RADIAL", "PINHOLE", "colmap image_undistorter"] {
        assert!(error.contains(needle), "{needle}: {error}");
    }
}

#[test]
fn missing_label_maps_come_with_the_names_that_are_looked_for() {
    let scratch = things();
    let names =
        |stem: &str| format!("{stem}.png, {stem}.jpg.png, {stem}_l.png, {stem}.label.png or {stem}.mask.png");
    let error = refused(&scratch, "densify scene.mvs --label-path nowhere", 1);
    assert!(
        error.contains("nowhere: no such folder of label maps") && error.contains(&names("DSC1")),
        "{error}"
    );
    let first = |words: &str| {
        let out = scratch.semvs(words);
        out.stderr.lines().find(|line| line.starts_with("error: ")).unwrap().to_owned()
    };
    let error = first("densify scene.mvs --label-path empty");
    let expected = format!("for images/0003.jpg {} is not in empty (where no PNG file is)", names("0003"));
    assert!(
        error.contains("no image has a label map") && error.contains(&names("0003")),
        "{error}\n{expected}"
    );
    assert!(
        error.contains("is not in empty (where no PNG file is), nor is there images/0003.mask.png"),
        "{error}"
    );
    std::fs::create_dir(scratch.path("seg")).unwrap();
    scratch.write("seg/seg_0003.png", "");
    let error = first("densify scene.mvs --label-path seg");
    assert!(error.contains("seg (whose 1 PNG files are called like seg_0003.png)"), "{error}");
    for (words, place) in [
        ("labels check scene.mvs --label-path empty", "in empty"),
        ("labels check scene.mvs", "--label-path"),
    ] {
        let error = first(words);
        assert!(error.contains(&names("DSC1")) && error.contains(place), "{error}");
    }
}

#[test]
fn slips_on_the_command_line_are_asked_about_and_help_is_that_of_the_command() {
    let scratch = things();
    all_refused(
        &scratch,
        &[
            ("densfy scene.mvs", &["'densfy'; did you mean densify?; see semvs --help"]),
            (
                "densify scene.mvs --qualty draft",
                &["'--qualty' found; did you mean --quality?; see semvs densify --help"],
            ),
            ("densify scene.mvs --quality best", &["draft, normal, high", "see semvs densify --help"]),
            (
                "densify scene.mvs --max-threads -2",
                &["unexpected argument '-2' found; see semvs densify --help"],
            ),
            ("densify scene.mvs --number-views few", &["'few'", "give a whole number, not below 0"]),
            (
                "evaluate cloud.ply --truth cloud.ply --thresholds abc",
                &["give a number; see semvs evaluate --help"],
            ),
            ("convert cloud.ply", &["--output <OUT>; see semvs convert --help"]),
            ("labels chek scene.mvs", &["did you mean check?; see semvs labels --help"]),
            ("labels render scene.mvs", &["--cloud", "see semvs labels render --help"]),
        ],
    );
    let long = scratch.write("dense.cfg", "x".repeat(5000));
    let error = refused(&scratch, "densify scene.mvs --dense-config-file dense.cfg", 1);
    assert!(error.contains("dense.cfg: line 1: 'xxx") && error.len() < 200, "{}: {error}", long.display());
}

#[test]
fn time_and_memory_are_said_before_the_work_and_what_is_left_during_it() {
    let scratch = Scratch::facade6();
    let words = format!("densify scene.mvs {SMALL} -w out -o out/x.ply --max-threads 2");
    let out = scratch.semvs(&words).ok();
    let lines: Vec<&str> = out.stderr.lines().collect();
    let at = lines.iter().position(|line| line.starts_with("To make: ")).unwrap();
    assert!(lines[at].starts_with("To make: 6 depth maps of 200×150 with about "), "{}", lines[at]);
    assert!(
        lines[at].contains(" neighbours each: about ") && lines[at].contains(" on 2 threads"),
        "{}",
        lines[at]
    );
    assert!(lines[at].ends_with(" GB of memory"), "{}", lines[at]);
    let done = |line: &&&str| line.contains(" of 6");
    assert!(!lines[..at].iter().any(|line| line.starts_with("Estimating")), "{}", out.stderr);
    assert!(lines[at..].iter().filter(done).all(|line| line.ends_with(" left")), "{}", out.stderr);
    // Nothing is to be made any more.
    let again = scratch.semvs(&words).ok();
    assert!(!again.stderr.contains("To make"), "{}", again.stderr);
    let quiet = scratch.semvs(&format!("{words} --force -q")).ok();
    assert!(quiet.stderr.is_empty(), "{}", quiet.stderr);
    // Four times the pixels take longer; here that is said in seconds.
    let large =
        scratch.semvs("densify scene.mvs --estimate-roi 0 --max-threads 1 --force -w out -o out/x.ply").ok();
    let seconds = |text: &str| -> f64 {
        let line = text.lines().find(|line| line.starts_with("To make: ")).unwrap();
        let words = line.split("each: about ").nth(1).unwrap();
        words.split(' ').next().unwrap().parse().unwrap()
    };
    assert!(seconds(&large.stderr) > seconds(&out.stderr), "{}\n{}", large.stderr, out.stderr);
    let drop_in = scratch.densify_point_cloud(&format!("scene.mvs {SMALL} --geometric-iters 0 -v 3")).ok();
    assert!(!drop_in.stdout.contains("To make") && !drop_in.stderr.contains("To make"));
}
