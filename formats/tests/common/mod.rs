//! Where the test files are.
#![allow(clippy::print_stdout, dead_code)]

use std::path::{Path, PathBuf};

use semvs_formats::{Error, Limits};

pub(crate) fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// A bundled file.
pub(crate) fn fixture(path: &str) -> Vec<u8> {
    let path = root().join("compat-fixtures").join(path);
    std::fs::read(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// A file that is not bundled, if it is there.
pub(crate) fn shared(path: &str) -> Option<Vec<u8>> {
    let path = root().join("../shared").join(path);
    let bytes = std::fs::read(&path).ok();
    println!("{}: {}", path.display(), if bytes.is_some() { "tested" } else { "not there, skipped" });
    bytes
}

/// Calls `read` with every prefix of `bytes`, with `bytes` after each single-byte change, and with absurd numbers at
/// every place, and checks that it comes back with a value or an error of one line that blames the file.
pub(crate) fn damage(bytes: &[u8], read: impl Fn(&[u8]) -> Result<(), Error>) {
    let check = |bytes: &[u8]| {
        if let Err(e) = read(bytes) {
            assert!(!matches!(e, Error::Io(_)), "{e}");
            assert!(!e.to_string().contains('\n'), "{e}");
        }
    };
    for end in 0..bytes.len() {
        check(&bytes[..end]);
    }
    let mut changed = bytes.to_vec();
    for i in 0..bytes.len() {
        for value in [0, 1, 0x7f, 0x80, 0xff, bytes[i] ^ 1, bytes[i] ^ 0x10, bytes[i].wrapping_add(1)] {
            changed[i] = value;
            check(&changed);
        }
        changed[i] = bytes[i];
    }
    // Counts that no file holds, wherever there may be one.
    for i in 0..bytes.len().saturating_sub(8) {
        for count in [u64::MAX, i64::MAX as u64, 1 << 40, 1 << 32, u32::MAX.into(), 1 << 20, 1 << 16] {
            changed[i..i + 8].copy_from_slice(&count.to_le_bytes());
            check(&changed);
        }
        changed[i..i + 8].copy_from_slice(&bytes[i..i + 8]);
    }
}

/// Limits under which a small test file cannot take much memory.
pub(crate) fn small_limits() -> Limits {
    Limits { max_bytes: 64 << 20, ..Limits::default() }
}
