//! The command lines of `semvs demo`, `semvs completions` and `semvs man`, as typed.

use clap::{Args, ValueEnum};
use clap_complete::Shell;
use std::path::PathBuf;

/// Reconstruct a small scene that comes with the program, to see what a run leaves
///
/// Six photographs of a façade, 400 by 300 pixels, with label maps, go into DIR/scene; the labelled cloud, the depth maps and a
/// page to look at in the browser go into DIR. Run again, it goes on where it was. Files that are not its own stay as they are.
#[derive(Clone, Debug, Args)]
#[command(after_help = DEMO_EXAMPLES)]
pub(crate) struct DemoArgs {
    /// Folder to write: a new or an empty one, or that of an earlier demo
    #[arg(short, long, value_name = "DIR", default_value = "semvs-demo")]
    pub(crate) output: PathBuf,
    /// Number of threads; 0 = all that the machine has
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) max_threads: u32,
}

const DEMO_EXAMPLES: &str = "\
Examples:
  semvs demo
      writes semvs-demo/report.html: open it in a browser
  semvs demo -o facade --max-threads 2";

/// Print a script that makes a shell complete the words of a command line
#[derive(Clone, Debug, Args)]
#[command(after_help = COMPLETIONS_EXAMPLES)]
pub(crate) struct CompletionsArgs {
    /// The shell
    #[arg(value_name = "SHELL", value_enum)]
    pub(crate) shell: Shell,
    /// The program whose words are completed
    #[arg(long, value_name = "NAME", value_enum, default_value_t = Program::Semvs)]
    pub(crate) program: Program,
}

/// `--program`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Program {
    /// the program with commands
    Semvs,
    /// the drop-in
    #[value(name = "DensifyPointCloud")]
    DensifyPointCloud,
}

const COMPLETIONS_EXAMPLES: &str = "\
Examples:
  semvs completions bash > ~/.local/share/bash-completion/completions/semvs
  semvs completions zsh > ~/.zfunc/_semvs
      with ~/.zfunc in fpath before compinit
  semvs completions fish > ~/.config/fish/completions/semvs.fish
  semvs completions powershell | Out-String | Invoke-Expression
  semvs completions bash --program DensifyPointCloud";

/// Print the manual page of semvs, or write those of all commands
#[derive(Clone, Debug, Args)]
#[command(after_help = MAN_EXAMPLES)]
pub(crate) struct ManArgs {
    /// Write one page for each command and one for DensifyPointCloud into this folder
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: Option<PathBuf>,
}

const MAN_EXAMPLES: &str = "\
Examples:
  semvs man -o ~/.local/share/man/man1
      then: man semvs-densify
  semvs man | man -l -";
