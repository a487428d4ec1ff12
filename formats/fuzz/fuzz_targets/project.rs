#![no_main]
//! Native projects: the body is given as it is and, if it claims to be compressed, also compressed by the target.

use std::io::Write;

use libfuzzer_sys::fuzz_target;
use semvs_formats::mvs;

mod scene;

fuzz_target!(|bytes: &[u8]| {
    scene::check(bytes);
    // Damage inside of a compressed stream seldom gets past the decompressor.
    let Some((header, body)) = bytes.split_at_checked(20) else { return };
    let Ok(Some(mvs::Container::Project { kind: mvs::ArchiveKind::Binary })) = mvs::identify(header) else {
        return;
    };
    let mut header = header.to_vec();
    header[8] = mvs::ArchiveKind::Zlib as u8;
    let mut encoder = flate2::write::ZlibEncoder::new(header, flate2::Compression::fast());
    encoder.write_all(body).expect("vectors take everything");
    scene::check(&encoder.finish().expect("vectors take everything"));
});
