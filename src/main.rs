//! The program `semvs`.

use std::process::ExitCode;

#[global_allocator]
static ALLOCATOR: semvs::internals::cli::ExitWhenExhausted = semvs::internals::cli::ExitWhenExhausted;

fn main() -> ExitCode {
    semvs::internals::cli::semvs(std::env::args_os())
}
