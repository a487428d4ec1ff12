//! Expect files: what the differences between two results may be.

use crate::error::{Error, Result};
use crate::evaluate::{Kind, Limit, Tolerance};
use std::path::{Path, PathBuf};
use toml::{Table, Value};

/// Limits on the figures of a comparison, from a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Expectation {
    /// The file.
    pub path: PathBuf,
    /// What is to be compared, if the file says so.
    pub kind: Option<String>,
    /// Up to which difference values count as the same when the first differing element is looked for.
    pub tolerance: Tolerance,
    /// Limits in the order of their names.
    pub limits: Vec<Limit>,
}

impl Expectation {
    /// Reads an expect file.
    ///
    /// # Errors
    /// The file cannot be read, is no TOML, or holds entries that mean nothing; all name the entry.
    pub fn read(path: &Path) -> Result<Self> {
        let text = std::fs::read_to_string(path).map_err(|e| Error::io(path, "read", e))?;
        Self::parse(&text, path).map_err(|what| Error::content(path, what))
    }

    fn parse(text: &str, path: &Path) -> std::result::Result<Self, String> {
        let table: Table = text.parse().map_err(|e: toml::de::Error| one_line(&e, text))?;
        let mut expect = Expectation {
            path: path.to_owned(),
            kind: None,
            tolerance: Tolerance::default(),
            limits: Vec::new(),
        };
        for (name, value) in &table {
            match (name.as_str(), value) {
                ("kind", Value::String(kind)) => expect.kind = Some(kind.clone()),
                ("kind", _) => return Err("kind: give \"scenes\", \"depth-maps\" or \"clouds\"".to_owned()),
                ("tolerance", Value::Table(entries)) => expect.tolerance = tolerance(entries)?,
                ("limits", Value::Table(entries)) => collect(entries, "", &mut expect.limits)?,
                _ => return Err(format!("{name}: the file may have kind, [tolerance] and [limits]")),
            }
        }
        if expect.limits.is_empty() {
            return Err("no limits: give some under [limits], such as depth.p99 = { max = 0.001 }".to_owned());
        }
        Ok(expect)
    }

    /// Refuses another kind of results than the file is meant for.
    ///
    /// # Errors
    /// [`Error::Content`] about the file.
    pub(super) fn check_kind(&self, kind: Kind) -> Result<()> {
        match &self.kind {
            Some(named) if named != kind.name() => {
                Err(self.error(&format!("it is for {named}, these are {}", kind.name())))
            }
            _ => Ok(()),
        }
    }

    /// An error about this file.
    pub(super) fn error(&self, what: &str) -> Error {
        Error::content(&self.path, what)
    }
}

/// What is wrong with the text, and in which line.
fn one_line(error: &toml::de::Error, text: &str) -> String {
    let start = error.span().map_or(0, |span| span.start);
    let line = text.bytes().take(start).filter(|b| *b == b'\n').count() + 1;
    format!("line {line}: {}", error.message().replace('\n', " "))
}

fn tolerance(entries: &Table) -> std::result::Result<Tolerance, String> {
    let mut tolerance = Tolerance::default();
    for (name, value) in entries {
        let field = match name.as_str() {
            "relative" => &mut tolerance.relative,
            "position" => &mut tolerance.position,
            "angle" => &mut tolerance.angle,
            "color" => &mut tolerance.color,
            _ => return Err(format!("tolerance.{name}: there are relative, position, angle and color")),
        };
        *field = number(value).ok_or_else(|| format!("tolerance.{name}: give a number"))?;
    }
    tolerance.check().map_err(|e| e.to_string())?;
    Ok(tolerance)
}

fn number(value: &Value) -> Option<f64> {
    match value {
        Value::Integer(i) => Some(*i as f64),
        Value::Float(f) if !f.is_nan() => Some(*f),
        _ => None,
    }
}

/// Gathers the limits below `prefix`: tables of tables, down to `{ min, max }`.
fn collect(table: &Table, prefix: &str, limits: &mut Vec<Limit>) -> std::result::Result<(), String> {
    for (name, value) in table {
        let path = if prefix.is_empty() { name.clone() } else { format!("{prefix}.{name}") };
        let Value::Table(entries) = value else {
            return Err(format!("{path}: write {path} = {{ max = ... }}, with min, max or both"));
        };
        if entries.values().all(|v| matches!(v, Value::Table(_))) && !entries.is_empty() {
            collect(entries, &path, limits)?;
        } else {
            limits.push(limit(&path, entries)?);
        }
    }
    Ok(())
}

fn limit(path: &str, entries: &Table) -> std::result::Result<Limit, String> {
    let mut limit = Limit { figure: path.to_owned(), min: None, max: None };
    for (name, value) in entries {
        let bound = match name.as_str() {
            "min" => &mut limit.min,
            "max" => &mut limit.max,
            _ => {
                return Err(format!(
                    "{path}.{name}: a limit has min, max or both: {path}.{name} = {{ max = ... }}"
                ));
            }
        };
        *bound = Some(number(value).ok_or_else(|| format!("{path}.{name}: give a number"))?);
    }
    match (limit.min, limit.max) {
        (None, None) => Err(format!("{path}: give min, max or both")),
        (Some(min), Some(max)) if min > max => Err(format!("{path}: min {min} is above max {max}")),
        _ => Ok(limit),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> std::result::Result<Expectation, String> {
        Expectation::parse(text, Path::new("expect.toml"))
    }

    #[test]
    fn limits_have_dotted_names() {
        let text = "kind = 'depth-maps'\n[tolerance]\nrelative = 1e-6\n[limits]\nmaps.both = { min = 6, max = 6 }\n\
                    depth.max = { max = 0.5 }\ndepth.within_1e-6.min = 0.9999\n[limits.valid.iou]\nmin = 0.99\n";
        let expect = parse(text).unwrap();
        assert_eq!((expect.kind.as_deref(), expect.tolerance.relative), (Some("depth-maps"), 1e-6));
        let limit = |figure: &str, min, max| Limit { figure: figure.to_owned(), min, max };
        let mut limits = expect.limits.clone();
        limits.sort_by(|a, b| a.figure.cmp(&b.figure));
        assert_eq!(
            limits,
            [
                limit("depth.max", None, Some(0.5)),
                limit("depth.within_1e-6", Some(0.9999), None),
                limit("maps.both", Some(6.0), Some(6.0)),
                limit("valid.iou", Some(0.99), None),
            ]
        );
        assert!(expect.check_kind(Kind::DepthMaps).is_ok() && expect.check_kind(Kind::Clouds).is_err());
    }

    #[test]
    fn what_means_nothing_is_named() {
        for (text, needle) in [
            ("", "no limits"),
            ("[limits]\n", "no limits"),
            ("limit.x = 1\n", "limit: the file may have"),
            ("kind = 3\n", "kind"),
            ("[limits]\ndepth.p99 = 0.5\n", "depth.p99 = { max"),
            ("[limits]\ndepth.p99 = { most = 0.5 }\n", "depth.p99.most"),
            ("[limits]\ndepth.p99 = { max = 'x' }\n", "depth.p99.max: give a number"),
            ("[limits]\ndepth.p99 = { max = nan }\n", "give a number"),
            ("[limits]\ndepth.p99 = {}\n", "depth.p99: give min"),
            ("[limits]\ndepth.p99 = { min = 2, max = 1 }\n", "above"),
            ("[tolerance]\ndepth = 1\n[limits]\na.max = 1\n", "tolerance.depth"),
            ("[tolerance]\nangle = -1\n[limits]\na.max = 1\n", "angle"),
            ("[limits]\n\nx = \n", "line 3"),
        ] {
            let error = parse(text).unwrap_err();
            assert!(error.contains(needle) && !error.contains('\n'), "{text:?}: {error}");
        }
    }
}
