//! The program `semvs`.

use super::console::{Console, Level};
use super::listen::Recorder;
use super::one_line::one_line;
use super::semvs_args::{Command, SemvsArgs};
use super::{commands, complain, print};
use clap::error::ErrorKind;
use clap::{ArgMatches, CommandFactory, FromArgMatches};
use std::ffi::OsString;
use std::process::ExitCode;
use std::sync::Arc;

/// Runs `semvs` with the words of its command line, the program's name first. Results go to stdout, everything
/// else to stderr; every failure is one line and exit code 1.
pub fn semvs(words: impl IntoIterator<Item = OsString>) -> ExitCode {
    let matches = match SemvsArgs::command().try_get_matches_from(words) {
        Ok(matches) => matches,
        Err(error) => return refuse(&error),
    };
    let args = match SemvsArgs::from_arg_matches(&matches) {
        Ok(args) => args,
        Err(error) => return refuse(&error),
    };
    let console = Console::new(Level::of(args.verbose, args.quiet));
    let recorder = Recorder::start(Arc::new(console));
    match run(&args, &matches, &recorder) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            complain(&format!("error: {error}\n"));
            ExitCode::FAILURE
        }
    }
}

fn run(args: &SemvsArgs, matches: &ArgMatches, recorder: &Arc<Recorder>) -> crate::Result<()> {
    let Some((_, typed)) = matches.subcommand() else { return Ok(()) };
    match &args.command {
        Command::Densify(args) => commands::densify(args, typed, recorder),
        Command::Fuse(args) => commands::fuse(args, typed, recorder),
        Command::Convert(args) => commands::convert(args, &recorder.progress()),
        Command::Inspect(args) => commands::inspect(args),
        Command::Evaluate(args) => commands::evaluate(args),
    }
}

/// Help and version are results; anything else is a mistake on the command line.
fn refuse(error: &clap::Error) -> ExitCode {
    match error.kind() {
        ErrorKind::DisplayHelp | ErrorKind::DisplayVersion => {
            print(&error.render().to_string());
            ExitCode::SUCCESS
        }
        ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand => {
            complain(&error.render().to_string());
            ExitCode::FAILURE
        }
        _ => {
            complain(&format!("error: {}; see semvs --help\n", one_line(error)));
            ExitCode::FAILURE
        }
    }
}
