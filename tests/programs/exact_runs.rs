//! The drop-in, given OpenMVS's maps and command lines, writes OpenMVS's maps, scenes and clouds.

use crate::common::{self, Scratch, bytes, facade6, shared};
use std::path::{Path, PathBuf};

/// The same points in the same order, each figure on all but one of 10 000 points.
const SAME_CLOUD: &str = "points.difference = { max = 0 }\norder.same = { min = 1 }\nviews.same = { min = 0.9999 }\n\
    position_of_depth.p9999 = { max = 1e-5 }\nnormal.p9999 = { max = 0.1 }\nweights.p9999 = { max = 1e-5 }\n";

/// The same depths and confidences on all but one of 10 000 pixels.
const SAME_MAPS: &str = "maps.only_b = { max = 0 }\nvalid.same = { min = 0.9999 }\n\
    depth.within_1e-6 = { min = 0.9999 }\nconfidence.within_1e-6 = { min = 0.9999 }\n\
    normal.p9999 = { max = 0.05 }\n";

/// Same neighbours, same order, same point counts; exp and acos differ between libraries.
const SAME_SCENE: &str = "images.other_name = { max = 0 }\nimages.other_id = { max = 0 }\n\
    camera.k.max = { max = 1e-9 }\ncamera.size_differs = { max = 0 }\ncamera.rotation.max = { max = 1e-9 }\n\
    camera.center.max = { max = 1e-9 }\nneighbors.same_order = { min = 1 }\nneighbors.same_points = { min = 1 }\n\
    neighbors.score.max = { max = 1e-6 }\nneighbors.scale.max = { max = 1e-6 }\n\
    neighbors.angle.max = { max = 1e-6 }\nneighbors.area.max = { max = 1e-6 }\ndepth.avg.max = { max = 1e-6 }\n\
    points.position.max = { max = 0 }\npoints.views_same = { min = 1 }\nroi.in_one = { max = 0 }\n";

/// Asserts that `ours` is `theirs` within `limits`.
#[track_caller]
fn assert_within(scratch: &Scratch, ours: &str, theirs: &Path, scene: Option<&str>, limits: &str) {
    scratch.write("expect.toml", format!("[limits]\n{limits}"));
    let theirs = theirs.display().to_string();
    let mut words = vec!["compare", ours, &theirs, "--expect", "expect.toml"];
    words.extend(scene.iter().flat_map(|scene| ["--scene", scene]));
    let outcome = scratch.run(common::SEMVS, &words);
    assert_eq!(outcome.code, Some(0), "{}{}", outcome.stdout, outcome.stderr);
}

/// Runs the drop-in in the scene's folder with the options of all of facade6's outputs and `more`.
fn facade6_run(maps: &str, more: &str) -> Scratch {
    let scratch = Scratch::facade6();
    scratch.add_maps(maps, ".");
    let options =
        "--resolution-level 1 --min-resolution 160 --tower-mode 0 --estimate-roi 0 --geometric-iters 0";
    scratch.densify_point_cloud(&format!("scene.mvs {options} {more}")).ok();
    scratch
}

#[test]
fn filters_of_the_bundled_scene() {
    for (bits, folder) in [(3, "post3"), (7, "post7")] {
        let scratch = facade6_run("raw", &format!("--postprocess-dmaps {bits}"));
        let theirs = facade6().join("openmvs-2.3.0").join(folder);
        assert_within(
            &scratch,
            ".",
            &theirs,
            None,
            &format!("header.differing = {{ max = 0 }}\n{SAME_MAPS}"),
        );
    }
}

#[test]
fn fusion_of_the_bundled_scene() {
    let limits = format!("{SAME_CLOUD}color.p9999 = {{ max = 1 }}\n");
    for (views, folder) in [(3, "post7"), (2, "fuse2")] {
        let scratch = facade6_run("post7", &format!("--postprocess-dmaps 0 --number-views-fuse {views}"));
        let cloud = facade6().join("openmvs-2.3.0").join(folder).join("scene_dense.ply.zst");
        assert_within(&scratch, "scene_dense.ply", &cloud, Some("scene_dense.mvs"), &limits);
        let scene = facade6().join("openmvs-2.3.0/post7/scene_dense.mvs");
        assert_within(&scratch, "scene_dense.mvs", &scene, None, SAME_SCENE);
    }
}

#[test]
fn project_archives_of_the_bundled_scene_hold_the_same_cloud() {
    for kind in [2, 3] {
        let scratch = facade6_run("post7", &format!("--postprocess-dmaps 0 --archive-type {kind}"));
        let theirs = facade6().join(format!("openmvs-2.3.0/archive{kind}/scene_dense.mvs"));
        let cloud = "points.normal.p9999 = { max = 0.1 }\npoints.color.p9999 = { max = 1 }\n\
                     points.weights.p9999 = { max = 1e-5 }\n";
        let limits =
            SAME_SCENE.replace("points.position.max = { max = 0 }", "points.position.max = { max = 1e-4 }");
        assert_within(&scratch, "scene_dense.mvs", &theirs, None, &format!("{limits}{cloud}"));
    }
}

/// OpenMVS's own test scene, if it is there, and a folder with its files and its filtered maps.
fn tests4() -> Option<(PathBuf, Scratch)> {
    let folder = shared("reference/tests4")?;
    let scratch = Scratch::new();
    std::fs::create_dir(scratch.path("images")).unwrap();
    scratch.write("scene.mvs", std::fs::read(folder.join("scene.mvs")).unwrap());
    for i in 0..4 {
        let image = format!("images/{i:05}.jpg");
        scratch.write(&image, std::fs::read(folder.join(&image)).unwrap());
        let map = format!("depth{i:04}.dmap");
        scratch.write(&map, bytes(&folder.join(format!("post7/{map}.zst"))));
    }
    Some((folder, scratch))
}

#[test]
fn fusion_and_crop_of_a_photographed_scene() {
    let Some((folder, scratch)) = tests4() else { return };
    // Decoders interpolate the reduced chroma of these photographs in different ways.
    let limits = format!("{SAME_CLOUD}color.p9999 = {{ max = 6 }}\n");
    let run = |options: &str| {
        let common = "scene.mvs --geometric-iters 0 --postprocess-dmaps 0";
        scratch.densify_point_cloud(&format!("{common} {options}")).ok();
    };
    run("--number-views-fuse 3");
    let (cloud, scene) = ("scene_dense.ply", "scene_dense.mvs");
    assert_within(&scratch, cloud, &folder.join("fuse_fuse3/scene_dense.ply.zst"), Some(scene), &limits);
    // One image sees one of the 2663 points twice, of which the scene that is written tells once.
    let limits_of_scene =
        SAME_SCENE.replace("points.views_same = { min = 1 }", "points.views_same = { min = 0.9996 }");
    assert_within(&scratch, scene, &folder.join("fuse_fuse3/scene_dense.mvs"), None, &limits_of_scene);
    // The region is estimated, and cropping changes the order of the points.
    run("--estimate-roi 1");
    assert_within(&scratch, cloud, &folder.join("fuse_roi1/scene_dense.ply.zst"), Some(scene), &limits);
}
