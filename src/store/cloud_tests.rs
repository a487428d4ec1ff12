use super::*;
use crate::progress::{Event, Listener, Stage};
use crate::scene::{CloudPoint, PointCloud, PointSink, ViewIndex};
use crate::store::cloud_output::POINTS_PER_CHUNK;
use semvs_formats::Limits;
use semvs_formats::ply::{self, Cloud};
use std::sync::{Arc, Mutex};

const ALL: CloudLayout =
    CloudLayout { normals: true, colors: true, views: true, weights: true, confidence: false, labels: true };

/// `n` points whose attributes all differ, with labels 0, 1, 4, 0, 1, 4, ...
fn cloud(n: u32, layout: CloudLayout) -> PointCloud {
    let mut cloud = PointCloud::new(layout);
    for i in 0..n {
        let views = [ViewIndex(i), ViewIndex(i + 3)];
        let weights = [i as f32, 0.5];
        let point = CloudPoint {
            position: [i as f32, 0.5, -1.0],
            normal: [0.0, 1.0, i as f32],
            color: [i as u8, 2, 3],
            views: &views[..1 + i as usize % 2],
            weights: &weights[..1 + i as usize % 2],
            confidence: 0.25 * i as f32,
            label: [0, 1, 4][i as usize % 3],
            label_confidence: [0.0, 0.5, 1.0][i as usize % 3],
        };
        cloud.push(&point).unwrap();
    }
    cloud
}

fn facade() -> ClassTable {
    ClassTable::builtin("3dom-facade").unwrap()
}

fn read(path: &Path) -> Cloud {
    ply::read_cloud(std::fs::File::open(path).unwrap(), &Limits::default()).unwrap()
}

fn header(path: &Path) -> Vec<String> {
    let bytes = std::fs::read(path).unwrap();
    let end = bytes.windows(10).position(|w| w == b"end_header").unwrap();
    String::from_utf8(bytes[..end].to_vec()).unwrap().lines().map(str::to_owned).collect()
}

fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).unwrap();
    let mut names: Vec<_> = entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

#[test]
fn labels_stand_between_normals_and_views_with_a_comment_per_class() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.ply");
    let table = facade();
    let options = CloudOptions { layout: PlyLayout::OpenMvs, table: Some(&table), ..CloudOptions::default() };
    let written = write_clouds(&cloud(7, ALL), &path, &options, &Progress::silent()).unwrap();
    let expected = [
        "ply",
        "format binary_little_endian 1.0",
        "comment class 1 building 0 0 255",
        "comment class 2 sky 255 255 0",
        "comment class 3 obstacle 255 0 0",
        "comment class 4 window 0 255 0",
        "comment class 5 door 255 0 255",
        "element vertex 7",
        "property float32 x",
        "property float32 y",
        "property float32 z",
        "property uint8 red",
        "property uint8 green",
        "property uint8 blue",
        "property float32 nx",
        "property float32 ny",
        "property float32 nz",
        "property uint8 label",
        "property float32 label_confidence",
        "property list uint8 uint32 view_indices",
        "property list uint8 float32 view_weights",
    ];
    assert_eq!(header(&path), expected);
    let points = read(&path);
    assert_eq!(points.labels, [0, 1, 4, 0, 1, 4, 0]);
    assert_eq!(points.label_confidence[..3], [0.0, 0.5, 1.0]);
    assert_eq!(points.images_of(5), [5, 8]);
    assert_eq!(points.weights_of(5), [5.0, 0.5]);
    assert_eq!(points.images_of(6), [6]);
    assert_eq!(points.normals[6], [0.0, 1.0, 6.0]);
    let classes: Vec<_> = written.classes.iter().map(|(id, c)| (id.0, c.points, c.confidence_sum)).collect();
    assert_eq!(classes, [(0, 3, 0.0), (1, 2, 1.0), (4, 2, 2.0)]);
    assert_eq!(names(folder.path()), ["x.legend.png", "x.ply"]);
    assert_eq!(written.legend, Some(folder.path().join("x.legend.png")));
}

#[test]
fn the_plain_layout_has_no_lists_and_an_unlabelled_cloud_no_comments() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.ply");
    let layout = CloudLayout { labels: false, ..ALL };
    write_clouds(&cloud(3, layout), &path, &CloudOptions::default(), &Progress::silent()).unwrap();
    let header = header(&path);
    assert!(
        header
            .iter()
            .all(|line| !line.contains("list") && !line.contains("comment") && !line.contains("label"))
    );
    assert_eq!(read(&path).colors, [[0, 2, 3], [1, 2, 3], [2, 2, 3]]);
}

#[test]
fn the_parts_hold_exactly_the_points_of_the_whole() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.ply");
    let table = facade();
    let options = CloudOptions {
        table: Some(&table),
        split_by_class: true,
        color_by_label: true,
        ..CloudOptions::default()
    };
    // More points than one chunk holds.
    let n = 3 * POINTS_PER_CHUNK as u32 + 5;
    let written = write_clouds(&cloud(n, ALL), &path, &options, &Progress::silent()).unwrap();
    let expected = ["x.building.ply", "x.labels.ply", "x.legend.png", "x.ply", "x.void.ply", "x.window.ply"];
    assert_eq!(names(folder.path()), expected);
    let whole = read(&path);
    assert_eq!(whole.len() as u32, n);
    let mut parts = 0;
    for (name, label) in [("building", 1), ("void", 0), ("window", 4)] {
        let part = read(&folder.path().join(format!("x.{name}.ply")));
        let of_class = |i: &usize| whole.labels[*i] == label;
        let positions: Vec<[f32; 3]> =
            (0..whole.len()).filter(of_class).map(|i| whole.positions[i]).collect();
        assert_eq!(part.positions, positions);
        assert!(part.labels.iter().all(|&l| l == label));
        parts += part.len();
    }
    assert_eq!(parts, whole.len());
    let colored = read(&folder.path().join("x.labels.ply"));
    assert_eq!(colored.positions, whole.positions);
    assert_eq!(colored.colors[..3], [[0, 0, 0], [0, 0, 255], [0, 255, 0]]);
    let points: Vec<u64> = written.files.iter().map(|file| file.points).collect();
    assert_eq!(points.iter().sum::<u64>(), 3 * u64::from(n));
}

#[test]
fn ids_above_255_take_two_bytes_and_names_are_single_words() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.ply");
    let text =
        "class = [{ id = 300, name = \"traffic light\", color = [1, 2, 3] }, { id = 1, name = \"b\" }]";
    let table = ClassTable::from_toml(text, Path::new("t.toml")).unwrap();
    let options = CloudOptions { table: Some(&table), ..CloudOptions::default() };
    let mut points = PointCloud::new(CloudLayout { labels: true, ..CloudLayout::default() });
    points.push(&CloudPoint { label: 300, label_confidence: 1.0, ..CloudPoint::default() }).unwrap();
    write_clouds(&points, &path, &options, &Progress::silent()).unwrap();
    let header = header(&path);
    assert!(header.contains(&"comment class 300 traffic_light 1 2 3".to_owned()), "{header:?}");
    assert!(header.iter().any(|line| line.ends_with(" label") && line.contains("ushort")), "{header:?}");
    assert_eq!(read(&path).labels, [300]);
}

#[test]
fn many_classes_are_written_in_several_passes() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.ply");
    let table = ClassTable::ids().with_ids((1..=40).map(ClassId));
    let options = CloudOptions { table: Some(&table), split_by_class: true, ..CloudOptions::default() };
    let mut points = PointCloud::new(CloudLayout { labels: true, ..CloudLayout::default() });
    for i in 0..80u16 {
        points
            .push(&CloudPoint { label: 1 + i % 40, position: [i.into(); 3], ..CloudPoint::default() })
            .unwrap();
    }
    write_clouds(&points, &path, &options, &Progress::silent()).unwrap();
    assert_eq!(names(folder.path()).len(), 42);
    assert_eq!(read(&folder.path().join("x.class-40.ply")).positions, [[39.0; 3], [79.0; 3]]);
}

#[derive(Default)]
struct Warnings(Mutex<Vec<String>>);

impl Listener for Warnings {
    fn event(&self, event: &Event) {
        if let Event::Warning(text) = event {
            self.0.lock().unwrap().push(text.clone());
        }
    }
    fn steps(&self, _: Stage, _: usize, _: usize) {}
}

#[test]
fn an_empty_cloud_is_a_warning_and_no_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.ply");
    let warnings = Arc::new(Warnings::default());
    let progress = Progress::new(warnings.clone());
    let written = write_clouds(&cloud(0, ALL), &path, &CloudOptions::default(), &progress).unwrap();
    assert_eq!(written, WrittenClouds::default());
    assert!(warnings.0.lock().unwrap()[0].ends_with("x.ply: not written, the cloud has no points"));
    assert!(names(folder.path()).is_empty());
}

/// A cloud that fails on the way.
struct Failing(PointCloud);

impl PointSource for Failing {
    fn layout(&self) -> CloudLayout {
        self.0.layout()
    }
    fn len(&self) -> u64 {
        self.0.len() + 1
    }
    fn for_each(&self, visit: &mut dyn FnMut(&CloudPoint<'_>) -> Result<()>) -> Result<()> {
        self.0.for_each(visit)?;
        Err(Error::invalid("the spool is gone"))
    }
}

/// A cloud that holds fewer points than it says.
struct Short(PointCloud);

impl PointSource for Short {
    fn layout(&self) -> CloudLayout {
        self.0.layout()
    }
    fn len(&self) -> u64 {
        self.0.len() + 1
    }
    fn for_each(&self, visit: &mut dyn FnMut(&CloudPoint<'_>) -> Result<()>) -> Result<()> {
        self.0.for_each(visit)
    }
}

#[test]
fn a_failure_leaves_what_was_there() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.ply");
    std::fs::write(&path, b"before").unwrap();
    let layout = CloudLayout { labels: false, ..ALL };
    let sources: [Box<dyn PointSource>; 2] =
        [Box::new(Failing(cloud(9, layout))), Box::new(Short(cloud(9, layout)))];
    for source in sources {
        write_clouds(&*source, &path, &CloudOptions::default(), &Progress::silent()).unwrap_err();
        assert_eq!(std::fs::read(&path).unwrap(), b"before");
        assert_eq!(names(folder.path()), ["x.ply"]);
    }
}

#[test]
fn options_that_cannot_be_met_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.ply");
    let write = |layout: CloudLayout, options: &CloudOptions<'_>| {
        write_clouds(&cloud(2, layout), &path, options, &Progress::silent()).unwrap_err().to_string()
    };
    let unlabelled = CloudLayout { labels: false, ..ALL };
    let split = CloudOptions { split_by_class: true, ..CloudOptions::default() };
    assert!(write(unlabelled, &split).starts_with("--split-by-class needs labels"));
    assert!(check_cloud_paths(&path, &split, None).is_err());
    let colored = CloudOptions { color_by_label: true, ..CloudOptions::default() };
    assert!(write(unlabelled, &colored).starts_with("--color-by-label needs labels"));
    let listed = CloudOptions { layout: PlyLayout::OpenMvs, ..CloudOptions::default() };
    let viewless = CloudLayout { views: false, weights: false, labels: false, ..ALL };
    assert!(write(viewless, &listed).contains("have no views for --ply-layout openmvs"));
}

#[test]
fn places_that_cannot_be_written_show_before_the_work() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.ply");
    let table = facade();
    let options = CloudOptions {
        table: Some(&table),
        split_by_class: true,
        color_by_label: true,
        ..CloudOptions::default()
    };
    check_cloud_paths(&path, &options, None).unwrap();
    assert!(names(folder.path()).is_empty());
    std::fs::create_dir(folder.path().join("x.sky.ply")).unwrap();
    let error = check_cloud_paths(&path, &options, None).unwrap_err().to_string();
    assert!(error.contains("x.sky.ply"), "{error}");
    let rules = crate::semantics::ClassRules { exclude: vec!["sky".into()], ..Default::default() };
    let policy = ClassPolicy::new(&table, &rules).unwrap();
    check_cloud_paths(&path, &options, Some(&policy)).unwrap();
    std::fs::create_dir(folder.path().join("x.labels.ply")).unwrap();
    assert!(check_cloud_paths(&path, &options, Some(&policy)).is_err());
}

/// The points of a LAS or LAZ file.
fn las_points(path: &Path) -> Vec<las::Point> {
    let data = las::Reader::from_path(path).unwrap().read_all().unwrap();
    data.points().map(|point| point.unwrap()).collect()
}

#[test]
fn las_and_laz_hold_what_the_ply_holds_where_it_belongs() {
    let folder = tempfile::tempdir().unwrap();
    let table = facade();
    let n = 2 * POINTS_PER_CHUNK as u32 + 5;
    let source = cloud(n, CloudLayout { confidence: true, ..ALL });
    let placement = Placement::shift([500_000.0, 5_200_000.25, 0.0]);
    let options = CloudOptions {
        table: Some(&table),
        split_by_class: true,
        color_by_label: true,
        placement,
        ..CloudOptions::default()
    };
    for extension in ["las", "laz"] {
        let path = folder.path().join(format!("x.{extension}"));
        let written = write_clouds(&source, &path, &options, &Progress::silent()).unwrap();
        let of = |part: &str| las_points(&folder.path().join(format!("x.{part}{extension}")));
        let whole = of("");
        assert_eq!(whole.len() as u32, n);
        for (found, point) in whole.iter().zip(source.iter()) {
            let place = placement.place(point.position);
            for (a, b) in [found.x, found.y, found.z].into_iter().zip(place) {
                assert!((a - b).abs() <= 0.000_5, "{a} {b}");
            }
            assert_eq!(
                u8::from(found.classification),
                [1, 6, 68][usize::from(point.label != 0) + usize::from(point.label == 4)]
            );
            assert_eq!(found.extra_bytes.len(), 12 + 2 + 4 + 4 + 2);
            assert_eq!(found.extra_bytes[12..14], point.label.to_le_bytes());
        }
        assert_eq!(of("labels.")[4].color.unwrap().blue, 255 << 8);
        let parts: usize = ["void.", "building.", "window."].iter().map(|part| of(part).len()).sum();
        assert_eq!(parts as u32, n);
        let places = |points: &[las::Point]| points.iter().map(|p| (p.x, p.y, p.z)).collect::<Vec<_>>();
        let windows: Vec<las::Point> =
            whole.iter().filter(|p| u8::from(p.classification) == 68).cloned().collect();
        assert_eq!(places(&of("window.")), places(&windows), "on the grid of the whole");
        assert_eq!(written.files.len(), 5);
    }
    let bytes = |name: &str| std::fs::read(folder.path().join(name)).unwrap();
    assert!(bytes("x.laz").len() < bytes("x.las").len());
    let before = bytes("x.laz");
    write_clouds(&source, &folder.path().join("x.laz"), &options, &Progress::silent()).unwrap();
    assert_eq!(before, bytes("x.laz"));
}

#[test]
fn las_without_labels_colours_and_normals_is_bare() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.las");
    let bare = CloudLayout { normals: true, ..CloudLayout::default() };
    let options = CloudOptions { las_without_normals: true, ..CloudOptions::default() };
    write_clouds(&cloud(3, bare), &path, &options, &Progress::silent()).unwrap();
    let points = las_points(&path);
    assert!(points.iter().all(|p| p.extra_bytes.is_empty() && p.color.is_none()));
    assert!(points.iter().all(|p| u8::from(p.classification) == 0));
    assert_eq!(names(folder.path()), ["x.las"]);
}

#[test]
fn classes_that_have_no_las_code_show_before_the_work() {
    let folder = tempfile::tempdir().unwrap();
    let text = "name = \"t\"\nclass = [{ id = 192, name = \"a\" }, { id = 200, name = \"b\", las = 2 }]";
    let table = ClassTable::from_toml(text, Path::new("t.toml")).unwrap();
    let options = CloudOptions { table: Some(&table), ..CloudOptions::default() };
    let check = |name: &str, policy: Option<&ClassPolicy>| {
        check_cloud_paths(&folder.path().join(name), &options, policy).map_err(|e| e.to_string())
    };
    let error = check("x.laz", None).unwrap_err();
    assert!(error.starts_with("class 192 \"a\" of class table t has no LAS code"), "{error}");
    assert_eq!(check("x.ply", None), Ok(()));
    let rules = crate::semantics::ClassRules { exclude: vec!["a".into()], ..Default::default() };
    let policy = ClassPolicy::new(&table, &rules).unwrap();
    assert_eq!(check("x.las", Some(&policy)), Ok(()));
    let mut points = PointCloud::new(CloudLayout { labels: true, ..CloudLayout::default() });
    points.push(&CloudPoint { label: 192, ..CloudPoint::default() }).unwrap();
    let written = write_clouds(&points, &folder.path().join("x.las"), &options, &Progress::silent());
    assert!(written.unwrap_err().to_string().contains("class 192"));
}

#[test]
fn coordinates_that_are_no_numbers_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let mut points = PointCloud::new(CloudLayout::default());
    points.push(&CloudPoint::default()).unwrap();
    points.push(&CloudPoint { position: [0.0, f32::NAN, 0.0], ..CloudPoint::default() }).unwrap();
    let path = folder.path().join("x.las");
    let error = write_clouds(&points, &path, &CloudOptions::default(), &Progress::silent()).unwrap_err();
    assert!(error.to_string().starts_with("point 1 has a coordinate that is no number"), "{error}");
    assert!(names(folder.path()).is_empty());
}

#[test]
fn doubles_keep_the_digits_of_large_coordinates() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.ply");
    let layout = CloudLayout { labels: false, ..ALL };
    let placement = Placement::shift([500_000.0, 5_200_000.25, 0.0]);
    let options =
        CloudOptions { doubles: true, placement, layout: PlyLayout::OpenMvs, ..CloudOptions::default() };
    write_clouds(&cloud(3, layout), &path, &options, &Progress::silent()).unwrap();
    let points = read(&path);
    assert_eq!(points.positions_f64[2], [500_002.0, 5_200_000.75, -1.0]);
    assert_eq!(points.images_of(1), [1, 4]);
    let odm = CloudOptions { layout: PlyLayout::Odm, doubles: true, ..CloudOptions::default() };
    let error = write_clouds(&cloud(3, layout), &path, &odm, &Progress::silent()).unwrap_err().to_string();
    assert!(error.contains("--ply-doubles"), "{error}");
}

#[test]
fn class_clouds_of_an_earlier_run_are_named() {
    for extension in ["ply", "las", "laz"] {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(format!("x.{extension}"));
        let table = facade();
        let split = CloudOptions { table: Some(&table), split_by_class: true, ..CloudOptions::default() };
        write_clouds(&cloud(9, ALL), &path, &split, &Progress::silent()).unwrap();
        let warnings = Arc::new(Warnings::default());
        let mut points = PointCloud::new(CloudLayout { labels: true, ..CloudLayout::default() });
        points.push(&CloudPoint { label: 1, ..CloudPoint::default() }).unwrap();
        write_clouds(&points, &path, &split, &Progress::new(warnings.clone())).unwrap();
        let lines = warnings.0.lock().unwrap();
        let [line] = lines.as_slice() else { panic!("{lines:?}") };
        let named = |part: &str| line.contains(&format!("x.{part}.{extension}"));
        assert!(named("void") && named("window") && !named("building"), "{line}");
    }
}
