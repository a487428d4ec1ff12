#![no_main]
//! Depth maps, raw and quantised.

use libfuzzer_sys::fuzz_target;
use semvs_formats::{Limits, dmap::DepthMapFile};

fuzz_target!(|bytes: &[u8]| {
    let limits = Limits::default();
    let Ok(map) = DepthMapFile::from_bytes(bytes, &limits) else { return };
    let mut written = Vec::new();
    if map.write(&mut written).is_ok() {
        let again = DepthMapFile::from_bytes(&written, &limits).expect("what was written is read");
        // The range of depths may be no number, which equals nothing.
        if !map.depth_min.is_nan() && !map.depth_max.is_nan() {
            assert_eq!(map, again);
        }
    }
});
