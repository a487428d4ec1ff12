//! Depth maps to clouds without fusion, on the bundled scene.

use crate::common::{self, Scratch, facade6};
use semvs::internals::pipeline::{ConvertJob, LabelJob, Outputs, convert};
use semvs::internals::progress::Progress;
use semvs::internals::semantics::ClassRules;
use semvs::internals::store::cloud::PlyLayout;
use semvs::internals::store::depth_store::read_depth_map;
use semvs::internals::store::labels::LabelSources;
use semvs_formats::Limits;
use std::path::{Path, PathBuf};

/// A folder with OpenMVS's filtered maps and nothing else.
fn maps() -> Scratch {
    let scratch = Scratch::new();
    scratch.add_maps("post7", "");
    scratch
}

fn labels(folder: &Path, classes: &[&str]) -> LabelJob {
    let class_table = Some("3dom-facade".to_owned());
    let sources =
        LabelSources { label_path: Some(folder.to_owned()), class_table, ..LabelSources::default() };
    let classes = classes.iter().map(|class| class.to_string()).collect();
    LabelJob { sources, rules: ClassRules { classes, ..ClassRules::default() } }
}

/// A job that writes `x.ply` in `folder`.
fn job(depth_maps: Vec<PathBuf>, labels: Option<LabelJob>, cloud: &Path) -> ConvertJob {
    let outputs = Outputs::of(cloud.to_owned());
    ConvertJob { depth_maps, working_folder: Some(facade6()), masks: None, labels, outputs }
}

/// Positions go through `f32` twice on the way to a pixel and back.
const PIXEL_TOLERANCE: f64 = 1e-3;
/// Relative, for the same reason.
const DEPTH_TOLERANCE: f64 = 1e-5;

#[test]
fn every_depth_becomes_a_point_with_what_its_pixel_has() {
    let scratch = maps();
    let map = scratch.path("depth0003.dmap");
    let cloud = scratch.path("out/x.ply");
    let mut job = job(vec![map.clone()], Some(labels(&facade6().join("labels"), &[])), &cloud);
    job.outputs.layout = PlyLayout::OpenMvs;
    convert(&job, &Progress::silent()).unwrap();
    let points = common::cloud(&cloud);
    let estimate = read_depth_map(&map, Limits::default()).unwrap();
    let label_file = facade6().join("labels").join(match estimate.image_name.rsplit('/').next().unwrap() {
        name if name.ends_with(".jpg") => format!("{}_l.png", name.trim_end_matches(".jpg")),
        name => panic!("{name}"),
    });
    let colors = image::open(label_file).unwrap().to_rgb8();
    let classes = semvs::internals::semantics::ClassTable::builtin("3dom-facade").unwrap();
    let sky = classes.resolve("sky").unwrap().0;
    let table = classes.colors();
    let (mut i, mut on_sky) = (0, 0);
    for y in 0..150usize {
        for x in 0..200usize {
            let depth = estimate.depth[(x, y)];
            if depth <= 0.0 {
                continue;
            }
            let label = table[&colors.get_pixel(2 * x as u32, 2 * y as u32).0].0;
            if label == sky {
                // a class without a surface makes no points
                on_sky += 1;
                continue;
            }
            let position = points.positions[i].map(f64::from);
            let in_cam = estimate.camera.cam_from_world(&position.into());
            let (u, v) = estimate.camera.image_from_cam(&in_cam);
            assert!(
                (u - x as f64).abs() < PIXEL_TOLERANCE && (v - y as f64).abs() < PIXEL_TOLERANCE,
                "{x} {y}: {u} {v}"
            );
            assert!((in_cam.z / f64::from(depth) - 1.0).abs() < DEPTH_TOLERANCE);
            assert_eq!(points.confidence[i], estimate.confidence.as_ref().unwrap()[(x, y)]);
            assert_eq!(points.labels[i], label);
            assert_eq!(points.label_confidence[i], if label == 0 { 0.0 } else { 1.0 });
            assert_eq!(points.images_of(i).len(), 1);
            i += 1;
        }
    }
    assert_eq!(i, points.len());
    assert!(on_sky > 0 && on_sky < i, "{on_sky} {i}");
    assert!(points.colors.iter().any(|c| *c != points.colors[0]));
    let center = estimate.camera.center().as_slice();
    let facing = |i: usize| away_from(points.normals[i], points.positions[i], center) < 0.0;
    let facing = (0..points.len()).filter(|&i| facing(i)).count();
    assert!(facing as f64 > 0.99 * points.len() as f64, "{facing} of {}", points.len());
}

/// Normal times the direction from the camera to the point: negative where the surface faces the camera.
fn away_from(normal: [f32; 3], point: [f32; 3], center: &[f64]) -> f64 {
    (0..3).map(|k| f64::from(normal[k]) * (f64::from(point[k]) - center[k])).sum()
}

#[test]
fn several_maps_make_one_cloud_of_the_kept_classes() {
    let scratch = maps();
    let depth_maps: Vec<PathBuf> = (0..6).map(|i| scratch.path(&format!("depth{i:04}.dmap"))).collect();
    let cloud = scratch.path("x.ply");
    let label_maps = facade6().join("labels");
    let mut all = job(depth_maps, Some(labels(&label_maps, &[])), &cloud);
    all.outputs.split_by_class = true;
    convert(&all, &Progress::silent()).unwrap();
    let whole = common::cloud(&cloud);
    let by_class = |id: u16| whole.labels.iter().filter(|&&l| l == id).count() as u64;
    let part = |name: &str| common::cloud(&scratch.path(&format!("x.{name}.ply"))).len() as u64;
    let parts = ["building", "obstacle", "window", "door"].map(part);
    assert_eq!(parts, [1, 3, 4, 5].map(by_class));
    assert!([1, 3, 4, 5].iter().all(|&id| by_class(id) > 100));
    all.labels = Some(labels(&label_maps, &["window", "door"]));
    convert(&all, &Progress::silent()).unwrap();
    let kept = common::cloud(&cloud);
    assert_eq!(kept.len() as u64, by_class(4) + by_class(5));
    assert!(kept.labels.iter().all(|l| [4, 5].contains(l)));
}

#[test]
fn without_images_and_labels_points_still_have_their_place() {
    let scratch = maps();
    let map = scratch.path("depth0000.dmap");
    let cloud = scratch.path("x.ply");
    let job = ConvertJob { working_folder: Some(scratch.path("")), ..job(vec![map], None, &cloud) };
    convert(&job, &Progress::silent()).unwrap();
    let points = common::cloud(&cloud);
    assert!(points.colors.is_empty() && points.labels.is_empty() && points.len() > 10_000);
}

#[test]
fn bad_input_is_named_and_nothing_is_written() {
    let scratch = maps();
    let map = scratch.path("depth0000.dmap");
    let cloud = scratch.path("x.ply");
    let job = job(vec![map.clone()], None, &cloud);
    let error = |job: &ConvertJob| convert(job, &Progress::silent()).unwrap_err().to_string();
    let mut split = job.clone();
    split.outputs.split_by_class = true;
    assert!(error(&split).starts_with("--split-by-class needs labels"));
    let missing = ConvertJob { depth_maps: vec![scratch.path("depth0009.dmap")], ..job.clone() };
    assert!(error(&missing).contains("depth0009.dmap"));
    let elsewhere = ConvertJob { labels: Some(labels(&scratch.path(""), &[])), ..job.clone() };
    assert!(error(&elsewhere).contains("no label map for"));
    let bytes = std::fs::read(&map).unwrap();
    std::fs::write(&map, &bytes[..bytes.len() / 2]).unwrap();
    assert!(error(&job).contains("depth0000.dmap"));
    assert!(!cloud.exists());
}
