//! Pages about runs, and pictures of depth maps. `tests/page.sh` opens pages in a browser.

use crate::common::{SMALL, Scratch};
use serde_json::Value;

const LABELS: &str = "--label-path labels --class-table 3dom-facade";

/// A page, taken apart.
struct Page {
    text: String,
    data: Value,
    points: usize,
}

impl Page {
    #[track_caller]
    fn read(scratch: &Scratch, name: &str) -> Page {
        let text = String::from_utf8(scratch.read(name)).unwrap();
        let element = |id: &str| {
            let start = text.find(&format!("id=\"{id}\">")).unwrap();
            let body = &text[start..];
            let body = &body[body.find('>').unwrap() + 1..];
            body[..body.find("</script>").unwrap()].to_owned()
        };
        let data: Value = serde_json::from_str(&element("data")).unwrap();
        let packed = element("points");
        let padding = packed.bytes().rev().take_while(|b| *b == b'=').count();
        let bytes = packed.len() / 4 * 3 - padding;
        assert_eq!(bytes % 16, 0);
        Page { text, data, points: bytes / 16 }
    }

    fn layers(&self, view: usize) -> Vec<&str> {
        self.data["views"][view]["layers"].as_object().unwrap().keys().map(String::as_str).collect()
    }
}

/// Depth maps of OpenMVS and a labelled cloud of them in `out/`.
fn fused() -> Scratch {
    let scratch = Scratch::facade6();
    scratch.add_maps("post7", "out");
    scratch.semvs(&format!("fuse scene.mvs --depth-maps out -o out/a.ply {LABELS} --report out/a.json")).ok();
    std::fs::copy(scratch.path("scene.mvs"), scratch.path("out/a.mvs")).unwrap();
    scratch
}

#[test]
fn a_page_shows_what_a_folder_holds() {
    let scratch = fused();
    let out = scratch.semvs("report out").ok();
    assert!(out.stdout.contains("out/report.html: 6 views"), "{}", out.stdout);
    let page = Page::read(&scratch, "out/report.html");
    let cloud = scratch.cloud("out/a.ply");
    let data = &page.data;
    assert_eq!((data["title"].as_str(), data["program"].as_str()), (Some("a"), Some("semvs fuse")));
    assert_eq!(data["points"], cloud.len());
    assert_eq!(data["options"]["class-table"], "3dom-facade");
    assert_eq!(data["stages"][0]["stage"], "load");
    assert!(data["edges"].as_array().unwrap().len() >= 5);
    let shown = data["cloud"]["count"].as_u64().unwrap() as usize;
    assert_eq!(shown, page.points);
    assert!(shown > cloud.len() * 97 / 100 && shown <= cloud.len(), "{shown} of {}", cloud.len());
    assert!(data["cloud"]["most_views"].as_u64().unwrap() >= 3, "counted in the depth maps");
    assert_eq!(data["cloud"]["has_confidence"], true);
    let classes: Vec<&str> =
        data["cloud"]["classes"].as_array().unwrap().iter().map(|c| c["name"].as_str().unwrap()).collect();
    assert!(classes.contains(&"building") && classes.contains(&"window"), "{classes:?}");
    for view in 0..6 {
        assert_eq!(page.layers(view)[..5], ["image", "depth", "normal", "confidence", "labels"]);
        let row = &data["views"][view];
        assert_eq!((row["width"].as_u64(), row["height"].as_u64()), (Some(200), Some(150)));
        assert!(row["coverage"].as_f64().unwrap() > 0.3 && row["mean_confidence"].as_f64().unwrap() > 0.1);
        assert_eq!(row["depth_scale"], data["views"][0]["depth_scale"], "one scale for all");
        // A camera looks at the cloud.
        let (camera, center) = (&row["camera"], &data["cloud"]["center"]);
        let ahead: f64 = (0..3)
            .map(|k| {
                let to = center[k].as_f64().unwrap() - camera["center"][k].as_f64().unwrap();
                to * camera["axis"][k].as_f64().unwrap()
            })
            .sum();
        assert!(ahead > 1.0, "{ahead}");
    }
    // The same page for any number of threads, and without the run's summary almost the same.
    let text = scratch.read("out/report.html");
    scratch.semvs("report out -o other/b.html --max-threads 1").ok();
    assert!(text == scratch.read("other/b.html"));
    std::fs::remove_file(scratch.path("out/a.json")).unwrap();
    scratch.semvs(&format!("report out -o c.html --points 1000 {LABELS}")).ok();
    let bare = Page::read(&scratch, "c.html");
    assert!(bare.points > 900 && bare.points <= 1000, "{}", bare.points);
    assert_eq!(
        (bare.data["points"].as_u64(), bare.data["program"].as_str()),
        (Some(cloud.len() as u64), Some(""))
    );
    assert_eq!(bare.data["views"][1]["layers"], page.data["views"][1]["layers"]);
    assert!(page.text.len() < 3_000_000, "{}", page.text.len());
}

#[test]
fn a_run_writes_its_page_itself() {
    let scratch = Scratch::facade6();
    let quick = "--number-views 2 --iters 1 --geometric-iters 0 --number-views-fuse 2";
    let words =
        format!("densify scene.mvs -o out/a.ply -w out {SMALL} {quick} {LABELS} --exclude-classes sky");
    let out = scratch.semvs(&format!("{words} --report-html out/page.html --report out/r.json")).ok();
    assert!(out.stdout.contains("out/page.html: 6 views"), "{}", out.stdout);
    let page = Page::read(&scratch, "out/page.html");
    assert_eq!(page.data["program"], "semvs densify");
    assert_eq!(page.data["version"], semvs::internals::report::build());
    assert_eq!(page.layers(3)[..5], ["image", "depth", "normal", "confidence", "labels"]);
    assert_ne!(page.data["peak_memory"].is_null(), cfg!(target_os = "linux"));
    let json: Value = serde_json::from_slice(&scratch.read("out/r.json")).unwrap();
    let written = json["outputs"].as_array().unwrap();
    assert!(written.iter().any(|o| o["path"] == "out/page.html"), "{written:?}");
    // What is found later is the same.
    scratch.semvs("report out -o later.html").ok();
    let later = Page::read(&scratch, "later.html");
    for part in ["views", "edges", "classes", "options", "cloud", "warnings"] {
        assert_eq!(later.data[part], page.data[part], "{part}");
    }
    // Depth maps alone, and a cloud that the viewer cannot take, have pages too.
    scratch.semvs(&format!("{words} --fusion-mode 1 --report-html maps.html")).ok();
    let maps = Page::read(&scratch, "maps.html");
    assert!(maps.data["cloud"].is_null() && maps.layers(0).contains(&"depth"));
    let words = words.replace("a.ply", "a.laz");
    let out = scratch.semvs(&format!("{words} --report-html laz.html")).ok();
    assert!(out.stderr.contains("a.laz: the 3D view takes PLY clouds only"), "{}", out.stderr);
    assert!(Page::read(&scratch, "laz.html").data["cloud"].is_null());
}

#[test]
fn what_a_page_cannot_show_is_said_and_left_out() {
    let scratch = fused();
    scratch.edit("out/depth0002.dmap", |bytes| bytes.truncate(bytes.len() / 2));
    std::fs::remove_file(scratch.path("images/0006.jpg")).unwrap();
    std::fs::remove_dir_all(scratch.path("labels")).unwrap();
    let out = scratch.semvs("report out").ok();
    assert!(out.stderr.contains("depth0002.dmap"), "{}", out.stderr);
    let page = Page::read(&scratch, "out/report.html");
    assert_eq!(page.layers(2), ["image"]);
    assert_eq!(page.layers(0), ["image", "depth", "normal", "confidence"]);
    assert!(!page.layers(3).contains(&"image"));
    let warnings = page.data["warnings"].as_array().unwrap();
    for needle in ["depth0002.dmap", "0006.jpg"] {
        assert!(warnings.iter().any(|w| w.as_str().unwrap().contains(needle)), "{warnings:?}");
    }
}

#[test]
fn pages_that_cannot_be_are_refused_in_one_line() {
    let scratch = fused();
    let report = |words: &str| scratch.semvs(&format!("report {words}"));
    report("nothing").fails_naming(&["nothing", "no such file or folder"]);
    report("labels").fails_naming(&["labels", "no scene (.mvs)", "--scene"]);
    report("out -o out/a.ply").fails_naming(&["out/a.ply", ".html"]);
    report("out --points 0").fails_naming(&["--points"]);
    report("out --points 3000000").fails_naming(&["--points", "2000000"]);
    report("out --cloud scene.mvs").fails_naming(&["scene.mvs"]);
    report("out -o out/a.mvs/x.html").fails_naming(&["out/a.mvs", "in the way"]);
    let densify = |words: &str| scratch.semvs(&format!("densify scene.mvs -o x.ply {words}"));
    densify("--report-html x.ply").fails_naming(&["x.ply", ".html"]);
    densify("--report-html p.html --report p.html").fails_naming(&["p.html", "--report"]);
    scratch.write("p.html", "a diary");
    densify("--report-html p.html").fails_naming(&["p.html", "no report"]);
    assert!(!scratch.has("out/report.html") && !scratch.has("x.ply"));
}

#[test]
fn depth_maps_become_pictures_on_one_scale() {
    let scratch = Scratch::facade6();
    scratch.add_maps("post7", ".");
    let out = scratch.semvs(&format!("preview . -o p {LABELS}")).ok();
    assert_eq!(out.stdout.lines().count(), 6 * 4 + 1 + 1, "{}", out.stdout);
    let size = |name: &str| image::image_dimensions(scratch.path(name)).unwrap();
    for what in ["depth", "normal", "confidence", "labels"] {
        assert_eq!(size(&format!("p/depth0005.{what}.png")), (200, 150));
    }
    assert!(scratch.has("p/depth-scale.png"));
    // A scale of its own looks different; the common one, given, looks the same.
    scratch.semvs("preview depth0005.dmap -o own").ok();
    assert!(!scratch.has("own/depth0005.labels.png"));
    assert_ne!(scratch.read("own/depth0005.depth.png"), scratch.read("p/depth0005.depth.png"));
    let last = out.stdout.lines().last().unwrap();
    let numbers: Vec<&str> = last.split_whitespace().filter(|word| word.parse::<f32>().is_ok()).collect();
    let range = numbers.join(",");
    scratch.semvs(&format!("preview depth0005.dmap -o given --depth-range {range} --max-threads 1")).ok();
    assert_eq!(scratch.read("given/depth0005.depth.png"), scratch.read("p/depth0005.depth.png"));
    assert_eq!(scratch.read("own/depth0005.normal.png"), scratch.read("p/depth0005.normal.png"));
    // Beside the depth maps if nothing else is said.
    scratch.semvs("preview depth0001.dmap").ok();
    assert!(scratch.has("depth0001.depth.png"));
}

#[test]
fn pictures_that_cannot_be_are_refused_in_one_line() {
    let scratch = Scratch::facade6();
    let preview = |words: &str| scratch.semvs(&format!("preview {words}"));
    preview("images").fails_naming(&["images", "no depth map"]);
    preview("nothing.dmap").fails_naming(&["nothing.dmap"]);
    preview("scene.mvs").fails_naming(&["scene.mvs"]);
    scratch.add_maps("raw", ".");
    preview(". --depth-range 3").fails_naming(&["--depth-range"]);
    preview(". --depth-range 5,3").fails_naming(&["--depth-range", "smaller first"]);
    preview(". --label-path images").fails_naming(&["label"]);
    preview("depth0000.dmap -o scene.mvs").fails_naming(&["scene.mvs", "in the way"]);
}
