//! `semvs man`.

use crate::cli::densify_point_cloud::DropInArgs;
use crate::cli::install_args::ManArgs;
use crate::cli::semvs_args::SemvsArgs;
use crate::error::Result;
use crate::report::VERSION;
use crate::store::atomic::write_file;
use clap::{Command, CommandFactory};
use clap_mangen::Man;
use clap_mangen::roff::{Roff, roman};

/// Prints the page of semvs, or writes all pages and prints their names.
///
/// # Errors
/// A page cannot be written.
pub(crate) fn man(args: &ManArgs) -> Result<()> {
    let mut semvs = SemvsArgs::command().disable_help_subcommand(true);
    semvs.build();
    let Some(folder) = &args.output else {
        crate::cli::print(&page(&semvs));
        return Ok(());
    };
    let mut commands = Vec::new();
    collect(&semvs, &mut commands);
    commands.push(drop_in());
    for command in commands {
        let path = folder.join(format!("{}.1", name(&command)));
        write_file(&path, page(&command).as_bytes())?;
        crate::cli::print(&format!("{}\n", path.display()));
    }
    Ok(())
}

/// `command` and all commands below it.
fn collect(command: &Command, all: &mut Vec<Command>) {
    all.push(command.clone());
    command.get_subcommands().for_each(|below| collect(below, all));
}

/// `semvs-densify` for `semvs densify`.
fn name(command: &Command) -> &str {
    command.get_display_name().unwrap_or_else(|| command.get_name())
}

/// The drop-in has a reader of words of its own; its options are these.
fn drop_in() -> Command {
    let what = "The drop-in for the program of this name of OpenMVS 2.3.0: the same options, files and log, read by the same \
                rules. Options may be shortened as long as they are told apart, and stand in the config file as name = value.";
    DropInArgs::command()
        .no_binary_name(false)
        .about("Make a dense cloud from a scene as OpenMVS does")
        .long_about(what)
        .override_usage("DensifyPointCloud [OPTIONS] SCENE.mvs")
        .version(VERSION)
        .disable_version_flag(true)
}

/// The page of one command.
fn page(command: &Command) -> String {
    let man = Man::new(command.clone());
    let title = name(command).to_uppercase();
    // Without a date, so that the same version has the same pages.
    let mut text = format!(".TH \"{title}\" 1 \"\" \"semvs {VERSION}\" \"semvs\"\n").into_bytes();
    let has_options = command.get_arguments().any(|arg| !arg.is_hide_set());
    // Writing to memory does not fail.
    let _ = man
        .render_name_section(&mut text)
        .and_then(|()| man.render_synopsis_section(&mut text))
        .and_then(|()| man.render_description_section(&mut text))
        .and_then(|()| if has_options { man.render_options_section(&mut text) } else { Ok(()) })
        .and_then(
            |()| if command.has_subcommands() { man.render_subcommands_section(&mut text) } else { Ok(()) },
        )
        .and_then(|()| end(command).to_writer(&mut text));
    String::from_utf8_lossy(&text).into_owned()
}

/// Examples line by line, and where to read on.
fn end(command: &Command) -> Roff {
    let mut roff = Roff::new();
    if let Some(examples) = command.get_after_help() {
        roff.control("SH", ["EXAMPLES"]);
        roff.control("nf", []);
        for line in examples.to_string().lines().filter(|line| line.starts_with(' ')) {
            roff.text([roman(line.strip_prefix("  ").unwrap_or(line))]);
        }
        roff.control("fi", []);
    }
    if name(command) != "semvs" {
        roff.control("SH", ["SEE ALSO"]);
        roff.text([roman("semvs(1)")]);
    }
    roff
}
