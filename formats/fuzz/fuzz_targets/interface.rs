#![no_main]
//! Interface archives of every version, the one without header included.

use libfuzzer_sys::{Corpus, fuzz_target};

mod scene;

fuzz_target!(|bytes: &[u8]| -> Corpus {
    if bytes.starts_with(b"MVS\0") {
        return Corpus::Reject;
    }
    scene::check(bytes);
    Corpus::Keep
});
