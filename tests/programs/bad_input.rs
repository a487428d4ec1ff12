//! Bad input ends in one clear line and exit code 1: no panic, nothing half-written, nothing lost.

use crate::common::{self, FUSE_ONLY, SMALL, Scratch};
use semvs_formats::Limits;
use semvs_formats::mvs::{self, NEWEST_VERSION, Scene};

/// The scene with a change.
fn changed(change: impl FnOnce(&mut Scene)) -> Scratch {
    let scratch = Scratch::facade6();
    let mut scene = mvs::read(scratch.path("scene.mvs"), &Limits::default()).unwrap();
    change(&mut scene);
    let mut bytes = Vec::new();
    // Written by way of the file value: bad indices are what is wanted here.
    let file = mvs::SceneFile {
        scene,
        container: mvs::Container::Interface { version: NEWEST_VERSION },
        reserved: 0,
        trailing_bytes: 0,
    };
    file.write(&mut bytes).unwrap();
    scratch.write("scene.mvs", bytes);
    scratch
}

/// Both programs refuse the scene, naming `needles`, and write nothing but a log.
#[track_caller]
fn refused(scratch: &Scratch, options: &str, needles: &[&str]) {
    let files = || scratch.files().into_iter().filter(|f| !f.ends_with(".log")).collect::<Vec<String>>();
    let before = files();
    scratch.semvs(&format!("densify scene.mvs -o out/cloud.ply -w out {options}")).fails_naming(needles);
    scratch.densify_point_cloud(&format!("scene.mvs -o dense {options}")).fails_naming(needles);
    assert_eq!(before, files());
}

#[test]
fn scenes_cut_short_or_corrupt() {
    let scratch = Scratch::facade6();
    let whole = scratch.read("scene.mvs");
    for length in [0, 3, 8, 20, 100, whole.len() / 2, whole.len() - 1] {
        scratch.write("scene.mvs", &whole[..length]);
        refused(&scratch, SMALL, &["scene.mvs"]);
    }
    // A count beyond the end of the file: the number of platforms.
    let mut bytes = whole.clone();
    bytes[12..20].copy_from_slice(&u64::MAX.to_le_bytes());
    scratch.write("scene.mvs", &bytes);
    refused(&scratch, SMALL, &["scene.mvs"]);
    scratch.write("scene.mvs", "this is not a scene");
    refused(&scratch, SMALL, &["scene.mvs"]);
}

#[test]
fn impossible_cameras() {
    for bad in [f64::NAN, f64::INFINITY] {
        let scratch = changed(|scene| scene.platforms[0].poses[2].center[1] = bad);
        refused(&scratch, SMALL, &["scene.mvs", "poses[2]"]);
        let scratch = changed(|scene| scene.platforms[0].poses[2].rotation[4] = bad);
        refused(&scratch, SMALL, &["scene.mvs", "poses[2]"]);
    }
    let scratch = changed(|scene| scene.platforms[0].cameras[0].k[0] = 0.0);
    refused(&scratch, SMALL, &["scene.mvs", "cameras[0]"]);
}

#[test]
fn indices_out_of_range() {
    refused(&changed(|scene| scene.images[1].platform = 9), SMALL, &["scene.mvs", "images[1]"]);
    refused(&changed(|scene| scene.images[1].camera = 9), SMALL, &["scene.mvs", "images[1]"]);
    refused(&changed(|scene| scene.images[1].pose = 99), SMALL, &["scene.mvs", "images[1]"]);
}

#[test]
fn too_few_views_and_no_points() {
    let scratch = changed(|scene| scene.images.iter_mut().skip(1).for_each(|i| i.pose = mvs::NO_ID));
    refused(&scratch, SMALL, &["scene.mvs", "at least two"]);
    let scratch = Scratch::facade6();
    for name in ["0004", "0005", "0006", "0012", "0013"] {
        std::fs::remove_file(scratch.path(&format!("images/{name}.jpg"))).unwrap();
    }
    refused(&scratch, SMALL, &["scene.mvs", "at least two"]);
    // Viewing axes that meet could stand in for the points.
    let scratch = changed(|scene| {
        scene.points = mvs::PointCloud::default();
        let rotation = scene.platforms[0].poses[0].rotation;
        scene.platforms[0].poses.iter_mut().for_each(|pose| pose.rotation = rotation);
    });
    refused(&scratch, SMALL, &["no sparse points"]);
}

/// Makes an image unusable.
type Spoil = fn(&Scratch);

#[test]
fn images_that_cannot_be_used_are_left_out_unless_strict() {
    let make: [(&str, Spoil); 4] = [
        ("missing", |s| std::fs::remove_file(s.path("images/0005.jpg")).unwrap()),
        ("cut short", |s| s.edit("images/0005.jpg", |bytes| bytes.truncate(bytes.len() / 2))),
        ("no image", |s| drop(s.write("images/0005.jpg", "not a JPEG"))),
        ("other shape", |s| {
            std::fs::copy(s.path("labels/0005_l.png"), s.path("images/0005.jpg")).unwrap();
            s.write("images/0005.jpg", wide_png());
        }),
    ];
    for (what, spoil) in make {
        let scratch = Scratch::facade6();
        scratch.add_maps("post7", ".");
        spoil(&scratch);
        let out = scratch.densify_point_cloud(&format!("scene.mvs {FUSE_ONLY}")).ok();
        assert!(
            out.stdout.contains("warning: ") && out.stdout.contains("0005.jpg"),
            "{what}: {}",
            out.stdout
        );
        assert!(
            out.stdout.contains("Preparing images for dense reconstruction completed: 5 images"),
            "{what}"
        );
        let strict = scratch.densify_point_cloud(&format!("scene.mvs --strict {FUSE_ONLY}"));
        strict.fails_naming(&["0005.jpg"]);
    }
}

/// A PNG of 60×20 pixels.
fn wide_png() -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, 60, 20);
    encoder.set_color(png::ColorType::Rgb);
    encoder.write_header().unwrap().write_image_data(&[128; 60 * 20 * 3]).unwrap();
    bytes
}

#[test]
fn faulty_label_maps_are_found_before_work() {
    let labels = "--label-path labels --class-table 3dom-facade";
    let scratch = Scratch::facade6();
    std::fs::remove_file(scratch.path("labels/0004_l.png")).unwrap();
    refused(&scratch, &format!("{SMALL} {labels}"), &["0004.jpg", "--missing-labels void"]);

    scratch.write("labels/0004_l.png", wide_png());
    refused(&scratch, &format!("{SMALL} {labels}"), &["0004_l.png", "60×20", "400×300"]);

    let scratch = Scratch::facade6();
    scratch.edit("labels/0004_l.png", |bytes| bytes.truncate(bytes.len() / 2));
    refused(&scratch, &format!("{SMALL} {labels}"), &["0004_l.png"]);

    let scratch = Scratch::facade6();
    let table = "[[class]]\nid = 1\nname = \"building\"\ncolor = [0, 0, 255]\n";
    scratch.write("one.toml", table);
    let one = "--label-path labels --class-table one.toml";
    refused(&scratch, &format!("{SMALL} {one}"), &["_l.png", "colour (", "--unknown-label void"]);
    refused(&scratch, &format!("{SMALL} --label-path labels"), &["_l.png", "--class-table"]);
    refused(&scratch, &format!("{SMALL} --label-path nowhere --class-table ids"), &["nowhere"]);
    refused(&scratch, &format!("{SMALL} {labels} --exclude-classes skye"), &["skye", "sky"]);
    scratch.write("one.toml", format!("{table}{table}"));
    refused(&scratch, &format!("{SMALL} {one}"), &["one.toml"]);
}

/// Both programs refuse `options` before they look at any image; the line holds `needles`.
#[track_caller]
fn refused_at_once(scratch: &Scratch, options: &str, needles: &[&str]) {
    refused(scratch, &format!("{SMALL} {options}"), needles);
    let out = scratch.semvs(&format!("densify scene.mvs -o out/cloud.ply -w out {SMALL} {options}"));
    assert!(
        !out.stderr.contains("Images ready") && !out.stderr.contains("Preparing images"),
        "{}",
        out.stderr
    );
    let out = scratch.densify_point_cloud(&format!("scene.mvs -o dense {SMALL} {options}"));
    assert!(!out.stdout.contains("Preparing images"), "{}", out.stdout);
}

#[test]
fn faulty_class_tables_and_class_names_are_told_before_images() {
    let scratch = Scratch::facade6();
    let wall = "[[class]]\nid = 1\nname = \"building\"\ncolor = [0, 0, 255]\n";
    for (more, needle) in [
        ("[[class]]\nid = 1\nname = \"roof\"\n", "line 5: key class.id: 1 is taken by class 1"),
        ("[[class]]\nid = 2\nname = \"Building\"\n", "line 5: key class.name: \"Building\" is taken"),
        (
            "[[class]]\nid = 2\nname = \"roof\"\ncolor = [0, 0, 255]\n",
            "line 5: key class.color: [0, 0, 255] is taken",
        ),
        ("colour = [1, 2, 3]\n", "line 5: unknown key class.colour"),
        ("[[class]]\nid = 65536\nname = \"roof\"\n", "line 6: key class.id: 65536 is not in 1..=65535"),
        ("las = 256\n", "line 5: key class.las: 256 is not in 0..=255"),
    ] {
        scratch.write("t.toml", format!("{wall}{more}"));
        refused_at_once(&scratch, "--label-path labels --class-table t.toml", &["t.toml", needle]);
    }
    let facade = "--label-path labels --class-table 3dom-facade";
    for option in ["--classes", "--exclude-classes"] {
        refused_at_once(
            &scratch,
            &format!("{facade} {option} widnow"),
            &["widnow", "did you mean \"window\"?"],
        );
    }
    refused_at_once(&scratch, "--label-path labels --class-table 3dom-facde", &["did you mean 3dom-facade?"]);
    refused_at_once(
        &scratch,
        "--label-path images/0003.jpg --class-table ids",
        &["0003.jpg", "--label-path"],
    );
}

#[test]
fn label_maps_for_no_view_at_all() {
    let scratch = Scratch::facade6();
    std::fs::create_dir(scratch.path("empty")).unwrap();
    let needles = ["no image has a label map", "0003_l.png", "in empty (where no PNG file is)"];
    for missing in ["", "--missing-labels void"] {
        let options = format!("--label-path empty --class-table 3dom-facade {missing}");
        refused_at_once(&scratch, &options, &needles);
    }
}

#[test]
fn classes_without_a_las_code() {
    let scratch = Scratch::facade6();
    let facade = String::from("[[class]]\nid = 200\nname = \"building\"\ncolor = [0, 0, 255]\n");
    scratch.write("t.toml", &facade);
    let words = format!("{SMALL} --label-path labels --class-table t.toml --unknown-label void");
    let needles = ["class 200 \"building\"", "64 + 200", "las = CODE"];
    for name in ["x.las", "x.laz"] {
        let out = scratch.semvs(&format!("densify scene.mvs -o {name} {words}")).fails_naming(&needles);
        assert!(!out.stderr.contains("Scene read"), "{}", out.stderr);
        scratch.densify_point_cloud(&format!("scene.mvs -o {name} {words}")).fails_naming(&needles);
    }
    // Of the table `ids` only the label maps tell which ids there are.
    std::fs::create_dir(scratch.path("ids")).unwrap();
    for name in ["0003", "0004", "0005", "0006", "0012", "0013"] {
        let ids = image::ImageBuffer::from_pixel(400, 300, image::Luma([300u16]));
        ids.save(scratch.path(&format!("ids/{name}.png"))).unwrap();
    }
    let words = format!("densify scene.mvs -o x.las {SMALL} --label-path ids --class-table ids");
    let out = scratch.semvs(&words).fails_naming(&["class 300 \"class-300\""]);
    assert!(!out.stderr.contains("Images ready"), "{}", out.stderr);
    assert!(!scratch.files().iter().any(|f| f.ends_with(".dmap") || f.starts_with("x.")));
}

#[test]
fn folders_in_the_place_of_class_clouds_and_files_in_that_of_folders() {
    let scratch = Scratch::facade6();
    let labels = "--label-path labels --class-table 3dom-facade --split-by-class";
    for name in ["x.door.ply", "x.legend.png"] {
        std::fs::create_dir(scratch.path(name)).unwrap();
        let out =
            scratch.semvs(&format!("densify scene.mvs -o x.ply {SMALL} {labels}")).fails_naming(&[name]);
        assert!(!out.stderr.contains("Scene read"), "{}", out.stderr);
        std::fs::remove_dir(scratch.path(name)).unwrap();
    }
    // Classes that only the label maps tell.
    std::fs::create_dir(scratch.path("ids")).unwrap();
    for name in ["0003", "0004", "0005", "0006", "0012", "0013"] {
        image::GrayImage::from_pixel(400, 300, image::Luma([3]))
            .save(scratch.path(&format!("ids/{name}.png")))
            .unwrap();
    }
    std::fs::create_dir(scratch.path("x.class-3.ply")).unwrap();
    let words =
        format!("densify scene.mvs -o x.ply {SMALL} --label-path ids --class-table ids --split-by-class");
    let out = scratch.semvs(&words).fails_naming(&["x.class-3.ply"]);
    assert!(!out.stderr.contains("Images ready"), "{}", out.stderr);

    scratch.add_maps("post7", "maps");
    scratch.write("file", "");
    for words in [
        "densify scene.mvs -o y.ply -w file",
        "fuse scene.mvs --depth-maps maps -o y.ply -w file",
        "convert maps/depth0000.dmap -o y.ply -w file",
    ] {
        let out = scratch.semvs(words).fails_naming(&["file"]);
        assert!(!out.stderr.contains("Images ready") && !out.stderr.contains("os error"), "{}", out.stderr);
    }
    let out = scratch.densify_point_cloud("scene.mvs -w file").fails_naming(&["file", "working folder (-w)"]);
    assert!(!out.stderr.contains("os error"), "{}", out.stderr);
}

#[test]
fn clouds_of_classes_that_are_no_more_are_named() {
    let scratch = Scratch::with_maps();
    let fuse = "fuse scene.mvs --depth-maps . -o x.laz --label-path labels --class-table 3dom-facade --split-by-class";
    scratch.semvs(fuse).ok();
    let out = scratch.semvs(&format!("{fuse} --classes building,window")).ok();
    let line = out.stderr.lines().find(|line| line.contains("earlier run")).unwrap_or_default();
    assert!(line.contains("x.door.laz") && line.contains("x.obstacle.laz"), "{}", out.stderr);
    assert!(!line.contains("x.building.laz") && !line.contains("x.window.laz"), "{line}");
    // A run without labels has none of them.
    let out = scratch.semvs("fuse scene.mvs --depth-maps . -o x.laz").ok();
    assert!(out.stderr.contains("x.building.laz"), "{}", out.stderr);
}

#[test]
fn places_that_cannot_be_written() {
    let scratch = Scratch::facade6();
    scratch.write("file", "in the way");
    std::fs::create_dir(scratch.path("folder.ply")).unwrap();
    let fail = |words: &str, needle: &str| {
        scratch.semvs(&format!("densify scene.mvs {SMALL} {words}")).fails_naming(&[needle]);
    };
    fail("-o file/cloud.ply", "file");
    fail("-o folder.ply", "folder.ply");
    fail("-o ok.ply -w file/maps", "file");
    fail("-o ok.ply --report file/run.json", "file");
    fail("-o /proc/none/cloud.ply", "/proc/none");
    scratch.densify_point_cloud(&format!("scene.mvs -w file {SMALL}")).fails_naming(&["file"]);
    scratch.densify_point_cloud(&format!("scene.mvs -o file/dense {SMALL}")).fails_naming(&["file"]);
    assert_eq!(scratch.read("file"), b"in the way");
    assert!(!scratch.files().iter().any(|f| f.ends_with(".dmap") || f.ends_with(".mvs") && f != "scene.mvs"));
}

#[cfg(unix)]
#[test]
fn a_read_only_folder() {
    use std::os::unix::fs::PermissionsExt;
    let scratch = Scratch::facade6();
    std::fs::create_dir(scratch.path("locked")).unwrap();
    std::fs::set_permissions(scratch.path("locked"), std::fs::Permissions::from_mode(0o555)).unwrap();
    if std::fs::write(scratch.path("locked/probe"), "").is_ok() {
        println!("permissions do not bind this user: skipped");
        return;
    }
    for words in ["-o locked/cloud.ply", "-o ok.ply -w locked"] {
        scratch
            .semvs(&format!("densify scene.mvs {SMALL} {words}"))
            .fails_naming(&["locked", "may not be written in; choose another place"]);
    }
}

#[test]
fn depth_maps_that_do_not_belong() {
    let scratch = Scratch::facade6();
    scratch.add_maps("post7", "maps");
    let good = scratch.read("maps/depth0001.dmap");
    let fuse = "fuse scene.mvs --depth-maps maps -o fused.ply";
    scratch.write("fused.ply", "from before");
    // Of another image.
    scratch.write("maps/depth0001.dmap", scratch.read("maps/depth0002.dmap"));
    scratch.semvs(fuse).fails_naming(&["depth0001.dmap", "image 0002"]);
    // Cut short, damaged, empty.
    for length in [0, 10, 200, good.len() - 1] {
        scratch.write("maps/depth0001.dmap", &good[..length]);
        scratch.semvs(fuse).fails_naming(&["depth0001.dmap"]);
        scratch.semvs("convert maps/depth0001.dmap -o fused.ply").fails_naming(&["depth0001.dmap"]);
        scratch.semvs("inspect maps/depth0001.dmap").fails_naming(&["depth0001.dmap"]);
    }
    // Of another scene: the camera stands elsewhere.
    scratch.write("maps/depth0001.dmap", &good);
    let mut scene = mvs::read(scratch.path("scene.mvs"), &Limits::default()).unwrap();
    scene.platforms[0].poses.iter_mut().for_each(|pose| pose.center[0] += 1.0);
    let mut bytes = Vec::new();
    mvs::write_interface(&mut bytes, &scene, NEWEST_VERSION).unwrap();
    scratch.write("moved.mvs", bytes);
    scratch
        .semvs("fuse moved.mvs --depth-maps maps -o fused.ply")
        .fails_naming(&["depth0000.dmap", "stands elsewhere"]);
    std::fs::create_dir(scratch.path("empty")).unwrap();
    scratch.semvs("fuse scene.mvs --depth-maps empty -o fused.ply").fails_naming(&["empty", "no depth map"]);
    scratch.semvs("fuse scene.mvs --depth-maps none -o fused.ply").fails_naming(&["none"]);
    assert_eq!(scratch.read("fused.ply"), b"from before");
}

#[test]
fn clouds_cut_short_or_corrupt() {
    let scratch = Scratch::new();
    let whole = std::fs::read(common::facade6().join("truth/truth.ply")).unwrap();
    scratch.write("truth.ply", &whole);
    for length in [0, 4, 60, whole.len() / 2, whole.len() - 1] {
        scratch.write("cloud.ply", &whole[..length]);
        let out = scratch.semvs("evaluate cloud.ply --truth truth.ply --thresholds 0.1");
        out.fails_naming(&["cloud.ply"]);
        scratch.semvs("inspect cloud.ply").fails_naming(&["cloud.ply"]);
    }
    let text = String::from_utf8_lossy(&whole[..300]).into_owned();
    let start = text.find("element vertex ").unwrap() + "element vertex ".len();
    let mut hostile = whole.clone();
    hostile.splice(start..start, b"99999999999".iter().copied());
    scratch.write("cloud.ply", hostile);
    scratch.semvs("inspect cloud.ply").fails_naming(&["cloud.ply"]);
    let missing = scratch.semvs("evaluate none.ply --truth truth.ply --thresholds 0.1");
    missing.fails_naming(&["none.ply"]);
}

#[test]
fn a_report_never_replaces_an_input_or_another_output() {
    let scratch = Scratch::facade6();
    scratch.add_maps("post7", "maps");
    let photograph = scratch.read("images/0003.jpg");
    let map = scratch.read("maps/depth0000.dmap");
    let fuse = |report: &str| {
        scratch.semvs(&format!("fuse scene.mvs --depth-maps maps -o fused.ply --report {report}"))
    };
    for report in ["images/0003.jpg", "maps/depth0000.dmap", "scene.mvs", "fused.ply"] {
        fuse(report).fails_naming(&["--report", report]);
    }
    assert_eq!(scratch.read("images/0003.jpg"), photograph);
    assert_eq!(scratch.read("maps/depth0000.dmap"), map);
    fuse("run.json").ok();
    fuse("run.json").ok();
}

#[test]
fn missing_depth_maps_are_named_and_refused_when_strict() {
    let scratch = Scratch::facade6();
    scratch.add_maps("post7", "maps");
    std::fs::remove_file(scratch.path("maps/depth0002.dmap")).unwrap();
    let fuse = "fuse scene.mvs --depth-maps maps -o fused.ply";
    let out = scratch.semvs(fuse).ok();
    assert!(out.stderr.contains("depth0002.dmap"), "{}", out.stderr);
    scratch.semvs(&format!("{fuse} --strict")).fails_naming(&["depth0002.dmap"]);
}

#[test]
fn a_cloud_without_points_is_a_failure() {
    let scratch = Scratch::facade6();
    scratch.add_maps("post7", "maps");
    for map in 1..6 {
        std::fs::remove_file(scratch.path(&format!("maps/depth000{map}.dmap"))).unwrap();
    }
    scratch.write("fused.ply", "from before");
    scratch.semvs("fuse scene.mvs --depth-maps maps -o fused.ply").fails_naming(&["no point"]);
    assert_eq!(scratch.read("fused.ply"), b"from before");
}

#[test]
fn absurd_thread_counts_are_refused() {
    let scratch = Scratch::facade6();
    refused(&scratch, &format!("{SMALL} --max-threads 100000"), &["--max-threads 100000"]);
}

#[test]
fn what_can_be_checked_is_checked_before_any_image_is_read() {
    let scratch = Scratch::facade6();
    scratch.write("file", "in the way");
    for folder in ["out.building.ply", "out.labels.ply"] {
        std::fs::create_dir(scratch.path(folder)).unwrap();
    }
    let labels = "--label-path labels --class-table 3dom-facade";
    for (words, needle) in [
        (format!("{labels} --exclude-classes skye"), "skye"),
        (format!("{labels} --classes window --exclude-classes window"), "cancel out"),
        ("--label-path labels --class-table nope".into(), "nope"),
        ("--label-path nowhere --class-table ids".into(), "nowhere"),
        (format!("{labels} --split-by-class"), "out.building.ply"),
        (format!("{labels} --color-by-label"), "out.labels.ply"),
        ("-w file".into(), "file"),
        ("--ignore-mask-label 0 --mask-path nowhere".into(), "nowhere"),
        ("--view-neighbors-file none.txt".into(), "none.txt"),
        ("-p none.ply".into(), "none.ply"),
        ("--sub-resolution-levels 30".into(), "--sub-resolution-levels 30"),
    ] {
        let out = scratch.semvs(&format!("densify scene.mvs -o out.ply {SMALL} {words}"));
        let out = out.fails_naming(&[needle]);
        assert!(!out.stderr.contains("Scene read"), "{}", out.stderr);
    }
}

#[test]
fn what_is_missing_is_named_with_the_places_that_were_tried() {
    let scratch = Scratch::facade6();
    std::fs::remove_file(scratch.path("images/0005.jpg")).unwrap();
    let places = ["out/images/0005.jpg", "the scene: images/0005.jpg"];
    scratch.semvs(&format!("densify scene.mvs -w out -o x.ply --strict {SMALL}")).fails_naming(&places);
    let here = scratch.path("scene.mvs").canonicalize().unwrap();
    let needles = ["out/scene.mvs", "(-w)", here.to_str().unwrap()];
    scratch.densify_point_cloud("scene.mvs -w out").fails_naming(&needles);
    scratch.densify_point_cloud("none.mvs -w out").fails_naming(&["out/none.mvs", "(-w)"]);
}

#[test]
fn views_without_neighbours_are_named_and_refused_when_strict() {
    // No point is seen by image 1.
    let scratch = changed(|scene| {
        let mut views = mvs::Visibility::default();
        for i in 0..scene.points.positions.len() {
            let seen: Vec<u32> =
                scene.points.views.images_of(i).iter().copied().filter(|&image| image != 1).collect();
            views.push(&seen, &[]);
        }
        scene.points.views = views;
    });
    scratch.add_maps("post7", ".");
    std::fs::remove_file(scratch.path("depth0001.dmap")).unwrap();
    let densify = format!("densify scene.mvs -o x.ply --report run.json {FUSE_ONLY}");
    let out = scratch.semvs(&densify).ok();
    assert!(out.stderr.contains("0004.jpg: no neighbour"), "{}", out.stderr);
    let report: serde_json::Value = serde_json::from_slice(&scratch.read("run.json")).unwrap();
    assert!(report["views"][1]["dropped"].as_str().unwrap().contains("no neighbour"));
    scratch.semvs(&format!("{densify} --strict")).fails_naming(&["0004.jpg", "no neighbour"]);
}

#[test]
fn too_few_views_for_a_point_are_noticed_before_work() {
    let scratch = Scratch::facade6();
    scratch.add_maps("post7", "maps");
    for map in 2..6 {
        std::fs::remove_file(scratch.path(&format!("maps/depth000{map}.dmap"))).unwrap();
    }
    let fuse = "fuse scene.mvs --depth-maps maps -o x.ply --estimate-roi 0";
    let out = scratch.semvs(fuse).fails_naming(&["no point", "--number-views-fuse 2"]);
    assert!(!out.stderr.contains("Fused"), "{}", out.stderr);
    // A scene of two usable images makes do with two.
    for name in ["0005", "0006", "0012", "0013"] {
        std::fs::remove_file(scratch.path(&format!("images/{name}.jpg"))).unwrap();
    }
    let out = scratch.semvs(fuse).ok();
    assert!(out.stderr.contains("--number-views-fuse 3: only 2 images"), "{}", out.stderr);
    assert!(scratch.has("x.ply"));
    let tiny = format!("densify scene.mvs -o y.ply {FUSE_ONLY} --max-resolution 11");
    scratch.semvs(&tiny).fails_naming(&["0 of its 6 images", "11×8", "--max-resolution"]);
}

#[test]
fn what_a_scene_holds_beyond_use_is_said() {
    let scratch = Scratch::facade6();
    scratch.add_maps("post7", "maps");
    scratch.edit("scene.mvs", |bytes| bytes.extend(b"tail"));
    let fuse = "fuse scene.mvs --depth-maps maps -o x.ply --estimate-roi 0";
    let out = scratch.semvs(fuse).ok();
    assert!(out.stderr.contains("scene.mvs: 4 bytes after the end"), "{}", out.stderr);
    // The region of interest ends the file.
    scratch.edit("scene.mvs", |bytes| {
        bytes.truncate(bytes.len() - 4);
        let end = bytes.len();
        bytes[end - 8..].copy_from_slice(&f64::NAN.to_le_bytes());
    });
    let out = scratch.semvs(fuse).ok();
    assert!(out.stderr.contains("scene.mvs: its region of interest"), "{}", out.stderr);
}

#[test]
fn a_report_never_replaces_a_class_table() {
    let scratch = Scratch::facade6();
    let table = r#"{"1": "building"}"#;
    scratch.write("labels/labels.json", table);
    scratch.write("classes.json", table);
    let run = |words: &str| scratch.semvs(&format!("densify scene.mvs -o x.ply {SMALL} {words}"));
    let named = "--label-path labels --class-table classes.json --report ./classes.json";
    run(named).fails_naming(&["--report", "classes.json"]);
    run("--label-path labels --report labels/labels.json").fails_naming(&["--report", "labels.json"]);
    assert_eq!(scratch.read("labels/labels.json"), table.as_bytes());
}

#[test]
fn clouds_go_to_files_only() {
    let scratch = Scratch::facade6();
    std::fs::create_dir(scratch.path("folder")).unwrap();
    for output in ["new/", "folder", "folder/", "/"] {
        scratch.semvs(&format!("densify scene.mvs {SMALL} -o {output}")).fails_naming(&["--output"]);
    }
    #[cfg(unix)]
    scratch
        .semvs(&format!("densify scene.mvs {SMALL} -o /dev/full"))
        .fails_naming(&["/dev/full", "--output"]);
    assert!(!scratch.has("new.ply") && !scratch.has("folder.ply"));
}

#[test]
fn clouds_that_cannot_be_judged() {
    let scratch = Scratch::new();
    std::fs::copy(common::facade6().join("truth/truth.ply"), scratch.path("truth.ply")).unwrap();
    let judge = |cloud: &str| scratch.semvs(&format!("evaluate {cloud} --truth truth.ply --thresholds 0.1"));
    let empty =
        "ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\nproperty float y\nproperty float z\n";
    scratch.write("empty.ply", format!("{empty}end_header\n"));
    judge("empty.ply").fails_naming(&["empty.ply", "no points"]);
    std::fs::copy(common::facade6().join("images/0003.jpg"), scratch.path("image.ply")).unwrap();
    judge("image.ply").fails_naming(&["image.ply", "this is a picture", "PLY"]);
    scratch.write("text.ply", "plain text\n");
    judge("text.ply").fails_naming(&["text.ply", "no PLY file"]);
    scratch.write("escape.ply", b"ply\nformat \x1b[2Jascii\x07 1.0\nend_header\n");
    let out = judge("escape.ply").fails_naming(&["escape.ply", "u{1b}"]);
    assert!(!out.stderr.contains(['\x1b', '\x07']), "{:?}", out.stderr);
    let negative = scratch.semvs("evaluate truth.ply --truth truth.ply --thresholds 0.1 -1");
    negative.fails_naming(&["threshold -1"]);
}

#[test]
fn convert_refuses_what_it_cannot_mean() {
    let scratch = Scratch::facade6();
    scratch.add_maps("post7", "maps");
    let convert = "convert maps/depth0000.dmap -o x.ply";
    scratch
        .semvs(&format!("{convert} maps/../maps/depth0000.dmap"))
        .fails_naming(&["depth0000.dmap", "twice"]);
    let labels = "--label-path labels --class-table 3dom-facade";
    scratch
        .semvs(&format!("{convert} {labels} --label-consistency strict"))
        .fails_naming(&["--label-consistency"]);
    assert!(!scratch.has("x.ply"));
}
