#![no_main]
//! The files of a sparse model; the input is taken for each of them in turn.

use libfuzzer_sys::fuzz_target;
use semvs_formats::Limits;
use semvs_formats::colmap::{Encoding, Model, ModelFile};

const FILES: [ModelFile; 5] =
    [ModelFile::Cameras, ModelFile::Images, ModelFile::Points, ModelFile::Rigs, ModelFile::Frames];

fn read(bytes: &[u8], file: ModelFile, encoding: Encoding) -> Option<Model> {
    let mut model = Model::default();
    let length = Some(bytes.len() as u64);
    model.read_file(file, encoding, bytes, length, &Limits::default()).ok().map(|()| model)
}

fuzz_target!(|bytes: &[u8]| {
    for file in FILES {
        for encoding in [Encoding::Binary, Encoding::Text] {
            let Some(model) = read(bytes, file, encoding) else { continue };
            let _ = model.check();
            for target in [Encoding::Binary, Encoding::Text] {
                let mut written = Vec::new();
                if model.write_file(file, target, &mut written).is_err() {
                    continue;
                }
                let again = read(&written, file, target).expect("what was written is read");
                let mut rewritten = Vec::new();
                again.write_file(file, target, &mut rewritten).expect("what was read is written");
                assert!(written == rewritten, "{file:?} as {target:?}: rewriting changes the bytes");
            }
        }
    }
});
