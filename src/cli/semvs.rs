//! The program `semvs`.

use super::console::{Console, Level};
use super::given;
use super::listen::Recorder;
use super::one_line::{one_line, printable};
use super::resolve::{cpu, kernels};
use super::semvs_args::{Command, SemvsArgs};
use super::{commands, complain, exit_code, print};
use crate::report::build;
use clap::error::ErrorKind;
use clap::{ArgMatches, CommandFactory, FromArgMatches};
use std::ffi::OsString;
use std::process::ExitCode;
use std::sync::Arc;

/// Runs `semvs` with the words of its command line, the program's name first. Results go to stdout, everything
/// else to stderr; every failure is one line and exit code 1, or 2 where 1 is an answer (`compare`).
pub fn semvs(words: impl IntoIterator<Item = OsString>) -> ExitCode {
    let words: Vec<OsString> = words.into_iter().collect();
    let failure = failure_of(&words);
    let help = help_of(&words);
    let matches = match SemvsArgs::command().try_get_matches_from(words) {
        Ok(matches) => matches,
        Err(error) => return refuse(&error, failure, &help),
    };
    let args = match SemvsArgs::from_arg_matches(&matches) {
        Ok(args) => args,
        Err(error) => return refuse(&error, failure, &help),
    };
    let console = Console::new(Level::of(args.verbose, args.quiet));
    let recorder = Recorder::before(Arc::new(console));
    match run(&args, &matches, &recorder) {
        Ok(code) => code,
        Err(error) => {
            complain(&format!("error: {}\n", printable(&error.to_string())));
            match error {
                crate::Error::OutOfMemory(_) | crate::Error::Interrupted => exit_code(&error),
                _ => failure,
            }
        }
    }
}

/// The exit code of failures of the command that `words` name.
fn failure_of(words: &[OsString]) -> ExitCode {
    let is_option = |word: &&OsString| word.to_string_lossy().starts_with('-');
    match words.iter().skip(1).find(|word| !is_option(word)) {
        Some(command) if command == "compare" => ExitCode::from(commands::INCOMPARABLE),
        _ => ExitCode::FAILURE,
    }
}

/// What to type for the help that `words` call for: that of a command, if they name one.
fn help_of(words: &[OsString]) -> String {
    let mut command = SemvsArgs::command();
    let mut typed = "semvs".to_owned();
    for word in words.iter().skip(1).filter_map(|word| word.to_str()) {
        let Some(next) = command.find_subcommand(word) else { break };
        typed = format!("{typed} {}", next.get_name());
        command = next.clone();
    }
    format!("{typed} --help")
}

fn run(args: &SemvsArgs, matches: &ArgMatches, recorder: &Arc<Recorder>) -> crate::Result<ExitCode> {
    let Some((_, typed)) = matches.subcommand() else { return Ok(ExitCode::SUCCESS) };
    given::check(&args.command)?;
    match &args.command {
        Command::Compare(args) => return commands::compare(args),
        Command::Completions(args) => {
            commands::completions(args);
            Ok(())
        }
        Command::Densify(args) => commands::densify(args, typed, recorder),
        Command::Fuse(args) => commands::fuse(args, typed, recorder),
        Command::Convert(args) => commands::convert(args, &recorder.progress()),
        Command::Import(args) => commands::import(args, &recorder.progress()),
        Command::Export(args) => commands::export(args, &recorder.progress()),
        Command::Inspect(args) => commands::inspect(args),
        Command::Evaluate(args) => commands::evaluate(args),
        Command::Labels(args) => commands::labels(args, &recorder.progress()),
        Command::Report(args) => commands::report(args, &recorder.progress()),
        Command::Preview(args) => commands::preview(args, &recorder.progress()),
        Command::Demo(args) => commands::demo(args, recorder),
        Command::Man(args) => commands::man(args),
    }?;
    Ok(ExitCode::SUCCESS)
}

/// Help and version are results; anything else is a mistake on the command line.
fn refuse(error: &clap::Error, failure: ExitCode, help: &str) -> ExitCode {
    match error.kind() {
        ErrorKind::DisplayHelp => {
            print(&error.render().to_string());
            ExitCode::SUCCESS
        }
        ErrorKind::DisplayVersion => match cpu() {
            Ok(level) => {
                print(&format!("semvs {}\n{}", build(), kernels(level)));
                ExitCode::SUCCESS
            }
            Err(error) => {
                complain(&format!("error: {}\n", printable(&error.to_string())));
                failure
            }
        },
        ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand => {
            complain(&error.render().to_string());
            failure
        }
        _ => {
            complain(&format!("error: {}; see {help}\n", printable(&one_line(error))));
            failure
        }
    }
}
