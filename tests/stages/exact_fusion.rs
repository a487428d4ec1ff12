//! Fusion reproduces OpenMVS 2.3.0 from its own maps, point for point.

use crate::common::{cloud, facade6, shared};
use crate::openmvs_maps::{MapsInMemory, points, scene};
use nalgebra::{Matrix3, Vector3};
use semvs::internals::evaluate::{Tolerance, compare_clouds};
use semvs::internals::fusion::{FusionInput, FusionOptions, FusionSummary, fuse};
use semvs::internals::geometry::Roi;
use semvs::internals::progress::Progress;
use semvs::internals::scene::{PointCloud, PointSink, PointSource, ResolutionOptions};
use semvs::internals::store::spool::PointSpool;
use semvs_formats::ply::Cloud;
use std::path::Path;

/// Largest distance of two positions relative to the depth of the point: f32 sums.
const MAX_RELATIVE_DISTANCE: f64 = 1e-5;
/// Largest angle of two normals, degrees.
const MAX_NORMAL_DEG: f64 = 0.1;
/// Largest relative difference of two fusion weights.
const MAX_RELATIVE_WEIGHT: f64 = 1e-5;
/// Share of the points that must be within the limits.
const MIN_SHARE: f64 = 0.9999;
/// Largest difference of a colour channel, levels: one JPEG decoder rounds as another one does not.
const MAX_COLOR: f64 = 1.0;
/// The same where images have reduced chroma, which decoders interpolate in different ways.
const MAX_COLOR_SUBSAMPLED: f64 = 6.0;

const FACADE6_RESOLUTION: ResolutionOptions = ResolutionOptions { level: 1, min: 160, max: 2560 };

fn facade6_maps(maps: &str) -> MapsInMemory {
    let folder = facade6().join("openmvs-2.3.0");
    MapsInMemory::load(
        &folder.join(maps),
        &facade6(),
        &scene(&folder.join("post7/scene_dense.mvs")),
        FACADE6_RESOLUTION,
    )
}

fn fused(maps: &MapsInMemory, options: &FusionOptions) -> (PointCloud, FusionSummary) {
    let input = FusionInput { views: &maps.views, source: maps, policy: None };
    let mut points = PointCloud::new(input.layout(options));
    let summary = fuse(&input, options, &Progress::silent(), &mut points).unwrap();
    assert_eq!(summary.points, points.len());
    (points, summary)
}

/// Asserts the same points in the same order, on all but one of 10 000 points in each respect.
fn assert_same_cloud(maps: &MapsInMemory, ours: &PointCloud, theirs: &Cloud, max_color: f64) {
    let theirs = points(theirs);
    assert_eq!(ours.len(), theirs.len(), "number of points");
    let cameras = maps.calibrations();
    let c = compare_clouds(ours, &theirs, Some(&cameras), &Tolerance::default()).unwrap();
    println!("{} points compared", ours.len());
    for (what, differences, most) in [
        ("position", c.position_of_depth, MAX_RELATIVE_DISTANCE),
        ("weights", c.weights, MAX_RELATIVE_WEIGHT),
        ("normal", c.normal, MAX_NORMAL_DEG),
        ("colour", c.color, max_color),
    ] {
        let found = differences.unwrap();
        println!("  {what}: {} equal, largest difference {:e}", found.equal, found.max);
        assert!(found.p9999 <= most, "{what}: {found:?}");
    }
    let views = c.views.unwrap();
    assert!(views.equal as f64 >= MIN_SHARE * views.compared as f64, "{views:?}");
}

#[test]
fn three_views_per_point_are_fused_as_by_openmvs() {
    let maps = facade6_maps("post7");
    let (points, summary) = fused(&maps, &FusionOptions::default());
    assert_same_cloud(
        &maps,
        &points,
        &cloud(&facade6().join("openmvs-2.3.0/post7/scene_dense.ply.zst")),
        MAX_COLOR,
    );
    // From OpenMVS's console: "6 depth-maps, 132021 depths, 24171 points".
    assert_eq!((summary.maps, summary.depths, summary.points), (6, 132_021, 24_171));
}

#[test]
fn two_views_per_point_are_fused_as_by_openmvs() {
    let options = FusionOptions { number_views_fuse: 2, ..FusionOptions::default() };
    let maps = facade6_maps("post7");
    let (points, _) = fused(&maps, &options);
    assert_same_cloud(
        &maps,
        &points,
        &cloud(&facade6().join("openmvs-2.3.0/fuse2/scene_dense.ply.zst")),
        MAX_COLOR,
    );
}

#[test]
fn a_photographed_scene_is_fused_as_by_openmvs() {
    let Some(folder) = shared("reference/tests4") else { return };
    let maps = tests4_maps(&folder);
    let (points, _) = fused(&maps, &FusionOptions::default());
    assert_same_cloud(
        &maps,
        &points,
        &cloud(&folder.join("fuse_fuse3/scene_dense.ply.zst")),
        MAX_COLOR_SUBSAMPLED,
    );
}

#[test]
fn a_crop_leaves_the_points_in_the_order_of_openmvs() {
    let Some(folder) = shared("reference/tests4") else { return };
    let maps = tests4_maps(&folder);
    let options = FusionOptions::default();
    let input = FusionInput { views: &maps.views, source: &maps, policy: None };
    let memory = 4 << 20;
    let mut spool =
        PointSpool::new(input.layout(&options), Some(tests4_roi()), &std::env::temp_dir(), memory);
    fuse(&input, &options, &Progress::silent(), &mut spool).unwrap();
    let spooled = spool.finish().unwrap();
    let mut points = PointCloud::new(spooled.layout());
    spooled.for_each(&mut |point| points.push(point)).unwrap();
    assert_same_cloud(
        &maps,
        &points,
        &cloud(&folder.join("fuse_roi1/scene_dense.ply.zst")),
        MAX_COLOR_SUBSAMPLED,
    );
}

/// The region that `--estimate-roi 1` finds for this scene.
fn tests4_roi() -> Roi {
    Roi {
        rotation: Matrix3::identity(),
        center: Vector3::new(0.569575, -0.991925, -3.074815),
        half_extent: Vector3::new(5.386892, 3.184098, 4.547450),
    }
}

fn tests4_maps(folder: &Path) -> MapsInMemory {
    let dense = scene(&folder.join("fuse_fuse3/scene_dense.mvs"));
    MapsInMemory::load(&folder.join("post7"), folder, &dense, ResolutionOptions::default())
}
