#![no_main]
//! What the dense stage writes: maps, consistency graphs, visibility, lists of images.

use libfuzzer_sys::fuzz_target;
use semvs_formats::Limits;
use semvs_formats::colmap::{
    ConsistencyGraph, Matrix, parse_fusion_config, parse_patch_match_config, patch_match_config,
    read_matrix_size, read_visibility, write_visibility,
};

fuzz_target!(|bytes: &[u8]| {
    let (limits, length) = (Limits::default(), Some(bytes.len() as u64));
    let size = read_matrix_size(bytes, length);
    if let Ok(map) = Matrix::read(bytes, length, &limits) {
        assert_eq!(size.ok(), Some([map.width, map.height, map.channels]));
        let mut written = Vec::new();
        map.write(&mut written).expect("what was read is written");
        let again = Matrix::read(written.as_slice(), None, &limits).expect("what was written is read");
        assert!(again.data.iter().map(|v| v.to_bits()).eq(map.data.iter().map(|v| v.to_bits())));
    }
    if let Ok(graph) = ConsistencyGraph::read(bytes, length, &limits) {
        let mut written = Vec::new();
        graph.write(&mut written).expect("what was read is written");
        assert_eq!(ConsistencyGraph::read(written.as_slice(), None, &limits).ok(), Some(graph));
    }
    if let Ok(views) = read_visibility(bytes, length, &limits) {
        let mut written = Vec::new();
        write_visibility(&views, &mut written).expect("what was read is written");
        assert_eq!(written, bytes);
    }
    if let Ok(text) = std::str::from_utf8(bytes) {
        let _ = parse_fusion_config(text);
        if let Ok(entries) = parse_patch_match_config(text) {
            let _ = parse_patch_match_config(&patch_match_config(&entries));
        }
    }
});
