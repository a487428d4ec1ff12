//! A comparison of two results as one HTML page that needs nothing else.

use super::document::Document;
use super::page::PageCloud;
use super::pictures::{ONLY_A, ONLY_B, Ramp};
use crate::evaluate::{Check, Differences, Figure, Figures, FirstDifference};
use serde::Serialize;

const BODY: &str = include_str!("page/comparison.html");
const SCRIPT: &str = include_str!("page/comparison.js");

/// What a page about a comparison shows; the scripts in `page/` read it as JSON.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct ComparisonPage {
    /// The headline.
    pub title: String,
    /// The result in question.
    pub a: String,
    /// What it should be.
    pub b: String,
    /// What they are: `scenes`, `depth-maps`, `clouds`.
    pub kind: &'static str,
    /// Version of the program.
    pub version: String,
    /// Numbers about the whole.
    pub figures: PageFigures,
    /// The numbers held against their limits; `None` without limits.
    pub checks: Option<Vec<PageCheck>>,
    /// What numbers do not say.
    pub notes: Vec<String>,
    /// The first element that differs.
    pub first: Option<FirstDifference>,
    /// The pairs of depth maps.
    pub parts: Vec<PagePair>,
    /// What the colours of pictures mean.
    pub ramps: ComparisonRamps,
    /// Values at the ends of the ramps.
    pub scales: ComparisonScales,
    /// The points of both clouds, if there are some: of class 0 the first's, of class 1 the second's.
    pub cloud: Option<PageCloud>,
}

/// Quantities: single numbers, and differences.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct PageFigures {
    /// Names and numbers.
    pub single: Vec<(&'static str, f64)>,
    /// Differences.
    pub differences: Vec<PageDifferences>,
}

/// How much one quantity differs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PageDifferences {
    /// Its name.
    pub name: &'static str,
    /// Whether differences are relative to the larger value.
    pub relative: bool,
    /// The differences.
    #[serde(flatten)]
    pub of: Differences,
}

impl From<&Figures> for PageFigures {
    fn from(figures: &Figures) -> Self {
        let mut page = PageFigures::default();
        for (name, figure) in figures.iter() {
            match figure {
                Figure::Count(count) => page.single.push((name, count as f64)),
                Figure::Number(number) => page.single.push((name, number)),
                Figure::Absolute(of) => page.differences.push(PageDifferences { name, relative: false, of }),
                Figure::Relative(of) => page.differences.push(PageDifferences { name, relative: true, of }),
            }
        }
        page
    }
}

/// A number held against its limit.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PageCheck {
    /// The number and its limit.
    #[serde(flatten)]
    pub of: Check,
    /// Whether it is within.
    pub holds: bool,
    /// Whether the results have no such number.
    pub missing: bool,
}

impl From<&Check> for PageCheck {
    fn from(check: &Check) -> Self {
        PageCheck { of: check.clone(), holds: check.holds(), missing: check.value.is_none() }
    }
}

/// Two depth maps of the same name.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct PagePair {
    /// The file name.
    pub name: String,
    /// Columns and rows of both.
    pub size: [u32; 2],
    /// Numbers about the pair.
    pub figures: PageFigures,
    /// What numbers do not say.
    pub notes: Vec<String>,
    /// The first pixel that differs.
    pub first: Option<FirstDifference>,
    /// Their pictures.
    pub layers: PairLayers,
}

/// The pictures of a pair as `data:` addresses.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct PairLayers {
    /// Depths of the first.
    pub a: String,
    /// Depths of the second.
    pub b: String,
    /// Relative differences of the depths.
    pub depth: String,
    /// Which of them has a depth.
    pub presence: String,
    /// Angles between the normals.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub normal: Option<String>,
    /// Differences of the confidences.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub confidence: Option<String>,
}

/// Colours from the first to the last end.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ComparisonRamps {
    /// Of depths.
    pub depth: &'static [[u8; 3]],
    /// Of differences with a sign.
    pub difference: &'static [[u8; 3]],
    /// Of differences without.
    pub amount: &'static [[u8; 3]],
    /// What only the first and only the second has.
    pub only: [[u8; 3]; 2],
}

impl Default for ComparisonRamps {
    fn default() -> Self {
        ComparisonRamps {
            depth: Ramp::DEPTH.stops(),
            difference: Ramp::DIFFERENCE.stops(),
            amount: Ramp::AMOUNT.stops(),
            only: [ONLY_A, ONLY_B],
        }
    }
}

/// Values at the ends of the ramps, the same for all pairs; 0 where nothing differs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct ComparisonScales {
    /// Depths of both ends, scene units.
    pub depth: [f32; 2],
    /// Largest relative difference of depths.
    pub difference: f32,
    /// Largest angle between normals, degrees.
    pub normal: f32,
    /// Largest difference of confidences.
    pub confidence: f32,
    /// Least and largest distance between the clouds, scene units; the ramp is logarithmic.
    pub distance: [f64; 2],
}

impl ComparisonPage {
    /// The page. `points`: those of [`PageCloud`], as [`super::packed`] has them.
    ///
    /// # Errors
    /// None in practice: every value has a JSON form.
    pub fn render(&self, points: &[u8]) -> serde_json::Result<String> {
        Document { title: &self.title, body: BODY, script: SCRIPT }.render(self, points)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_cannot_break_out_of_the_page_and_it_asks_nobody() {
        let page = ComparisonPage {
            title: "<i>a</i>".to_owned(),
            notes: vec!["</script><img src=x onerror=alert(1)>".to_owned()],
            ..ComparisonPage::default()
        };
        let text = page.render(b"points").unwrap();
        assert!(text.contains("<title>&lt;i&gt;a&lt;/i&gt;</title>") && !text.contains("</script><img"));
        for word in ["http:", "https:", "//cdn", "@import", "fetch(", "XMLHttpRequest", "src=\"", "innerHTML"]
        {
            let found =
                text.match_indices(word).filter(|(at, _)| !text[*at..].starts_with("http://www.w3.org/"));
            assert_eq!(found.count(), 0, "{word}");
        }
        assert!(text.contains("default-src 'none'") && !text.contains("{{"));
    }
}
