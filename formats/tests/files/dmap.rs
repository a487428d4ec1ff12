//! Depth maps: real and synthetic files.

use crate::common::{damage, fixture, shared, small_limits};
use semvs_formats::dmap::{self, DepthMapFile};
use semvs_formats::{Error, Limits};

fn read(bytes: &[u8]) -> DepthMapFile {
    DepthMapFile::from_bytes(bytes, &Limits::default()).unwrap()
}

fn write(map: &DepthMapFile) -> Vec<u8> {
    let mut out = Vec::new();
    map.write(&mut out).unwrap();
    out
}

fn d7() -> Vec<u8> {
    fixture("format-corpus/other/d7.dmap")
}

#[test]
fn real_maps_are_rewritten_to_the_same_bytes() {
    for run in ["raw", "post3", "post7"] {
        for view in 0..6 {
            let name = format!("facade6/openmvs-2.3.0/{run}/depth{view:04}.dmap.zst");
            let bytes = zstd::decode_all(fixture(&name).as_slice()).unwrap();
            let map = read(&bytes);
            assert_eq!((map.width, map.height, map.ids[0]), (200, 150, view));
            assert!(!map.normal.is_empty() && !map.confidence.is_empty());
            assert!(map.depth.iter().all(|&d| d == 0.0 || (map.depth_min..=map.depth_max).contains(&d)));
            assert!(write(&map) == bytes, "{name}: bytes differ after rewriting");
        }
    }
    for view in 0..4 {
        if let Some(bytes) = shared(&format!("reference/tests4/post7/depth{view:04}.dmap.zst")) {
            let bytes = zstd::decode_all(bytes.as_slice()).unwrap();
            assert!(write(&read(&bytes)) == bytes, "view {view}: bytes differ after rewriting");
        }
    }
}

#[test]
fn every_combination_of_planes_is_kept() {
    let full = read(&d7());
    assert!(write(&full) == d7());
    assert_eq!(full.normal.len(), full.depth.len());
    assert_eq!(full.confidence.len(), full.depth.len());
    assert_eq!(full.views.len(), full.depth.len());
    for absent in 0..8 {
        let mut map = full.clone();
        if absent & 1 != 0 {
            map.normal.clear();
        }
        if absent & 2 != 0 {
            map.confidence.clear();
        }
        if absent & 4 != 0 {
            map.views.clear();
        }
        let bytes = write(&map);
        assert_eq!(bytes[2], 1 + 2 * (7 - absent));
        assert_eq!(read(&bytes), map);
    }
}

#[test]
fn the_header_can_be_read_alone() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("depth0000.dmap");
    std::fs::write(&path, d7()).unwrap();
    let header = dmap::read_header(&path, &Limits::default()).unwrap();
    assert_eq!(header, read(&d7()).header());
    assert_eq!(DepthMapFile::read(&path, &Limits::default()).unwrap(), read(&d7()));
    std::fs::write(&path, &d7()[..700]).unwrap();
    assert!(dmap::read_header(&path, &Limits::default()).is_err());
}

#[test]
fn values_that_mean_nothing_become_zero() {
    let mut map = read(&d7());
    map.depth[0] = 1.5;
    let mut bytes = write(&map);
    let start = bytes.len() - map.depth.len() * (4 + 12 + 4 + 4);
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -1.0, -0.0] {
        bytes[start..start + 4].copy_from_slice(&bad.to_le_bytes());
        assert_eq!(read(&bytes).depth[0].to_bits(), 0, "{bad}");
        assert_eq!(read(&bytes).depth[1..], map.depth[1..]);
        let mut spoilt = map.clone();
        spoilt.depth[0] = bad;
        assert_eq!(read(&write(&spoilt)).depth[0], 0.0);
    }
    map.normal[2] = [0.0, f32::NAN, 1.0];
    map.confidence[1] = f32::NAN;
    let back = read(&write(&map));
    assert_eq!((back.normal[2], back.confidence[1]), ([0.0; 3], 0.0));
}

#[test]
fn quantised_maps_are_read() {
    let raw = read(&d7());
    let area = raw.depth.len();
    let mut bytes = b"D2\x0f\xff".to_vec(); // all planes, exponent -1
    for size in [raw.image_width, raw.image_height, raw.width, raw.height] {
        bytes.extend(size.to_le_bytes());
    }
    for value in [0.5f32, 9.0, 3.0] {
        bytes.extend(value.to_le_bytes());
    }
    bytes.extend([1, 0, b'x']);
    bytes.extend(2u32.to_le_bytes());
    bytes.extend([7u32, 9].map(u32::to_le_bytes).as_flattened());
    bytes.extend(raw.k.iter().chain(&raw.rotation).chain(&raw.center).flat_map(|v| v.to_le_bytes()));
    bytes.extend([0x00, 0x44].repeat(area)); // 4.0
    bytes.extend([0, 0, 0x01, 0x80].repeat(area)); // p = 0, q = -1
    bytes.extend([51].repeat(area));
    bytes.extend([0, 1, 255, 255].repeat(area));
    let map = read(&bytes);
    assert_eq!((map.depth_min, map.depth_max), (0.5, 9.0));
    assert_eq!((map.image_name.as_slice(), map.ids.as_slice()), (&b"x"[..], &[7, 9][..]));
    assert_eq!(map.k, raw.k);
    assert_eq!(map.depth, vec![2.0; area]);
    assert_eq!(map.normal, vec![[0.0, -1.0, 0.0]; area]);
    assert!(map.confidence.iter().all(|c| (c - 0.6).abs() < 1e-6));
    assert_eq!(map.views, vec![[0, 1, 255, 255]; area]);
    damage(&bytes, |b| DepthMapFile::from_bytes(b, &small_limits()).map(drop));
}

#[test]
fn impossible_maps_are_refused_with_the_field() {
    let refused = |at: usize, value: &[u8], message: &str| {
        let mut bytes = d7();
        bytes[at..at + value.len()].copy_from_slice(value);
        let found = DepthMapFile::from_bytes(&bytes, &Limits::default()).unwrap_err().to_string();
        assert!(found.contains(message), "{found}");
    };
    let name_length = usize::from(d7()[28]);
    let ids = 30 + name_length;
    let camera = ids + 4 + 4 * read(&d7()).ids.len();
    refused(0, b"DX", "neither DR nor D2");
    refused(2, &[14], "no depth");
    refused(2, &[31], "flag bit 4");
    refused(2, &[47], "unknown type bits 0x20");
    refused(12, &[0; 4], "map size 0×");
    refused(12, &[0xff; 4], "does not fit an image");
    refused(28, &[0xff; 2], "fileName");
    refused(ids, &[0; 4], "0 view IDs");
    refused(ids, &[0xff; 4], "view IDs");
    refused(camera, &f64::NAN.to_le_bytes(), "in K");
    refused(camera, &(-1.0f64).to_le_bytes(), "focal lengths");
    refused(camera + 72, &f64::INFINITY.to_le_bytes(), "in R");
    refused(camera + 144, &f64::INFINITY.to_le_bytes(), "in C");
    refused(4, &[0xff; 16], "480 are left in planes");
    let mut long = d7();
    long.push(0);
    assert!(DepthMapFile::from_bytes(&long, &Limits::default()).is_err());
}

#[test]
fn impossible_maps_are_not_written() {
    let refused = |change: fn(&mut DepthMapFile)| {
        let mut map = read(&d7());
        change(&mut map);
        let mut out = Vec::new();
        assert!(matches!(map.write(&mut out), Err(Error::Invalid { .. })));
        assert!(out.is_empty());
    };
    refused(|m| m.width += 1);
    refused(|m| m.normal.truncate(1));
    refused(|m| m.depth.clear());
    refused(|m| m.ids.clear());
    refused(|m| m.ids = vec![0; 256]);
    refused(|m| m.image_name = vec![b'x'; 65_536]);
    refused(|m| m.k[0] = 0.0);
}

#[test]
fn damaged_maps_are_errors_or_maps() {
    damage(&d7(), |bytes| DepthMapFile::from_bytes(bytes, &small_limits()).map(drop));
}

#[test]
fn limits_hold() {
    let limits = Limits { max_bytes: 100, ..Limits::default() };
    let error = DepthMapFile::from_bytes(&d7(), &limits).unwrap_err();
    assert!(matches!(error, Error::Limits { .. }), "{error}");
}
