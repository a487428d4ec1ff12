//! `semvs compare`: what it reports, limits, exit codes.

use crate::common::{self, Outcome, Scratch, facade6};
use serde_json::Value;

fn openmvs(path: &str) -> String {
    facade6().join("openmvs-2.3.0").join(path).display().to_string()
}

fn compare(scratch: &Scratch, a: &str, b: &str, more: &[&str]) -> Outcome {
    let mut words = vec!["compare", a, b];
    words.extend(more);
    scratch.run(common::SEMVS, &words)
}

/// The JSON report.
fn json(scratch: &Scratch, a: &str, b: &str, more: &[&str]) -> Value {
    let words: Vec<&str> = more.iter().copied().chain(["--json"]).collect();
    serde_json::from_str(&compare(scratch, a, b, &words).ok().stdout).unwrap()
}

/// Asserts that the two could not be compared, with one error line that holds `needle`.
#[track_caller]
fn cannot(outcome: &Outcome, needle: &str) {
    assert_eq!(outcome.code, Some(2), "{outcome:?}");
    let errors: Vec<&str> = outcome.stderr.lines().filter(|l| l.starts_with("error: ")).collect();
    assert!(errors.len() == 1 && errors[0].contains(needle), "{needle:?} not in {}", outcome.stderr);
    assert_eq!(outcome.stdout, "");
}

#[test]
fn folders_of_depth_maps_are_paired_by_name() {
    let scratch = Scratch::new();
    scratch.add_maps("post7", "maps");
    std::fs::remove_file(scratch.path("maps/depth0003.dmap")).unwrap();
    std::fs::copy(scratch.path("maps/depth0000.dmap"), scratch.path("maps/extra.dmap")).unwrap();
    let report = json(&scratch, "maps", &openmvs("post7"), &[]);
    assert_eq!((&report["schema"], &report["kind"]), (&1.into(), &"depth-maps".into()));
    let figures = &report["figures"];
    let counts = ["maps.both", "maps.only_a", "maps.only_b"].map(|name| figures[name].as_u64().unwrap());
    assert_eq!(counts, [5, 1, 1]);
    assert_eq!(report["notes"][0], "only in A: extra.dmap");
    assert_eq!(report["notes"][1], "only in B: depth0003.dmap");
    for part in report["parts"].as_array().unwrap() {
        assert_eq!((&part["figures"]["depth.max"], &part["figures"]["valid.iou"]), (&0.into(), &1.into()));
        assert_eq!(part["first"], Value::Null);
    }
    let text = compare(&scratch, "maps", &openmvs("post7"), &[]).ok().stdout;
    assert!(text.contains("depth0005.dmap") && text.contains("no element differs"), "{text}");
}

#[test]
fn the_first_differing_pixel_of_two_maps_is_named() {
    let scratch = Scratch::new();
    scratch.add_maps("raw", "maps");
    // The last depth of the map: behind it are normals and confidences.
    let pixels = 200 * 150;
    scratch.edit("maps/depth0000.dmap", |bytes| {
        let end = bytes.len() - pixels * 16;
        bytes[end - 4..end].copy_from_slice(&77.5f32.to_le_bytes());
    });
    let report = json(&scratch, "maps/depth0000.dmap", &openmvs("raw/depth0000.dmap.zst"), &[]);
    let part = &report["parts"][0];
    assert_eq!(part["name"], "depth0000.dmap");
    let first = &part["first"];
    assert_eq!((&first["place"], &first["attribute"]), (&"pixel (199, 149)".into(), &"depth".into()));
    assert_eq!(first["a"], "77.5");
    assert!(
        part["figures"]["depth.p9999"].as_f64().unwrap() <= part["figures"]["depth.max"].as_f64().unwrap()
    );
}

#[test]
fn filtered_maps_differ_from_raw_ones_by_what_the_filter_does() {
    let report = json(&Scratch::new(), &openmvs("post7"), &openmvs("raw"), &[]);
    let figures = &report["parts"][0]["figures"];
    let number = |name: &str| figures[name].as_f64().unwrap();
    assert!(number("valid.a") < number("valid.b") && number("valid.iou") < 0.95);
    assert!(number("depth.within_1e-2") > 0.98 && number("depth.within_1e-6") < 0.01);
    assert_eq!((number("header.differing"), number("camera.k")), (0.0, 0.0));
}

#[test]
fn scenes_of_any_kind_are_compared() {
    let scratch = Scratch::new();
    let (zlib, zstd) = (openmvs("archive2/scene_dense.mvs"), openmvs("archive3/scene_dense.mvs"));
    let text = compare(&scratch, &zlib, &zstd, &[]).ok().stdout;
    assert!(text.contains("no element differs"), "{text}");
    let interface = openmvs("post7/scene_dense.mvs");
    let report = json(&scratch, &interface, &zlib, &[]);
    let figures = &report["figures"];
    assert_eq!(figures["neighbors.same_order"], 1);
    assert!(figures["camera.k.max"].as_f64().unwrap() < 1e-6, "{figures}");
    // The project holds the dense cloud, the interface archive the sparse one.
    assert_eq!(figures["points.b"], 24171);
    let sparse = facade6().join("scene.mvs").display().to_string();
    let report = json(&scratch, &sparse, &interface, &[]);
    let figures = &report["figures"];
    assert_eq!((&figures["points.position.max"], &figures["points.views_same"]), (&0.into(), &1.into()));
    assert_eq!((&figures["neighbors.lists"], &figures["neighbors.same_order"]), (&6.into(), &0.into()));
    assert_eq!(report["first"]["place"], "image 0");
}

#[test]
fn clouds_are_compared_point_by_point_or_by_nearest_points() {
    let scratch = Scratch::new();
    let dense = openmvs("post7/scene_dense.ply.zst");
    let scene = openmvs("post7/scene_dense.mvs");
    let report = json(&scratch, &dense, &dense, &["--scene", &scene]);
    let figures = &report["figures"];
    assert_eq!((&figures["order.same"], &figures["position_of_depth.max"]), (&1.into(), &0.into()));
    assert_eq!((&figures["views.same"], &figures["color.compared"]), (&1.into(), &24171.into()));
    let other = json(&scratch, &openmvs("fuse2/scene_dense.ply.zst"), &dense, &[]);
    assert_eq!(
        (&other["figures"]["points.a"], &other["figures"]["position.max"]),
        (&27651.into(), &Value::Null)
    );
    assert!(other["figures"]["nearest.b_to_a.p50"].as_f64().unwrap() < 1e-3);
    assert_eq!(other["first"]["attribute"], "points");
}

#[test]
fn limits_decide_the_exit_code() {
    let scratch = Scratch::new();
    let (a, b) = (openmvs("post7"), openmvs("raw"));
    let with = |limits: &str| {
        scratch.write("expect.toml", format!("[limits]\n{limits}\n"));
        compare(&scratch, &a, &b, &["--expect", "expect.toml"])
    };
    let within = with("depth.within_1e-2 = { min = 0.98 }\nmaps.both = { min = 6, max = 6 }").ok();
    assert!(within.stdout.ends_with("within all limits\n"), "{}", within.stdout);
    let outside = with("maps.both = { max = 5 }\nvalid.iou = { min = 0.9999 }");
    assert_eq!((outside.code, outside.stderr.as_str()), (Some(1), ""));
    let lines: Vec<&str> = outside.stdout.lines().filter(|l| l.starts_with("outside: ")).collect();
    assert_eq!((lines.len(), lines[0]), (7, "outside: maps.both is 6, must be at most 5"));
    assert!(lines[6].starts_with("outside: depth0005.dmap: valid.iou is 0."), "{}", lines[6]);
    let report = compare(&scratch, &a, &b, &["--expect", "expect.toml", "--json"]);
    let report: Value = serde_json::from_str(&report.stdout).unwrap();
    assert_eq!((&report["within"], &report["violations"][0]["value"]), (&false.into(), &6.0.into()));

    cannot(&with("valid.iuo = { min = 1 }"), "did you mean valid.iou?");
    cannot(&with("points.a = { min = 1 }"), "no such figure for depth-maps");
    cannot(&with("valid.iou = 1"), "valid.iou");
    cannot(&with(""), "no limits");
    cannot(&compare(&scratch, &a, &b, &["--expect", "none.toml"]), "none.toml");
    scratch.write("expect.toml", "kind = 'clouds'\n[limits]\npoints.a = { min = 1 }\n");
    cannot(&compare(&scratch, &a, &b, &["--expect", "expect.toml"]), "it is for clouds");
}

#[test]
fn what_cannot_be_compared_exits_with_two() {
    let scratch = Scratch::new();
    let (maps, map) = (openmvs("raw"), openmvs("raw/depth0000.dmap.zst"));
    let (scene, cloud) = (openmvs("post7/scene_dense.mvs"), openmvs("post7/scene_dense.ply.zst"));
    cannot(&compare(&scratch, &maps, &map, &[]), "different kinds");
    cannot(&compare(&scratch, &scene, &cloud, &[]), "different kinds");
    cannot(&compare(&scratch, "missing.ply", &cloud, &[]), "missing.ply");
    cannot(&compare(&scratch, &map, &map, &["--scene", &scene]), "--scene");
    cannot(&compare(&scratch, ".", &maps, &[]), "no depth map");
    scratch.write("other.dmap", b"DR");
    cannot(&compare(&scratch, ".", &maps, &[]), "none of its depth maps");
    cannot(&compare(&scratch, "other.dmap", &map, &[]), "other.dmap");
    scratch.write("text.txt", "text");
    cannot(&compare(&scratch, "text.txt", &map, &[]), "text.txt");
    cannot(&compare(&scratch, "a", "b", &["--expectation"]), "--expect");
    cannot(&scratch.semvs("compare"), "required");
}

/// The page that explains the command.
fn page() -> String {
    std::fs::read_to_string(page_path()).unwrap()
}

fn page_path() -> std::path::PathBuf {
    std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/regression-testing.md")
}

#[test]
fn every_figure_is_explained() {
    use semvs::internals::evaluate::{CLOUD_FIGURES, FOLDER_FIGURES, MAP_FIGURES, SCENE_FIGURES};
    let page = page();
    let (_, figures) = page.split_once("## Figures").unwrap();
    for (title, catalog) in [
        ("Depth maps, once", FOLDER_FIGURES),
        ("Depth maps, for every pair", MAP_FIGURES),
        ("Clouds:", CLOUD_FIGURES),
        ("Scenes,", SCENE_FIGURES),
    ] {
        let (_, table) = figures.split_once(&format!("\n{title}")).unwrap();
        let rows: Vec<&str> =
            table.lines().skip_while(|l| !l.starts_with('|')).take_while(|l| l.starts_with('|')).collect();
        for (name, _) in catalog {
            assert!(rows.iter().any(|row| row.contains(&format!("`{name}`"))), "{title} {name}");
        }
    }
}

/// Runs a command of the page: the two programs, and the few words of a shell that it uses.
fn shell(scratch: &Scratch, command: &str, last: &mut Option<i32>) -> String {
    let words: Vec<&str> = command.split_whitespace().collect();
    match words.as_slice() {
        ["mkdir", "-p", folder] => std::fs::create_dir_all(scratch.path(folder)).unwrap(),
        ["zstd", "-dq", "--output-dir-flat", to, pattern] => {
            let folder = scratch.path(pattern.strip_suffix("/*.dmap.zst").unwrap());
            for entry in std::fs::read_dir(folder).unwrap() {
                let path = entry.unwrap().path();
                let name = path.file_name().unwrap().to_string_lossy().into_owned();
                if let Some(name) = name.strip_suffix(".zst").filter(|n| n.ends_with(".dmap")) {
                    let bytes = zstd::decode_all(std::fs::File::open(&path).unwrap()).unwrap();
                    scratch.write(&format!("{to}/{name}"), bytes);
                }
            }
        }
        ["echo", "$?"] => return format!("{}\n", last.unwrap()),
        [program @ ("semvs" | "DensifyPointCloud"), args @ ..] => {
            let program = if *program == "semvs" { common::SEMVS } else { common::DENSIFY };
            let outcome = scratch.run(program, args);
            assert_eq!(outcome.stderr, "", "{command}");
            *last = outcome.code;
            return outcome.stdout;
        }
        _ => panic!("{command}: not a command of the page"),
    }
    String::new()
}

/// Whether two lines say the same: equal words, and numbers that differ by at most the share `most` (libraries and
/// processors differ in the last bits, of which small differences are made).
fn same_line(a: &str, b: &str, most: f64) -> bool {
    let same = |(a, b): (&str, &str)| {
        let numbers = a.trim_matches(',').parse::<f64>().ok().zip(b.trim_matches(',').parse::<f64>().ok());
        a == b || numbers.is_some_and(|(a, b)| (a - b).abs() <= most * a.abs().max(b.abs()) + 1e-6)
    };
    a.split_whitespace().count() == b.split_whitespace().count()
        && a.split_whitespace().zip(b.split_whitespace()).all(same)
}

/// Every command of the page runs and prints what the page shows; `...` stands for any output.
/// With `UPDATE_GOLDEN` set, the page gets what is printed.
#[cfg(unix)]
#[test]
fn the_commands_of_the_page_print_what_it_shows() {
    let scratch = Scratch::new();
    std::os::unix::fs::symlink(common::fixtures(), scratch.path("compat-fixtures")).unwrap();
    let page = page();
    let (mut new, mut last, mut commands) = (String::new(), None, 0);
    let mut lines = page.lines().peekable();
    let mut in_block = false;
    while let Some(line) = lines.next() {
        new.push_str(line);
        new.push('\n');
        in_block = line == "```console" || in_block && line != "```";
        let Some(command) = line.strip_prefix("$ ").filter(|_| in_block) else { continue };
        let printed = shell(&scratch, command, &mut last);
        commands += 1;
        let mut shown = Vec::new();
        while let Some(line) = lines.next_if(|line| !line.starts_with("$ ") && *line != "```") {
            shown.push(line);
        }
        if shown == ["..."] {
            assert_eq!(last, Some(0), "{command}");
            new.push_str("...\n");
            continue;
        }
        new.push_str(&printed);
        // What estimation gives may change, and the page need not follow every time.
        let most = if command.contains("out/estimated") { 1.0 } else { 0.02 };
        let same = printed.lines().count() == shown.len()
            && printed.lines().zip(&shown).all(|(printed, shown)| same_line(printed, shown, most));
        if std::env::var_os("UPDATE_GOLDEN").is_none() {
            assert!(same, "{command}\nprints\n{printed}\nUPDATE_GOLDEN=1 accepts it");
        }
    }
    assert_eq!(commands, 12);
    if std::env::var_os("UPDATE_GOLDEN").is_some() {
        std::fs::write(page_path(), new).unwrap();
    }
}

/// The data of a page.
#[track_caller]
fn data_of(scratch: &Scratch, name: &str) -> (String, Value) {
    let text = String::from_utf8(scratch.read(name)).unwrap();
    let data = text.split_once("id=\"data\">").unwrap().1.split_once("</script>").unwrap().0;
    let data = serde_json::from_str(data).unwrap();
    (text, data)
}

#[test]
fn a_page_shows_where_depth_maps_differ() {
    let scratch = Scratch::new();
    scratch.write("expect.toml", "[limits]\nvalid.iou = { min = 0.93 }\nmaps.both = { max = 6 }\n");
    let (a, b) = (openmvs("post7"), openmvs("raw"));
    let out = compare(&scratch, &a, &b, &["--expect", "expect.toml", "--html", "d/page.html"]);
    assert_eq!(out.code, Some(1), "{out:?}");
    assert!(out.stdout.contains("outside the limits\n\nd/page.html: "), "{}", out.stdout);
    let (text, data) = data_of(&scratch, "d/page.html");
    assert!(text.len() < 1_500_000, "{}", text.len());
    let report = compare(&scratch, &a, &b, &["--expect", "expect.toml", "--json"]);
    let report: Value = serde_json::from_str(&report.stdout).unwrap();
    // Every limit has its row, and those that fail are those of the report.
    let checks = data["checks"].as_array().unwrap();
    let failed: Vec<&Value> = checks.iter().filter(|check| check["holds"] == false).collect();
    let violations = report["violations"].as_array().unwrap();
    assert!(checks.len() == 7 && !failed.is_empty() && failed.len() < 7, "{checks:?}");
    assert_eq!(failed.len(), violations.len());
    for (check, violation) in failed.iter().zip(violations) {
        assert_eq!((&check["part"], &check["value"]), (&violation["part"], &violation["value"]));
    }
    let parts = data["parts"].as_array().unwrap();
    assert_eq!(parts.len(), 6);
    for (part, reported) in parts.iter().zip(report["parts"].as_array().unwrap()) {
        assert_eq!(part["first"], reported["first"]);
        let layers = part["layers"].as_object().unwrap();
        let names: Vec<&str> = layers.keys().map(String::as_str).collect();
        assert_eq!(names, ["a", "b", "depth", "presence", "normal", "confidence"]);
        let depth = &part["figures"]["differences"][0];
        assert_eq!((&depth["name"], &depth["p99"]), (&"depth".into(), &reported["figures"]["depth.p99"]));
        let bars = depth["sizes"]["bars"].as_array().unwrap();
        let counted: u64 = bars.iter().map(|bar| bar.as_u64().unwrap()).sum();
        assert_eq!(counted + depth["equal"].as_u64().unwrap(), depth["compared"].as_u64().unwrap());
    }
    let scales = &data["scales"];
    assert!((0.001..0.02).contains(&scales["difference"].as_f64().unwrap()), "{scales}");
    assert!(scales["depth"][0].as_f64().unwrap() > 1.0);
    // The picture of a map is that of its pixels: those that the filter has dropped are in B alone.
    let presence = decoded(&parts[0]["layers"]["presence"]);
    assert_eq!(presence.dimensions(), (200, 150));
    let count = |color: [u8; 3]| presence.pixels().filter(|pixel| pixel.0 == color).count() as u64;
    let single = parts[0]["figures"]["single"].as_array().unwrap();
    let figure = |name: &str| single.iter().find(|row| row[0] == name).unwrap()[1].as_f64().unwrap() as u64;
    assert_eq!(count([0, 114, 178]), figure("valid.b") - figure("valid.both"));
    assert_eq!(count([247, 247, 247]), figure("valid.both"));
    // Equal maps have white pictures and no scale.
    compare(&scratch, &a, &a, &["--html", "same.html"]).ok();
    let (_, same) = data_of(&scratch, "same.html");
    assert_eq!((&same["scales"]["difference"], &same["checks"]), (&0.0.into(), &Value::Null));
    let colors: std::collections::BTreeSet<[u8; 3]> =
        decoded(&same["parts"][0]["layers"]["depth"]).pixels().map(|pixel| pixel.0).collect();
    assert_eq!(colors.into_iter().collect::<Vec<_>>(), [[150, 154, 160], [247, 247, 247]]);
}

/// The picture of a `data:` address.
fn decoded(address: &Value) -> image::RgbImage {
    use base64::Engine as _;
    let (_, bytes) = address.as_str().unwrap().split_once("base64,").unwrap();
    let bytes = base64::engine::general_purpose::STANDARD.decode(bytes).unwrap();
    image::load_from_memory(&bytes).unwrap().into_rgb8()
}

#[test]
fn pages_about_clouds_and_scenes_have_what_there_is() {
    let scratch = Scratch::new();
    let (a, b) = (openmvs("fuse2/scene_dense.ply.zst"), openmvs("post7/scene_dense.ply.zst"));
    let out = compare(&scratch, &a, &b, &["--html", "clouds.html", "--json"]).ok();
    let report: Value = serde_json::from_str(&out.stdout).unwrap();
    assert_eq!(report["page"], "clouds.html");
    let (text, data) = data_of(&scratch, "clouds.html");
    let classes = data["cloud"]["classes"].as_array().unwrap();
    let counts: Vec<u64> = classes.iter().map(|class| class["points"].as_u64().unwrap()).collect();
    assert!((27_000..=27_651).contains(&counts[0]) && (23_700..=24_171).contains(&counts[1]), "{counts:?}");
    assert!(data["scales"]["distance"][1].as_f64().unwrap() > 0.0 && text.len() < 2_000_000);
    let names: Vec<&str> = data["figures"]["differences"]
        .as_array()
        .unwrap()
        .iter()
        .map(|differences| differences["name"].as_str().unwrap())
        .collect();
    assert_eq!(names, ["nearest.a_to_b", "nearest.b_to_a"]);
    let (a, b) = (openmvs("post7/scene_dense.mvs"), openmvs("archive2/scene_dense.mvs"));
    compare(&scratch, &a, &b, &["--html", "scenes.html"]).ok();
    let (_, data) = data_of(&scratch, "scenes.html");
    assert_eq!((&data["kind"], &data["cloud"]), (&"scenes".into(), &Value::Null));
    assert!(data["first"]["place"].is_string(), "{}", data["first"]);
    // A page never takes the place of a result, and the results are not looked at before that is known.
    cannot(&compare(&scratch, &a, &b, &["--html", "x.mvs"]), "end the name in .html");
    scratch.write("file", "");
    cannot(&compare(&scratch, &a, &b, &["--html", "file/x.html"]), "file");
}
