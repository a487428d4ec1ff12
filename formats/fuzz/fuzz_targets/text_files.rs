#![no_main]
//! Regions of interest and view-neighbour files.

use libfuzzer_sys::fuzz_target;
use semvs_formats::{neighbors_file, roi};

fuzz_target!(|bytes: &[u8]| {
    if let Ok(obb) = roi::parse(bytes) {
        let mut written = Vec::new();
        roi::write(&mut written, &obb).expect("what was read is written");
        assert_eq!(roi::parse(&written).expect("what was written is read"), obb);
    }
    if let Ok(file) = neighbors_file::parse(bytes, 64) {
        for list in &file.lists {
            assert!(list.image < 64 && list.neighbors.iter().all(|&n| n < 64 && n != list.image));
        }
    }
});
