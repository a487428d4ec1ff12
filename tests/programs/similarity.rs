//! The bundled scene scaled, turned and moved: the same cloud, scaled, turned and moved.

use crate::common::{Scratch, facade6};
use nalgebra::{Matrix3, Vector3};
use semvs_formats::Limits;
use semvs_formats::mvs::{self, NEWEST_VERSION};
use semvs_formats::ply::{self, Cloud};
use std::fmt::Write;

const OPTIONS: &str =
    "--resolution-level 1 --min-resolution 160 --ply-doubles --estimate-roi 0 --tower-mode 0 -q";

/// x' = scale · rotation · x + offset.
#[derive(Clone, Copy)]
struct Similarity {
    scale: f64,
    /// About (1, 2, 3), degrees.
    angle: f64,
    offset: f64,
}

const NONE: Similarity = Similarity { scale: 1.0, angle: 0.0, offset: 0.0 };

impl Similarity {
    fn rotation(&self) -> Matrix3<f64> {
        let axis = nalgebra::Unit::new_normalize(Vector3::new(1.0, 2.0, 3.0));
        *nalgebra::Rotation3::from_axis_angle(&axis, self.angle.to_radians()).matrix()
    }

    fn offset(&self) -> Vector3<f64> {
        Vector3::new(1.0, -0.7, 0.01) * self.offset
    }

    fn forth(&self, point: Vector3<f64>) -> Vector3<f64> {
        self.rotation() * point * self.scale + self.offset()
    }

    fn back(&self, point: Vector3<f64>) -> Vector3<f64> {
        self.rotation().transpose() * (point - self.offset()) / self.scale
    }

    /// The bundled scene after the move.
    fn scene(&self) -> Scratch {
        let scratch = Scratch::facade6();
        let mut scene = mvs::read(scratch.path("scene.mvs"), &Limits::default()).unwrap();
        for platform in &mut scene.platforms {
            for camera in &mut platform.cameras {
                camera.center = camera.center.map(|c| c * self.scale);
            }
            for pose in &mut platform.poses {
                pose.center = self.forth(pose.center.into()).into();
                let rotation = Matrix3::from_row_slice(&pose.rotation) * self.rotation().transpose();
                if self.angle != 0.0 {
                    pose.rotation.copy_from_slice(rotation.transpose().as_slice());
                }
            }
        }
        for point in &mut scene.points.positions {
            let moved = self.forth(Vector3::from(point.map(f64::from)));
            *point = [moved.x as f32, moved.y as f32, moved.z as f32];
        }
        let mut bytes = Vec::new();
        mvs::write_interface(&mut bytes, &scene, NEWEST_VERSION).unwrap();
        scratch.write("scene.mvs", bytes);
        scratch
    }
}

/// Positions of a cloud in doubles, moved back.
fn moved_back(scratch: &Scratch, by: Similarity) -> (Vec<[f64; 3]>, Cloud) {
    let bytes = scratch.read("out.ply");
    let positions = doubles(&bytes);
    let back = |p: &[f64; 3]| by.back(Vector3::from(*p)).into();
    (positions.iter().map(back).collect(), ply::read_cloud(bytes.as_slice(), &Limits::default()).unwrap())
}

/// The 64-bit positions with which every record begins.
fn doubles(bytes: &[u8]) -> Vec<[f64; 3]> {
    let end = bytes.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
    let header = String::from_utf8_lossy(&bytes[..end]).into_owned();
    assert!(header.contains("float64 x") || header.contains("double x"), "{header}");
    let size: usize = header
        .lines()
        .filter_map(|line| line.strip_prefix("property ")?.split(' ').next())
        .map(|kind| match kind {
            "double" | "float64" => 8,
            "float" | "float32" | "int" | "uint" | "uint32" => 4,
            "ushort" | "uint16" => 2,
            "uchar" | "uint8" => 1,
            other => panic!("{other}"),
        })
        .sum();
    let real = |record: &[u8], i: usize| f64::from_le_bytes(record[8 * i..8 * i + 8].try_into().unwrap());
    bytes[end..].chunks_exact(size).map(|record| [0, 1, 2].map(|i| real(record, i))).collect()
}

/// F1 of points in the bundled scene's coordinates.
fn f1(scratch: &Scratch, positions: &[[f64; 3]]) -> f64 {
    let mut text = format!(
        "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\nend_header\n",
        positions.len()
    );
    positions
        .iter()
        .for_each(|[x, y, z]| writeln!(text, "{} {} {}", *x as f32, *y as f32, *z as f32).unwrap());
    scratch.write("back.ply", text);
    let truth = facade6().join("truth/truth.ply");
    let words = format!("evaluate back.ply --truth {} --thresholds 0.05 --json", truth.display());
    let out = scratch.semvs(&words).ok();
    let scores: serde_json::Value = serde_json::from_str(&out.stdout).unwrap();
    let f1 = find(&scores, "f1").unwrap_or_else(|| panic!("{scores}"));
    assert!((0.2..=1.0).contains(&f1), "{f1}");
    f1
}

/// The first number of that name.
fn find(value: &serde_json::Value, name: &str) -> Option<f64> {
    match value {
        serde_json::Value::Object(map) => map
            .get(name)
            .and_then(serde_json::Value::as_f64)
            .or_else(|| map.values().find_map(|v| find(v, name))),
        serde_json::Value::Array(list) => list.iter().find_map(|v| find(v, name)),
        _ => None,
    }
}

fn densify(by: Similarity) -> (Scratch, Vec<[f64; 3]>, Cloud) {
    let scratch = by.scene();
    scratch.semvs(&format!("densify scene.mvs -o out.ply {OPTIONS}")).ok();
    let (positions, cloud) = moved_back(&scratch, by);
    assert!(cloud.positions.iter().chain(&cloud.normals).flatten().all(|v| v.is_finite()));
    (scratch, positions, cloud)
}

#[test]
fn powers_of_two_change_nothing_but_the_exponent() {
    /// Relative to the largest coordinate, and to what.
    const TOLERANCE: f64 = 1e-6;
    let (_, plain, _) = densify(NONE);
    let extent = plain.iter().flatten().fold(0.0f64, |most, v| most.max(v.abs()));
    for scale in [1024.0, 1.0 / 1024.0] {
        let (_, scaled, _) = densify(Similarity { scale, ..NONE });
        let same = plain
            .iter()
            .zip(&scaled)
            .filter(|(a, b)| a.iter().zip(*b).all(|(a, b)| (a - b).abs() <= TOLERANCE * extent));
        let same = same.count();
        println!("scale {scale}: {same} of {} points are the same, {} there", plain.len(), scaled.len());
        assert!(same as f64 >= 0.999 * plain.len() as f64 && scaled.len() == plain.len());
    }
}

#[test]
fn any_scale_rotation_and_offset_gives_the_same_quality() {
    let (scratch, plain, _) = densify(NONE);
    let expected = f1(&scratch, &plain);
    for (what, by) in [
        ("scale 1e4", Similarity { scale: 1e4, ..NONE }),
        ("scale 1e-4", Similarity { scale: 1e-4, ..NONE }),
        ("30 degrees", Similarity { angle: 30.0, ..NONE }),
        ("offset 1e4", Similarity { offset: 1e4, ..NONE }),
    ] {
        let (scratch, positions, _) = densify(by);
        check(what, (plain.len(), expected), (positions.len(), f1(&scratch, &positions)));
    }
}

/// Coordinates that are rounded otherwise lead estimation along other random paths, as other seeds do: over eight seeds F1 of
/// this scene scatters by 0.0016 where it is and by 0.003 far away, with the same mean. Three times that of a difference.
const SCATTER: f64 = 0.01;

#[track_caller]
fn check(what: &str, (points, f1): (usize, f64), (found, found_f1): (usize, f64)) {
    println!("{what}: {found} points, F1 {found_f1:.4}; {points} and {f1:.4} as it was");
    assert!(found.abs_diff(points) * 100 <= points, "{what}: {found} points, {points} as it was");
    assert!((f1 - found_f1).abs() <= SCATTER, "{what}: F1 {found_f1}, {f1} as it was");
}

#[test]
fn colmap_models_far_away_lose_nothing() {
    let by = |offset| Similarity { offset, ..NONE };
    let run = |offset: f64| {
        let scratch = workspace(by(offset));
        let out = scratch.semvs(&format!("densify dense -o out.ply -w maps {OPTIONS}")).ok();
        (moved_back(&scratch, by(offset)).0, scratch, out)
    };
    let (plain, scratch, _) = run(0.0);
    let expected = f1(&scratch, &plain);
    let (far, scratch, _) = run(5e6);
    check("offset 5e6", (plain.len(), expected), (far.len(), f1(&scratch, &far)));
}

/// The bundled COLMAP model after the move, with its images.
fn workspace(by: Similarity) -> Scratch {
    let scratch = Scratch::facade6();
    std::fs::create_dir_all(scratch.path("dense/sparse")).unwrap();
    std::fs::rename(scratch.path("images"), scratch.path("dense/images")).unwrap();
    let sparse = |name: &str| std::fs::read_to_string(facade6().join("sparse").join(name)).unwrap();
    scratch.write("dense/sparse/cameras.txt", sparse("cameras.txt"));
    let mut text = String::new();
    for (i, line) in sparse("images.txt").lines().filter(|line| !line.starts_with('#')).enumerate() {
        if i % 2 == 1 {
            writeln!(text, "{line}").unwrap();
            continue;
        }
        let words: Vec<&str> = line.split_whitespace().collect();
        let number = |at: usize| words[at].parse::<f64>().unwrap();
        let quaternion = nalgebra::Quaternion::new(number(1), number(2), number(3), number(4));
        let rotation = nalgebra::UnitQuaternion::from_quaternion(quaternion);
        let translation = Vector3::new(number(5), number(6), number(7)) - rotation * by.offset();
        let [x, y, z]: [f64; 3] = translation.into();
        writeln!(text, "{} {x:.17} {y:.17} {z:.17} {}", words[..5].join(" "), words[8..].join(" ")).unwrap();
    }
    scratch.write("dense/sparse/images.txt", text);
    let mut text = String::new();
    for line in sparse("points3D.txt").lines().filter(|line| !line.starts_with('#')) {
        let words: Vec<&str> = line.split_whitespace().collect();
        let number = |at: usize| words[at].parse::<f64>().unwrap();
        let [x, y, z]: [f64; 3] = by.forth(Vector3::new(number(1), number(2), number(3))).into();
        writeln!(text, "{} {x:.12} {y:.12} {z:.12} {}", words[0], words[4..].join(" ")).unwrap();
    }
    scratch.write("dense/sparse/points3D.txt", text);
    scratch
}
