//! The option list that `DensifyPointCloud --help` prints.

use super::args::{BEYOND, DENSIFY, DropInArgs, GENERIC};
use clap::{Arg, CommandFactory};
use std::fmt::Write;

/// Column in which descriptions begin.
const INDENT: usize = 44;
/// Longest line.
const WIDTH: usize = 110;

/// The whole list, ending in a line feed.
pub(crate) fn text() -> String {
    let mut out = String::from("Available options:\n");
    for (title, names) in [
        ("Generic options", GENERIC),
        ("Densify options", DENSIFY),
        ("Options beyond OpenMVS (labels, reports; see also: semvs densify --help)", BEYOND),
    ] {
        group(&mut out, title, names);
    }
    out
}

fn group(out: &mut String, title: &str, names: &[&str]) {
    let command = DropInArgs::command();
    let _ = writeln!(out, "\n{title}:");
    for name in names {
        if let Some(arg) = command.get_arguments().find(|a| a.get_long() == Some(name)) {
            let head = head(arg, name);
            let help = arg.get_help().map(ToString::to_string).unwrap_or_default();
            entry(out, &head, &help);
        }
    }
}

/// `  -w [ --working-folder ] arg` or `  --iters arg (=3)`, as boost prints it.
fn head(arg: &Arg, name: &str) -> String {
    let mut head = match arg.get_short() {
        Some(short) => format!("  -{short} [ --{name} ]"),
        None => format!("  --{name}"),
    };
    if arg.get_action().takes_values() {
        head.push_str(" arg");
        let mut defaults: Vec<_> = arg.get_default_values().iter().map(|v| v.to_string_lossy()).collect();
        if name == "postprocess-dmaps" {
            // What it is with this program's default filter; with another one it is another.
            defaults = vec!["7".into()];
        }
        if !defaults.is_empty() {
            let _ = write!(head, " (={})", defaults.join(","));
        }
    }
    head
}

fn entry(out: &mut String, head: &str, help: &str) {
    out.push_str(head);
    let mut column = head.chars().count();
    if column + 1 > INDENT {
        out.push('\n');
        column = 0;
    }
    let _ = write!(out, "{:1$}", "", INDENT - column);
    column = INDENT;
    for (i, word) in help.split_whitespace().enumerate() {
        let length = word.chars().count();
        if i > 0 && column + 1 + length > WIDTH {
            let _ = write!(out, "\n{:1$}", "", INDENT);
            column = INDENT;
        } else if i > 0 {
            out.push(' ');
            column += 1;
        }
        out.push_str(word);
        column += length;
    }
    out.push('\n');
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_names_defaults_and_no_hidden_options() {
        let text = text();
        for line in [
            "  -h [ --help ]",
            "  -w [ --working-folder ] arg",
            "  --archive-type arg (=-1)",
            "  -v [ --verbosity ] arg (=2)",
            "  -c [ --config-file ] arg (=DensifyPointCloud.cfg)",
            "  --resolution-level arg (=1)",
            "  --max-resolution arg (=2560)",
            "  --number-views arg (=5)",
            "  --roi-border arg (=0)",
            "  --crop-to-roi arg (=1)",
            "  --label-path arg",
        ] {
            assert!(text.lines().any(|l| l.starts_with(line)), "{line}\n{text}");
        }
        assert!(!text.contains("--mesh-file"));
        assert!(text.lines().all(|l| l.chars().count() <= WIDTH), "{text}");
    }
}
