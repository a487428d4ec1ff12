//! `semvs inspect`.

use crate::cli::one_line::printable;
use crate::cli::semvs_args::InspectArgs;
use crate::error::{Error, Result};
use crate::pipeline;
use serde_json::{Map, Value};
use std::fmt::Write;

/// Runs the command.
pub(crate) fn inspect(args: &InspectArgs) -> Result<()> {
    let inspection = pipeline::inspect::inspect(&args.file)?;
    let no_json = |e| Error::invalid(format!("no JSON: {e}"));
    let text = match args.json {
        true => serde_json::to_string_pretty(&inspection).map_err(no_json)? + "\n",
        false => text(&serde_json::to_value(&inspection).map_err(no_json)?),
    };
    crate::cli::print(&text);
    Ok(())
}

/// Rows of a list of records that are shown.
const MAX_ROWS: usize = 50;

/// One line per fact; lists of records get a line per record.
fn text(facts: &Value) -> String {
    let mut out = String::new();
    for (name, value) in facts.as_object().into_iter().flatten() {
        let name = name.replace('_', " ");
        match value {
            Value::Array(rows) if rows.iter().any(Value::is_object) => {
                if let Some(bars) = bars(rows) {
                    let _ = write!(out, "{name}:\n{bars}");
                    continue;
                }
                let _ = writeln!(out, "{name}: {}", rows.len());
                for row in rows.iter().take(MAX_ROWS) {
                    let _ = writeln!(out, "  {}", inline(row));
                }
                if rows.len() > MAX_ROWS {
                    let _ = writeln!(out, "  ... and {} more (--json shows all)", rows.len() - MAX_ROWS);
                }
            }
            Value::Object(counts) if name == "labels" => {
                let _ = write!(out, "{name}:\n{}", label_bars(counts, facts["comments"].as_array()));
            }
            Value::Object(fields) => {
                let _ = writeln!(out, "{name}:");
                for (key, value) in fields {
                    let _ = writeln!(out, "  {}: {}", key.replace('_', " "), inline(value));
                }
            }
            value => {
                let _ = writeln!(out, "{name}: {}", inline(value));
            }
        }
    }
    out
}

/// Widest bar of a histogram, characters.
const BAR: f64 = 40.0;

/// A histogram as lines of bars; `None` if the rows are no histogram.
fn bars(rows: &[Value]) -> Option<String> {
    let bar = |row: &Value| Some((row["from"].as_f64()?, row["to"].as_f64()?, row["pixels"].as_u64()?));
    let bars = rows.iter().map(bar).collect::<Option<Vec<_>>>()?;
    let most = bars.iter().map(|bar| bar.2).max()?.max(1);
    let line = |&(from, to, pixels): &(f64, f64, u64)| {
        let bar = "#".repeat((pixels as f64 / most as f64 * BAR).ceil() as usize);
        format!("  {:>10} to {:<10} {bar:<40} {pixels}\n", short(from), short(to))
    };
    Some(bars.iter().map(line).collect())
}

/// Numbers of points by class id as lines of bars, with the names that the file's comments give the classes.
fn label_bars(counts: &Map<String, Value>, comments: Option<&Vec<Value>>) -> String {
    let name_of = |id: &str| {
        let named = comments.into_iter().flatten().filter_map(Value::as_str).find_map(|comment| {
            let (known, name) = comment.strip_prefix("class ")?.split_once(' ')?;
            // Behind the name is the colour.
            let name = name.rsplitn(4, ' ').last().unwrap_or(name);
            (known == id).then(|| printable(name))
        });
        named.unwrap_or_else(|| if id == "0" { "void".to_owned() } else { String::new() })
    };
    let rows: Vec<(String, u64)> =
        counts.iter().map(|(id, n)| (format!("{id} {}", name_of(id)), n.as_u64().unwrap_or(0))).collect();
    let most = rows.iter().map(|row| row.1).max().unwrap_or(0).max(1);
    let line = |(name, points): &(String, u64)| {
        let bar = "#".repeat((*points as f64 / most as f64 * BAR).ceil() as usize);
        format!("  {name:<24} {bar:<40} {points}\n")
    };
    rows.iter().map(line).collect()
}

/// Four digits of a number, or a few more.
fn short(v: f64) -> String {
    let digits = 3usize.saturating_sub(v.abs().max(1.0).log10() as usize);
    format!("{v:.digits$}")
}

fn inline(value: &Value) -> String {
    match value {
        Value::Null => "none".to_owned(),
        Value::Bool(yes) => if *yes { "yes" } else { "no" }.to_owned(),
        Value::String(text) => printable(text),
        Value::Number(number) => match number.as_f64() {
            Some(v) if number.is_f64() => format!("{}", (v * 1e6).round() / 1e6),
            _ => number.to_string(),
        },
        Value::Array(items) => items.iter().map(inline).collect::<Vec<_>>().join(" "),
        Value::Object(fields) => {
            let field =
                |(key, value): (&String, &Value)| format!("{} {}", key.replace('_', " "), inline(value));
            fields.iter().map(field).collect::<Vec<_>>().join(", ")
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn histograms_become_bars() {
        let bar =
            |from: f64, pixels: u64| serde_json::json!({"from": from, "to": from + 0.5, "pixels": pixels});
        let text =
            text(&serde_json::json!({"depth_histogram": [bar(9.75, 10), bar(10.25, 40), bar(10.75, 0)]}));
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines[0], "depth histogram:");
        assert_eq!(lines[1], format!("       9.750 to 10.25      {:<40} 10", "#".repeat(10)));
        assert!(lines[2].contains(&"#".repeat(40)) && lines[3].ends_with(" 0") && !lines[3].contains('#'));
    }

    #[test]
    fn labels_become_bars_with_names() {
        let facts = serde_json::json!({
            "comments": ["class 1 tall building 0 0 255", "made by hand"],
            "labels": {"0": 10, "1": 40, "7": 1},
        });
        let text = text(&facts);
        let lines: Vec<&str> = text.lines().skip_while(|line| *line != "labels:").collect();
        assert_eq!(lines[1], format!("  {:<24} {:<40} 10", "0 void", "#".repeat(10)));
        assert_eq!(lines[2], format!("  {:<24} {:<40} 40", "1 tall building", "#".repeat(40)));
        assert_eq!(lines[3], format!("  {:<24} {:<40} 1", "7 ", "#"));
    }

    #[test]
    fn facts_become_lines() {
        let facts = serde_json::json!({
            "kind": "cloud",
            "points": 2,
            "bounds": {"min": [0.0, 1.0], "max": [2.5, 3.0]},
            "colors": true,
            "images": [{"id": 1, "name": "a"}, {"id": 2, "name": "b"}],
            "views": null,
        });
        let text = text(&facts);
        for line in ["points: 2", "  max: 2.5 3", "colors: yes", "images: 2", "  id 1, name a", "views: none"]
        {
            assert!(text.lines().any(|l| l == line), "{line}\n{text}");
        }
    }
}
