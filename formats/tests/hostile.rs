//! What hostile files do to every reader: nothing but a typed error or a value, in little memory and time.
//!
//! Each reader gets small files of each of its kinds, cut at every byte, with every byte changed, with absurd numbers
//! at every place, and large files made to cost much memory per byte. The allocator of this program counts.

#![allow(clippy::unwrap_used)]

mod common;
mod hostile_files;

use std::alloc::System;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Mutex;

use peakmem_alloc::{INSTRUMENTED_SYSTEM, PeakMemAlloc, PeakMemAllocTrait};
use semvs_formats::Error;

use hostile_files::{READERS, Reader, floods};

#[global_allocator]
static COUNTING: &PeakMemAlloc<System> = &INSTRUMENTED_SYSTEM;

/// One measurement at a time.
static MEASURING: Mutex<()> = Mutex::new(());

/// What a reader may take for a file of `length` bytes: 4 times the file and 64 MiB.
fn allowed(length: usize) -> usize {
    4 * length + (64 << 20)
}

/// Reads `bytes` and checks how that ends and what it costs; `what` says what was done to them.
fn check(reader: &Reader, bytes: &[u8], what: &dyn Fn() -> String) {
    COUNTING.reset_peak_memory();
    let outcome = catch_unwind(AssertUnwindSafe(|| (reader.read)(bytes)));
    let peak = COUNTING.get_peak_memory();
    let name = reader.name;
    let Ok(outcome) = outcome else { panic!("{name}: panic on {}", what()) };
    assert!(peak <= allowed(bytes.len()), "{name}: {peak} bytes of memory for {} of {}", bytes.len(), what());
    if let Err(error) = outcome {
        assert!(!matches!(error, Error::Io(_)), "{name}: {}: blames the medium: {error}", what());
        let message = error.to_string();
        assert!(!message.contains('\n'), "{name}: {}: more than a line: {message}", what());
        assert!(message.len() < 1000, "{name}: {}: a message of {} bytes", what(), message.len());
    }
}

/// Runs `test` for every small file of every reader.
fn each_seed(test: impl Fn(&Reader, &str, &[u8])) {
    let _one = MEASURING.lock();
    for reader in READERS {
        let seeds = (reader.seeds)();
        assert!(!seeds.is_empty(), "{}", reader.name);
        for (name, bytes) in seeds {
            test(reader, &name, &bytes);
        }
    }
}

#[test]
fn sound_files_are_read_and_empty_ones_refused() {
    each_seed(|reader, name, bytes| {
        (reader.read)(bytes).unwrap_or_else(|e| panic!("{} {name}: {e}", reader.name));
        assert!(bytes.len() < 6000, "{} {name} is not small: {} bytes", reader.name, bytes.len());
        check(reader, &[], &|| "nothing".into());
    });
}

#[test]
fn files_that_end_anywhere() {
    each_seed(|reader, name, bytes| {
        for end in 0..bytes.len() {
            check(reader, &bytes[..end], &|| format!("{name} cut at {end}"));
        }
    });
}

#[test]
fn files_with_any_byte_changed() {
    each_seed(|reader, name, bytes| {
        let mut changed = bytes.to_vec();
        for i in 0..bytes.len() {
            for value in [0, 0x7f, 0xff, b'9', b'-', b' ', b'\n', bytes[i] ^ 1, bytes[i] ^ 0x80] {
                changed[i] = value;
                check(reader, &changed, &|| format!("{name} with {value:#04x} at {i}"));
            }
            changed[i] = bytes[i];
        }
    });
}

#[test]
fn files_with_absurd_counts_anywhere() {
    let wide =
        [u64::MAX, i64::MAX as u64, 1 << 60, 1 << 40, u32::MAX as u64, i32::MAX as u64, 1 << 24, 1 << 16];
    each_seed(|reader, name, bytes| {
        let mut changed = bytes.to_vec();
        for i in 0..bytes.len().saturating_sub(8) {
            for count in wide {
                changed[i..i + 8].copy_from_slice(&count.to_le_bytes());
                check(reader, &changed, &|| format!("{name} with the 64-bit {count:#x} at {i}"));
            }
            changed[i..i + 8].copy_from_slice(&bytes[i..i + 8]);
            for count in [u32::MAX, i32::MAX as u32, 1 << 30, 1 << 16] {
                changed[i..i + 4].copy_from_slice(&count.to_le_bytes());
                check(reader, &changed, &|| format!("{name} with the 32-bit {count:#x} at {i}"));
            }
            changed[i..i + 4].copy_from_slice(&bytes[i..i + 4]);
        }
    });
}

/// Every run of digits replaced by absurd numbers: text counts, sizes in headers.
#[test]
fn files_with_absurd_numbers_in_their_text() {
    let numbers = ["", "0", "-1", "255", "65536", "4294967295", "4294967296", "9223372036854775807"];
    let more = ["18446744073709551615", "18446744073709551616", "1e400", "nan", "99999999999999999999999999"];
    each_seed(|reader, name, bytes| {
        let mut start = 0;
        while start < bytes.len() {
            let digits = bytes[start..].iter().take_while(|b| b.is_ascii_digit()).count();
            for number in numbers.iter().chain(&more).filter(|_| digits > 0) {
                let changed = [&bytes[..start], number.as_bytes(), &bytes[start + digits..]].concat();
                check(reader, &changed, &|| format!("{name} with {number:?} at {start}"));
            }
            start += digits.max(1);
        }
    });
}

/// Two damages at once: the second may be reached only because of the first.
#[test]
fn files_with_parts_repeated_or_missing() {
    each_seed(|reader, name, bytes| {
        let step = (bytes.len() / 40).max(1);
        for i in (0..bytes.len()).step_by(step) {
            for j in (i..bytes.len()).step_by(step) {
                let missing = [&bytes[..i], &bytes[j..]].concat();
                check(reader, &missing, &|| format!("{name} without {i}..{j}"));
                let repeated = [&bytes[..j], &bytes[i..]].concat();
                check(reader, &repeated, &|| format!("{name} with {i}..{j} twice"));
            }
        }
    });
}

#[test]
fn large_files_made_to_cost_memory() {
    let _one = MEASURING.lock();
    for (name, what, make) in floods() {
        let reader = READERS.iter().find(|r| r.name == name).unwrap_or_else(|| panic!("{name}"));
        let bytes = make();
        check(reader, &bytes, &|| what.to_owned());
    }
}
