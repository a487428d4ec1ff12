//! The stages one by one on the bundled scene (six maps of 200 × 150 pixels), in time of one processor.
//!
//! `cargo bench --bench stages`; whole programs are compared by `benches/compare.sh`.

#![allow(clippy::unwrap_used, clippy::panic, clippy::print_stdout, missing_docs)]

mod busy;
mod codecs;
#[path = "../../tests/common/mod.rs"]
mod common;
mod estimate;
mod maps;
#[path = "../../tests/stages/openmvs_maps.rs"]
#[allow(dead_code, reason = "the tests use more of it")]
mod openmvs_maps;
mod scene;

use criterion::{criterion_group, criterion_main};

criterion_group!(benches, estimate::estimate, maps::filter, maps::fuse, codecs::codecs);
criterion_main!(benches);
