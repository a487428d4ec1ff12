//! Small sound files of every kind.

use semvs_formats::colmap::{
    Camera, CameraModel, ConsistencyGraph, Encoding, Frame, FrameData, Image, Matrix, Model, ModelFile,
    NO_POINT, Observation, Points, Pose, Rig, RigSensor, Sensor, SensorKind, TrackElement, write_visibility,
};
use semvs_formats::mvs::Visibility;
use semvs_formats::{npy, pfm};

use crate::common::fixture;

/// Small files by name.
pub(crate) type Seeds = Vec<(String, Vec<u8>)>;

/// Bundled files.
pub(super) fn corpus(names: &[&str]) -> Seeds {
    names.iter().map(|name| ((*name).to_owned(), fixture(&format!("format-corpus/{name}")))).collect()
}

/// What `write` writes.
fn written(name: &str, write: impl FnOnce(&mut Vec<u8>) -> semvs_formats::Result<()>) -> (String, Vec<u8>) {
    let mut bytes = Vec::new();
    write(&mut bytes).unwrap();
    (name.to_owned(), bytes)
}

/// A quantised depth map with all planes.
pub(super) fn depth_map() -> Seeds {
    let (width, height) = (5u32, 4u32);
    let mut b = b"D2\x0f\x02".to_vec();
    for size in [10, 8, width, height] {
        b.extend(size.to_le_bytes());
    }
    for value in [0.5f32, 20.0, 1.0] {
        b.extend(value.to_le_bytes());
    }
    b.extend(5u16.to_le_bytes());
    b.extend(b"a.jpg");
    b.extend(3u32.to_le_bytes());
    [0u32, 1, 2].iter().for_each(|id| b.extend(id.to_le_bytes()));
    let camera = [100.0, 0.0, 4.5, 0.0, 100.0, 3.5, 0.0, 0.0, 1.0];
    let pose = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 3.0, 4.0, 5.0f64];
    camera.iter().chain(&pose).for_each(|v: &f64| b.extend(v.to_le_bytes()));
    b.extend((0..(2 + 4 + 1 + 4) * width * height).map(|i| (i * 37) as u8));
    vec![("D2".to_owned(), b)]
}

/// One file of a small sparse model.
pub(super) fn model_file(file: ModelFile, encoding: Encoding) -> Seeds {
    vec![written(&file.name(encoding), |out| model().write_file(file, encoding, out))]
}

/// A sparse model with every kind of entry.
fn model() -> Model {
    let pose = Pose { rotation: [0.5, -0.5, 0.5, 0.5], translation: [1.0, -2.5, 1e-9] };
    let camera = |id: u32, model: CameraModel| {
        let params = (0..model.param_count()).map(|k| 100.5 + k as f64).collect();
        Camera { id, model, width: 640, height: 480, params }
    };
    let image = |id: u32, name: &[u8], observations| Image {
        id,
        pose,
        camera_id: 1,
        name: name.to_vec(),
        observations,
    };
    let seen = |x: f64, point_id| Observation { position: [x, 33.25], point_id };
    let element = |image_id, observation| TrackElement { image_id, observation };
    let sensor = |kind, id| Sensor { kind, id };
    Model {
        cameras: vec![camera(1, CameraModel::Pinhole), camera(2, CameraModel::FullOpencv)],
        images: vec![
            image(1, b"b/1.jpg", vec![seen(0.5, 3), seen(639.5, NO_POINT)]),
            image(2, b"a.jpg", Vec::new()),
        ],
        points: Points {
            ids: vec![3, 1 << 40],
            positions: vec![[0.1, 1e300, -7.0], [5.0, 6.0, 7.0]],
            colors: vec![[1, 2, 255], [0, 0, 0]],
            errors: vec![0.25, -1.0],
            track_ends: vec![2, 2],
            tracks: vec![element(1, 0), element(2, 1)],
        },
        rigs: vec![
            Rig {
                id: 1,
                reference: Some(sensor(SensorKind::Camera, 1)),
                others: vec![
                    RigSensor { sensor: sensor(SensorKind::Camera, 2), pose: Some(pose) },
                    RigSensor { sensor: sensor(SensorKind::Imu, 1), pose: None },
                ],
            },
            Rig { id: 9, reference: None, others: Vec::new() },
        ],
        frames: vec![Frame {
            id: 4,
            rig_id: 1,
            pose,
            data: vec![FrameData { sensor: sensor(SensorKind::Camera, 1), data_id: 7 }],
        }],
    }
}

fn ramp(count: usize) -> Vec<f32> {
    (0..count).map(|i| i as f32 * 0.25).collect()
}

/// Depth and normal maps of the dense stage.
pub(super) fn matrix() -> Seeds {
    let map = |channels: u32| Matrix { width: 12, height: 3, channels, data: ramp(36 * channels as usize) };
    vec![written("depth", |out| map(1).write(out)), written("normal", |out| map(3).write(out))]
}

fn lists() -> Visibility {
    Visibility { offsets: vec![0, 2, 2, 5], images: vec![0, 1, 4, 2, 0], weights: Vec::new() }
}

/// A consistency graph of three pixels.
pub(super) fn graph() -> Seeds {
    let graph =
        ConsistencyGraph { width: 4, height: 3, pixels: vec![[0, 0], [3, 2], [1, 1]], images: lists() };
    vec![written("graph", |out| graph.write(out))]
}

/// The views of three points.
pub(super) fn view_lists() -> Seeds {
    vec![written("vis", |out| write_visibility(&lists(), out))]
}

/// Float maps of both kinds.
pub(super) fn pfm_map() -> Seeds {
    let map =
        |channels: u32| pfm::FloatMap { width: 6, height: 3, channels, data: ramp(18 * channels as usize) };
    vec![written("Pf", |out| pfm::write(&map(1), out)), written("PF", |out| pfm::write(&map(3), out))]
}

/// Arrays of one to three dimensions, one of them in Fortran's order.
pub(super) fn numpy() -> Seeds {
    let array = |shape: &[u64]| npy::FloatArray {
        shape: shape.to_vec(),
        data: ramp(shape.iter().product::<u64>() as usize),
    };
    let mut seeds: Seeds = [&[5][..], &[3, 4], &[2, 3, 3]]
        .iter()
        .map(|shape| written(&format!("{shape:?}"), |out| npy::write(&array(shape), out)))
        .collect();
    let (_, c_order) = &seeds[1];
    let text = String::from_utf8_lossy(&c_order[..128]).contains("False");
    assert!(text, "the order stands in the header");
    let at = c_order.windows(5).position(|w| w == b"False").unwrap();
    let fortran = [&c_order[..at], b"True ", &c_order[at + 5..]].concat();
    seeds.push(("Fortran".to_owned(), fortran));
    seeds
}
