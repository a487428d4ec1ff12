//! The program `semvs`.

use std::process::ExitCode;

#[global_allocator]
static ALLOCATOR: semvs::cli::ExitWhenExhausted = semvs::cli::ExitWhenExhausted;

fn main() -> ExitCode {
    semvs::cli::semvs(std::env::args_os())
}
