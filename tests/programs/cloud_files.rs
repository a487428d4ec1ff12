//! Clouds as LAS and LAZ, with doubles, in their place in the world.

use crate::common::{FUSE_ONLY, Scratch};
use semvs_formats::Limits;
use semvs_formats::mvs;
use std::path::Path;

const LABELS: &str = "--label-path labels --class-table 3dom-facade";
/// Half the step of a LAS file for a scene in metres, and what arithmetic adds.
const HALF_STEP: f64 = 0.5001e-4;

fn las_points(path: &Path) -> Vec<las::Point> {
    let data = las::Reader::from_path(path).unwrap().read_all().unwrap();
    data.points().map(|point| point.unwrap()).collect()
}

/// Positions of a LAS file against those of a PLY file plus `offset`.
#[track_caller]
fn same_places(las: &[las::Point], ply: &[[f32; 3]], offset: [f64; 3]) {
    assert_eq!(las.len(), ply.len());
    for (a, b) in las.iter().zip(ply) {
        for ((a, b), offset) in [a.x, a.y, a.z].into_iter().zip(b).zip(offset) {
            assert!((a - f64::from(*b) - offset).abs() <= HALF_STEP, "{a} {b}");
        }
    }
}

#[test]
fn both_programs_write_laz_by_the_name() {
    let scratch = Scratch::with_maps();
    let out = scratch.densify_point_cloud(&format!("scene.mvs -o dense.laz {FUSE_ONLY} {LABELS}")).ok();
    assert!(out.stdout.contains("dense.laz"), "{}", out.stdout);
    assert!(scratch.has("dense.mvs") && scratch.has("dense.legend.png") && !scratch.has("dense.ply"));
    scratch.densify_point_cloud(&format!("scene.mvs -o dense {FUSE_ONLY} {LABELS}")).ok();
    let ply = scratch.cloud("dense.ply");
    let laz = las_points(&scratch.path("dense.laz"));
    same_places(&laz, &ply.positions, [0.0; 3]);
    for (point, label) in laz.iter().zip(&ply.labels) {
        let code = [1, 6, 66, 67, 68, 69][usize::from(*label)];
        assert_eq!(u8::from(point.classification), code);
        assert_eq!(point.extra_bytes[12..14], label.to_le_bytes());
    }
    scratch
        .semvs(&format!(
            "fuse scene.mvs --depth-maps . -o again.LAZ {LABELS} --number-views-fuse 3 --support unclaimed --split-by-class --color-by-label"
        ))
        .ok();
    assert_eq!(las_points(&scratch.path("again.LAZ")).len(), laz.len());
    assert!(scratch.has("again.building.laz") && scratch.has("again.labels.laz"));
    let strict = format!("scene.mvs -o dense.laz --strict-openmvs {FUSE_ONLY}");
    std::fs::remove_file(scratch.path("dense.laz")).unwrap();
    scratch.densify_point_cloud(&strict).ok();
    assert!(!scratch.has("dense.laz"), "as OpenMVS does");
}

#[test]
fn an_offset_needs_digits_and_gets_them() {
    let scratch = Scratch::with_maps();
    let fuse = |words: &str| scratch.semvs(&format!("fuse scene.mvs --depth-maps . {words}"));
    fuse("-o x.ply --offset 500000,5200000,0").fails_naming(&[
        "--offset 500000,5200000,0",
        "--ply-doubles",
        ".laz",
    ]);
    fuse("-o x.ply").ok();
    fuse("-o y.ply --offset 500000.5,-5200000,0 --ply-doubles").ok();
    fuse("-o y.las --offset 500000.5,-5200000,0 --las-normals 0").ok();
    let (x, y) = (scratch.cloud("x.ply"), scratch.cloud("y.ply"));
    let moved = |p: &[f32; 3]| [f64::from(p[0]) + 500_000.5, f64::from(p[1]) - 5_200_000.0, f64::from(p[2])];
    assert!(x.positions.iter().zip(&y.positions_f64).all(|(x, y)| moved(x) == *y));
    let las = las_points(&scratch.path("y.las"));
    same_places(&las, &x.positions, [500_000.5, -5_200_000.0, 0.0]);
    assert_eq!(las[0].extra_bytes.len(), 2, "views alone");
}

#[test]
fn the_scenes_transform_places_clouds_that_have_the_digits() {
    let scratch = Scratch::with_maps();
    let mut scene = mvs::read(scratch.path("scene.mvs"), &Limits::default()).unwrap();
    (scene.transform[3], scene.transform[7]) = (-300_000.0, -4_000_000.0);
    let mut bytes = Vec::new();
    mvs::write_interface(&mut bytes, &scene, mvs::NEWEST_VERSION).unwrap();
    scratch.write("scene.mvs", bytes);
    let fuse = |words: &str| scratch.semvs(&format!("fuse scene.mvs --depth-maps . {words}"));
    fuse("-o x.ply").ok();
    let out = fuse("-o x.las").ok();
    assert!(out.stderr.contains("(300000, 4000000, 0)"), "{}", out.stderr);
    let ply = scratch.cloud("x.ply");
    same_places(&las_points(&scratch.path("x.las")), &ply.positions, [300_000.0, 4_000_000.0, 0.0]);
    fuse("-o x.las --offset 0,0,0").ok();
    same_places(&las_points(&scratch.path("x.las")), &ply.positions, [0.0; 3]);
}

#[test]
fn finished_clouds_are_written_as_las_too() {
    let scratch = Scratch::with_maps();
    scratch.densify_point_cloud(&format!("scene.mvs -o dense --archive-type 1 {FUSE_ONLY}")).ok();
    scratch.densify_point_cloud("dense.mvs -o few.laz --export-number-views 4").ok();
    assert!(las_points(&scratch.path("few_4views.laz")).len() > 100);
}

#[test]
fn a_cloud_becomes_laz_and_the_classes_come_along() {
    let scratch = Scratch::with_maps();
    scratch.semvs(&format!("fuse scene.mvs --depth-maps . -o x.ply --ply-layout openmvs {LABELS}")).ok();
    let ply = scratch.cloud("x.ply");
    assert!(scratch.semvs("inspect x.laz").code == Some(1));
    // By the classes that its header lists: they have names and colours, but no codes of their own.
    scratch.semvs("convert x.ply -o y.laz --split-by-class --color-by-label --offset 100000,0,0").ok();
    let laz = las_points(&scratch.path("y.laz"));
    same_places(&laz, &ply.positions, [100_000.0, 0.0, 0.0]);
    assert!(
        laz.iter()
            .zip(&ply.labels)
            .all(|(p, &l)| u16::from(u8::from(p.classification)) == [1, 65, 66, 67, 68, 69][usize::from(l)])
    );
    assert!(scratch.has("y.building.laz") && scratch.has("y.labels.laz") && scratch.has("y.legend.png"));
    let shown = scratch.semvs("inspect y.laz").ok().stdout;
    for line in [&format!("points: {}", laz.len()), "compressed: yes", "version: 1.4", "  65: building"] {
        assert!(shown.lines().any(|l| l == line), "{line}\n{shown}");
    }
    let json: serde_json::Value =
        serde_json::from_str(&scratch.semvs("inspect y.laz --json").ok().stdout).unwrap();
    assert_eq!((&json["kind"], &json["extra_bytes"][3]), (&"las-cloud".into(), &"uint16 label".into()));
    // By a table, and not all of them.
    scratch.semvs("convert x.ply -o z.las --class-table 3dom-facade --classes building,door").ok();
    let las = las_points(&scratch.path("z.las"));
    assert_eq!(las.len(), ply.labels.iter().filter(|&&label| label == 1 || label == 5).count());
    assert!(las.iter().all(|p| [6, 69].contains(&u8::from(p.classification))));
    // There and back with doubles.
    scratch.semvs("convert x.ply -o d.ply --ply-doubles --offset 500000,5200000,0 --ply-layout openmvs").ok();
    scratch
        .semvs("convert d.ply -o e.ply --ply-doubles --offset -500000,-5200000,0 --ply-layout openmvs")
        .ok();
    let (d, e) = (scratch.cloud("d.ply"), scratch.cloud("e.ply"));
    assert_eq!(d.positions_f64[7][0], f64::from(ply.positions[7][0]) + 500_000.0);
    assert!(
        ply.positions.iter().flatten().zip(e.positions.iter().flatten()).all(|(a, b)| (a - b).abs() < 1e-5)
    );
    assert_eq!((&e.views, &e.labels), (&ply.views, &ply.labels));
    let out = scratch.semvs("convert d.ply -o f.ply").ok();
    assert!(out.stderr.contains("--ply-doubles"), "{}", out.stderr);
}

#[test]
fn what_cannot_be_converted_is_said() {
    let scratch = Scratch::with_maps();
    scratch.semvs("fuse scene.mvs --depth-maps . -o plain.ply").ok();
    scratch.semvs(&format!("fuse scene.mvs --depth-maps . -o x.ply {LABELS}")).ok();
    let fails = |words: &str, needles: &[&str]| {
        drop(scratch.semvs(&format!("convert {words}")).fails_naming(needles))
    };
    fails("x.ply -o x.ply", &["x.ply", "this is the input"]);
    fails("none.ply -o y.las", &["none.ply"]);
    fails("plain.ply -o y.las --classes building", &["plain.ply", "no labels"]);
    fails("plain.ply -o y.las --split-by-class", &["--split-by-class"]);
    fails("x.ply -o y.las --classes bilding", &["bilding", "did you mean \"building\""]);
    fails("x.ply -o y.las --class-table openmvs-aerial --classes 7", &["no point of it is wanted"]);
    fails("x.ply -o y.las --label-path labels", &["--label-path"]);
    fails("x.ply depth0000.dmap -o y.las", &["x.ply"]);
    scratch.write("one.toml", "[[class]]\nid = 1\nname = \"building\"\n");
    fails("x.ply -o y.las --class-table one.toml", &["x.ply", "label ", "class table one"]);
    assert!(!scratch.has("y.las"));
}

#[test]
fn scenes_that_stand_at_utm_coordinates_are_told_of() {
    let scratch = Scratch::with_maps();
    let fuse = "fuse scene.mvs --depth-maps . -o x.las";
    assert!(!scratch.semvs(fuse).ok().stderr.contains("stripes"));
    let mut scene = mvs::read(scratch.path("scene.mvs"), &Limits::default()).unwrap();
    for pose in scene.platforms.iter_mut().flat_map(|platform| &mut platform.poses) {
        pose.center[0] += 500_000.0;
        pose.center[1] += 5_200_000.0;
    }
    let mut bytes = Vec::new();
    mvs::write_interface(&mut bytes, &scene, mvs::NEWEST_VERSION).unwrap();
    scratch.write("scene.mvs", bytes);
    let stderr = scratch.semvs(fuse).stderr;
    assert!(stderr.contains("are about 0.62 apart") && stderr.contains("--ply-doubles"), "{stderr}");
}

/// Ids of `ade20k` for those of `3dom-facade`; 3 is the sky, which is no surface.
const ADE20K: [u16; 6] = [0, 1, 3, 80, 120, 150];

#[test]
fn a_table_of_150_classes_and_ids_of_two_bytes_change_no_point() {
    let scratch = Scratch::with_maps();
    let colors = [[0, 0, 0], [0, 0, 255], [255, 255, 0], [255, 0, 0], [0, 255, 0], [255, 0, 255]];
    for folder in ["ade", "wide"] {
        std::fs::create_dir(scratch.path(folder)).unwrap();
    }
    let mut wide = String::new();
    ADE20K[1..]
        .iter()
        .for_each(|id| wide += &format!("[[class]]\nid = {}\nname = \"c{id}\"\nlas = {id}\n", 1000 + id));
    let wide = wide.replace("\"c3\"\n", "\"c3\"\nsurface = false\n");
    scratch.write("wide.toml", wide);
    for name in ["0003", "0004", "0005", "0006", "0012", "0013"] {
        let labels = image::open(scratch.path(&format!("labels/{name}_l.png"))).unwrap().to_rgb8();
        let id = |x, y| ADE20K[colors.iter().position(|c| *c == labels.get_pixel(x, y).0).unwrap()];
        let (width, height) = labels.dimensions();
        let ids = image::ImageBuffer::from_fn(width, height, |x, y| image::Luma([id(x, y)]));
        ids.save(scratch.path(&format!("ade/{name}.png"))).unwrap();
        let ids = image::ImageBuffer::from_fn(width, height, |x, y| {
            image::Luma([id(x, y) + 1000 * id(x, y).min(1)])
        });
        ids.save(scratch.path(&format!("wide/{name}.png"))).unwrap();
    }
    let fuse = |name: &str, words: &str| {
        scratch.semvs(&format!("fuse scene.mvs --depth-maps . -o {name} {words}")).ok();
    };
    fuse("five.ply", LABELS);
    fuse("ade.ply", "--label-path ade --class-table ade20k");
    fuse("ade.laz", "--label-path ade --class-table ade20k");
    fuse("wide.ply", "--label-path wide --class-table wide.toml");
    fuse("wide.las", "--label-path wide --class-table wide.toml");
    let [five, ade, wide] = ["five.ply", "ade.ply", "wide.ply"].map(|name| scratch.cloud(name));
    assert!(five.positions == ade.positions && five.positions == wide.positions, "the same points");
    for (i, &label) in five.labels.iter().enumerate() {
        let id = ADE20K[usize::from(label)];
        assert_eq!((ade.labels[i], wide.labels[i]), (id, if id > 0 { 1000 + id } else { 0 }));
    }
    let codes = |name: &str| -> Vec<u16> {
        las_points(&scratch.path(name)).iter().map(|p| u16::from(u8::from(p.classification))).collect()
    };
    assert!(
        codes("ade.laz").iter().zip(&ade.labels).all(|(code, id)| *code == if *id > 0 { 64 + id } else { 1 })
    );
    assert!(codes("wide.las").iter().zip(&ade.labels).all(|(code, id)| code == id.max(&1)));
}
