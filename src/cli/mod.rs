//! The programs: what is typed, what it means, what is said meanwhile.

mod allocator;
mod commands;
mod console;
mod dense_config;
mod densify_point_cloud;
mod duration;
mod exchange_args;
mod forecast;
mod given;
mod install_args;
mod interrupt;
mod label_options;
mod labels_args;
mod listen;
mod one_line;
mod options;
#[cfg(test)]
mod options_page_tests;
mod page_args;
mod resolve;
mod resolve_labels;
mod semvs;
mod semvs_args;
mod values;

pub use allocator::ExitWhenExhausted;
pub use densify_point_cloud::densify_point_cloud;
pub use semvs::semvs;

use std::io::Write;

/// What callers take for "out of memory", because the system kills with it.
const OUT_OF_MEMORY: u8 = 137;

/// The exit code of a failure.
fn exit_code(error: &crate::Error) -> std::process::ExitCode {
    match error {
        crate::Error::OutOfMemory(_) => std::process::ExitCode::from(OUT_OF_MEMORY),
        crate::Error::Interrupted => std::process::ExitCode::from(interrupt::INTERRUPTED),
        _ => std::process::ExitCode::FAILURE,
    }
}

/// To stdout; a closed pipe is no failure.
fn print(text: &str) {
    let mut out = std::io::stdout().lock();
    let _ = out.write_all(text.as_bytes()).and_then(|()| out.flush());
}

/// To stderr; a closed pipe is no failure.
fn complain(text: &str) {
    let mut err = std::io::stderr().lock();
    let _ = err.write_all(text.as_bytes());
}
