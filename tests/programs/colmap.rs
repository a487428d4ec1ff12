//! COLMAP as a host: its workspace in place of a scene, its depth maps in place of ours, and the way back.

#[cfg(unix)]
use crate::common;
use crate::common::{Scratch, facade6};
use semvs_formats::colmap::{Encoding, Matrix, Model, NO_POINT, parse_patch_match_config, read_visibility};
use semvs_formats::{Limits, dmap::DepthMapFile, mvs, ply};
use std::path::Path;

/// Depth maps at half size, without a region of interest.
const HALF: &str = "--resolution-level 1 --min-resolution 160 --estimate-roi 0";
/// Label maps of the photographs.
const LABELS: &str = "--label-path labels --class-table 3dom-facade";

/// facade6 with `dense/`: its photographs and the sparse model of this encoding.
fn workspace(encoding: Encoding) -> Scratch {
    let scratch = Scratch::facade6();
    let (from, names): (_, &[&str]) = match encoding {
        Encoding::Text => (facade6().join("sparse"), &["cameras.txt", "images.txt", "points3D.txt"]),
        Encoding::Binary => (
            facade6().join("colmap-4.2/binary"),
            &["cameras.bin", "images.bin", "points3D.bin", "rigs.bin", "frames.bin"],
        ),
    };
    std::fs::create_dir_all(scratch.path("dense/sparse")).unwrap();
    std::fs::create_dir_all(scratch.path("dense/images")).unwrap();
    for name in names {
        std::fs::copy(from.join(name), scratch.path("dense/sparse").join(name)).unwrap();
    }
    for entry in std::fs::read_dir(facade6().join("images")).unwrap() {
        let entry = entry.unwrap();
        std::fs::copy(entry.path(), scratch.path("dense/images").join(entry.file_name())).unwrap();
    }
    scratch
}

/// A workspace whose `stereo/` holds OpenMVS's filtered maps, which lie in `maps/` too.
fn with_colmap_maps() -> Scratch {
    let scratch = workspace(Encoding::Text);
    scratch.add_maps("post7", "maps");
    scratch.semvs("export dense --to colmap --depth-maps maps -o dense").ok();
    scratch
}

fn cloud(path: &Path) -> ply::Cloud {
    ply::read_cloud(std::fs::File::open(path).unwrap(), &Limits::default()).unwrap()
}

fn scene(path: &Path) -> mvs::Scene {
    mvs::read(path, &Limits::default()).unwrap()
}

fn matrix(path: &Path) -> Matrix {
    let bytes = std::fs::read(path).unwrap();
    Matrix::read(bytes.as_slice(), Some(bytes.len() as u64), &Limits::default()).unwrap()
}

/// Largest distance between points of the same position in two clouds.
fn farthest(a: &ply::Cloud, b: &ply::Cloud) -> f32 {
    let distance =
        |(p, q): (&[f32; 3], &[f32; 3])| p.iter().zip(q).map(|(p, q)| (p - q).abs()).fold(0.0, f32::max);
    a.positions.iter().zip(&b.positions).map(distance).fold(0.0, f32::max)
}

/// The bundled `.mvs` was converted from the text model by OpenMVS's importer. What is imported here must be that: the
/// numbers differ by the last digits of quaternions written in 12 digits.
#[test]
fn a_workspace_is_the_scene_that_openmvs_imports_from_it() {
    const ROUNDING: f64 = 1e-9;
    let scratch = workspace(Encoding::Text);
    scratch.semvs("import dense -o dense.mvs").ok();
    let (ours, theirs) = (scene(&scratch.path("dense.mvs")), scene(&scratch.path("scene.mvs")));
    assert_eq!(ours.images.len(), theirs.images.len());
    for (a, b) in ours.images.iter().zip(&theirs.images) {
        assert_eq!((a.id, a.platform, a.camera, a.pose), (b.id, b.platform, b.camera, b.pose));
        let name = String::from_utf8_lossy(&b.name).into_owned();
        assert_eq!(String::from_utf8_lossy(&a.name), format!("dense/{name}"));
    }
    let (p, q) = (&ours.platforms[0], &theirs.platforms[0]);
    assert_eq!((p.cameras[0].width, p.cameras[0].height), (q.cameras[0].width, q.cameras[0].height));
    let near = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < ROUNDING);
    assert!(near(&p.cameras[0].k, &q.cameras[0].k), "{:?} {:?}", p.cameras[0].k, q.cameras[0].k);
    for (a, b) in p.poses.iter().zip(&q.poses) {
        assert!(near(&a.rotation, &b.rotation) && near(&a.center, &b.center), "{a:?} {b:?}");
    }
    assert_eq!(ours.points.positions, theirs.points.positions);
    assert_eq!(ours.points.views.images, theirs.points.views.images);
    assert_eq!(ours.points.colors, theirs.points.colors);
}

/// Poses differ in the 16th digit between the `.mvs` and the model, which moves the estimates by rounding at most.
#[test]
fn densifying_a_workspace_is_densifying_its_scene() {
    /// A tenth of a millimetre in a scene of metres; the mean pixel is 3 cm wide.
    const ROUNDING: f32 = 1e-4;
    let scratch = workspace(Encoding::Binary);
    scratch.semvs(&format!("densify dense --geometric-iters 1 {HALF}")).ok();
    scratch.semvs("import dense -o imported.mvs").ok();
    scratch.semvs(&format!("densify imported.mvs -o mvs/dense.ply -w mvs --geometric-iters 1 {HALF}")).ok();
    let (ours, theirs) =
        (scene(&scratch.path("dense/semvs/dense.mvs")), scene(&scratch.path("mvs/dense.mvs")));
    for (a, b) in ours.images.iter().zip(&theirs.images) {
        assert!(!a.view_scores.is_empty());
        assert_eq!(a.view_scores, b.view_scores, "neighbours with their scores");
    }
    assert_eq!(String::from_utf8_lossy(&ours.images[0].name), "../images/0003.jpg");
    let (a, b) = (cloud(&scratch.path("dense/semvs/dense.ply")), cloud(&scratch.path("mvs/dense.ply")));
    assert!(a.len() > 20_000, "{}", a.len());
    assert_eq!(a.len(), b.len());
    assert!(farthest(&a, &b) < ROUNDING, "{}", farthest(&a, &b));
    for i in 0..6 {
        assert!(scratch.has(&format!("dense/semvs/depth{i:04}.dmap")));
    }
    let touched = |name: &str| !name.starts_with("dense/semvs/") && name.starts_with("dense/");
    let files: Vec<String> = scratch.files().into_iter().filter(|name| touched(name)).collect();
    assert_eq!(files.len(), 5 + 6, "nothing but sparse and images: {files:?}");
}

/// Maps written for COLMAP and read back lose their confidence, so points are means with other weights.
#[test]
fn colmap_maps_are_fused_like_our_own() {
    const FEW: f64 = 0.01;
    /// Half a pixel of these maps at the distance of the façade, 14 m.
    const NEAR: f32 = 0.04;
    let scratch = with_colmap_maps();
    let maps = scratch.path("dense/stereo/depth_maps/0003.jpg.geometric.bin");
    let original = DepthMapFile::read(scratch.path("maps/depth0000.dmap"), &Limits::default()).unwrap();
    assert_eq!(matrix(&maps).data, original.depth);
    scratch.semvs("fuse scene.mvs --depth-maps maps -o direct.ply --estimate-roi 0").ok();
    let said = scratch.semvs("fuse dense --maps geometric -o colmap.ply --estimate-roi 0").ok();
    assert!(said.stdout.contains("colmap.ply"));
    let (a, b) = (cloud(&scratch.path("direct.ply")), cloud(&scratch.path("colmap.ply")));
    let differing = a.len().abs_diff(b.len()) as f64 / a.len() as f64;
    assert!(differing < FEW, "{} and {} points", a.len(), b.len());
    let nearest = |p: &[f32; 3]| {
        let d = |q: &[f32; 3]| p.iter().zip(q).map(|(p, q)| (p - q) * (p - q)).sum::<f32>();
        a.positions.iter().map(d).fold(f32::INFINITY, f32::min).sqrt()
    };
    println!("{} direct, {} from COLMAP's maps", a.len(), b.len());
    let far = b.positions.iter().step_by(50).filter(|p| nearest(p) > NEAR).count();
    assert!(far as f64 <= FEW * b.len() as f64 / 50.0, "{far} points have no direct one near");
    assert_eq!(b.normals.len(), b.len());
}

#[test]
fn labels_are_checked_on_colmap_maps_too() {
    let scratch = with_colmap_maps();
    let report = "--report report.json";
    scratch
        .semvs(&format!(
            "fuse dense -o labelled.ply --estimate-roi 0 {LABELS} --exclude-classes obstacle {report}"
        ))
        .ok();
    let labelled = cloud(&scratch.path("labelled.ply"));
    assert!(labelled.len() > 10_000);
    assert_eq!(labelled.labels.len(), labelled.len());
    scratch.semvs("fuse dense -o plain.ply --estimate-roi 0").ok();
    let plain = cloud(&scratch.path("plain.ply"));
    assert!(labelled.len() < plain.len(), "{} of {}: the tree is gone", labelled.len(), plain.len());
    let report = String::from_utf8(scratch.read("report.json")).unwrap();
    assert!(report.contains("obstacle"));
}

#[test]
fn odd_values_and_odd_sizes_of_colmap_maps_are_taken() {
    let scratch = with_colmap_maps();
    // Sizes as max_image_size leaves them: 267×201 where half to even gives 267×200.
    let depth = matrix(&scratch.path("dense/stereo/depth_maps/0003.jpg.geometric.bin"));
    let (width, height) = (267u32, 201u32);
    for name in ["0003", "0004", "0005", "0006", "0012", "0013"] {
        let from = matrix(&scratch.path(&format!("dense/stereo/depth_maps/{name}.jpg.geometric.bin")));
        let at = |x: u32, y: u32| {
            let (x, y) = (x * from.width / width, y * from.height / height);
            from.data[(y * from.width + x) as usize]
        };
        let mut data: Vec<f32> =
            (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| at(x, y)).collect();
        data[..6].copy_from_slice(&[f32::NAN, f32::INFINITY, -3.0, 1e30, 1e-30, f32::MIN_POSITIVE / 2.0]);
        let mut bytes = Vec::new();
        Matrix { width, height, channels: 1, data }.write(&mut bytes).unwrap();
        scratch.write(&format!("dense/stereo/depth_maps/{name}.jpg.photometric.bin"), bytes);
    }
    scratch.semvs("fuse dense --maps photometric -o odd.ply --estimate-roi 0").ok();
    let odd = cloud(&scratch.path("odd.ply"));
    assert!(odd.len() > 10_000, "{}", odd.len());
    assert!(odd.positions.iter().flatten().all(|v| v.is_finite() && v.abs() < 100.0));
    let wrong =
        Matrix::from_depths(depth.width, depth.height / 2, depth.data[..depth.data.len() / 2].to_vec())
            .unwrap();
    let mut bytes = Vec::new();
    wrong.write(&mut bytes).unwrap();
    scratch.write("dense/stereo/depth_maps/0003.jpg.geometric.bin", &bytes);
    scratch.semvs("fuse dense -o x.ply").fails_naming(&["0003.jpg.geometric.bin", "200×75", "400×300"]);
    scratch.write("dense/stereo/depth_maps/0003.jpg.geometric.bin", &bytes[..bytes.len() - 1]);
    scratch.semvs("fuse dense -o x.ply").fails_naming(&["0003.jpg.geometric.bin"]);
}

#[test]
fn what_cannot_be_densified_is_said() {
    let scratch = workspace(Encoding::Text);
    scratch.semvs("fuse dense -o x.ply").fails_naming(&["dense", "patch_match_stereo"]);
    scratch.semvs("fuse dense --maps photometric -o x.ply").fails_naming(&["photometric"]);
    scratch.semvs("fuse scene.mvs --maps geometric -o x.ply").fails_naming(&["COLMAP workspace"]);
    scratch.semvs("densify labels").fails_naming(&["labels", "no COLMAP workspace"]);
    scratch.write("dense/fused.ply", "theirs");
    scratch.semvs("densify dense -o dense/fused.ply").fails_naming(&["fused.ply", "file of COLMAP"]);
    scratch.semvs("import dense -o dense/sparse/cameras.txt").fails_naming(&[".mvs"]);
    scratch.edit("dense/sparse/cameras.txt", |text| {
        let changed =
            String::from_utf8_lossy(text).replace("PINHOLE", "OPENCV").replace("150.0", "150.0 0.1 0 0 0");
        *text = changed.into_bytes();
    });
    scratch.semvs("densify dense").fails_naming(&["OPENCV", "colmap image_undistorter"]);
}

#[test]
fn a_model_survives_export_and_import() {
    /// Single precision of coordinates of tens of metres.
    const ROUNDING: f64 = 1e-5;
    let scratch = workspace(Encoding::Text);
    let original = Model::read(scratch.path("dense/sparse"), &Limits::default()).unwrap();
    for (words, folder) in [("", "new"), ("--text", "text")] {
        let said = scratch.semvs(&format!("export scene.mvs --to colmap {words} -o {folder}")).ok();
        assert!(said.stderr.contains("--copy-images"));
        let model = Model::read(scratch.path(&format!("{folder}/sparse")), &Limits::default()).unwrap();
        assert_eq!((model.cameras.len(), model.images.len()), (1, 6));
        assert_eq!(model.cameras[0].pinhole().map(|k| k[2]), Some(200.0), "the corner is the origin again");
        assert_eq!(model.points.len(), original.points.len());
        for (a, b) in model.images.iter().zip(&original.images) {
            assert_eq!((a.id, &a.name), (b.id, &b.name));
            let (p, q) = (a.pose.rotation_matrix(), b.pose.rotation_matrix());
            assert!(p.iter().zip(&q).all(|(p, q)| (p - q).abs() < ROUNDING));
            let near = |(s, t): (&f64, &f64)| (s - t).abs() < ROUNDING;
            assert!(a.pose.translation.iter().zip(&b.pose.translation).all(near));
            assert!(a.observations.iter().all(|o| o.point_id != NO_POINT));
        }
        for (i, id) in model.points.ids.iter().enumerate() {
            for element in model.points.track(i) {
                let image = model.images.iter().find(|image| image.id == element.image_id).unwrap();
                let observation = image.observations[element.observation as usize];
                assert_eq!(observation.point_id, *id, "0-based indices");
            }
        }
        // Key points are where the features were found, up to their reprojection errors.
        let observed =
            |model: &Model| model.images[0].observations.iter().map(|o| o.position).collect::<Vec<_>>();
        let (ours, theirs) = (observed(&model), observed(&original));
        let apart = |(a, b): (&[f64; 2], &[f64; 2])| (a[0] - b[0]).hypot(a[1] - b[1]);
        let mut distances: Vec<f64> = ours.iter().zip(&theirs).map(apart).collect();
        distances.sort_by(f64::total_cmp);
        assert!(distances[distances.len() / 2] < 1.0, "{}", distances[distances.len() / 2]);
        scratch.semvs(&format!("import {folder} -o {folder}.mvs --image-path images")).ok();
        let (a, b) = (scene(&scratch.path(&format!("{folder}.mvs"))), scene(&scratch.path("scene.mvs")));
        assert_eq!((a.points.positions, a.points.views.images), (b.points.positions, b.points.views.images));
    }
    scratch.semvs("export scene.mvs --to colmap -o new").fails_naming(&["model is here already"]);
    scratch.semvs("export dense --to colmap -o dense").fails_naming(&["this is the input"]);
}

#[test]
fn what_colmaps_fusion_needs_is_written() {
    let scratch = with_colmap_maps();
    let files = scratch.files();
    for name in ["0003.jpg", "0013.jpg"] {
        for folder in ["depth_maps", "normal_maps"] {
            assert!(files.contains(&format!("dense/stereo/{folder}/{name}.geometric.bin")), "{files:?}");
        }
    }
    let normals = matrix(&scratch.path("dense/stereo/normal_maps/0003.jpg.geometric.bin"));
    let depths = matrix(&scratch.path("dense/stereo/depth_maps/0003.jpg.geometric.bin"));
    assert_eq!((normals.channels, normals.width), (3, depths.width));
    let faces = |n: &[f32; 3], d: &f32| if *d > 0.0 { n[2] < 0.0 } else { *n == [0.0; 3] };
    let turned = normals.normals().unwrap().iter().zip(&depths.data).filter(|(n, d)| !faces(n, d)).count();
    assert!(turned < depths.data.len() / 50, "{turned} normals face away");
    let config = String::from_utf8(scratch.read("dense/stereo/patch-match.cfg")).unwrap();
    assert_eq!(parse_patch_match_config(&config).unwrap().len(), 6);
    assert_eq!(scratch.read("dense/stereo/fusion.cfg").split(|&b| b == b'\n').count(), 7);
    scratch
        .semvs("export dense --to colmap --depth-maps maps -o dense")
        .fails_naming(&["depth_maps", "geometric"]);

    scratch.semvs("fuse dense -o openmvs.ply --ply-layout openmvs --estimate-roi 0").ok();
    scratch.semvs("export scene.mvs --to colmap -p openmvs.ply --copy-images -o new").ok();
    let (fused, views) = (cloud(&scratch.path("new/fused.ply")), scratch.read("new/fused.ply.vis"));
    let views = read_visibility(views.as_slice(), Some(views.len() as u64), &Limits::default()).unwrap();
    let original = cloud(&scratch.path("openmvs.ply"));
    assert_eq!((fused.len(), views.len()), (original.len(), original.len()));
    assert_eq!((&fused.positions, &views.images), (&original.positions, &original.views.images));
    let header = String::from_utf8_lossy(&scratch.read("new/fused.ply")[..200]).into_owned();
    assert!(header.find("float nx").unwrap() < header.find("uchar red").unwrap(), "{header}");
    scratch.semvs("import new -o round/scene.mvs --fused").ok();
    let round = cloud(&scratch.path("round/scene.ply"));
    assert_eq!((&round.positions, &round.views.images), (&original.positions, &original.views.images));
    assert_eq!((&round.normals, &round.colors), (&original.normals, &original.colors));
    scratch.semvs("import new -o new/fused.mvs --fused").fails_naming(&["fused.ply", "file of COLMAP"]);
    assert_eq!(scratch.read("new/images/0003.jpg"), scratch.read("images/0003.jpg"));
    scratch
        .semvs("densify new --resolution-level 2 --min-resolution 80 --number-views 2 --geometric-iters 0")
        .ok();
    scratch.semvs("fuse new --depth-maps new/semvs -o again.ply --number-views-fuse 2").ok();
}

#[test]
fn colmap_maps_become_depth_maps() {
    let scratch = with_colmap_maps();
    scratch.semvs("import dense -o mvs/scene.mvs --maps geometric").ok();
    let ours = DepthMapFile::read(scratch.path("mvs/depth0002.dmap"), &Limits::default()).unwrap();
    let original = DepthMapFile::read(scratch.path("maps/depth0002.dmap"), &Limits::default()).unwrap();
    assert_eq!((ours.ids[0], &ours.depth), (2, &original.depth));
    assert!(ours.ids.len() > 2 && ours.confidence.is_empty());
    assert_eq!(String::from_utf8_lossy(&ours.image_name), "../dense/images/0005.jpg");
    assert!(
        ours.k.iter().zip(&original.k).all(|(a, b)| (a - b).abs() < 1e-3),
        "{:?} {:?}",
        ours.k,
        original.k
    );
    scratch.semvs("fuse mvs/scene.mvs --depth-maps mvs -o a.ply --estimate-roi 0").ok();
    scratch.semvs("fuse dense -o b.ply --estimate-roi 0").ok();
    assert_eq!(scratch.read("a.ply"), scratch.read("b.ply"), "the same maps by another way");
    scratch.semvs("import dense -o x.mvs --maps photometric").fails_naming(&["photometric"]);
}

/// Every `semvs` line of docs/colmap.md runs, and leaves what the page says.
#[cfg(unix)]
#[test]
fn the_page_about_colmap_is_true() {
    let page = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/colmap.md")).unwrap();
    let blocks = page.split("```sh\n").skip(1).map(|block| block.split("```").next().unwrap());
    let commands: Vec<&str> = blocks.flat_map(str::lines).filter(|line| line.starts_with("semvs ")).collect();
    assert!(commands.len() >= 7, "{commands:?}");
    let scratch = with_colmap_maps();
    for command in commands {
        let command = command.replacen("semvs", common::SEMVS, 1);
        scratch.run("sh", &["-c", &command]).ok();
    }
    for name in [
        "dense/semvs/dense.ply",
        "dense/semvs/dense.mvs",
        "dense/semvs/depth0005.dmap",
        "labelled.ply",
        "ours/sparse/points3D.bin",
        "ours/stereo/depth_maps/0013.jpg.geometric.bin",
        "ours/images/0013.jpg",
        "mvs/depth0005.dmap",
        "arrays/0013.confidence.npy",
        "mine.ply",
    ] {
        assert!(scratch.has(name), "{name}");
    }
}
