#![no_main]
//! Headers of LAS and LAZ files.

use libfuzzer_sys::fuzz_target;
use semvs_formats::Limits;
use semvs_formats::las::LasInfo;

fuzz_target!(|bytes: &[u8]| {
    if let Ok(info) = LasInfo::read(bytes, &Limits::default()) {
        assert!(info.class_names.len() <= 256);
    }
});
