//! The numbers of a comparison under their names: what is reported, and what limits can be set on.

use super::Differences;
use serde::ser::{Serialize, SerializeMap, Serializer};

/// One quantity of a comparison.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Figure {
    /// How many.
    Count(u64),
    /// A share 0..1, or another single number.
    Number(f64),
    /// Differences with a unit.
    Absolute(Differences),
    /// Relative differences; the shares within 1e-6, 0.1 % and 1 % are reported too.
    Relative(Differences),
}

impl Figure {
    /// The figure of `agreeing` of `all` elements, as a share; 1 of none.
    pub(super) fn share(agreeing: usize, all: usize) -> Figure {
        Figure::Number(if all == 0 { 1.0 } else { agreeing as f64 / all as f64 })
    }
}

/// How many numbers a quantity has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    /// One: [`Figure::Count`] or [`Figure::Number`].
    One,
    /// Those of [`Figure::Absolute`].
    Absolute,
    /// Those of [`Figure::Relative`].
    Relative,
}

/// A number of differences: its name, and how it is taken from them.
type Number = (&'static str, fn(&Differences) -> f64);

/// Numbers of all differences.
const OF_DIFFERENCES: [Number; 8] = [
    ("compared", |d| d.compared as f64),
    ("equal", |d| d.equal as f64 / d.compared as f64),
    ("p50", |d| d.p50),
    ("p90", |d| d.p90),
    ("p99", |d| d.p99),
    ("p999", |d| d.p999),
    ("p9999", |d| d.p9999),
    ("max", |d| d.max),
];

/// More numbers of relative differences.
const OF_RELATIVE: [Number; 3] =
    [("within_1e-6", |d| d.within[0]), ("within_1e-3", |d| d.within[1]), ("within_1e-2", |d| d.within[2])];

/// What a kind of comparison can report: name of the quantity, its shape.
pub type Catalog = &'static [(&'static str, Shape)];

/// Every name under which a comparison with this catalog can report a number.
pub fn names(catalog: Catalog) -> Vec<String> {
    let mut names = Vec::new();
    for &(name, shape) in catalog {
        let dotted = |part: &str| format!("{name}.{part}");
        match shape {
            Shape::One => names.push(name.to_owned()),
            Shape::Absolute | Shape::Relative => names.extend(OF_DIFFERENCES.map(|(part, _)| dotted(part))),
        }
        if shape == Shape::Relative {
            names.extend(OF_RELATIVE.map(|(part, _)| dotted(part)));
        }
    }
    names
}

/// Quantities in the order of their catalog. One that the results lack is not there.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Figures(Vec<(&'static str, Figure)>);

impl Figures {
    /// Adds a quantity, if there is one.
    pub(super) fn add(&mut self, name: &'static str, figure: impl Into<Option<Figure>>) {
        self.0.extend(figure.into().map(|figure| (name, figure)));
    }

    /// The quantities.
    pub fn iter(&self) -> impl Iterator<Item = (&'static str, Figure)> {
        self.0.iter().copied()
    }

    /// A quantity.
    pub fn get(&self, name: &str) -> Option<Figure> {
        self.iter().find(|(known, _)| *known == name).map(|(_, figure)| figure)
    }

    /// Every number under its dotted name, `depth.p99` for instance.
    pub fn numbers(&self) -> Vec<(String, f64)> {
        let mut numbers = Vec::new();
        for (name, figure) in self.iter() {
            let of = |d: &Differences, (part, value): Number| (format!("{name}.{part}"), value(d));
            match figure {
                Figure::Count(count) => numbers.push((name.to_owned(), count as f64)),
                Figure::Number(number) => numbers.push((name.to_owned(), number)),
                Figure::Absolute(d) => numbers.extend(OF_DIFFERENCES.map(|part| of(&d, part))),
                Figure::Relative(d) => {
                    numbers.extend(OF_DIFFERENCES.iter().chain(&OF_RELATIVE).map(|part| of(&d, *part)));
                }
            }
        }
        numbers
    }
}

/// A flat map of dotted names; whole numbers without fraction, infinite ones as `null`.
impl Serialize for Figures {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        /// Above it an `f64` may stand for a neighbouring whole number.
        const EXACT: f64 = 9_007_199_254_740_992.0;
        let numbers = self.numbers();
        let mut map = serializer.serialize_map(Some(numbers.len()))?;
        for (name, value) in &numbers {
            if value.fract() == 0.0 && value.abs() <= EXACT {
                map.serialize_entry(name, &(*value as i64))?;
            } else {
                map.serialize_entry(name, value)?;
            }
        }
        map.end()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_the_names_of_the_catalog() {
        const CATALOG: Catalog = &[
            ("n", Shape::One),
            ("share", Shape::One),
            ("angle", Shape::Absolute),
            ("depth", Shape::Relative),
        ];
        let mut figures = Figures::default();
        figures.add("n", Figure::Count(3));
        figures.add("share", Figure::share(3, 4));
        figures.add("gone", None);
        figures.add("angle", Differences::of(vec![0.0, f64::INFINITY]).map(Figure::Absolute));
        figures.add("depth", Differences::of(vec![0.0, 1e-3, 0.5, 0.5]).map(Figure::Relative));
        let numbers = figures.numbers();
        assert_eq!(numbers.iter().map(|(name, _)| name.clone()).collect::<Vec<_>>(), names(CATALOG));
        let json = serde_json::to_string(&figures).unwrap();
        assert!(json.starts_with(r#"{"n":3,"share":0.75,"angle.compared":2,"angle.equal":0.5,"#), "{json}");
        assert!(
            json.contains(r#""angle.max":null"#) && json.contains(r#""depth.within_1e-3":0.5"#),
            "{json}"
        );
        assert_eq!(figures.get("share"), Some(Figure::Number(0.75)));
        assert_eq!(Figure::share(0, 0), Figure::Number(1.0));
    }
}
