//! MVSI interface archives: real and synthetic files of every version.

use crate::common::{self, damage, fixture, shared, small_limits};
use semvs_formats::mvs::{self, Container, NO_ID, Scene, SceneFile};
use semvs_formats::{Error, Limits};

fn read(bytes: &[u8]) -> SceneFile {
    SceneFile::from_bytes(bytes, &Limits::default()).unwrap()
}

fn corpus(name: &str) -> Vec<u8> {
    fixture(&format!("format-corpus/mvsi/{name}.mvs"))
}

fn write(scene: &Scene, version: u32) -> Vec<u8> {
    let mut out = Vec::new();
    mvs::write_interface(&mut out, scene, version).unwrap();
    out
}

/// The same file with an unrotated box.
fn with_box(mut bytes: Vec<u8>) -> Vec<u8> {
    let at = bytes.len() - 120;
    for i in 0..9 {
        let value = if i % 4 == 0 { 1.0 } else { 0.0 };
        bytes[at + 8 * i..at + 8 * i + 8].copy_from_slice(&f64::to_le_bytes(value));
    }
    bytes
}

fn assert_same_bytes(bytes: &[u8], what: &str) {
    let file = read(bytes);
    let mut out = Vec::new();
    file.write(&mut out).unwrap();
    assert_eq!(file.trailing_bytes, 0, "{what}");
    assert!(out == bytes, "{what}: bytes differ after rewriting");
}

#[test]
fn every_version_is_rewritten_to_the_same_bytes() {
    for version in 0..=7 {
        let bytes = corpus(&format!("i{version}"));
        assert_eq!(read(&bytes).container, Container::Interface { version });
        assert_same_bytes(&bytes, &format!("i{version}"));
    }
    for name in ["i7_bs", "i7_one"] {
        assert_same_bytes(&corpus(name), name);
    }
}

#[test]
fn real_files_are_rewritten_to_the_same_bytes() {
    for name in ["facade6/scene.mvs", "facade6/openmvs-2.3.0/post7/scene_dense.mvs"] {
        assert_same_bytes(&fixture(name), name);
    }
    for name in [
        "datasets/facade16/scene.mvs",
        "datasets/fountain_p11/scene.mvs",
        "reference/facade16/scene_dense.mvs",
        "reference/fountain_p11/scene_dense.mvs",
        "reference/tests4/fuse_fuse3/scene_dense.mvs",
        "reference/tests4/scene.mvs",
    ] {
        if let Some(bytes) = shared(name) {
            assert_same_bytes(&bytes, name);
            read(&bytes).scene.check().unwrap();
        }
    }
}

#[test]
fn values_of_version_7_are_where_they_belong() {
    let scene = read(&corpus("i7")).scene;
    assert_eq!(scene.platforms.len(), 2);
    assert_eq!(scene.platforms[1].name, "été".as_bytes());
    let camera = &scene.platforms[0].cameras[0];
    assert_eq!((camera.name.as_slice(), camera.band.as_slice()), (&b"cam-0"[..], &b"NIR"[..]));
    assert_eq!((camera.width, camera.height, camera.k[0], camera.k[2]), (640, 480, 500.0, 310.25));
    assert_eq!(scene.platforms[0].poses[1].center, [4.0, 5.0, 6.0]);
    assert_eq!(scene.images.len(), 4);
    assert_eq!(scene.images[0].view_scores.len(), 2);
    assert_eq!((scene.images[1].mask_name.as_slice(), scene.images[1].id), (&b"masks/m1.png"[..], 101));
    assert_eq!((scene.images[1].min_depth, scene.images[1].max_depth), (2.0, 4.0));
    assert_eq!((scene.images[3].pose, scene.images[3].name.as_slice()), (NO_ID, &b"images/uncal.jpg"[..]));
    assert_eq!(scene.points.positions.len(), 5);
    assert_eq!(scene.points.colors[0], [30, 20, 10]);
    assert_eq!(scene.points.views.images_of(1), [2, 1, 0]);
    assert_eq!(scene.points.views.weights_of(1), [1.0, 1.5, 2.0]);
    assert_eq!((scene.lines.len(), scene.line_colors[0]), (2, [3, 2, 1]));
    assert_eq!(scene.transform[3], 11.0);
    // The box of this file is not rotated properly, so it does not count.
    assert_eq!(scene.obb, None);
    let obb = read(&with_box(corpus("i7"))).scene.obb.unwrap();
    assert_eq!((obb.center, obb.half_extent), ([1.5; 3], [2.5, 3.5, 4.5]));
}

/// Versions lose exactly the fields that came later.
#[test]
fn a_version_keeps_the_fields_it_has() {
    let newest = read(&with_box(corpus("i7"))).scene;
    for version in 0..=7 {
        let scene = read(&write(&newest, version)).scene;
        assert_eq!(scene.points, newest.points, "version {version}");
        assert_eq!(scene.platforms[0].cameras[0].width > 0, version >= 1);
        assert_eq!(scene.lines == newest.lines && scene.line_normals == newest.line_normals, version >= 1);
        assert_eq!(scene.transform == newest.transform, version >= 2);
        assert_eq!(scene.images[1].id == newest.images[1].id, version >= 3);
        assert_eq!(scene.platforms[0].cameras[0].band == newest.platforms[0].cameras[0].band, version >= 4);
        assert_eq!(scene.images[1].mask_name == newest.images[1].mask_name, version >= 5);
        assert_eq!(scene.obb == newest.obb, version >= 6);
        assert_eq!(scene.images[0] == newest.images[0], version >= 7);
        assert_eq!(scene == newest, version == 7);
    }
}

/// Every version holds less than the next, in words; nothing is said to be lost that is not.
#[test]
fn losses_are_named() {
    let newest = read(&with_box(corpus("i7"))).scene;
    let losses = |version| newest.losses(Container::Interface { version });
    let counts: Vec<usize> = (0..=7).map(|version| losses(version).len()).collect();
    assert_eq!(counts, [8, 6, 5, 4, 3, 2, 1, 0]);
    for version in 0..=7 {
        let scene = read(&write(&newest, version)).scene;
        assert_eq!(scene.losses(Container::Interface { version }), Vec::<&str>::new(), "version {version}");
    }
    let project = newest.losses(Container::Project { kind: mvs::ArchiveKind::Binary });
    assert!(project.iter().any(|lost| lost.contains("lines")), "{project:?}");
}

/// Version 0 has no resolution, so its intrinsics are normalised: 500 / 640 and (310.25 + 0.5) / 640 - 0.5.
#[test]
fn version_0_gets_normalised_intrinsics() {
    let newest = read(&with_box(corpus("i7"))).scene;
    let k = read(&write(&newest, 0)).scene.platforms[0].cameras[0].k;
    assert_eq!(k[0], 0.78125);
    assert!((k[2] - -0.014453125).abs() < 1e-15, "{}", k[2]);
}

#[test]
fn attributes_come_and_go_independently() {
    let full = read(&with_box(corpus("i7"))).scene;
    for version in 1..=7 {
        for absent in 0..32u32 {
            let mut scene = full.clone();
            let without = |bit: u32| absent & 1 << bit != 0;
            if without(0) {
                scene.points.normals.clear();
            }
            if without(1) {
                scene.points.colors.clear();
            }
            if without(2) {
                scene.points.views.weights.clear();
            }
            if without(3) {
                scene.line_normals.clear();
            }
            if without(4) {
                scene.line_colors.clear();
                scene.obb = None;
            }
            let back = read(&write(&scene, version)).scene;
            assert_eq!(back.points, scene.points);
            assert_eq!((back.line_normals, back.line_colors), (scene.line_normals, scene.line_colors));
            assert_eq!(back.obb, scene.obb.filter(|_| version >= 6));
        }
    }
}

#[test]
fn boxes_without_volume_are_absent_but_rewritten() {
    let mut bytes = with_box(corpus("i7"));
    let end = bytes.len();
    bytes[end - 8..].copy_from_slice(&f64::to_le_bytes(-7.0)); // ptMax.z below ptMin.z
    let scene = read(&bytes).scene;
    assert_eq!(scene.obb, None);
    assert_same_bytes(&bytes, "inverted box");
    // Corners whose centre and half extent cannot be told apart from rounding.
    bytes[end - 8..].copy_from_slice(&f64::to_le_bytes(1e-300));
    bytes[end - 32..end - 24].copy_from_slice(&f64::to_le_bytes(-0.1));
    assert!(read(&bytes).scene.obb.is_some());
    assert_same_bytes(&bytes, "rounded box");
}

#[test]
fn what_is_not_a_readable_scene_is_refused_clearly() {
    let message = |bytes: &[u8]| SceneFile::from_bytes(bytes, &Limits::default()).unwrap_err().to_string();
    assert!(message(&corpus("i8")).contains("version 8"), "{}", message(&corpus("i8")));
    for bytes in [&b""[..], b"M", b"MVS", b"ply\nformat ascii 1.0\n", &[0; 4096]] {
        assert!(message(bytes).contains("not an OpenMVS scene"), "{}", message(bytes));
    }
    let mut bytes = corpus("i7");
    bytes[12..20].copy_from_slice(&u64::MAX.to_le_bytes());
    assert!(message(&bytes).contains("platforms"), "{}", message(&bytes));
    bytes = corpus("i7");
    bytes.truncate(1000);
    assert!(message(&bytes).contains("images at byte 975"), "{}", message(&bytes));
    assert!(matches!(mvs::read(common::root(), &Limits::default()), Err(Error::Io(_))));
    assert!(mvs::read(common::root().join("Cargo.toml"), &Limits::default()).is_err());
}

#[test]
fn bytes_after_the_end_are_counted() {
    let mut bytes = corpus("i6");
    bytes.extend_from_slice(b"tail");
    assert_eq!(read(&bytes).trailing_bytes, 4);
}

#[test]
fn bad_indices_and_numbers_are_named() {
    let good = read(&fixture("facade6/scene.mvs")).scene;
    good.check().unwrap();
    let refused = |change: fn(&mut Scene), place: &str| {
        let mut scene = good.clone();
        change(&mut scene);
        let message = scene.check().unwrap_err().to_string();
        assert!(message.starts_with(place), "{message}");
    };
    refused(|s| s.images[3].platform = 99, "images[3].platform: index 99");
    refused(|s| s.images[3].camera = 1, "images[3].camera: ");
    refused(|s| s.images[3].pose = 1000, "images[3].pose: ");
    refused(|s| s.images[2].name = b"a\0b".to_vec(), "images[2].name: ");
    refused(|s| s.points.views.images[0] = 6, "vertices[0].views: index 6");
    refused(|s| s.points.colors = vec![[0; 3]], "verticesColor: 1 entries");
    refused(|s| s.points.views.weights = vec![1.0], "views: 1 weights");
    refused(|s| s.platforms[0].cameras[0].k[0] = 0.0, "platforms[0].cameras[0].K: focal");
    refused(|s| s.platforms[0].cameras[0].k[5] = f64::NAN, "platforms[0].cameras[0].K: NaN");
    refused(|s| s.platforms[0].cameras[0].k[8] = 0.0, "platforms[0].cameras[0].K: not of the form");
    refused(|s| s.platforms[0].cameras[0].k[3] = 1.0, "platforms[0].cameras[0].K: not of the form");
    refused(|s| s.platforms[0].cameras[0].k[0] = 1e300, "platforms[0].cameras[0].K: focal lengths 1");
    refused(|s| s.platforms[0].cameras[0].k[2] = -1e300, "platforms[0].cameras[0].K: skew");
    refused(|s| s.platforms[0].poses[0].center[0] = 1e300, "platforms[0].poses[0].C: 1");
    refused(|s| s.platforms[0].poses[0].rotation[0] *= -1.0, "platforms[0].poses[0].R: not a rotation");
    refused(|s| s.platforms[0].poses[0].center[2] = f64::INFINITY, "platforms[0].poses[0].C: inf");
    refused(|s| s.platforms[0].cameras[0].height = 0, "platforms[0].cameras[0]: resolution");
}

#[test]
fn writers_refuse_what_no_file_may_hold() {
    let scene = read(&corpus("i7")).scene;
    assert!(matches!(mvs::write_interface(Vec::new(), &scene, 8), Err(Error::Unsupported(_))));
    let mut bad = scene.clone();
    bad.images[0].view_scores[0].image = 4;
    assert!(matches!(mvs::write_interface(Vec::new(), &bad, 7), Err(Error::Invalid { .. })));
    let mut bad = scene.clone();
    bad.mesh.vertices.push([0.0; 3]);
    assert!(matches!(mvs::write_interface(Vec::new(), &bad, 7), Err(Error::Unsupported(_))));
}

#[test]
fn damaged_files_are_errors_or_scenes() {
    for version in 0..=7 {
        damage(&corpus(&format!("i{version}")), |bytes| {
            let scene = SceneFile::from_bytes(bytes, &small_limits())?.scene;
            let _ = scene.check();
            let _ = mvs::write_interface(Vec::new(), &scene, 7);
            Ok(())
        });
    }
}
