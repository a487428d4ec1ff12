//! Clouds read, written and refused as wholes.

use super::*;
use crate::{Error, Limits, Result};
use std::path::{Path, PathBuf};

fn fixtures() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../compat-fixtures")
}

fn corpus(name: &str) -> Vec<u8> {
    std::fs::read(fixtures().join("format-corpus/ply").join(name)).unwrap()
}

fn read(bytes: &[u8]) -> Result<Cloud> {
    read_cloud(bytes, &Limits::default())
}

fn written(layout: &Layout, cloud: &Cloud) -> Vec<u8> {
    let mut out = Vec::new();
    write_cloud(&mut out, layout, cloud).unwrap();
    out
}

fn legacy(mut layout: Layout) -> Layout {
    layout.type_names = TypeNames::Legacy;
    layout
}

fn sized(mut layout: Layout) -> Layout {
    layout.type_names = TypeNames::Sized;
    layout
}

fn with_fields(mut layout: Layout, fields: &[Field]) -> Layout {
    layout.fields.extend(fields);
    layout
}

/// Every variant that OpenMVS and COLMAP write comes back byte for byte.
#[test]
fn corpus_files_are_rewritten_identically() {
    let scale = [Field::Confidence, Field::Value];
    let ascii = Layout { encoding: Encoding::Ascii, ..Layout::openmvs(true, true, true) };
    let cases = [
        ("pc_full.ply", Layout::openmvs(true, true, true)),
        ("pc_min.ply", Layout::openmvs(false, false, false)),
        ("pc_300views.ply", Layout::openmvs(false, false, false)),
        ("pc_noviews.ply", sized(Layout::plain(true, true))),
        ("pc_nviews.ply", sized(Layout::plain(true, true))),
        ("pc_nviews_nonorm.ply", sized(Layout::plain(true, false))),
        ("pc_legacy.ply", legacy(Layout::openmvs(true, true, true))),
        ("pc_ascii.ply", ascii),
        ("pc_scale.ply", with_fields(sized(Layout::plain(true, true)), &scale)),
        ("pc_scale_now.ply", with_fields(sized(Layout::plain(false, false)), &scale)),
        ("cfused.ply", Layout::colmap()),
    ];
    for (name, layout) in cases {
        let bytes = corpus(name);
        assert_eq!(written(&layout, &read(&bytes).unwrap()), bytes, "{name}");
    }
}

#[test]
fn corpus_values_are_those_of_the_ascii_variant() {
    let cloud = read(&corpus("pc_ascii.ply")).unwrap();
    assert_eq!(cloud, read(&corpus("pc_full.ply")).unwrap());
    assert_eq!(cloud, read(&corpus("pc_legacy.ply")).unwrap());
    assert_eq!(cloud.positions[1], [1.5, -1.25, 4.0]);
    assert_eq!(cloud.colors[1], [31, 21, 11]);
    assert_eq!(cloud.normals[1], [0.0, 0.6, -0.8]);
    assert_eq!((cloud.images_of(1), cloud.weights_of(1)), (&[0, 1, 2][..], &[2.0, 1.5, 1.0][..]));
    assert_eq!(cloud.images_of(4), [1, 2]);
}

#[test]
fn odd_but_legal_inputs_are_understood() {
    let mixed = read(&corpus("o_mixed.ply")).unwrap();
    let big = read(&corpus("o_be.ply")).unwrap();
    let short = read(&corpus("o_16.ply")).unwrap();
    assert_eq!(mixed.positions_f64.len(), 2, "double coordinates are kept");
    assert_eq!(Cloud { positions_f64: Vec::new(), ..mixed }, big);
    assert_eq!(short, big);
    assert_eq!((big.len(), big.colors.len(), big.weights_of(0).len()), (2, 2, big.images_of(0).len()));
    let diffuse = read(&corpus("o_diff.ply")).unwrap();
    assert_eq!((diffuse.len(), diffuse.colors.len()), (2, 2));
}

#[test]
fn dense_clouds_of_openmvs_are_rewritten_identically() {
    for run in ["post7", "fuse2"] {
        let path = fixtures().join("facade6/openmvs-2.3.0").join(run).join("scene_dense.ply.zst");
        let bytes = zstd::decode_all(std::fs::File::open(path).unwrap()).unwrap();
        let cloud = read(&bytes).unwrap();
        assert!(cloud.len() > 20_000 && cloud.images_of(7).len() >= 2);
        assert!(written(&Layout::openmvs(true, true, true), &cloud) == bytes, "{run}");
    }
}

#[test]
fn a_labelled_truth_cloud_keeps_its_comments_and_labels() {
    let bytes = std::fs::read(fixtures().join("facade6/truth/truth.ply")).unwrap();
    let cloud = read(&bytes).unwrap();
    assert_eq!(cloud.comments[0], "class 1 building 0 0 255");
    assert_eq!((cloud.len(), cloud.labels.len()), (178_045, 178_045));
    let layout = Layout::plain(false, false).with_label(false, false).with_comments(cloud.comments.clone());
    assert!(written(&layout, &cloud) == bytes);
}

fn sample() -> Cloud {
    let views = crate::mvs::Visibility {
        offsets: vec![0, 2, 2, 3],
        images: vec![4, 9, 1],
        weights: vec![0.5, 2.0, 1.0],
    };
    Cloud {
        positions: vec![[1.0, -2.5, 3.0], [0.1, 1e-7, -1e9], [f32::NAN, 0.0, -0.0]],
        colors: vec![[1, 2, 3], [255, 0, 128], [9, 8, 7]],
        normals: vec![[0.0, 0.0, 1.0]; 3],
        labels: vec![0, 255, 7],
        label_confidence: vec![0.0, 1.0, 0.25],
        views,
        ..Cloud::default()
    }
}

#[test]
fn labels_stand_between_normals_and_view_lists() {
    let cloud = sample();
    let layout = Layout::openmvs(true, true, true).with_label(true, true);
    let names: Vec<_> = layout.header(3).elements[0].properties.iter().map(|p| p.name.clone()).collect();
    assert_eq!(names[8..], ["nz", "label", "label_confidence", "view_indices", "view_weights"]);
    let back = read(&written(&layout, &cloud)).unwrap();
    assert_eq!(format!("{back:?}"), format!("{cloud:?}"), "NaN included");
}

#[test]
fn odm_layout_is_what_its_point_filter_expects() {
    let bytes = written(&Layout::odm(), &sample());
    let expected = "ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float32 x\n\
        property float32 y\nproperty float32 z\nproperty uint8 red\nproperty uint8 green\nproperty uint8 blue\n\
        property float32 nx\nproperty float32 ny\nproperty float32 nz\nproperty uint8 views\nend_header\n";
    assert!(bytes.starts_with(expected.as_bytes()));
    assert_eq!(bytes.len(), expected.len() + 3 * 28);
    assert_eq!(read(&bytes).unwrap().view_counts, [2, 0, 1]);
}

#[test]
fn of_more_than_255_views_the_heaviest_are_kept_in_order() {
    let mut cloud = Cloud { positions: vec![[0.0; 3]], ..Cloud::default() };
    cloud.views.offsets = vec![0, 300];
    cloud.views.images = (0..300).collect();
    cloud.views.weights = (0..300).map(|i| if i % 6 == 0 { 0.1 } else { 1.0 + i as f32 }).collect();
    let kept = read(&written(&Layout::openmvs(false, false, true), &cloud)).unwrap();
    let mut expected: Vec<u32> = (0..300).filter(|i| i % 6 != 0).collect();
    expected.extend([0, 6, 12, 18, 24]);
    expected.sort_unstable();
    assert_eq!(kept.images_of(0), expected);
    assert_eq!(kept.weights_of(0)[1], 2.0);
    cloud.views.weights.clear();
    let kept = read(&written(&Layout::openmvs(false, false, false), &cloud)).unwrap();
    assert_eq!(kept.images_of(0), (0..255).collect::<Vec<_>>());
}

#[test]
fn double_positions_survive_in_binary_and_text() {
    let mut cloud = Cloud { positions_f64: vec![[500_000.123_456_789, -4.0e6, 0.1]], ..Cloud::default() };
    cloud.positions = cloud.positions_f64.iter().map(|p| p.map(|v| v as f32)).collect();
    for encoding in [Encoding::LittleEndian, Encoding::Ascii] {
        let layout = Layout { encoding, ..Layout::plain(false, false).with_f64_positions() };
        assert_eq!(read(&written(&layout, &cloud)).unwrap(), cloud);
    }
}

#[test]
fn other_elements_and_unknown_properties_are_skipped() {
    let text = "ply\nformat ascii 1.0\nelement camera 2\nproperty list uchar int v\nelement void 3\nelement vertex 2\n\
        property list uchar float q\nproperty int z\nproperty uint8 extra\nproperty float y\nproperty float x\n\
        element face 1\nproperty list uchar int f\nend_header\n2 1 2\n0\n\n1 0.5 3 9 2 1\n0 6 9 5 4\n3 0 1 2\n";
    let cloud = read(text.as_bytes()).unwrap();
    assert_eq!(cloud.positions, [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]);
    let mut binary =
        text[..text.find("end_header").unwrap()].replace("ascii", "binary_big_endian").into_bytes();
    binary.extend(b"end_header\n\x02\0\0\0\x01\0\0\0\x02\0");
    binary.extend(b"\x01\x3f\0\0\0\0\0\0\x03\x09\x40\0\0\0\x3f\x80\0\0");
    binary.extend(b"\0\0\0\0\x06\x09\x40\xa0\0\0\x40\x80\0\0\x03\0\0\0\0");
    assert_eq!(read(&binary).unwrap(), cloud);
}

#[test]
fn chunks_add_up_to_the_whole() {
    let path = fixtures().join("facade6/openmvs-2.3.0/post7/scene_dense.ply.zst");
    let bytes = zstd::decode_all(std::fs::File::open(path).unwrap()).unwrap();
    let whole = read(&bytes).unwrap();
    let mut reader = PointReader::new(bytes.as_slice(), &Limits::default()).unwrap();
    let mut out = PlyWriter::new(Vec::new(), &Layout::openmvs(true, true, true), reader.remaining()).unwrap();
    let mut chunk = Cloud::default();
    while reader.read(&mut chunk, 1000).unwrap() > 0 {
        assert!(chunk.len() == 1000 || reader.remaining() == 0);
        out.write(&chunk).unwrap();
        chunk.clear();
    }
    assert!(out.finish().unwrap() == bytes);
    assert_eq!(whole.len(), 24_171);
}

#[test]
fn every_prefix_and_every_changed_byte_is_an_error_or_a_cloud() {
    for name in ["pc_full.ply", "pc_ascii.ply", "o_mixed.ply", "o_be.ply"] {
        let bytes = corpus(name);
        // the last line of text may lose its end, and its end may lose digits
        let whole = if name == "pc_ascii.ply" { bytes.len() - 2 } else { bytes.len() };
        for end in 0..whole {
            assert!(read(&bytes[..end]).is_err(), "{name} cut at {end}");
        }
        for at in 0..bytes.len() {
            for change in [0x01, 0x80, 0xff] {
                let mut bad = bytes.clone();
                bad[at] ^= change;
                let _ = read(&bad);
            }
        }
    }
}

#[test]
fn counts_larger_than_the_file_end_in_an_error() {
    let head = "ply\nformat binary_little_endian 1.0\nelement vertex 18446744073709551615\n\
        property float x\nproperty float y\nproperty float z\n";
    let error = read(format!("{head}end_header\n0123").as_bytes()).unwrap_err().to_string();
    assert!(error.contains("ends after about 0 of 18446744073709551615 points"), "{error}");
    let list = format!(
        "{head}property list uint double view_indices\nend_header\n0123456789ab\u{7f}\u{7f}\u{7f}\u{7f}"
    );
    assert!(read(list.as_bytes()).unwrap_err().to_string().contains("ends after"));
    let huge = "ply\nformat ascii 1.0\nelement face 99999999999\nelement vertex 1\nproperty float x\nproperty float y\n\
        property float z\nend_header\n1 2 3\n";
    assert_eq!(read(huge.as_bytes()).unwrap().len(), 1, "records without properties take no bytes");
}

#[test]
fn unusable_vertices_are_refused_with_the_reason() {
    let vertex = |properties: &str, values: &str| {
        let mut text = String::from("ply\nformat ascii 1.0\nelement vertex 1\n");
        for property in properties.split(',') {
            text += &format!("property {property}\n");
        }
        read(format!("{text}end_header\n{values}\n").as_bytes()).unwrap_err().to_string()
    };
    let xyz = "float x,float y,float z";
    let cases = [
        ("float x,float y", "1 2", "must be there together"),
        ("float a", "1", "there are no properties x, y, z"),
        (&format!("{xyz},uchar red"), "1 2 3 4", "red, green, blue must be there together"),
        (&format!("{xyz},float nx,float ny"), "1 2 3 4 5", "nx, ny, nz must be there together"),
        (&format!("{xyz},int label"), "1 2 3 65536", "vertex[0].label"),
        (&format!("{xyz},float label"), "1 2 3 0.5", "vertex[0].label"),
        (&format!("{xyz},list uchar int view_indices"), "1 2 3 1 -1", "-1 is not an image index"),
        (&format!("{xyz},list char int view_indices"), "1 2 3 -1", "a count of -1"),
        (
            &format!("{xyz},list uchar int view_indices,list uchar float view_weights"),
            "1 2 3 1 0 2 1 1",
            "2 weights for 1 views",
        ),
        (xyz, "1 two 3", "\"two\" is not a F32 value"),
    ];
    for (properties, values, expected) in cases {
        let error = vertex(properties, values);
        assert!(error.contains(expected), "{error}");
    }
    let no_vertex = read(b"ply\nformat ascii 1.0\nelement face 0\nend_header\n").unwrap_err();
    assert!(no_vertex.to_string().contains("no element \"vertex\""));
}

#[test]
fn limits_are_kept() {
    let limits = Limits { max_bytes: 1 << 16, ..Limits::default() };
    let bytes = std::fs::read(fixtures().join("facade6/truth/truth.ply")).unwrap();
    assert!(matches!(read_cloud(bytes.as_slice(), &limits), Err(Error::Limits { .. })));
}

#[test]
fn the_writer_refuses_what_it_cannot_write() {
    let error =
        |layout: &Layout, cloud: &Cloud| write_cloud(Vec::new(), layout, cloud).unwrap_err().to_string();
    let bare = Cloud { positions: vec![[0.0; 3]], ..Cloud::default() };
    assert!(error(&Layout::plain(true, false), &bare).contains("Color"));
    assert!(error(&Layout::openmvs(false, false, false), &bare).contains("ViewIndices"));
    let ragged = Cloud { colors: vec![[0; 3]; 2], ..bare.clone() };
    assert!(error(&Layout::plain(true, false), &ragged).contains("colors"));
    let wide = Cloud { labels: vec![256], ..bare.clone() };
    assert!(error(&Layout::plain(false, false).with_label(false, false), &wide).contains("256"));
    let big = Layout { encoding: Encoding::BigEndian, ..Layout::plain(false, false) };
    assert!(error(&big, &bare).contains("big-endian"));

    let layout = Layout::plain(false, false);
    let mut few = PlyWriter::new(Vec::new(), &layout, 2).unwrap();
    few.write(&bare).unwrap();
    assert!(few.finish().unwrap_err().to_string().contains("1 points written, 2 declared"));
    let mut many = PlyWriter::new(Vec::new(), &layout, 0).unwrap();
    assert!(many.write(&bare).is_err());
}

#[test]
fn line_breaks_in_comments_cannot_forge_header_lines() {
    let layout = Layout::plain(false, false).with_comments(["a\nelement vertex 9".to_owned()]);
    let bytes = written(&layout, &Cloud::default());
    let cloud = read(&bytes).unwrap();
    assert_eq!((cloud.len(), cloud.comments.as_slice()), (0, &["a element vertex 9".to_owned()][..]));
}
