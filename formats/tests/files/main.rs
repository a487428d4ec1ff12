//! Every kind of file, there and back: real files to the byte, made-up ones over all their versions, damaged ones.
#![allow(clippy::unwrap_used)]

#[path = "../common/mod.rs"]
mod common;

mod dmap;
mod interface;
mod project;
mod round_trip;
mod text_files;
