//! The program `DensifyPointCloud`: drop-in for OpenMVS's.
#![allow(non_snake_case)]

use std::process::ExitCode;

fn main() -> ExitCode {
    semvs::cli::densify_point_cloud(std::env::args_os().skip(1))
}
