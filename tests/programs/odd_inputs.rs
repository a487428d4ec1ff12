//! Photographs, names and cameras as they should not be, but are.

use crate::common::{Scratch, facade6};
use image::{DynamicImage, ImageFormat};
use nalgebra::{Matrix3, Vector3};
use semvs_formats::Limits;
use semvs_formats::dmap::DepthMapFile;
use semvs_formats::mvs::{self, NEWEST_VERSION, Scene};
use std::io::Cursor;

/// Small maps, quickly, with all stages.
const QUICK: &str = "--resolution-level 2 --min-resolution 80 --iters 1 --sub-resolution-levels 0 --number-views 2 \
                     --number-views-fuse 2";

/// The scene with a change.
fn changed(change: impl FnOnce(&mut Scene)) -> Scratch {
    let scratch = Scratch::facade6();
    let mut scene = mvs::read(scratch.path("scene.mvs"), &Limits::default()).unwrap();
    change(&mut scene);
    let mut bytes = Vec::new();
    mvs::write_interface(&mut bytes, &scene, NEWEST_VERSION).unwrap();
    scratch.write("scene.mvs", bytes);
    scratch
}

fn densify(scratch: &Scratch) -> crate::common::Outcome {
    scratch.semvs(&format!("densify scene.mvs -o out.ply {QUICK}"))
}

fn encoded(image: &DynamicImage, format: ImageFormat) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    image.write_to(&mut bytes, format).unwrap();
    bytes.into_inner()
}

fn photograph(name: &str) -> DynamicImage {
    image::open(facade6().join("images").join(name)).unwrap()
}

#[test]
fn photographs_of_every_kind_are_used() {
    let scratch = Scratch::facade6();
    densify(&scratch).ok();
    let points = scratch.cloud("out.ply").len();
    let image = photograph("0005.jpg");
    let cmyk =
        std::fs::read(std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/cmyk.jpg")).unwrap();
    let kinds: [(&str, Vec<u8>); 6] = [
        ("grey", encoded(&image.clone().into_luma8().into(), ImageFormat::Png)),
        ("16 bits", encoded(&image.clone().into_rgb16().into(), ImageFormat::Png)),
        ("16 bits, grey, TIFF", encoded(&image.clone().into_luma16().into(), ImageFormat::Tiff)),
        ("alpha", encoded(&image.clone().into_rgba8().into(), ImageFormat::Png)),
        ("CMYK", cmyk),
        ("turned by EXIF", with_orientation(&scratch.read("images/0005.jpg"))),
    ];
    for (kind, bytes) in kinds {
        // The content counts, not the extension.
        scratch.write("images/0005.jpg", bytes);
        let out = densify(&scratch).ok();
        assert!(!out.stderr.contains("warning"), "{kind}: {}", out.stderr);
        let found = scratch.cloud("out.ply").len();
        assert!(found.abs_diff(points) < points / 10, "{kind}: {found} points, {points} as it was");
    }
}

/// The JPEG with an EXIF block that says it is to be turned by 90°.
fn with_orientation(jpeg: &[u8]) -> Vec<u8> {
    let tiff = b"II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0\x06\0\0\0\0\0\0\0";
    let mut bytes = jpeg[..2].to_vec();
    bytes.extend([0xFF, 0xE1]);
    bytes.extend(((2 + 6 + tiff.len()) as u16).to_be_bytes());
    bytes.extend(b"Exif\0\0");
    bytes.extend(tiff);
    bytes.extend(&jpeg[2..]);
    bytes
}

#[test]
fn photographs_of_odd_sizes_cost_their_view_alone() {
    for (width, height) in [(1, 1), (2, 300), (400, 2), (300, 400)] {
        let scratch = Scratch::facade6();
        let odd = photograph("0005.jpg").resize_exact(width, height, image::imageops::FilterType::Nearest);
        scratch.write("images/0005.jpg", encoded(&odd, ImageFormat::Png));
        let out = densify(&scratch).ok();
        assert!(
            out.stderr.contains("0005.jpg") && out.stderr.contains("left out"),
            "{width}×{height}: {}",
            out.stderr
        );
        assert!(!scratch.has("depth0002.dmap") && scratch.has("depth0003.dmap"));
    }
}

#[test]
fn portraits_are_as_good_as_landscapes() {
    let scratch = Scratch::facade6();
    densify(&scratch).ok();
    let points = scratch.cloud("out.ply").len();
    let turned = changed(|scene| {
        let quarter = Matrix3::new(0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0);
        for platform in &mut scene.platforms {
            for camera in &mut platform.cameras {
                let [fx, _, cx, _, fy, cy, ..] = camera.k;
                let height = f64::from(camera.height);
                camera.k = [fy, 0.0, height - 1.0 - cy, 0.0, fx, cx, 0.0, 0.0, 1.0];
                std::mem::swap(&mut camera.width, &mut camera.height);
                assert!(camera.width > 0, "the bundled scene states sizes");
            }
            for pose in &mut platform.poses {
                let rotation = quarter * Matrix3::from_row_slice(&pose.rotation);
                pose.rotation.copy_from_slice(rotation.transpose().as_slice());
            }
        }
    });
    for name in ["0003", "0004", "0005", "0006", "0012", "0013"] {
        let name = format!("{name}.jpg");
        turned.write(&format!("images/{name}"), encoded(&photograph(&name).rotate90(), ImageFormat::Png));
    }
    let out = densify(&turned).ok();
    assert!(!out.stderr.contains("warning"), "{}", out.stderr);
    let found = turned.cloud("out.ply").len();
    assert!(found.abs_diff(points) < points / 10, "{found} points, {points} before");
}

#[test]
fn names_of_every_kind_are_found_and_kept() {
    let long = format!("{}.jpg", "n".repeat(200));
    let names =
        ["with space.jpg", "quote's \"two\".jpg", "Fassade-Süd-北立面.jpg", "%20&;$(x).jpg", &long, "-o.jpg"];
    let scratch = changed(|scene| {
        for (image, name) in scene.images.iter_mut().zip(names) {
            image.name = format!("images/{name}").into_bytes();
        }
    });
    let stored = ["0003", "0004", "0005", "0006", "0012", "0013"];
    for (old, new) in stored.iter().zip(names) {
        std::fs::rename(scratch.path(&format!("images/{old}.jpg")), scratch.path(&format!("images/{new}")))
            .unwrap();
    }
    let out = scratch.semvs(&format!("densify scene.mvs -o dense/out.ply -w . {QUICK}")).ok();
    assert!(!out.stderr.contains("warning"), "{}", out.stderr);
    let written = mvs::read(scratch.path("dense/out.mvs"), &Limits::default()).unwrap();
    for (image, name) in written.images.iter().zip(names) {
        assert_eq!(String::from_utf8_lossy(&image.name), format!("../images/{name}"));
    }
}

#[cfg(target_os = "linux")]
#[test]
fn names_that_are_no_text_cost_their_view_alone() {
    use std::os::unix::ffi::OsStrExt;
    let name = b"images/\xff\xfe.jpg";
    let scratch = changed(|scene| scene.images[2].name = name.to_vec());
    let odd = scratch.path("").join(std::ffi::OsStr::from_bytes(name));
    std::fs::rename(scratch.path("images/0005.jpg"), odd).unwrap();
    let out = densify(&scratch).ok();
    assert!(out.stderr.contains("no such image"), "{}", out.stderr);
    assert!(scratch.has("depth0003.dmap") && !scratch.has("depth0002.dmap"));
    // The folder and the scene itself may be named so.
    let folder = scratch.path("").join(std::ffi::OsStr::from_bytes(b"out\xff"));
    std::fs::create_dir(&folder).unwrap();
    let cloud = folder.join(std::ffi::OsStr::from_bytes(b"cl\xfeoud.ply"));
    let mut words: Vec<std::ffi::OsString> = vec!["densify".into(), "scene.mvs".into(), "-o".into()];
    words.push(cloud.clone().into());
    words.extend(QUICK.split_whitespace().map(Into::into));
    scratch.run(crate::common::SEMVS, &words).ok();
    assert!(cloud.exists());
}

#[test]
fn names_that_climb_are_read_but_never_written_to() {
    let scratch = changed(|scene| {
        for image in &mut scene.images {
            let name = String::from_utf8(image.name.clone()).unwrap();
            image.name = format!("../{name}").into_bytes();
        }
    });
    std::fs::create_dir(scratch.path("inner")).unwrap();
    std::fs::rename(scratch.path("scene.mvs"), scratch.path("inner/scene.mvs")).unwrap();
    let outside = |scratch: &Scratch| {
        let files = scratch.files().into_iter().filter(|name| !name.starts_with("inner/"));
        files.map(|name| (scratch.read(&name), name)).collect::<Vec<_>>()
    };
    let before = outside(&scratch);
    let dense = "inner/scene.mvs -o inner/out.ply -w inner";
    let labels = "--label-path labels --class-table 3dom-facade";
    scratch.semvs(&format!("densify {dense} {QUICK} {labels}")).ok();
    scratch.semvs("export inner/scene.mvs --to colmap --depth-maps inner --copy-images -o inner/colmap").ok();
    scratch.semvs("export inner/depth0000.dmap --to png -o inner/maps").ok();
    scratch.semvs("labels render inner/scene.mvs --cloud inner/out.ply -w inner -o inner/labels").ok();
    assert_eq!(outside(&scratch), before);
}

#[test]
fn images_of_one_name_are_used_once_for_each_pose() {
    let scratch = changed(|scene| scene.images[1].name = scene.images[0].name.clone());
    let out = densify(&scratch);
    assert!(out.code == Some(0) || out.code == Some(1), "{}", out.stderr);
    assert!(!out.stderr.contains("panicked"), "{}", out.stderr);
    assert!(
        scratch.has("depth0000.dmap") && scratch.has("depth0001.dmap"),
        "every image has a map of its own"
    );
}

#[test]
fn decimal_commas_of_the_locale_change_nothing() {
    let scratch = Scratch::facade6();
    let words: Vec<String> = format!("densify scene.mvs -o out.ply {QUICK} --report r.json")
        .split_whitespace()
        .map(str::to_owned)
        .collect();
    scratch.run(crate::common::SEMVS, &words).ok();
    let first = scratch.read("out.ply");
    let locale = [("LC_ALL", "de_DE.UTF-8"), ("LC_NUMERIC", "de_DE.UTF-8"), ("LANG", "de_DE.UTF-8")];
    let forced: Vec<String> = words.iter().cloned().chain(["--force".to_owned()]).collect();
    scratch.run_with(crate::common::SEMVS, &forced, &locale).ok();
    assert_eq!(scratch.read("out.ply"), first);
    serde_json::from_slice::<serde_json::Value>(&scratch.read("r.json")).unwrap();
}

/// Changes the cameras.
type Spoil = fn(&mut Scene);

#[test]
fn degenerate_cameras_end_in_a_clear_line_or_a_finite_cloud() {
    let make: [(&str, Spoil); 8] = [
        ("all in one place", |s| {
            s.platforms.iter_mut().flat_map(|p| &mut p.poses).for_each(|p| p.center = [1.0, 2.0, 3.0])
        }),
        ("two in one place", |s| {
            let center = s.platforms[0].poses[0].center;
            s.platforms[0].poses[1].center = center;
        }),
        ("twice the same view", |s| {
            let pose = s.platforms[0].poses[0].clone();
            s.platforms[0].poses[1] = pose;
        }),
        ("points behind", |s| {
            let turn = |pose: &mut mvs::Pose| {
                let back = Matrix3::from_diagonal(&Vector3::new(-1.0, 1.0, -1.0))
                    * Matrix3::from_row_slice(&pose.rotation);
                pose.rotation.copy_from_slice(back.transpose().as_slice());
            };
            s.platforms.iter_mut().flat_map(|p| &mut p.poses).for_each(turn);
        }),
        ("one far away", |s| s.platforms[0].poses[0].center = [1e30, 0.0, 0.0]),
        ("points far away", |s| {
            s.points.positions.iter_mut().step_by(3).for_each(|p| *p = [1e38, -1e38, 1e38])
        }),
        ("points in one place", |s| s.points.positions.fill([0.0, 0.0, 0.0])),
        ("points in the camera", |s| {
            let center = s.platforms[0].poses[0].center.map(|c| c as f32);
            s.points.positions.iter_mut().step_by(2).for_each(|p| *p = center);
        }),
    ];
    for (what, spoil) in make {
        let scratch = changed(spoil);
        let out = densify(&scratch);
        assert!(!out.stderr.contains("panicked"), "{what}: {}", out.stderr);
        match out.code {
            Some(0) => assert_finite(&scratch, what),
            _ => drop(out.fails_naming(&[])),
        }
    }
}

/// No number in any output is anything but a number.
#[track_caller]
pub(crate) fn assert_finite(scratch: &Scratch, what: &str) {
    let cloud = scratch.cloud("out.ply");
    assert!(cloud.positions.iter().chain(&cloud.normals).flatten().all(|v| v.is_finite()), "{what}");
    for name in scratch.files().iter().filter(|name| name.ends_with(".dmap")) {
        let map = DepthMapFile::read(scratch.path(name), &Limits::default()).unwrap();
        // Readers and writers set right what is not finite; the file itself must not need it.
        let mut rewritten = Vec::new();
        map.write(&mut rewritten).unwrap();
        let is_finite = rewritten == scratch.read(name);
        assert!(is_finite && map.depth_min.is_finite() && map.depth_max.is_finite(), "{what}: {name}");
    }
}
