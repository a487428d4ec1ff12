#![no_main]
//! PFM maps and NPY arrays.

use libfuzzer_sys::fuzz_target;
use semvs_formats::{Limits, npy, pfm};

fn bits(values: &[f32]) -> Vec<u32> {
    values.iter().map(|v| v.to_bits()).collect()
}

fuzz_target!(|bytes: &[u8]| {
    let (limits, length) = (Limits::default(), Some(bytes.len() as u64));
    let mut written = Vec::new();
    if let Ok(map) = pfm::read(bytes, length, &limits) {
        pfm::write(&map, &mut written).expect("what was read is written");
        let again = pfm::read(written.as_slice(), None, &limits).expect("what was written is read");
        assert_eq!((again.width, again.height, bits(&again.data)), (map.width, map.height, bits(&map.data)));
    }
    if let Ok(array) = npy::read(bytes, length, &limits) {
        npy::write(&array, &mut written).expect("what was read is written");
        let again = npy::read(written.as_slice(), None, &limits).expect("what was written is read");
        assert_eq!((again.shape, bits(&again.data)), (array.shape, bits(&array.data)));
    }
});
