//! The program `semvs`.

use std::process::ExitCode;

fn main() -> ExitCode {
    semvs::cli::semvs(std::env::args_os())
}
