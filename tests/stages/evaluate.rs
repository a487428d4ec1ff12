//! Scores equal those of an independent script (numpy and scipy: one k-d tree, one dilation) on real clouds and maps.

use crate::common::{self, bytes, facade6};
use semvs::internals::evaluate::{
    CloudScoreOptions, LabelledPoints, MapScoreOptions, MapScores, cloud_scores, map_scores,
};
use semvs::internals::geometry::Size;
use semvs::internals::scene::{DepthMap, Grid};
use semvs_formats::Limits;
use semvs_formats::dmap::DepthMapFile;
use serde_json::Value;
use std::path::Path;

/// The script prints five decimals; ours may round the other way.
const TOLERANCE: f64 = 1.01e-5;

fn cloud(path: &Path) -> LabelledPoints {
    let cloud = common::cloud(path);
    LabelledPoints {
        positions: cloud.positions.iter().map(|p| p.map(f64::from)).collect(),
        labels: (!cloud.labels.is_empty()).then_some(cloud.labels),
        ..LabelledPoints::default()
    }
}

fn depths_of(path: &Path) -> DepthMap {
    let file = DepthMapFile::from_bytes(&bytes(path), &Limits::default()).unwrap();
    Grid::from_vec(Size { width: file.width, height: file.height }, file.depth).unwrap()
}

/// Depths of a `.npy` file of 300×400 little-endian 32-bit numbers.
fn truth_depths(path: &Path) -> DepthMap {
    let bytes = bytes(path);
    let size = Size { width: 400, height: 300 };
    let values = bytes[bytes.len() - 4 * size.area()..].chunks_exact(4);
    let depth = values.map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect();
    Grid::from_vec(size, depth).unwrap()
}

/// Same keys in the same places, same numbers.
fn assert_same(ours: &Value, script: &Value, place: &str) {
    match (ours, script) {
        (Value::Object(a), Value::Object(b)) => {
            let keys = |m: &serde_json::Map<String, Value>| m.keys().cloned().collect::<Vec<_>>();
            assert_eq!(keys(a), keys(b), "{place}");
            a.iter().for_each(|(k, v)| assert_same(v, &b[k], &format!("{place}.{k}")));
        }
        (Value::Array(a), Value::Array(b)) => {
            assert_eq!(a.len(), b.len(), "{place}");
            a.iter().zip(b).enumerate().for_each(|(i, (a, b))| assert_same(a, b, &format!("{place}[{i}]")));
        }
        _ => match (ours.as_f64(), script.as_f64()) {
            (Some(a), Some(b)) => assert!((a - b).abs() <= TOLERANCE, "{place}: {a}, script {b}"),
            _ => assert_eq!(ours, script, "{place}"),
        },
    }
}

fn assert_scores(ours: &impl serde::Serialize, script: &str) {
    assert_same(&serde_json::to_value(ours).unwrap(), &serde_json::from_str(script).unwrap(), "");
}

#[test]
fn scores_of_openmvs_clouds_are_those_of_the_script() {
    let truth = cloud(&facade6().join("truth/truth.ply"));
    let fused = cloud(&facade6().join("openmvs-2.3.0/fuse2/scene_dense.ply.zst"));
    assert_scores(
        &cloud_scores(&fused, &truth, &CloudScoreOptions::default()).unwrap(),
        r#"{"points": 27651, "thinned": 27648, "truth": 178045, "voxel": 0.01, "scores": [
            {"t": 0.02, "accuracy": 0.06706, "completeness": 0.01073, "f1": 0.0185, "gross": 0.052445},
            {"t": 0.05, "accuracy": 0.51034, "completeness": 0.1829, "f1": 0.26929, "gross": 0.002821},
            {"t": 0.1, "accuracy": 0.78961, "completeness": 0.39, "f1": 0.52211, "gross": 0.0}]}"#,
    );
}

/// The dense cloud with made-up labels.
fn labelled() -> LabelledPoints {
    let mut cloud = cloud(&facade6().join("openmvs-2.3.0/post7/scene_dense.ply.zst"));
    let label = |(i, p): (usize, &[f64; 3])| match i {
        _ if i % 50 == 0 => 0,
        _ if p[2] < 2.0 => 1,
        _ => 4 - u16::from(i % 7 == 0),
    };
    cloud.labels = Some(cloud.positions.iter().enumerate().map(label).collect());
    cloud
}

#[test]
fn label_scores_and_class_choices_are_those_of_the_script() {
    let (cloud, truth) = (labelled(), cloud(&facade6().join("truth/truth.ply")));
    assert_scores(
        &cloud_scores(&cloud, &truth, &CloudScoreOptions { per_class: true, ..Default::default() }).unwrap(),
        r#"{"points": 24171, "thinned": 24171, "truth": 178045, "voxel": 0.01, "scores": [
            {"t": 0.02, "accuracy": 0.06777, "completeness": 0.00949, "f1": 0.01665, "gross": 0.048281},
            {"t": 0.05, "accuracy": 0.52046, "completeness": 0.17038, "f1": 0.25672, "gross": 0.001407},
            {"t": 0.1, "accuracy": 0.79922, "completeness": 0.37663, "f1": 0.51199, "gross": 0.0}],
            "per_class": {
            "1": {"0.02": {"accuracy": 0.07228, "completeness": 0.0132}, "0.05": {"accuracy": 0.55556, "completeness": 0.24845}, "0.1": {"accuracy": 0.82866, "completeness": 0.52689}},
            "3": {"0.02": {"accuracy": 0.10253, "completeness": 0.00468}, "0.05": {"accuracy": 0.58894, "completeness": 0.04143}, "0.1": {"accuracy": 0.85885, "completeness": 0.08656}},
            "4": {"0.02": {"accuracy": 0.02786, "completeness": 0.00389}, "0.05": {"accuracy": 0.30249, "completeness": 0.09225}, "0.1": {"accuracy": 0.61692, "completeness": 0.30626}},
            "5": {"0.02": {"accuracy": 0.00522, "completeness": 0.00092}, "0.05": {"accuracy": 0.28522, "completeness": 0.13747}, "0.1": {"accuracy": 0.5913, "completeness": 0.40503}}},
            "labels": {"accuracy": 0.20639, "miou": 0.0649, "iou": {"1": 0.1478, "3": 0.0011, "4": 0.1107, "5": 0.0}}}"#,
    );
    let options = CloudScoreOptions {
        thresholds: vec![0.1, 0.05],
        voxel: Some(0.0),
        ignore_truth_labels: vec![3, 5],
        cloud_classes: vec![1, 4],
        ..Default::default()
    };
    assert_scores(
        &cloud_scores(&cloud, &truth, &options).unwrap(),
        r#"{"points": 21078, "thinned": 21078, "truth": 125882, "voxel": 0.0, "scores": [
            {"t": 0.05, "accuracy": 0.52254, "completeness": 0.19205, "f1": 0.28087, "gross": 0.001566},
            {"t": 0.1, "accuracy": 0.80273, "completeness": 0.47642, "f1": 0.59796, "gross": 0.0}],
            "labels": {"accuracy": 0.2354, "miou": 0.1403, "iou": {"1": 0.1676, "4": 0.113}}}"#,
    );
    let options = CloudScoreOptions {
        thresholds: vec![0.05],
        voxel: Some(0.08),
        truth_classes: vec![1, 4],
        per_class: true,
        ..Default::default()
    };
    assert_scores(
        &cloud_scores(&cloud, &truth, &options).unwrap(),
        r#"{"points": 24171, "thinned": 22997, "truth": 55351, "voxel": 0.08, "scores": [
            {"t": 0.05, "accuracy": 0.36096, "completeness": 0.19844, "f1": 0.25609, "gross": 0.072401}],
            "per_class": {"1": {"0.05": {"accuracy": 0.41637, "completeness": 0.21816}}, "4": {"0.05": {"accuracy": 0.2189, "completeness": 0.09268}}},
            "labels": {"accuracy": 0.22829, "miou": 0.1336, "iou": {"1": 0.1795, "4": 0.0877}}}"#,
    );
}

#[test]
fn scores_do_not_depend_on_the_number_of_threads() {
    let (cloud, truth) = (labelled(), cloud(&facade6().join("truth/truth.ply")));
    let options = CloudScoreOptions { per_class: true, ..Default::default() };
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| cloud_scores(&cloud, &truth, &options).unwrap())
    };
    let one = with(1);
    assert_eq!(with(2), one);
    assert_eq!(with(5), one);
}

fn map_folder(folder: &str) -> Vec<DepthMap> {
    let path = |i| facade6().join(format!("openmvs-2.3.0/{folder}/depth000{i}.dmap.zst"));
    (0..6).map(|i| depths_of(&path(i))).collect()
}

fn scored(a: &[DepthMap], b: &[DepthMap], options: &MapScoreOptions) -> MapScores {
    MapScores::mean(&a.iter().zip(b).map(|(a, b)| map_scores(a, b, options)).collect::<Vec<_>>())
}

#[test]
fn map_scores_are_those_of_the_script() {
    let filtered = map_folder("post7");
    assert_scores(
        &scored(&filtered, &map_folder("raw"), &MapScoreOptions::default()),
        r#"{"maps": 6, "valid_a": 0.742561, "valid_b": 0.891683, "both": 0.742144, "only_a": 0.000417, "only_b": 0.149539, "median_rel": 0.001208, "identical": 2.3e-05,
            "within_0.001": 0.417768, "good_0.001": 0.347535, "edge_good_0.001": 0.196378, "edge_within_0.001": 0.339825,
            "within_0.002": 0.721172, "good_0.002": 0.599959, "edge_good_0.002": 0.352524, "edge_within_0.002": 0.612302,
            "within_0.005": 0.952605, "good_0.005": 0.792663, "edge_good_0.005": 0.519949, "edge_within_0.005": 0.904037,
            "within_0.01": 0.991486, "good_0.01": 0.82484, "edge_good_0.01": 0.556298, "edge_within_0.01": 0.96843}"#,
    );
    let truth: Vec<_> =
        (0..6).map(|i| truth_depths(&facade6().join(format!("truth/000{i}.npy.zst")))).collect();
    let options = MapScoreOptions { relative: vec![0.005, 0.01], edge_band: 2 };
    assert_scores(
        &scored(&filtered, &truth, &options),
        r#"{"maps": 6, "valid_a": 0.742561, "valid_b": 0.949233, "both": 0.732494, "only_a": 0.010067, "only_b": 0.216739, "median_rel": 0.003943, "identical": 1.5e-05,
            "within_0.005": 0.578266, "good_0.005": 0.445713, "edge_good_0.005": 0.289495, "edge_within_0.005": 0.434747,
            "within_0.01": 0.76716, "good_0.01": 0.591666, "edge_good_0.01": 0.396361, "edge_within_0.01": 0.595208}"#,
    );
}
