//! The program `DensifyPointCloud`: drop-in for OpenMVS's.
#![allow(non_snake_case)]

use std::process::ExitCode;

#[global_allocator]
static ALLOCATOR: semvs::internals::cli::ExitWhenExhausted = semvs::internals::cli::ExitWhenExhausted;

fn main() -> ExitCode {
    semvs::internals::cli::densify_point_cloud(std::env::args_os().skip(1))
}
