//! Limits on the numbers of a comparison.

use super::{Comparison, Figures, names};
use crate::error::{Error, Result};
use serde::Serialize;

/// What a number may be.
#[derive(Clone, Debug, PartialEq)]
pub struct Limit {
    /// Its dotted name.
    pub figure: String,
    /// The least it may be.
    pub min: Option<f64>,
    /// The most it may be.
    pub max: Option<f64>,
}

/// A number held against its limit.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Check {
    /// Its dotted name.
    pub figure: String,
    /// The pair of files, where there are several.
    pub part: Option<String>,
    /// Its value; `None` if the results lack it.
    pub value: Option<f64>,
    /// The least it may be.
    pub min: Option<f64>,
    /// The most it may be.
    pub max: Option<f64>,
}

/// One line: the number, where it was found, and what it may be.
impl std::fmt::Display for Check {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if let Some(part) = &self.part {
            write!(f, "{part}: ")?;
        }
        match self.value {
            Some(value) => write!(f, "{} is {value}", self.figure)?,
            None => write!(f, "{} cannot be told from these results", self.figure)?,
        }
        let bounds = [("at least", self.min), ("at most", self.max)];
        for (i, (words, bound)) in bounds.iter().filter_map(|(w, b)| Some((w, (*b)?))).enumerate() {
            write!(f, "{} {words} {bound}", if i == 0 { ", must be" } else { " and" })?;
        }
        Ok(())
    }
}

impl Check {
    /// Whether the number is there and within its limit.
    pub fn holds(&self) -> bool {
        let above = |v: f64| self.min.is_none_or(|min| v >= min);
        let below = |v: f64| self.max.is_none_or(|max| v <= max);
        self.value.is_some_and(|v| above(v) && below(v))
    }
}

/// The numbers of `comparison` held against `limits`, in the order of the limits. A limit on a number of parts is one for
/// every part.
///
/// # Errors
/// [`Error::Invalid`] for a name that a comparison of this kind never reports, with the nearest that it does.
pub fn check_limits(comparison: &Comparison, limits: &[Limit]) -> Result<Vec<Check>> {
    let (whole, parts) = comparison.kind.catalogs();
    let (whole, parts) = (names(whole), names(parts));
    let mut checks = Vec::new();
    for limit in limits {
        if whole.contains(&limit.figure) {
            checks.push(limit.check(&comparison.figures, None));
        } else if parts.contains(&limit.figure) {
            let of_part = |part: &super::Part| limit.check(&part.figures, Some(&part.name));
            checks.extend(comparison.parts.iter().map(of_part));
        } else {
            let known = whole.iter().chain(&parts);
            let nearest = known.min_by_key(|name| edit_distance(name, &limit.figure));
            return Err(Error::invalid(format!(
                "{}: no such figure for {}; did you mean {}?",
                limit.figure,
                comparison.kind.name(),
                nearest.map_or("", |name| name.as_str())
            )));
        }
    }
    Ok(checks)
}

impl Limit {
    fn check(&self, figures: &Figures, part: Option<&str>) -> Check {
        let found = figures.numbers().into_iter().find(|(name, _)| *name == self.figure);
        Check {
            figure: self.figure.clone(),
            part: part.map(str::to_owned),
            value: found.map(|(_, value)| value),
            min: self.min,
            max: self.max,
        }
    }
}

/// Letters to insert, remove or replace on the way from one word to the other (Levenshtein 1966).
fn edit_distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, ca) in a.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, cb) in b.iter().enumerate() {
            let replaced = diagonal + usize::from(ca != *cb);
            diagonal = row[j + 1];
            row[j + 1] = replaced.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::super::{Figure, Kind, Part};
    use super::*;

    fn limit(figure: &str, min: Option<f64>, max: Option<f64>) -> Limit {
        Limit { figure: figure.to_owned(), min, max }
    }

    fn comparison() -> Comparison {
        let figures = |name, figure| {
            let mut figures = Figures::default();
            figures.add(name, figure);
            figures
        };
        let part = |name: &str, iou| Part {
            name: name.to_owned(),
            figures: figures("valid.iou", Figure::Number(iou)),
            notes: Vec::new(),
            first: None,
        };
        Comparison {
            kind: Kind::DepthMaps,
            figures: figures("maps.both", Figure::Count(2)),
            notes: Vec::new(),
            first: None,
            parts: vec![part("a.dmap", 0.9), part("b.dmap", 0.8)],
        }
    }

    #[test]
    fn every_part_must_be_within_the_limits() {
        let check = |limits: &[Limit]| check_limits(&comparison(), limits).unwrap();
        let within = check(&[limit("maps.both", Some(2.0), Some(2.0)), limit("valid.iou", Some(0.8), None)]);
        assert!(within.len() == 3 && within.iter().all(Check::holds), "{within:?}");
        let outside =
            check(&[limit("valid.iou", Some(0.91), Some(0.95)), limit("maps.both", None, Some(1.0))]);
        let lines: Vec<String> = outside.iter().map(ToString::to_string).collect();
        assert_eq!(
            lines,
            [
                "a.dmap: valid.iou is 0.9, must be at least 0.91 and at most 0.95",
                "b.dmap: valid.iou is 0.8, must be at least 0.91 and at most 0.95",
                "maps.both is 2, must be at most 1",
            ]
        );
        assert!(!outside.iter().any(Check::holds));
        let missing = check(&[limit("normal.p99", None, Some(1.0))]);
        assert!(missing.len() == 2 && !missing.iter().any(Check::holds));
        assert_eq!(
            missing[0].to_string(),
            "a.dmap: normal.p99 cannot be told from these results, must be at most 1"
        );
    }

    #[test]
    fn unknown_names_are_refused_with_the_nearest() {
        let error = check_limits(&comparison(), &[limit("valid.iuo", None, None)]).unwrap_err().to_string();
        assert!(error.contains("depth-maps") && error.ends_with("did you mean valid.iou?"), "{error}");
        let error = check_limits(&comparison(), &[limit("depth.p9", None, None)]).unwrap_err().to_string();
        assert!(error.contains("depth.p9"), "{error}");
    }

    #[test]
    fn edit_distances() {
        assert_eq!(
            (edit_distance("kitten", "sitting"), edit_distance("", "ab"), edit_distance("a", "a")),
            (3, 2, 0)
        );
    }
}
