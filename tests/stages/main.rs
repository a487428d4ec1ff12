//! The library's stages on real data: against OpenMVS's own results where they must be the same, against truth elsewhere.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout, reason = "tests may")]

#[path = "../common/mod.rs"]
mod common;

mod convert;
mod depth_store;
mod evaluate;
mod exact_filters;
mod exact_fusion;
mod labelled_fusion;
mod openmvs_maps;
mod scene;
mod unbiased_filter;
