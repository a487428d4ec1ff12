//! `docs/reference/options.md` is what the command lines say of themselves. `UPDATE_GOLDEN=1` writes it anew.

use super::densify_point_cloud::args::{BEYOND, DENSIFY, DropInArgs, GENERIC, HIDDEN};
use super::semvs_args::SemvsArgs;
use clap::{Arg, ArgAction, Command, CommandFactory};
use std::fmt::Write;

const HEAD: &str = "\
# Options

Every option of every command, made from the definitions that the programs read (a test keeps the page in step). The same is said
by `semvs COMMAND --help`. What options do to results, in pictures: [choosing options](../guide/options.md).

- **value**: what is given after the option, with its unit. Scene units are those of the camera positions; depths are along the optical
  axis. A *switch* takes no value.
- **default**: what holds without the option. \"–\": nothing, or as the effect says.
- A relative path is taken from the current folder.
- Every command takes the [options about messages](#every-command), `-h` (summary) and `--help`.

";

const TAIL: &str = "\
## Environment

| variable | value | effect |
| --- | --- | --- |
| `SEMVS_CPU` | `scalar`, `neon`, `avx2`, `avx512` | instruction set of the estimator, in place of the best that the processor has; results are the same bytes |
| `SEMVS_MEMORY_MIB` | MiB | what a run may use without `--max-memory`, where that is less than 70 % of the machine or its control group |

## Exit codes

| code | meaning |
| --- | --- |
| 0 | done; for `compare`: within the limits |
| 1 | an error, one line on stderr; for `compare`: outside the limits; for `labels check`: a label map is missing or cannot be used |
| 2 | `compare` cannot compare |
| 130 | interrupted with Ctrl-C; the same command goes on from there |
| 137 | memory ran out, or would |
";

#[test]
fn the_page_about_options_is_current() {
    let page = page();
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/reference/options.md");
    if std::env::var_os("UPDATE_GOLDEN").is_some() {
        std::fs::write(&path, &page).unwrap();
    }
    let there = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(
        there == page,
        "docs/reference/options.md is not what the options are; UPDATE_GOLDEN=1 writes it"
    );
}

fn page() -> String {
    let mut semvs = SemvsArgs::command();
    semvs.build();
    let mut out = HEAD.to_owned();
    let commands: Vec<&Command> = semvs.get_subcommands().filter(|c| c.get_name() != "help").collect();
    for command in &commands {
        let nested: Vec<&Command> = command.get_subcommands().filter(|c| c.get_name() != "help").collect();
        match nested.is_empty() {
            true => section(&mut out, command, command.get_name()),
            false => nested.iter().for_each(|inner| {
                section(&mut out, inner, &format!("{} {}", command.get_name(), inner.get_name()));
            }),
        }
    }
    let _ = writeln!(out, "## Every command\n");
    table(&mut out, semvs.get_arguments().filter(|arg| arg.is_global_set()));
    drop_in(&mut out);
    out.push_str(TAIL);
    out
}

/// A command of `semvs`: what it does, and its options under their headings.
fn section(out: &mut String, command: &Command, name: &str) {
    let about = command.get_long_about().or(command.get_about()).map(ToString::to_string).unwrap_or_default();
    let (first, rest) = about.split_once("\n\n").unwrap_or((&about, ""));
    let _ = writeln!(out, "## semvs {name}\n\n{}.\n", escaped(first));
    if !rest.is_empty() {
        let _ = writeln!(out, "{}\n", escaped(rest));
    }
    let shown: Vec<&Arg> =
        command.get_arguments().filter(|arg| !arg.is_global_set() && !built_in(arg)).collect();
    let mut headings: Vec<Option<&str>> = Vec::new();
    for arg in shown.iter().filter(|arg| !arg.is_hide_set()) {
        if !headings.contains(&arg.get_help_heading()) {
            headings.push(arg.get_help_heading());
        }
    }
    for heading in headings {
        if let Some(heading) = heading {
            let _ = writeln!(out, "**{heading}**\n");
        }
        table(out, shown.iter().copied().filter(|a| !a.is_hide_set() && a.get_help_heading() == heading));
    }
    let hidden: Vec<String> =
        shown.iter().filter(|a| a.is_hide_set()).map(|a| format!("`--{}`", a.get_long().unwrap())).collect();
    if !hidden.is_empty() {
        let what = if name == "fuse" {
            "Taken and without effect, so that a command line can be reused"
        } else {
            "Refused"
        };
        let _ = writeln!(out, "{what}: {}.\n", hidden.join(", "));
    }
}

fn drop_in(out: &mut String) {
    let command = DropInArgs::command();
    let _ = writeln!(
        out,
        "## DensifyPointCloud\n\nThe drop-in for OpenMVS's program. How each option compares with OpenMVS's, and how words are \
         read: [COMPATIBILITY.md](../COMPATIBILITY.md). Its relative paths are taken from the working folder.\n"
    );
    for (title, names) in [
        ("Generic, on the command line only", GENERIC),
        ("Densify, on the command line or in the config file", DENSIFY),
        ("The same, not listed by its help", HIDDEN),
        ("Beyond OpenMVS", BEYOND),
    ] {
        let _ = writeln!(out, "**{title}**\n");
        let find = |name: &&str| command.get_arguments().find(|arg| arg.get_long() == Some(*name)).unwrap();
        table(out, names.iter().map(find));
    }
}

fn built_in(arg: &Arg) -> bool {
    ["help", "version"].contains(&arg.get_id().as_str())
        && matches!(arg.get_action(), ArgAction::Help | ArgAction::Version)
}

fn table<'a>(out: &mut String, args: impl Iterator<Item = &'a Arg>) {
    out.push_str("| option | value | default | effect |\n| --- | --- | --- | --- |\n");
    for arg in args {
        let (default, effect) = default_and_effect(arg);
        let _ = writeln!(out, "| {} | {} | {default} | {effect} |", spelling(arg), unit(arg));
    }
    out.push('\n');
}

/// `-o`, `--output` and other names of the option; the name of an argument.
fn spelling(arg: &Arg) -> String {
    let mut names: Vec<String> = arg.get_short().iter().map(|short| format!("`-{short}`")).collect();
    names.extend(arg.get_long().map(|long| format!("`--{long}`")));
    names.extend(arg.get_visible_aliases().unwrap_or_default().iter().map(|alias| format!("`--{alias}`")));
    match names.is_empty() {
        true => format!("`{}`", value_name(arg).replace('|', "\\|")),
        false => names.join(", "),
    }
}

fn value_name(arg: &Arg) -> String {
    arg.get_value_names().and_then(|names| names.first()).map_or_else(String::new, ToString::to_string)
}

/// What is given, and in which unit. An option with a value of a new kind needs a line here.
fn unit(arg: &Arg) -> String {
    if !arg.get_action().takes_values() {
        return "switch".to_owned();
    }
    let possible = possible(arg);
    let name = value_name(arg);
    let unit = match (name.as_str(), arg.get_long().unwrap_or_default()) {
        _ if !possible.is_empty() => {
            return possible.iter().map(|(name, _)| format!("`{name}`")).collect::<Vec<_>>().join(", ");
        }
        ("0|1", _) => "0 or 1",
        (_, "iters" | "geometric-iters") => "passes",
        (_, "resolution-level" | "sub-resolution-levels") => "halvings",
        (_, "number-views" | "number-views-fuse" | "export-number-views") => "images",
        (_, "max-threads") => "threads",
        (_, "points" | "label-smooth") => "points",
        (_, "estimate-scale") => "factor",
        (_, "sub-scene-area") => "area: each 8th pixel counts 0.01 · focal length / depth",
        ("PIXELS", _) => "pixels",
        ("SIZE", _) => "bytes, with K, M, G or T",
        ("DIR" | "FOLDER", _) => "folder",
        ("OUT", _) => "file or folder",
        ("A" | "B", _) if arg.get_long().is_none() => "file or folder",
        ("B", "roi-border") => "factor, or scene units below 0",
        ("N" | "MODE" | "BITS" | "V" | "TYPE" | "AREA", _) => "number",
        ("VALUE", _) => "grey value",
        ("D" | "EDGE", _) => "scene units",
        ("MIN,MAX", _) => "two depths, scene units",
        ("X,Y,Z", _) => "three lengths, scene units",
        ("COST", _) => "matching cost",
        ("S", _) => "steps per scene unit",
        ("ID", _) => "class ids",
        ("A,B", _) => "names or ids",
        ("TABLE", _) => "file or name",
        ("SCENE" | "INPUT" | "NAME", _) => "file or folder",
        ("FILE.dmap|DIR", _) => "file or folder",
        (file, _) if file.starts_with("FILE") || file.contains('.') => "file",
        (other, option) => panic!("--{option} {other}: say in options_page_tests.rs which unit this has"),
    };
    unit.to_owned()
}

/// Names and meanings of the values, where there are a few.
fn possible(arg: &Arg) -> Vec<(String, String)> {
    if !arg.get_action().takes_values() || value_name(arg) == "0|1" {
        return Vec::new();
    }
    let values = arg.get_possible_values();
    let help =
        |value: &clap::builder::PossibleValue| value.get_help().map(ToString::to_string).unwrap_or_default();
    values.iter().filter(|v| !v.is_hide_set()).map(|v| (v.get_name().to_owned(), help(v))).collect()
}

/// The default, which a help text may say in brackets, and the rest of the help text with the meanings of values.
fn default_and_effect(arg: &Arg) -> (String, String) {
    let help = arg.get_help().map(ToString::to_string).unwrap_or_default();
    let help = help.split_whitespace().collect::<Vec<_>>().join(" ");
    let typed: Vec<String> =
        arg.get_default_values().iter().map(|value| format!("`{}`", value.to_string_lossy())).collect();
    let (mut effect, said) = match help.split_once(" [default: ") {
        Some((before, rest)) => {
            let (said, after) = rest.split_once(']').unwrap();
            (format!("{before}{after}"), Some(said.to_owned()))
        }
        None => (help, None),
    };
    let default = match (said, arg.get_action().takes_values()) {
        (Some(said), _) => escaped(&said),
        (None, false) => "off".to_owned(),
        (None, true) if typed.is_empty() => if arg.is_required_set() { "required" } else { "–" }.to_owned(),
        (None, true) => typed.join(","),
    };
    effect = escaped(&effect);
    let meanings: Vec<String> = possible(arg)
        .iter()
        .filter(|(_, meaning)| !meaning.is_empty())
        .map(|(name, meaning)| format!("`{name}`: {}", escaped(meaning)))
        .collect();
    if !meanings.is_empty() {
        let _ = write!(effect, ". {}", meanings.join("; "));
    }
    (default, effect)
}

/// Text that Markdown shows as it is.
fn escaped(text: &str) -> String {
    let mut out = String::new();
    for c in text.chars() {
        match c {
            '|' | '<' | '*' | '_' => out.extend(['\\', c]),
            c => out.push(c),
        }
    }
    out
}
