//! `semvs compare`.

use super::report::check_page;
use crate::cli::semvs_args::CompareArgs;
use crate::error::{Error, Result};
use crate::evaluate::{Check, Comparison, Differences, Figure, Figures, FirstDifference, Kind, Part};
use crate::pipeline::compare::{self, CompareJob, Expectation, Outcome};
use crate::report::{Align, Table};
use serde::Serialize;
use std::fmt::Write;
use std::process::ExitCode;

/// Exit code when the results are outside the limits.
const OUTSIDE: u8 = 1;
/// Exit code when the results cannot be compared.
pub(crate) const INCOMPARABLE: u8 = 2;
/// Version of the JSON output: a change of names or meanings raises it, new names do not.
const SCHEMA: u32 = 1;

/// Runs the command.
pub(crate) fn compare(args: &CompareArgs) -> Result<ExitCode> {
    let expect = args.expect.as_deref().map(Expectation::read).transpose()?;
    args.html.as_deref().map(check_page).transpose()?;
    let job = CompareJob {
        a: args.a.clone(),
        b: args.b.clone(),
        scene: args.scene.clone(),
        expect,
        page: args.html.clone(),
    };
    let outcome = compare::compare(&job)?;
    let text = match args.json {
        true => json(args, &outcome)?,
        false => text(args, &outcome),
    };
    crate::cli::print(&text);
    Ok(match outcome.violations() {
        Some(violations) if !violations.is_empty() => ExitCode::from(OUTSIDE),
        _ => ExitCode::SUCCESS,
    })
}

/// What `--json` prints.
#[derive(Serialize)]
struct Report<'a> {
    schema: u32,
    a: String,
    b: String,
    #[serde(flatten)]
    comparison: &'a Comparison,
    /// Whether all limits hold; not there without `--expect`.
    #[serde(skip_serializing_if = "Option::is_none")]
    within: Option<bool>,
    #[serde(skip_serializing_if = "Option::is_none")]
    violations: Option<Vec<Check>>,
    /// The page, if one was written.
    #[serde(skip_serializing_if = "Option::is_none")]
    page: Option<String>,
}

fn json(args: &CompareArgs, outcome: &Outcome) -> Result<String> {
    let violations = outcome.violations();
    let report = Report {
        schema: SCHEMA,
        a: args.a.display().to_string(),
        b: args.b.display().to_string(),
        comparison: &outcome.comparison,
        within: violations.as_ref().map(Vec::is_empty),
        violations,
        page: args.html.as_ref().map(|path| path.display().to_string()),
    };
    let text = serde_json::to_string_pretty(&report).map_err(|e| Error::invalid(format!("no JSON: {e}")))?;
    Ok(text + "\n")
}

fn text(args: &CompareArgs, outcome: &Outcome) -> String {
    let comparison = &outcome.comparison;
    let mut out = format!("A  {}\nB  {}\n", args.a.display(), args.b.display());
    match comparison.parts.as_slice() {
        [] => whole(comparison, &mut out),
        [part] if !args.a.is_dir() => details(&part.figures, &part.notes, part.first.as_ref(), &mut out),
        parts => folder(comparison, parts, &mut out),
    }
    if let Some(violations) = outcome.violations() {
        out.push('\n');
        for violation in &violations {
            let _ = writeln!(out, "outside: {violation}");
        }
        out.push_str(if violations.is_empty() { "within all limits\n" } else { "outside the limits\n" });
    }
    if let Some((path, bytes)) = args.html.as_ref().zip(outcome.page_bytes) {
        let _ = writeln!(out, "\n{}: {:.1} MB", path.display(), bytes as f64 / 1e6);
    }
    out
}

fn whole(comparison: &Comparison, out: &mut String) {
    details(&comparison.figures, &comparison.notes, comparison.first.as_ref(), out);
    let has = |name: &str| comparison.figures.get(name).is_some();
    if comparison.kind == Kind::Clouds && has("position") && !has("position_of_depth") {
        out.push_str("(give --scene for distances relative to depth)\n");
    }
}

/// Single numbers, then a table of differences, notes and the first difference.
fn details(figures: &Figures, notes: &[String], first: Option<&FirstDifference>, out: &mut String) {
    let mut single = Table::new(&[("figure", Align::Left), ("value", Align::Right)]);
    let mut differences = Table::new(&[
        ("differences", Align::Left),
        ("compared", Align::Right),
        ("equal", Align::Right),
        ("p50", Align::Right),
        ("p90", Align::Right),
        ("p99", Align::Right),
        ("p999", Align::Right),
        ("p9999", Align::Right),
        ("max", Align::Right),
        ("within_1e-6", Align::Right),
        ("1e-3", Align::Right),
        ("1e-2", Align::Right),
    ]);
    let mut rows = 0;
    for (name, figure) in figures.iter() {
        match figure {
            Figure::Count(count) => single.row([name.to_owned(), count.to_string()]),
            Figure::Number(number) => single.row([name.to_owned(), short(number)]),
            Figure::Absolute(d) => differences.row(cells(name, &d)),
            Figure::Relative(d) => {
                differences.row(cells(name, &d).into_iter().chain(d.within.map(short)));
            }
        }
        rows += usize::from(matches!(figure, Figure::Absolute(_) | Figure::Relative(_)));
    }
    let _ = write!(out, "\n{single}");
    if rows > 0 {
        let _ = write!(out, "\n{differences}");
    }
    out.push('\n');
    notes.iter().for_each(|note| out.push_str(&format!("note: {note}\n")));
    out.push_str(&format!("{}\n", first_line(first)));
}

fn cells(name: &str, d: &Differences) -> Vec<String> {
    let share = d.equal as f64 / d.compared as f64;
    let mut cells = vec![name.to_owned(), d.compared.to_string()];
    cells.extend([share, d.p50, d.p90, d.p99, d.p999, d.p9999, d.max].map(short));
    cells
}

/// A row per depth map.
fn folder(comparison: &Comparison, parts: &[Part], out: &mut String) {
    let mut table = Table::new(&[
        ("depth map", Align::Left),
        ("valid.a", Align::Right),
        ("valid.b", Align::Right),
        ("iou", Align::Right),
        ("same", Align::Right),
        ("depth.p50", Align::Right),
        ("p99", Align::Right),
        ("max", Align::Right),
        ("within_1e-6", Align::Right),
        ("1e-3", Align::Right),
        ("1e-2", Align::Right),
        ("confidence.p99", Align::Right),
        ("normal.p99", Align::Right),
    ]);
    for part in parts {
        let numbers = part.figures.numbers();
        let cell = |name: &str| {
            let found = numbers.iter().find(|(known, _)| known == name);
            found.map_or("-".to_owned(), |(_, value)| short(*value))
        };
        let columns = [
            "valid.a",
            "valid.b",
            "valid.iou",
            "valid.same",
            "depth.p50",
            "depth.p99",
            "depth.max",
            "depth.within_1e-6",
            "depth.within_1e-3",
            "depth.within_1e-2",
            "confidence.p99",
            "normal.p99",
        ];
        table.row(std::iter::once(part.name.clone()).chain(columns.map(cell)));
    }
    let _ = writeln!(out, "\n{table}");
    comparison.notes.iter().for_each(|note| out.push_str(&format!("note: {note}\n")));
    for part in parts {
        part.notes.iter().for_each(|note| out.push_str(&format!("note: {}: {note}\n", part.name)));
    }
    match parts.iter().find(|part| part.first.is_some()) {
        Some(part) => out.push_str(&format!("{}, in {}\n", first_line(part.first.as_ref()), part.name)),
        None => out.push_str(&format!("{}\n", first_line(None))),
    }
}

fn first_line(first: Option<&FirstDifference>) -> String {
    match first {
        None => "no element differs".to_owned(),
        Some(FirstDifference { place, attribute, a, b }) => {
            format!("first difference: {place}, {attribute}: {a} in A, {b} in B")
        }
    }
}

/// Up to six decimals; small and large numbers with an exponent.
fn short(value: f64) -> String {
    let size = value.abs();
    if value.fract() == 0.0 && size < 1e9 {
        format!("{value}")
    } else if (1e-3..1e6).contains(&size) {
        let text = format!("{value:.6}");
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        format!("{value:.2e}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        let shown =
            [0.0, 1.0, 24171.0, 0.99995, 0.999_999_9, 1.25e-7, 0.0123456789, f64::INFINITY].map(short);
        assert_eq!(shown, ["0", "1", "24171", "0.99995", "1", "1.25e-7", "0.012346", "inf"]);
    }
}
