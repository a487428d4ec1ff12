//! OpenMVS's own maps and neighbour lists, for the tests of the stages that must reproduce it.
#![allow(dead_code)]

use nalgebra::{Matrix3, Vector3};
use semvs::geometry::{Camera, Size};
use semvs::scene::{DepthEstimate, Grid, ImageId, ViewIndex};
use std::path::{Path, PathBuf};

/// The bundled scene.
pub(crate) fn facade6() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("compat-fixtures/facade6")
}

/// A folder of reference data that is not bundled, if it is there.
pub(crate) fn shared(relative: &str) -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared").join(relative);
    let path = if path.exists() { path } else { Path::new("/work/shared").join(relative) };
    let found = path.exists();
    println!("{relative}: {}", if found { "compared" } else { "not there, skipped" });
    found.then_some(path)
}

/// The bytes of `path`, decompressed if the name ends in `.zst`.
pub(crate) fn bytes(path: &Path) -> Vec<u8> {
    let raw = std::fs::read(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    if path.extension().is_some_and(|e| e == "zst") { zstd::decode_all(&raw[..]).unwrap() } else { raw }
}

/// The depth maps `depthNNNN.dmap.zst` of a folder, by index.
pub(crate) fn depth_maps(folder: &Path) -> Vec<DepthEstimate> {
    (0..)
        .map(|i| folder.join(format!("depth{i:04}.dmap.zst")))
        .take_while(|path| path.exists())
        .map(|path| parse_dmap(&bytes(&path)))
        .collect()
}

fn parse_dmap(b: &[u8]) -> DepthEstimate {
    let u32_at = |o: usize| u32::from_le_bytes(b[o..o + 4].try_into().unwrap());
    let f32_at = |o: usize| f32::from_le_bytes(b[o..o + 4].try_into().unwrap());
    let f64_at = |o: usize| f64::from_le_bytes(b[o..o + 8].try_into().unwrap());
    assert_eq!((&b[..2], b[2] & 7), (&b"DR"[..], 7));
    let size = Size::new(u32_at(12), u32_at(16));
    let name_len = usize::from(u16::from_le_bytes([b[28], b[29]]));
    let mut o = 30 + name_len;
    let ids: Vec<_> = (0..u32_at(o) as usize).map(|i| ImageId(u32_at(o + 4 + 4 * i))).collect();
    o += 4 + 4 * ids.len();
    let k = Matrix3::from_row_iterator((0..9).map(|i| f64_at(o + 8 * i)));
    let r = Matrix3::from_row_iterator((0..9).map(|i| f64_at(o + 72 + 8 * i)));
    let c = Vector3::from_iterator((0..3).map(|i| f64_at(o + 144 + 8 * i)));
    o += 168;
    let mut floats = |n: usize| {
        let v: Vec<f32> = (0..n).map(|i| f32_at(o + 4 * i)).collect();
        o += 4 * n;
        v
    };
    let n = size.area();
    let depth = Grid::from_vec(size, floats(n)).unwrap();
    let normal = floats(3 * n).chunks_exact(3).map(|v| [v[0], v[1], v[2]]).collect();
    DepthEstimate {
        image_id: ids[0],
        image_name: String::from_utf8(b[30..30 + name_len].to_vec()).unwrap(),
        source_ids: ids[1..].to_vec(),
        camera: Camera::new(Size::new(u32_at(4), u32_at(8)), k, r, c),
        depth_range: (f32_at(20), f32_at(24)),
        depth,
        normal: Some(Grid::from_vec(size, normal).unwrap()),
        confidence: Some(Grid::from_vec(size, floats(n)).unwrap()),
    }
}

/// The neighbour lists, best first, of an MVSI version 7 scene; lists are empty where none is stored.
pub(crate) fn neighbor_lists(scene: &Path) -> Vec<Vec<ViewIndex>> {
    let b = bytes(scene);
    assert_eq!(&b[..8], b"MVSI\x07\0\0\0");
    let mut at = 12;
    let u64_at = |o: usize| u64::from_le_bytes(b[o..o + 8].try_into().unwrap()) as usize;
    let skip_string = |at: &mut usize| *at += 8 + u64_at(*at);
    let count = |at: &mut usize| {
        *at += 8;
        u64_at(*at - 8)
    };
    for _ in 0..count(&mut at) {
        skip_string(&mut at);
        for _ in 0..count(&mut at) {
            skip_string(&mut at);
            skip_string(&mut at);
            at += 8 + 168;
        }
        at += count(&mut at) * 96;
    }
    (0..count(&mut at))
        .map(|_| {
            skip_string(&mut at);
            skip_string(&mut at);
            at += 28;
            (0..count(&mut at))
                .map(|_| {
                    at += 24;
                    ViewIndex(u32::from_le_bytes(b[at - 24..at - 20].try_into().unwrap()))
                })
                .collect()
        })
        .collect()
}
