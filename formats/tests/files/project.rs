//! Native project archives: real and synthetic files of every kind.

use std::io::Read;

use crate::common::{damage, fixture, shared, small_limits};
use semvs_formats::mvs::{self, ArchiveKind, Container, Scene, SceneFile};
use semvs_formats::{Error, Limits};

const HEADER: usize = 20;

fn corpus(name: &str) -> Vec<u8> {
    fixture(&format!("format-corpus/{name}.mvs"))
}

fn read(bytes: &[u8]) -> SceneFile {
    SceneFile::from_bytes(bytes, &Limits::default()).unwrap()
}

fn write(scene: &Scene, kind: ArchiveKind) -> Vec<u8> {
    let mut out = Vec::new();
    mvs::write_project(&mut out, scene, kind).unwrap();
    out
}

/// The binary body inside an archive.
fn binary_body(file: &[u8]) -> Vec<u8> {
    let body = &file[HEADER..];
    match file[8] {
        2 => {
            let mut out = Vec::new();
            flate2::read::ZlibDecoder::new(body).read_to_end(&mut out).unwrap();
            out
        }
        3 => zstd::decode_all(body).unwrap(),
        _ => body.to_vec(),
    }
}

#[test]
fn every_kind_holds_the_same_scene() {
    let first = read(&corpus("native/n0"));
    assert_eq!(first.container, Container::Project { kind: ArchiveKind::Text });
    for (name, kind) in [("n1", 1), ("n2", 2), ("n3", 3), ("n0_newlines", 0), ("n3_2frames", 3)] {
        let file = read(&corpus(&format!("native/{name}")));
        assert_eq!(file.container, Container::Project { kind: ArchiveKind::ALL[kind] });
        assert_eq!(file.scene, first.scene, "{name}");
        assert_eq!((file.trailing_bytes, file.reserved), (0, 0), "{name}");
    }
}

#[test]
fn bodies_are_rewritten_to_the_same_bytes() {
    let scene = read(&corpus("native/n1")).scene;
    assert!(write(&scene, ArchiveKind::Text) == corpus("native/n0"));
    assert!(write(&scene, ArchiveKind::Binary) == corpus("native/n1"));
    for (kind, name) in [(ArchiveKind::Zlib, "native/n2"), (ArchiveKind::Zstd, "native/n3")] {
        let bytes = write(&scene, kind);
        assert_eq!(bytes[..HEADER], corpus(name)[..HEADER]);
        assert!(binary_body(&bytes) == binary_body(&corpus(name)));
        assert_eq!(read(&bytes).scene, scene);
    }
}

#[test]
fn values_are_where_they_belong() {
    let scene = read(&corpus("native/n3")).scene;
    assert_eq!(scene.platforms[0].name, b"plat A");
    assert_eq!(scene.platforms[0].cameras[0].k[0], 0.78125);
    assert_eq!((scene.images[1].width, scene.images[1].height, scene.images[1].id), (640, 480, 101));
    assert_eq!(
        (scene.images[2].avg_depth, scene.images[1].mask_name.as_slice()),
        (4.0, &b"masks/m1.png"[..])
    );
    assert_eq!(scene.images[0].view_scores[1].image, 2);
    assert_eq!(scene.points.positions[1], [1.5, -1.25, 4.0]);
    assert_eq!(scene.points.views.images_of(1), [0, 1, 2]);
    assert_eq!(scene.points.views.weights_of(1), [2.0, 1.5, 1.0]);
    assert_eq!(scene.points.colors[4], [34, 24, 14]);
    assert_eq!(scene.mesh.faces, [[0, 1, 2], [1, 3, 2]]);
    assert_eq!(scene.mesh.vertex_faces.iter().collect::<Vec<_>>(), [&[0][..], &[0, 1], &[0, 1], &[1]]);
    assert_eq!((scene.mesh.face_texcoords.len(), scene.mesh.textures.len()), (6, 2));
    assert_eq!(scene.mesh.textures[0].pixels[1], [201, 101, 50]);
    assert_eq!(scene.mesh.face_textures, [0, 1]);
}

/// OpenMVS wrote `out_X` after loading `X`: its reading of the file, as text.
#[test]
fn projects_are_read_as_openmvs_reads_them() {
    for name in ["n0", "n0_newlines", "n0_short", "n1", "n1_trailing", "n2", "n3", "n3_2frames"] {
        let scene = read(&corpus(&format!("native/{name}"))).scene;
        assert!(write(&scene, ArchiveKind::Text) == corpus(&format!("native/out_{name}")), "{name}");
    }
}

/// The same for interface archives, after what OpenMVS does while it loads them: names get slashes, IDs are filled
/// in, views sorted, image sizes taken from the cameras (or image files).
#[test]
fn interface_archives_are_read_as_openmvs_reads_them() {
    for name in ["i1", "i2", "i3", "i4", "i5", "i6", "i7", "i7_bs"] {
        let mut scene = read(&corpus(&format!("mvsi/{name}"))).scene;
        for (i, image) in scene.images.iter_mut().enumerate() {
            image.name.iter_mut().filter(|b| **b == b'\\').for_each(|b| *b = b'/');
            if image.id == mvs::NO_ID {
                image.id = i as u32;
            }
            let platform = scene.platforms.get(image.platform as usize);
            if let Some(camera) = platform.and_then(|p| p.cameras.get(image.camera as usize)) {
                (image.width, image.height) = (camera.width, camera.height);
            }
        }
        let views = &mut scene.points.views;
        for i in 0..views.len() {
            let range = views.range(i);
            let mut pairs: Vec<_> = range.clone().map(|k| (views.images[k], views.weights[k])).collect();
            pairs.sort_by_key(|pair| pair.0);
            for (k, (image, weight)) in range.zip(pairs) {
                (views.images[k], views.weights[k]) = (image, weight);
            }
        }
        let expected = String::from_utf8_lossy(&corpus(&format!("mvsi/out_{name}"))).into_owned();
        let found = String::from_utf8_lossy(&write(&scene, ArchiveKind::Text)).into_owned();
        assert_eq!(found, expected, "{name}");
    }
}

#[test]
fn real_projects_are_rewritten_to_the_same_bytes() {
    let zlib = fixture("facade6/openmvs-2.3.0/archive2/scene_dense.mvs");
    let zstd = fixture("facade6/openmvs-2.3.0/archive3/scene_dense.mvs");
    for bytes in [&zlib, &zstd] {
        let file = read(bytes);
        assert_eq!(file.trailing_bytes, 0);
        assert!(file.scene.points.positions.len() > 10_000);
        file.scene.check().unwrap();
        let binary = write(&file.scene, ArchiveKind::Binary);
        assert!(binary[HEADER..] == binary_body(bytes));
        let mut again = Vec::new();
        file.write(&mut again).unwrap();
        assert!(binary_body(&again) == binary_body(bytes));
    }
    assert_eq!(read(&zlib).scene, read(&zstd).scene);
    for kind in 0..2 {
        if let Some(bytes) =
            shared(&format!("fixtures/facade6/openmvs-2.3.0/archive{kind}/scene_dense.mvs.zst"))
        {
            let bytes = zstd::decode_all(bytes.as_slice()).unwrap();
            let scene = read(&bytes).scene;
            assert_eq!(scene, read(&zstd).scene);
            assert!(write(&scene, ArchiveKind::ALL[kind]) == bytes, "archive{kind}: bytes differ");
        }
    }
}

#[test]
fn parts_come_and_go_independently() {
    let full = read(&corpus("native/n1")).scene;
    for absent in 0..64u32 {
        let mut scene = full.clone();
        let parts: [fn(&mut Scene); 6] = [
            |s| s.points.normals.clear(),
            |s| s.points.colors.clear(),
            |s| s.points.views.weights.clear(),
            |s| s.points.views = Default::default(),
            |s| s.mesh = Default::default(),
            |s| s.images.iter_mut().for_each(|i| i.view_scores.clear()),
        ];
        (0..6).filter(|bit| absent & 1 << bit != 0).for_each(|bit| parts[bit as usize](&mut scene));
        for kind in ArchiveKind::ALL {
            assert_eq!(read(&write(&scene, kind)).scene, scene, "{kind:?} without {absent:06b}");
        }
    }
}

/// The worked example of an empty scene: 244 bytes in binary.
#[test]
fn an_empty_scene_has_the_known_size() {
    let bytes = write(&Scene::default(), ArchiveKind::Binary);
    assert_eq!(bytes.len(), HEADER + 244);
    assert_eq!(read(&bytes).scene, Scene::default());
    let text = write(&Scene::default(), ArchiveKind::Text);
    let tokens: Vec<_> = std::str::from_utf8(&text[HEADER..]).unwrap().split_whitespace().collect();
    assert_eq!(tokens.len(), 53 + 9 + 2 + 6);
    assert!(tokens[..53].iter().all(|&t| t == "0"));
}

#[test]
fn bytes_after_the_data_are_counted() {
    assert_eq!(read(&corpus("native/n1_trailing")).trailing_bytes, 3);
    let scene = read(&corpus("native/n1")).scene;
    let mut body = binary_body(&corpus("native/n1"));
    body.extend([0; 5]);
    let mut bytes = write(&scene, ArchiveKind::Zstd)[..HEADER].to_vec();
    bytes.extend(zstd::encode_all(body.as_slice(), 19).unwrap());
    assert_eq!(read(&bytes).trailing_bytes, 5);
}

#[test]
fn unreadable_projects_are_refused_clearly() {
    let refused = |bytes: &[u8], message: &str| {
        let found = SceneFile::from_bytes(bytes, &Limits::default()).unwrap_err().to_string();
        assert!(found.contains(message), "{found}");
    };
    refused(&corpus("native/n1_v2"), "unsupported: native project of version 2");
    refused(&corpus("native/n2_gzip"), "compressed data is damaged");
    for kind in 0..4 {
        refused(&corpus(&format!("native/n{kind}"))[..HEADER], "the project is empty");
    }
    let mut bytes = corpus("native/n1");
    bytes[8] = 4;
    refused(&bytes, "archive type 4");
    refused(&bytes[..19], "file ends");
    let mut bytes = corpus("native/n1");
    bytes[HEADER] = 1;
    refused(&bytes, "tracking 1");
    refused(&bytes, "another OpenMVS release");
    let mut text = corpus("native/n0");
    text.truncate(text.len() - 40);
    refused(&text, "obb.ext");
    refused(&[&corpus("native/n0")[..HEADER], b"0 0 0 0 x"].concat(), "\"x\" is not a number");
}

#[test]
fn writers_refuse_what_no_project_may_hold() {
    let good = read(&corpus("native/n1")).scene;
    let refused = |change: fn(&mut Scene), message: &str| {
        let mut scene = good.clone();
        change(&mut scene);
        let found = mvs::write_project(Vec::new(), &scene, ArchiveKind::Text).unwrap_err().to_string();
        assert!(found.contains(message), "{found}");
    };
    refused(|s| s.points.views.images[0] = 4, "vertices[0].views: index 4");
    refused(|s| s.mesh.faces[1][2] = 4, "mesh.faces: index 4");
    refused(|s| s.mesh.face_textures[1] = 2, "mesh.faceTexindices: index 2");
    refused(|s| s.mesh.face_normals.truncate(1), "mesh.faceNormals: 1 entries");
    refused(|s| s.mesh.vertex_faces.ends[0] = 9, "mesh.vertexFaces");
    refused(|s| s.mesh.textures[0].width += 1, "mesh.textures[0]");
    refused(|s| s.points.positions[0][1] = f32::NAN, "NaN cannot be stored");
}

#[test]
fn damaged_projects_are_errors_or_scenes() {
    for name in ["n0_short", "n1", "n2", "n3"] {
        damage(&corpus(&format!("native/{name}")), |bytes| {
            let scene = SceneFile::from_bytes(bytes, &small_limits())?.scene;
            let _ = scene.check();
            let _ = mvs::write_project(Vec::new(), &scene, ArchiveKind::Binary);
            Ok(())
        });
    }
    // Bodies that decompress well to something damaged.
    let body = binary_body(&corpus("native/n1"));
    let header = &corpus("native/n3")[..HEADER];
    damage(&body, |body| {
        let bytes = [header, &zstd::encode_all(body, 1)?].concat();
        SceneFile::from_bytes(&bytes, &small_limits()).map(drop)
    });
}

/// A count that the limits allow but the file does not hold must not be believed before the bytes are there.
#[test]
fn counts_in_compressed_projects_are_not_believed() {
    let mut body = write(&Scene::default(), ArchiveKind::Binary)[HEADER..].to_vec();
    let points = body.windows(5 * 5).position(|w| w == [0; 25]).unwrap();
    assert_eq!(points, 0);
    // scene, platform list and count, image list and count, cloud, point list: then the count of points.
    let at = 5 + 9 + 9 + 5 + 5;
    body[at..at + 8].copy_from_slice(&(1u64 << 32).to_le_bytes());
    let header = &corpus("native/n3")[..HEADER];
    let bytes = [header, &zstd::encode_all(body.as_slice(), 1).unwrap()].concat();
    let error = SceneFile::from_bytes(&bytes, &Limits::default()).unwrap_err();
    assert!(error.to_string().contains("pointcloud.points"), "{error}");
    body[at..at + 8].copy_from_slice(&u64::MAX.to_le_bytes());
    let bytes = [header, &zstd::encode_all(body.as_slice(), 1).unwrap()].concat();
    let error = SceneFile::from_bytes(&bytes, &Limits::default()).unwrap_err();
    assert!(matches!(error, Error::Limits { .. }), "{error}");
}
