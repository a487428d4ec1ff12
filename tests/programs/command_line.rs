//! What the programs accept, refuse and say: spellings, names of outputs, exit codes, help.

use crate::common::{self, DENSIFY, FUSE_ONLY, SEMVS, SMALL, Scratch};
use semvs_formats::mvs::{ArchiveKind, Container, Image, SceneFile};
use std::path::Path;

/// Points of OpenMVS's own fusion of the same maps.
const POST7_POINTS: u64 = 24_171;

fn points_in(scratch: &Scratch, cloud: &str) -> u64 {
    let bytes = scratch.read(cloud);
    let end = bytes.windows(10).position(|w| w == b"end_header").unwrap();
    let header = String::from_utf8_lossy(&bytes[..end]).into_owned();
    header.lines().find_map(|l| l.strip_prefix("element vertex ")).unwrap().trim().parse().unwrap()
}

/// Compares `text` with the file of that name in `tests/golden`; with `UPDATE_GOLDEN` set, writes it.
#[track_caller]
fn golden(name: &str, text: &str) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden").join(name);
    if std::env::var_os("UPDATE_GOLDEN").is_some() {
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(&path, text).unwrap();
    }
    let expected = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(text == expected, "{name} has changed; UPDATE_GOLDEN=1 accepts it:\n{text}");
}

#[test]
fn help_is_as_agreed() {
    let scratch = Scratch::new();
    golden("semvs.txt", &scratch.semvs("--help").ok().stdout);
    for command in [
        "densify",
        "fuse",
        "convert",
        "import",
        "export",
        "inspect",
        "evaluate",
        "compare",
        "labels",
        "report",
        "preview",
        "demo",
        "completions",
        "man",
    ] {
        let help = scratch.semvs(&format!("{command} --help")).ok().stdout;
        golden(&format!("semvs-{command}.txt"), &help);
    }
    golden("DensifyPointCloud.txt", &scratch.densify_point_cloud("--help").options());
}

impl common::Outcome {
    /// Standard output from the option list on.
    fn options(&self) -> String {
        let start = self.stdout.find("Available options").unwrap();
        self.stdout[start..].to_owned()
    }
}

/// Names of the instruction sets, and whether this processor has them.
fn cpu_levels() -> [(&'static str, bool); 3] {
    [
        semvs::internals::stereo::CpuLevel::Scalar,
        semvs::internals::stereo::CpuLevel::Avx2,
        semvs::internals::stereo::CpuLevel::Avx512,
    ]
    .map(|level| (level.name(), level.is_supported()))
}

#[test]
fn version_is_a_result_and_tells_the_kernels() {
    let scratch = Scratch::new();
    let build = semvs::internals::report::build();
    assert!(build.starts_with(env!("CARGO_PKG_VERSION")), "{build}");
    let version = |level: &str| format!("semvs {build}\nkernels: {level}\n");
    let best = semvs::internals::stereo::CpuLevel::detect().name();
    assert_eq!(scratch.semvs("--version").ok().stdout, version(best));
    assert_eq!(scratch.run_with(SEMVS, &["-V"], &[("SEMVS_CPU", "")]).ok().stdout, version(best));
    for (level, is_supported) in cpu_levels() {
        let out = scratch.run_with(SEMVS, &["--version"], &[("SEMVS_CPU", level)]);
        match is_supported {
            true => assert_eq!(out.ok().stdout, version(level)),
            false => drop(out.fails_naming(&["SEMVS_CPU", level, "processor"])),
        }
    }
}

#[test]
fn release_builds_tell_the_commit_of_the_working_tree() {
    if cfg!(debug_assertions) {
        println!("skipped: not a release build");
        return;
    }
    let git = std::process::Command::new("git")
        .args(["rev-parse", "--show-toplevel", "HEAD"])
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output();
    let told = git.map(|output| String::from_utf8_lossy(&output.stdout).into_owned()).unwrap_or_default();
    match told.lines().collect::<Vec<_>>()[..] {
        [top, head] if Path::new(top) == Path::new(env!("CARGO_MANIFEST_DIR")) => {
            assert_eq!(semvs::internals::report::commit(), Some(&head[..12]));
        }
        _ => println!("skipped: not in a working tree of git"),
    }
}

#[test]
fn the_drop_in_tells_its_version_and_leaves_no_log() {
    let scratch = Scratch::new();
    let out = scratch.densify_point_cloud("--version").ok();
    let best = semvs::internals::stereo::CpuLevel::detect().name();
    let expected = format!(
        "semvs {}, DensifyPointCloud as of OpenMVS 2.3.0\nkernels: {best}\n",
        semvs::internals::report::build()
    );
    assert_eq!(out.stdout, expected);
    let out = scratch.run_with(DENSIFY, &["--version"], &[("SEMVS_CPU", "sse9")]);
    out.fails_naming(&["SEMVS_CPU", "sse9"]);
    assert_eq!(scratch.files(), Vec::<String>::new());
    // What is short for an option of OpenMVS stays so.
    scratch.densify_point_cloud("--ver 1 nothing.mvs").fails_naming(&["nothing.mvs"]);
}

#[test]
fn kernels_are_chosen_by_a_variable_and_told_in_reports() {
    let scratch = Scratch::facade6();
    let words = format!(
        "densify scene.mvs {SMALL} -v --number-views 2 --iters 1 --geometric-iters 0 --report r.json"
    );
    let words: Vec<&str> = words.split_whitespace().collect();
    let out = scratch.run_with(SEMVS, &words, &[("SEMVS_CPU", "scalar")]).ok();
    assert!(out.stderr.contains("with the scalar kernels"), "{}", out.stderr);
    let report: serde_json::Value = serde_json::from_slice(&scratch.read("r.json")).unwrap();
    assert_eq!(report["cpu_level"], "scalar");
    assert_eq!(report["version"], semvs::internals::report::VERSION);
    assert_eq!(report["commit"].as_str(), semvs::internals::report::commit());
    let best = semvs::internals::stereo::CpuLevel::detect().name();
    scratch.semvs(&words.join(" ")).ok();
    let report: serde_json::Value = serde_json::from_slice(&scratch.read("r.json")).unwrap();
    assert_eq!(report["cpu_level"], best);
    // Nothing is estimated, so no kernels.
    scratch.semvs("fuse scene.mvs --depth-maps . -o f.ply --report r.json").ok();
    let report: serde_json::Value = serde_json::from_slice(&scratch.read("r.json")).unwrap();
    assert!(report["cpu_level"].is_null());
}

#[test]
fn unknown_kernels_are_one_line_before_any_work() {
    let scratch = Scratch::facade6();
    let before = scratch.files();
    let unknown = [("SEMVS_CPU", "sse9")];
    let needles = ["SEMVS_CPU", "sse9", "scalar", "avx2", "avx512"];
    scratch.run_with(SEMVS, &["--version"], &unknown).fails_naming(&needles);
    scratch.run_with(SEMVS, &["densify", "scene.mvs"], &unknown).fails_naming(&needles);
    assert_eq!(scratch.files(), before);
    scratch.run_with(DENSIFY, &["scene.mvs"], &unknown).fails_naming(&needles);
    let new: Vec<_> = scratch.files().into_iter().filter(|file| !before.contains(file)).collect();
    assert!(new.iter().all(|file| file.ends_with(".log")), "{new:?}");
}

#[test]
fn mistakes_on_the_command_line_are_one_line_and_exit_code_1() {
    let scratch = Scratch::new();
    scratch.write("s.mvs", "");
    for (words, needle) in [
        ("densify", "SCENE.mvs"),
        ("densify s.mvs --nope", "--nope"),
        ("densify s.mvs --iters x", "--iters"),
        ("dense s.mvs", "dense"),
        ("evaluate a.ply --thresholds 1", "--truth"),
        ("densify s.mvs -o cloud.xyz", ".laz"),
        ("densify s.mvs -o cloud.las --offset 1,2", "--offset"),
        ("densify s.mvs --classes building", "--label-path"),
        ("densify s.mvs --split-by-class", "--split-by-class"),
        ("densify s.mvs --estimate-colors 3", "--estimate-colors"),
        ("densify s.mvs --estimate-roi 3", "--estimate-roi"),
        ("densify s.mvs --postprocess-dmaps 8", "--postprocess-dmaps"),
        ("densify s.mvs --fusion-mode -1", "--fusion-mode"),
        ("densify s.mvs --tower-mode -5", "--tower-mode"),
        ("densify s.mvs --ignore-mask-label 70000", "--ignore-mask-label"),
    ] {
        scratch.semvs(words).fails_naming(&[needle]);
    }
    assert_eq!(scratch.files(), ["s.mvs"]);
    assert_eq!(scratch.semvs("").code, Some(1));
}

#[test]
fn the_drop_in_without_input_lists_its_options_or_fails() {
    let scratch = Scratch::new();
    assert_eq!(scratch.densify_point_cloud("--help").code, Some(1));
    scratch.densify_point_cloud("").fails_naming(&["input file"]);
    scratch.densify_point_cloud("--nope 1").fails_naming(&["unrecognised option '--nope'"]);
    scratch.densify_point_cloud("a.mvs b.mvs").fails_naming(&["'--input-file'", "more than once"]);
    scratch.densify_point_cloud("a.mvs --number 3").fails_naming(&["'--number'", "ambiguous"]);
    scratch.densify_point_cloud("missing.mvs").fails_naming(&["missing.mvs"]);
}

#[test]
fn help_with_an_input_still_runs() {
    let scratch = Scratch::with_maps();
    let out = scratch.densify_point_cloud(&format!("scene.mvs -h {FUSE_ONLY}")).ok();
    assert!(out.stdout.contains("Available options"));
    assert_eq!(points_in(&scratch, "scene_dense.ply"), POST7_POINTS);
}

#[test]
fn what_is_not_available_is_refused_by_name_before_work() {
    let scratch = Scratch::facade6();
    for words in [
        "--archive-type 7",
        "--fusion-mode -2",
        "--fusion-mode -1",
        "--sample-mesh -100",
        "--mesh-file m.ply",
        "--export-depth-maps-name x",
    ] {
        let option = words.split(' ').next().unwrap();
        let out = scratch.densify_point_cloud(&format!("scene.mvs {words}")).fails_naming(&[option]);
        assert!(out.stdout.contains(&format!("error: {option}")), "{}", out.stdout);
    }
    assert!(!scratch.files().iter().any(|f| f.contains("dense") || f.ends_with(".dmap")));
}

#[test]
fn every_option_of_openmvs_works_in_all_spellings() {
    let scratch = Scratch::with_maps();
    scratch.write("nb.txt", "0 1 2\n");
    scratch.write("my.cfg", "iters = 2\n");
    // Estimation is not needed to see that an option is taken.
    let base = "scene.mvs --fusion-mode 1 --resolution-level 1 --min-resolution 160 --geometric-iters 0";
    let values = [
        ("working-folder", "."),
        ("config-file", "my.cfg"),
        ("archive-type", "3"),
        ("process-priority", "-1"),
        ("max-threads", "3"),
        ("verbosity", "3"),
        ("cuda-device", "-2"),
        ("output-file", "out/dense.mvs"),
        ("view-neighbors-file", "nb.txt"),
        ("max-resolution", "2000"),
        ("sub-resolution-levels", "1"),
        ("number-views", "0"),
        ("number-views-fuse", "2"),
        ("ignore-mask-label", "-1"),
        ("mask-path", "nowhere"),
        ("iters", "2"),
        ("estimate-colors", "1"),
        ("estimate-normals", "0"),
        ("estimate-scale", "0"),
        ("sub-scene-area", "0"),
        ("sample-mesh", "0"),
        ("postprocess-dmaps", "0"),
        ("filter-point-cloud", "20"),
        ("export-number-views", "0"),
        ("roi-border", "-0.5"),
        ("estimate-roi", "1"),
        ("crop-to-roi", "no"),
        ("remove-dmaps", "off"),
        ("tower-mode", "4"),
        ("dense-config-file", "Densify.ini"),
    ];
    for (name, value) in values {
        for words in [format!("--{name} {value}"), format!("--{name}={value}")] {
            scratch.densify_point_cloud(&format!("{base} {words}")).ok();
        }
    }
    for words in ["-w .", "-w.", "-c my.cfg", "-v 1", "-v1", "-o x", "-ox.ply", "--verb 2", "--max-t 1"] {
        scratch.densify_point_cloud(&format!("{base} {words}")).ok();
    }
    scratch.densify_point_cloud(&base.replace("scene.mvs", "-i scene.mvs")).ok();
    scratch.densify_point_cloud(&base.replace("scene.mvs", "--input-file=scene.mvs")).ok();
    assert!(String::from_utf8(scratch.read("Densify.ini")).unwrap().contains("Max Resolution = 3200"));
}

#[test]
fn output_names_are_openmvs_own() {
    for (words, base) in [
        ("", "scene_dense"),
        ("-o dense", "dense"),
        ("-o dense.ply", "dense"),
        ("-o dense.mvs", "dense"),
        ("-o new/folder.x/dense", "new/folder.x/dense"),
    ] {
        let scratch = Scratch::with_maps();
        scratch.densify_point_cloud(&format!("scene.mvs {words} {FUSE_ONLY}")).ok();
        assert_eq!(points_in(&scratch, &format!("{base}.ply")), POST7_POINTS, "{words}");
        assert!(scratch.has(&format!("{base}.mvs")), "{words}");
        let logs = scratch.files().iter().filter(|f| f.starts_with("DensifyPointCloud-")).count();
        assert_eq!(logs, 1);
    }
}

#[test]
fn project_archives_hold_the_dense_cloud_as_openmvs_stores_it() {
    let folder = common::facade6().join("openmvs-2.3.0");
    for (kind, reference) in [(0, "archive3"), (1, "archive3"), (2, "archive2"), (3, "archive3")] {
        let scratch = Scratch::with_maps();
        let out = scratch.densify_point_cloud(&format!("scene.mvs --archive-type {kind} {FUSE_ONLY}")).ok();
        let saved = out.stdout.lines().find(|line| line.contains("Scene saved")).unwrap();
        assert!(!saved.contains("interface"), "{saved}");
        let limits = semvs_formats::Limits::default();
        let ours = SceneFile::read(scratch.path("scene_dense.mvs"), &limits).unwrap();
        let theirs = SceneFile::read(folder.join(reference).join("scene_dense.mvs"), &limits).unwrap();
        assert_eq!(ours.container, Container::Project { kind: ArchiveKind::ALL[kind] });
        let (ours, theirs) = (ours.scene, theirs.scene);
        assert_eq!(ours.platforms.len(), theirs.platforms.len());
        assert_eq!(ours.platforms[0].name, theirs.platforms[0].name);
        assert_eq!(ours.platforms[0].poses, theirs.platforms[0].poses);
        for (a, b) in ours.images.iter().zip(&theirs.images) {
            assert_eq!((&a.name, a.id, a.width, a.height), (&b.name, b.id, b.width, b.height));
            let order = |image: &Image| image.view_scores.iter().map(|s| s.image).collect::<Vec<_>>();
            assert_eq!(order(a), order(b));
        }
        assert_eq!(ours.points.views.images, theirs.points.views.images);
        assert_eq!(ours.points.colors.len(), theirs.points.colors.len());
        let header = scratch.read("scene_dense.ply");
        let header = String::from_utf8_lossy(&header[..400]).into_owned();
        assert!(header.contains("property float32 nx") && !header.contains("list"), "{header}");
    }
}

#[test]
fn opendronemaps_point_filter_can_read_its_layout() {
    let scratch = Scratch::with_maps();
    scratch.densify_point_cloud(&format!("scene.mvs --ply-layout odm {FUSE_ONLY}")).ok();
    let bytes = scratch.read("scene_dense.ply");
    let end = bytes.windows(11).position(|w| w == b"end_header\n").unwrap();
    let header = String::from_utf8_lossy(&bytes[..end]).into_owned();
    let columns = ["float32 x", "float32 y", "float32 z", "uint8 red", "uint8 green", "uint8 blue"];
    let columns = columns.iter().chain(&["float32 nx", "float32 ny", "float32 nz", "uint8 views"]);
    let columns: String = columns.map(|c| format!("property {c}\n")).collect();
    let expected = format!("ply\nformat binary_little_endian 1.0\nelement vertex {POST7_POINTS}\n{columns}");
    assert_eq!(header, expected);
    assert!(bytes[end + 11..].chunks(28).all(|point| point[27] >= 3));
}

#[test]
fn the_working_folder_is_the_base_of_relative_paths() {
    let scratch = Scratch::new();
    std::fs::create_dir(scratch.path("work")).unwrap();
    let inner = Scratch::facade6();
    for name in inner.files() {
        let to = scratch.path("work").join(&name);
        std::fs::create_dir_all(to.parent().unwrap()).unwrap();
        std::fs::copy(inner.path(&name), to).unwrap();
    }
    scratch.add_maps("post7", "work");
    // Quotes that reach the program are dropped, backslashes are slashes.
    let words: Vec<&str> = ["-w", "\"work\"", ".\\scene.mvs", "-o", "d\\dense"]
        .into_iter()
        .chain(FUSE_ONLY.split(' '))
        .collect();
    scratch.run(DENSIFY, &words).ok();
    assert_eq!(points_in(&scratch, "work/d/dense.ply"), POST7_POINTS);
    assert!(scratch.files().iter().any(|f| f.starts_with("work/DensifyPointCloud-") && f.ends_with(".log")));
}

#[test]
fn options_come_from_command_line_then_config_file() {
    let scratch = Scratch::with_maps();
    scratch
        .write("DensifyPointCloud.cfg", "number-views-fuse = 2 # as in fuse2\noutput-file = from_config\n");
    scratch.densify_point_cloud(&format!("scene.mvs {FUSE_ONLY}")).ok();
    assert!(points_in(&scratch, "from_config.ply") > POST7_POINTS);
    scratch.densify_point_cloud(&format!("scene.mvs {FUSE_ONLY} --number-views-fuse 3")).ok();
    assert_eq!(points_in(&scratch, "from_config.ply"), POST7_POINTS);
    scratch.write("DensifyPointCloud.cfg", "max-threads = 2\n");
    scratch.densify_point_cloud("scene.mvs").fails_naming(&["DensifyPointCloud.cfg", "max-threads"]);
}

#[test]
fn the_dense_config_file_is_read_and_its_filters_count_unless_typed() {
    let scratch = Scratch::with_maps();
    let untouched = scratch.read("depth0000.dmap");
    scratch.write("Densify.ini", "Optimize = 0\nMin Views Filter = 1\n");
    let words = FUSE_ONLY.replace(" --postprocess-dmaps 0", " --dense-config-file Densify.ini");
    scratch.densify_point_cloud(&format!("scene.mvs {words}")).ok();
    assert_eq!(scratch.read("depth0000.dmap"), untouched);
    scratch.densify_point_cloud(&format!("scene.mvs {words} --postprocess-dmaps 4")).ok();
    assert_ne!(scratch.read("depth0000.dmap"), untouched);
    scratch.write("Densify.ini", "Optimize = x\n");
    scratch.densify_point_cloud(&format!("scene.mvs {words}")).fails_naming(&["Densify.ini", "Optimize"]);
}

#[test]
fn lines_that_callers_look_for_are_printed_and_logged() {
    let scratch = Scratch::with_maps();
    let out = scratch.densify_point_cloud(&format!("scene.mvs -v 0 {FUSE_ONLY}")).ok();
    let log = scratch.files().into_iter().find(|f| f.ends_with(".log")).unwrap();
    let log = String::from_utf8(scratch.read(&log)).unwrap();
    for text in [
        "Preparing images for dense reconstruction completed: 6 images (",
        "Selecting images for dense reconstruction completed: 6 images (",
        "Depth-maps fused and filtered: 6 depth-maps, 132021 depths, 24171 points (18%%) (",
        "Densifying point-cloud completed: 24171 points (",
        "Point-cloud 'scene_dense.ply' saved: 24171 points (",
        "Scene loaded from interface format (",
        "Scene saved to interface format (",
    ] {
        let found = |lines: &str| {
            lines
                .lines()
                .any(|l| l.get(8..).is_some_and(|l| l.starts_with(" [App     ] ") && l.contains(text)))
        };
        assert!(found(&out.stdout), "{text} not in\n{}", out.stdout);
        assert!(found(&log), "{text} not in\n{log}");
    }
    assert!(out.stdout.contains("\nFused depth-maps 6 (100%, "));
    assert_eq!(out.stderr, "");
}

#[test]
fn depth_maps_alone_are_announced_with_the_sparse_points() {
    let scratch = Scratch::with_maps();
    let out = scratch.densify_point_cloud(&format!("scene.mvs --fusion-mode 1 {FUSE_ONLY}")).ok();
    assert!(out.stdout.contains("Densifying point-cloud completed: 6344 points ("));
    assert_eq!(points_in(&scratch, "scene_dense.ply"), 6344);
    let out = scratch.semvs(&format!("densify scene.mvs -o only.ply --fusion-mode 1 {FUSE_ONLY}")).ok();
    assert!(out.stdout.contains("6 depth maps"), "{}", out.stdout);
    assert!(!scratch.has("only.ply"));
}

#[test]
fn regions_and_neighbours_go_to_text_and_back() {
    let scratch = Scratch::facade6();
    let none = scratch.densify_point_cloud("scene.mvs --output-view-neighbors-file nb.txt");
    none.fails_naming(&["scene.mvs", "neighbours"]);
    let dense = common::facade6().join("openmvs-2.3.0/post7/scene_dense.mvs");
    std::fs::copy(dense, scratch.path("dense.mvs")).unwrap();
    scratch.densify_point_cloud("dense.mvs --output-view-neighbors-file nb.txt").ok();
    assert_eq!(String::from_utf8(scratch.read("nb.txt")).unwrap().lines().count(), 6);

    scratch.densify_point_cloud("scene.mvs --estimate-roi 1 --export-roi-file roi.txt").ok();
    let roi = String::from_utf8(scratch.read("roi.txt")).unwrap();
    assert_eq!(roi.split_whitespace().count(), 15);
    scratch.densify_point_cloud("scene.mvs -o boxed.mvs --import-roi-file roi.txt").ok();
    let seen = scratch.semvs("inspect boxed.mvs --json").ok().stdout;
    let seen: serde_json::Value = serde_json::from_str(&seen).unwrap();
    let center = seen["region_of_interest"]["center"][0].as_f64().unwrap();
    let typed: f64 = roi.split_whitespace().nth(9).unwrap().parse().unwrap();
    assert!((center - typed).abs() <= 1e-6 * typed.abs().max(1.0), "{center} {typed}");
}

#[test]
fn semvs_fuses_maps_of_any_size_and_leaves_them_alone() {
    let scratch = Scratch::facade6();
    scratch.add_maps("post7", "maps");
    let before = scratch.read("maps/depth0002.dmap");
    let fuse = "fuse scene.mvs --depth-maps maps --estimate-roi 0";
    let out = scratch.semvs(&format!("{fuse} -o like-openmvs --support unclaimed")).ok();
    assert_eq!(points_in(&scratch, "like-openmvs.ply"), POST7_POINTS);
    assert!(out.stdout.contains("24 171"), "{}", out.stdout);
    scratch.semvs(&format!("{fuse} -o fused")).ok();
    let more = points_in(&scratch, "fused.ply");
    assert!(more > POST7_POINTS * 11 / 10, "claimed depths support more points: {more}");
    assert_eq!(scratch.read("maps/depth0002.dmap"), before);
    let sized = "--resolution-level 1 --min-resolution 160 --estimate-roi 0";
    scratch.semvs(&format!("fuse scene.mvs --depth-maps maps -o sized.ply {sized}")).ok();
    assert_eq!(scratch.read("sized.ply"), scratch.read("fused.ply"));
    // The default size is another one.
    let out = scratch.semvs("fuse scene.mvs --depth-maps maps -o other.ply --resolution-level 1");
    out.fails_naming(&["depth0000.dmap", "200×150", "400×300"]);
    assert!(!scratch.has("other.ply"));
}

#[test]
fn logs_go_to_stderr_and_can_be_silenced() {
    let scratch = Scratch::facade6();
    scratch.add_maps("post7", "maps");
    let fuse = "fuse scene.mvs --depth-maps maps -o fused.ply";
    assert!(scratch.semvs(fuse).ok().stderr.contains("Fused 6 depth maps"));
    assert_eq!(scratch.semvs(&format!("{fuse} -q")).ok().stderr, "");
    assert!(scratch.semvs(&format!("{fuse} -vv")).ok().stderr.contains("is matched with"));
}

#[test]
fn an_input_scene_is_never_replaced_by_semvs() {
    let scratch = Scratch::with_maps();
    let before = scratch.read("scene.mvs");
    scratch.semvs(&format!("densify scene.mvs -o scene.ply {FUSE_ONLY}")).fails_naming(&["--output"]);
    assert_eq!(scratch.read("scene.mvs"), before);
    assert!(!scratch.has("scene.ply"));
}

#[test]
fn files_are_inspected_for_people_and_programs() {
    let scratch = Scratch::with_maps();
    for (file, kind, needle) in [
        ("scene.mvs", "scene", "calibrated: 6"),
        ("depth0000.dmap", "depth-map", "size: 200 150"),
        ("images/0003.jpg", "image", "width: 400"),
        ("labels/0003_l.png", "label-map", "color 0 0 255"),
    ] {
        let text = scratch.semvs(&format!("inspect {file}")).ok().stdout;
        assert!(text.contains(needle), "{file}\n{text}");
        let json = scratch.semvs(&format!("inspect {file} --json")).ok().stdout;
        let json: serde_json::Value = serde_json::from_str(&json).unwrap();
        assert_eq!(json["kind"], kind);
    }
    let json = scratch.semvs("inspect scene.mvs --json").ok().stdout;
    let places = ["kind", "file", "bytes", "archive", "version", "cameras", "images", "region_of_interest"];
    let places = places.map(|key| json.find(&format!("\n  \"{key}\"")).unwrap());
    assert!(places.is_sorted(), "{json}");
    let truth = common::facade6().join("truth/truth.ply");
    let out = scratch.run(SEMVS, &[Path::new("inspect"), &truth]).ok();
    assert!(out.stdout.contains("encoding: binary little endian"), "{}", out.stdout);
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, 4, 1);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(png::BitDepth::Sixteen);
    encoder.write_header().unwrap().write_image_data(&[0, 7, 1, 0, 0, 7, 0, 7]).unwrap();
    scratch.write("ids.png", bytes);
    let json = scratch.semvs("inspect ids.png --json").ok().stdout;
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!((&json["kind"], &json["ids"][0]["id"]), (&"label-map".into(), &7.into()));
    assert_eq!((&json["ids"][1]["id"], &json["ids"][1]["pixels"]), (&256.into(), &1.into()));
    scratch.write("x.bin", "????????");
    scratch.semvs("inspect x.bin").fails_naming(&["x.bin", "not a kind of file"]);
}

#[test]
fn a_cloud_against_itself_is_perfect() {
    let truth = common::facade6().join("truth/truth.ply");
    let words = [Path::new("evaluate"), &truth, Path::new("--truth"), &truth];
    let tail = ["--thresholds", "0.02", "0.1", "--json"].map(Path::new);
    let out = Scratch::new().run(SEMVS, &[&words[..], &tail].concat()).ok();
    let json: serde_json::Value = serde_json::from_str(&out.stdout).unwrap();
    assert_eq!(json["scores"][0]["f1"], 1.0);
    assert_eq!(json["labels"]["accuracy"], 1.0);
}

#[cfg(unix)]
#[test]
fn lines_tell_the_local_time() {
    let scratch = Scratch::new();
    // Nine and a half hours ahead of UTC.
    let words = std::process::Command::new(DENSIFY)
        .current_dir(scratch.path("."))
        .env("TZ", "XYZ-9:30")
        .output()
        .unwrap();
    let line = String::from_utf8(words.stdout).unwrap();
    let said: u64 = 60 * line[..2].parse::<u64>().unwrap() + line[3..5].parse::<u64>().unwrap();
    let now = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).unwrap().as_secs() / 60;
    let expected = now + 9 * 60 + 30;
    assert!((expected + 24 * 60 - said) % (24 * 60) <= 2, "{line}");
}
