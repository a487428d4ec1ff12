//! `semvs completions`.

use crate::cli::densify_point_cloud::DropInArgs;
use crate::cli::install_args::{CompletionsArgs, Program};
use crate::cli::semvs_args::SemvsArgs;
use clap::CommandFactory;

/// Prints the script.
pub(crate) fn completions(args: &CompletionsArgs) {
    let (mut command, name) = match args.program {
        Program::Semvs => (SemvsArgs::command(), "semvs"),
        Program::DensifyPointCloud => (DropInArgs::command(), "DensifyPointCloud"),
    };
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut command, name, &mut script);
    crate::cli::print(&String::from_utf8_lossy(&script));
}
