//! The program `DensifyPointCloud`: drop-in for OpenMVS's.
#![allow(non_snake_case)]

use std::process::ExitCode;

#[global_allocator]
static ALLOCATOR: semvs::cli::ExitWhenExhausted = semvs::cli::ExitWhenExhausted;

fn main() -> ExitCode {
    semvs::cli::densify_point_cloud(std::env::args_os().skip(1))
}
