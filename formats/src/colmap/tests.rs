//! Models and maps read, written and refused as wholes.

use super::*;
use crate::mvs::Visibility;
use crate::{Error, Limits, Result};
use std::path::{Path, PathBuf};

const FILES: [ModelFile; 5] =
    [ModelFile::Cameras, ModelFile::Images, ModelFile::Points, ModelFile::Rigs, ModelFile::Frames];

fn facade6() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../compat-fixtures/facade6")
}

fn limits() -> Limits {
    Limits::default()
}

fn written(model: &Model, file: ModelFile, encoding: Encoding) -> Vec<u8> {
    let mut out = Vec::new();
    model.write_file(file, encoding, &mut out).unwrap();
    out
}

fn read(file: ModelFile, encoding: Encoding, bytes: &[u8]) -> Result<Model> {
    let mut model = Model::default();
    model.read_file(file, encoding, bytes, Some(bytes.len() as u64), &limits())?;
    Ok(model)
}

/// Every kind of entry, small.
fn sample() -> Model {
    let pose = Pose { rotation: [0.5, -0.5, 0.5, 0.5], translation: [1.0, -2.5, 1e-9] };
    let camera = |(i, &model): (usize, &CameraModel)| Camera {
        id: 10 + i as u32,
        model,
        width: 640,
        height: 480,
        params: (0..model.param_count()).map(|k| 0.1 + k as f64).collect(),
    };
    let image = |id: u32, name: &str, observations| Image {
        id,
        pose,
        camera_id: 11,
        name: name.as_bytes().to_vec(),
        observations,
    };
    let seen = |x: f64, point_id| Observation { position: [x, 1.0 / 3.0], point_id };
    let element = |image_id, observation| TrackElement { image_id, observation };
    let sensor = |kind, id| Sensor { kind, id };
    let others = vec![
        RigSensor { sensor: sensor(SensorKind::Camera, 12), pose: Some(pose) },
        RigSensor { sensor: sensor(SensorKind::Imu, 1), pose: None },
    ];
    Model {
        cameras: CameraModel::ALL.iter().enumerate().map(camera).collect(),
        images: vec![
            image(7, "b/1.jpg", vec![seen(0.5, 3), seen(639.5, NO_POINT)]),
            image(2, "a.jpg", Vec::new()),
            image(u32::MAX, "Zo\u{eb}.jpg", vec![seen(2.25, 1 << 40)]),
        ],
        points: Points {
            ids: vec![3, 1 << 40],
            positions: vec![[0.1, 1e300, -7.0], [5.0, 6.0, 7.0]],
            colors: vec![[1, 2, 255], [0, 0, 0]],
            errors: vec![0.25, -1.0],
            track_ends: vec![2, 2],
            tracks: vec![element(7, 0), element(7, 1)],
        },
        rigs: vec![
            Rig { id: 1, reference: Some(sensor(SensorKind::Camera, 11)), others },
            Rig { id: 9, reference: None, others: Vec::new() },
        ],
        frames: vec![Frame {
            id: 4,
            rig_id: 1,
            pose,
            data: vec![FrameData { sensor: sensor(SensorKind::Camera, 11), data_id: 7 }],
        }],
    }
}

#[test]
fn models_come_back_from_both_encodings() {
    let model = sample();
    for encoding in [Encoding::Binary, Encoding::Text] {
        let mut back = Model::default();
        for file in FILES {
            let bytes = written(&model, file, encoding);
            back.read_file(file, encoding, bytes.as_slice(), None, &limits()).unwrap();
        }
        assert_eq!(back, model, "{encoding:?}");
    }
    assert_eq!((model.points.track(0).len(), model.points.track(1).len()), (2, 0));
}

#[test]
fn files_of_colmap_are_rewritten_identically() {
    let folder = facade6().join("colmap-4.2/binary");
    let model = Model::read(&folder, &limits()).unwrap();
    assert_eq!((model.images.len(), model.points.len(), model.frames.len()), (6, 6344, 6));
    for file in FILES {
        let bytes = std::fs::read(folder.join(file.name(Encoding::Binary))).unwrap();
        assert!(written(&model, file, Encoding::Binary) == bytes, "{file:?}");
    }
    let text = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/fixtures/facade6/colmap-4.2/text");
    println!("COLMAP's text files: {}", if text.exists() { "compared" } else { "not there, skipped" });
    if !text.exists() {
        return;
    }
    assert_eq!(Model::read(&text, &limits()).unwrap(), model);
    for file in FILES {
        let bytes = std::fs::read(text.join(file.name(Encoding::Text))).unwrap();
        assert!(written(&model, file, Encoding::Text) == bytes, "{file:?}");
    }
}

#[test]
fn a_model_of_another_program_reads_as_colmap_reads_it() {
    let mut ours = Model::read(facade6().join("sparse"), &limits()).unwrap();
    let colmap = Model::read(facade6().join("colmap-4.2/binary"), &limits()).unwrap();
    assert!(ours.rigs.is_empty());
    (ours.rigs, ours.frames) = (colmap.rigs.clone(), colmap.frames.clone());
    assert_eq!(ours, colmap);
}

#[test]
fn lines_of_observations_may_be_empty_and_names_may_have_spaces() {
    let text = "# c\r\n1 1 0 0 0 0 0 0 1 my photo.jpg \r\n\r\n\r\n2 1 0 0 0 0 0 0 1 b.jpg\r\n1 2 -1\r\n3 1 0 0 0 0 0 0 1 c.jpg";
    let images = read(ModelFile::Images, Encoding::Text, text.as_bytes()).unwrap().images;
    let summary: Vec<_> = images.iter().map(|i| (i.id, i.name.as_slice(), i.observations.len())).collect();
    assert_eq!(summary, [(1, &b"my photo.jpg"[..], 0), (2, b"b.jpg", 1), (3, b"c.jpg", 0)]);
    let model = Model { images, ..Model::default() };
    let error = model.write_file(ModelFile::Images, Encoding::Text, Vec::new()).unwrap_err();
    assert!(error.to_string().contains("white space"), "{error}");
}

/// Found by fuzzing: they take more memory than four times their bytes.
#[test]
fn rigs_without_sensors_come_back_from_both_encodings() {
    let rig = |id| Rig { id, reference: None, others: Vec::new() };
    let model = Model { rigs: [9, 2, 3, 9, 4, 5, 6].map(rig).to_vec(), ..Model::default() };
    for encoding in [Encoding::Binary, Encoding::Text] {
        let bytes = written(&model, ModelFile::Rigs, encoding);
        assert_eq!(read(ModelFile::Rigs, encoding, &bytes).unwrap().rigs, model.rigs);
    }
}

#[test]
fn every_prefix_and_every_changed_byte_is_an_error_or_a_model() {
    let model = sample();
    for encoding in [Encoding::Binary, Encoding::Text] {
        for file in FILES {
            let bytes = written(&model, file, encoding);
            for end in 0..bytes.len() {
                let cut = read(file, encoding, &bytes[..end]);
                assert!(encoding == Encoding::Text || cut.is_err(), "{file:?} cut at {end}");
            }
            for at in 0..bytes.len() {
                for change in [0x01, 0x80, 0xff] {
                    let mut bad = bytes.clone();
                    bad[at] ^= change;
                    let _ = read(file, encoding, &bad);
                }
            }
        }
    }
}

#[test]
fn counts_larger_than_the_file_are_refused_before_anything_is_allocated() {
    for file in FILES {
        let mut bytes = u64::MAX.to_le_bytes().to_vec();
        bytes.extend([0; 100]);
        let error = read(file, Encoding::Binary, &bytes).unwrap_err().to_string();
        assert!(error.contains("do not fit") && error.contains(file.stem()), "{error}");
    }
    let unknown = [1u64.to_le_bytes(), (99u64 << 32).to_le_bytes(), [0; 8], [0; 8], [0; 8]].concat();
    let error = read(ModelFile::Cameras, Encoding::Binary, &unknown).unwrap_err();
    assert!(matches!(&error, Error::Unsupported(m) if m.contains("camera model 99")), "{error}");
}

#[test]
fn broken_text_names_line_and_field() {
    let cases = [
        (ModelFile::Cameras, "1 PINHOLE 4 3 1 1 2", "cameras line 1, PARAMS"),
        (ModelFile::Cameras, "\n1 PINHOLE 4 3 1 1 2 2 9", "cameras line 2, end"),
        (ModelFile::Cameras, "1 BOX 4 3", "camera model BOX"),
        (ModelFile::Images, "1 1 0 0 0 0 0 0 1", "images line 1, NAME"),
        (ModelFile::Images, "1 1 0 0 0 0 0 0 1 a\n1 2", "images line 2, POINT3D_ID"),
        (ModelFile::Images, "1 1 0 0 0 0 0 0 1 a\n1 2 -2", "\"-2\" is not"),
        (ModelFile::Points, "1 0 0 0 256 0 0 0", "points3D line 1, R"),
        (ModelFile::Points, "1 0 0 0 25 0 0 0 1", "points3D line 1, POINT2D_IDX"),
        (ModelFile::Rigs, "1 4000000000 CAMERA 1", "rigs line 1, SENSOR_TYPE"),
        (ModelFile::Rigs, "1 1 RADAR 1", "\"RADAR\""),
        (ModelFile::Frames, "1 1 1 0 0 0 0 0 x", "frames line 1, TZ"),
    ];
    for (file, text, expected) in cases {
        let error = read(file, Encoding::Text, text.as_bytes()).unwrap_err().to_string();
        assert!(error.contains(expected), "{error}");
    }
}

#[test]
fn models_that_nobody_can_use_are_refused() {
    let refused = |change: &dyn Fn(&mut Model)| {
        let mut model = sample();
        model.check().unwrap();
        change(&mut model);
        model.check().unwrap_err().to_string()
    };
    assert!(refused(&|m| m.images[1].id = 7).contains("image 7"));
    assert!(refused(&|m| m.cameras[1].id = 10).contains("camera 10"));
    assert!(refused(&|m| m.images[0].camera_id = 1).contains("camera 1 does not exist"));
    assert!(refused(&|m| m.images[0].pose.rotation = [0.0; 4]).contains("zero quaternion"));
    assert!(refused(&|m| m.images[0].pose.translation[1] = f64::NAN).contains("not finite"));
    assert!(refused(&|m| m.cameras[1].params[0] = 0.0).contains("unusable parameters"));
    assert!(refused(&|m| m.cameras[5].params[2] = f64::INFINITY).contains("unusable parameters"));
    assert!(refused(&|m| m.cameras[5].width = 0).contains("0 x 480"));
    let error = Model::read(facade6(), &limits()).unwrap_err().to_string();
    assert!(error.contains("no COLMAP model here"), "{error}");
}

#[test]
fn quaternions_turn_as_hamilton_has_it() {
    let half = 0.5f64.sqrt();
    let turn = |rotation| Pose { rotation, translation: [0.0; 3] }.rotation_matrix().map(f64::round);
    assert_eq!(turn([2.0 * half, 0.0, 0.0, 2.0 * half]), [0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0]);
    assert_eq!(turn([half, half, 0.0, 0.0]), [1.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 1.0, 0.0]);
}

#[test]
fn maps_are_stored_channel_after_channel() {
    let normals = [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]];
    let map = Matrix::from_normals(2, 1, &normals).unwrap();
    let mut bytes = Vec::new();
    map.write(&mut bytes).unwrap();
    let values: Vec<u8> = [1.0f32, 4.0, 2.0, 5.0, 3.0, 6.0].iter().flat_map(|v| v.to_le_bytes()).collect();
    assert_eq!(bytes, [b"2&1&3&".as_slice(), &values].concat());
    let back = Matrix::read(bytes.as_slice(), None, &limits()).unwrap();
    assert_eq!((back.normals().unwrap(), &back), (normals.to_vec(), &map));
    assert_eq!(Matrix::from_depths(1, 1, vec![3.0]).unwrap().normals(), None);
    assert_eq!(Matrix::from_depths(2, 1, vec![3.0]), None);
}

#[test]
fn leading_zeros_in_sizes_are_read_and_measured_alike() {
    let bytes = [b"3&0000002&1&".as_slice(), &[0; 24]].concat();
    let length = Some(bytes.len() as u64);
    let map = Matrix::read(bytes.as_slice(), length, &limits()).unwrap();
    let size = super::matrix::read_matrix_size(bytes.as_slice(), length).unwrap();
    assert_eq!((size, [3, 2, 1]), ([map.width, map.height, map.channels], size));
}

#[test]
fn broken_maps_are_refused() {
    let mut good = Vec::new();
    Matrix::from_depths(3, 2, vec![1.5; 6]).unwrap().write(&mut good).unwrap();
    let read = |bytes: &[u8]| Matrix::read(bytes, Some(bytes.len() as u64), &limits());
    assert!(read(&good).is_ok());
    for end in 0..good.len() {
        assert!(read(&good[..end]).is_err(), "cut at {end}");
    }
    assert!(read(&[good.as_slice(), b"x"].concat()).unwrap_err().to_string().contains("bytes follow"));
    for header in [
        "0&2&1&",
        "3&2&",
        "-3&2&1&",
        "3 &2&1&",
        "4294967296&1&1&",
        "&&&",
        "00000000000000000000000000000000000000000000000000000000000000000001&1&1&",
    ] {
        assert!(read(&[header.as_bytes(), &[0; 24]].concat()).is_err(), "{header}");
    }
    let huge = read(b"4000000000&4000000000&4000000000&abcd").unwrap_err().to_string();
    assert!(huge.contains("4000000000"), "{huge}");
    assert!(Matrix { width: 2, height: 2, channels: 1, data: vec![0.0; 3] }.write(Vec::new()).is_err());
}

fn lists() -> Visibility {
    Visibility { offsets: vec![0, 2, 2, 3], images: vec![5, 1, 0], weights: Vec::new() }
}

#[test]
fn lists_of_images_come_back_and_broken_ones_are_refused() {
    let mut vis = Vec::new();
    write_visibility(&lists(), &mut vis).unwrap();
    assert_eq!(vis.len(), 8 + 3 * 4 + 3 * 4);
    let read = |bytes: &[u8]| read_visibility(bytes, Some(bytes.len() as u64), &limits());
    assert_eq!(read(&vis).unwrap(), lists());
    for end in 0..vis.len() {
        assert!(read(&vis[..end]).is_err(), "cut at {end}");
    }
    assert!(read(&[vis.as_slice(), b"x"].concat()).is_err());
    vis[6] = 1;
    assert!(read(&vis).unwrap_err().to_string().contains("do not fit"));
}

#[test]
fn consistency_graphs_come_back_and_broken_ones_are_refused() {
    let pixels = vec![[0, 0], [3, 1], [2, 1]];
    let graph = ConsistencyGraph { width: 4, height: 2, pixels, images: lists() };
    let mut bytes = Vec::new();
    graph.write(&mut bytes).unwrap();
    let read = |bytes: &[u8]| ConsistencyGraph::read(bytes, Some(bytes.len() as u64), &limits());
    assert_eq!(read(&bytes).unwrap(), graph);
    let records = [bytes.len() - 16, bytes.len() - 28, bytes.len() - 48];
    for end in 0..bytes.len() {
        assert_eq!(read(&bytes[..end]).is_ok(), records.contains(&end), "cut at {end}");
    }
    let outside = ConsistencyGraph { height: 1, ..graph };
    let mut bytes = Vec::new();
    outside.write(&mut bytes).unwrap();
    assert!(read(&bytes).unwrap_err().to_string().contains("row 1 is outside 4 x 1"));
}
