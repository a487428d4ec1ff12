//! How two results differ, element by element: for regression tests against an earlier run or another program.

mod clouds;
mod figures;
mod limits;
mod map_differences;
mod maps;
mod scenes;

pub use clouds::{CLOUD_FIGURES, CloudComparison, compare_clouds};
pub use figures::{Catalog, Figure, Figures, Shape, names};
pub use limits::{Check, Limit, check_limits};
pub use map_differences::{MapDifferences, Presence, map_differences};
pub use maps::{FOLDER_FIGURES, MAP_FIGURES, MapComparison, compare_maps, folder_figures};
pub use scenes::{ComparedImage, ComparedScene, SCENE_FIGURES, compare_scenes};

use crate::error::{Error, Result};
use serde::Serialize;

/// What two results are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// Scene files.
    Scenes,
    /// Depth maps, or folders of them.
    DepthMaps,
    /// Clouds.
    Clouds,
}

impl Kind {
    /// The name in reports and expect files.
    pub fn name(self) -> &'static str {
        match self {
            Kind::Scenes => "scenes",
            Kind::DepthMaps => "depth-maps",
            Kind::Clouds => "clouds",
        }
    }

    /// What is reported once for the whole, and what is reported of every part.
    pub fn catalogs(self) -> (Catalog, Catalog) {
        match self {
            Kind::Scenes => (SCENE_FIGURES, &[]),
            Kind::DepthMaps => (FOLDER_FIGURES, MAP_FIGURES),
            Kind::Clouds => (CLOUD_FIGURES, &[]),
        }
    }
}

/// How two results differ.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Comparison {
    /// What they are.
    pub kind: Kind,
    /// Numbers about the whole.
    pub figures: Figures,
    /// What numbers do not say, a line each.
    pub notes: Vec<String>,
    /// The first element that differs by more than the tolerances.
    pub first: Option<FirstDifference>,
    /// The pairs of depth maps, by file name; empty for scenes and clouds.
    pub parts: Vec<Part>,
}

/// How two depth maps of the same file name differ.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Part {
    /// The file name.
    pub name: String,
    /// Numbers about the pair.
    pub figures: Figures,
    /// What numbers do not say, a line each.
    pub notes: Vec<String>,
    /// The first pixel that differs by more than the tolerances.
    pub first: Option<FirstDifference>,
}

/// Up to which difference two values count as the same when the first differing element is looked for. All default
/// to 0: any difference counts.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tolerance {
    /// Relative difference of depths, confidences, weights and scores.
    pub relative: f64,
    /// Distance of positions as a share of the diagonal of the second result's bounding box.
    pub position: f64,
    /// Angle between normals or rotations, degrees.
    pub angle: f64,
    /// Difference of a colour channel, levels.
    pub color: f64,
}

impl Tolerance {
    /// # Errors
    /// [`Error::Invalid`] for a tolerance that is not a number of at least 0.
    pub fn check(&self) -> Result<()> {
        let tolerances = [
            ("relative", self.relative),
            ("position", self.position),
            ("angle", self.angle),
            ("color", self.color),
        ];
        match tolerances.iter().find(|(_, v)| !(v.is_finite() && *v >= 0.0)) {
            Some((name, v)) => {
                Err(Error::invalid(format!("{name} tolerance {v}: it must be a number of at least 0")))
            }
            None => Ok(()),
        }
    }
}

/// How much one quantity differs over the elements that have it in both.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Differences {
    /// Elements compared.
    pub compared: usize,
    /// Elements without any difference.
    pub equal: usize,
    /// Half of the elements differ by at most this.
    pub p50: f64,
    /// 90 % of the elements differ by at most this.
    pub p90: f64,
    /// 99 % of the elements differ by at most this.
    pub p99: f64,
    /// 99.9 % of the elements differ by at most this.
    pub p999: f64,
    /// 99.99 % of the elements differ by at most this.
    pub p9999: f64,
    /// The largest difference; infinite (`null` in JSON) where only one value is a number.
    pub max: f64,
    /// Shares of the elements that differ by at most 1e-6, 1e-3 and 1e-2.
    pub within: [f64; 3],
    /// The elements by the size of their difference.
    pub sizes: Sizes,
}

/// Bars of the histogram of differences.
const BARS: usize = 24;

/// Elements by the size of their difference: two bars for every power of ten, down from the largest. Elements without any
/// difference are in none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Sizes {
    /// The last bar ends at 10^(top / 2).
    pub top: i32,
    /// How many differ by so much; the first bar has all that differ by less.
    pub bars: [usize; BARS],
    /// How many differ without bound.
    pub unbounded: usize,
}

impl Sizes {
    /// Of ascending differences.
    fn of(sorted: &[f64]) -> Self {
        let bounded = sorted.partition_point(|v| v.is_finite());
        let mut sizes = Sizes { unbounded: sorted.len() - bounded, ..Sizes::default() };
        let mut counted = sorted.partition_point(|v| *v <= 0.0);
        if counted >= bounded {
            return sizes;
        }
        sizes.top = (2.0 * sorted[bounded - 1].log10()).ceil() as i32;
        for (bar, count) in sizes.bars.iter_mut().enumerate() {
            let edge = 10f64.powf(f64::from(sizes.top - (BARS - 1 - bar) as i32) / 2.0);
            let up_to = if bar + 1 == BARS { bounded } else { sorted.partition_point(|v| *v <= edge) };
            *count = up_to.min(bounded).saturating_sub(counted);
            counted = counted.max(up_to.min(bounded));
        }
        sizes
    }
}

impl Differences {
    /// The percentiles (nearest rank) of `values`; `None` of none.
    fn of(mut values: Vec<f64>) -> Option<Self> {
        values.sort_unstable_by(f64::total_cmp);
        let max = *values.last()?;
        // in units of 0.01 %, to find the rank without rounding
        let at = |share: usize| values[(share * values.len()).div_ceil(10_000) - 1];
        Some(Differences {
            compared: values.len(),
            equal: values.partition_point(|v| *v <= 0.0),
            p50: at(5000),
            p90: at(9000),
            p99: at(9900),
            p999: at(9990),
            p9999: at(9999),
            max,
            within: [1e-6, 1e-3, 1e-2]
                .map(|limit| values.partition_point(|v| *v <= limit) as f64 / values.len() as f64),
            sizes: Sizes::of(&values),
        })
    }
}

/// How often a quantity is the same, where differences have no size.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Agreement {
    /// Elements compared.
    pub compared: usize,
    /// Elements that are the same.
    pub equal: usize,
}

impl Agreement {
    fn count(&mut self, equal: bool) {
        self.compared += 1;
        self.equal += usize::from(equal);
    }
}

/// The first element, in file order, that differs by more than the tolerances.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct FirstDifference {
    /// The element: "pixel (12, 7)", "point 31", "image 3, neighbour 2", ...
    pub place: String,
    /// What differs: "position", "depth", "views", ...
    pub attribute: &'static str,
    /// Its value in the first result.
    pub a: String,
    /// Its value in the second result.
    pub b: String,
}

/// Looks for the first difference.
#[derive(Default)]
struct Finder(Option<FirstDifference>);

impl Finder {
    /// Notes the values `a` and `b` of `attribute`, if they differ and are the first that do.
    fn note(
        &mut self,
        differs: bool,
        place: impl FnOnce() -> String,
        attribute: &'static str,
        a: &dyn std::fmt::Debug,
        b: &dyn std::fmt::Debug,
    ) {
        if differs && self.0.is_none() {
            let (a, b) = (format!("{a:?}"), format!("{b:?}"));
            self.0 = Some(FirstDifference { place: place(), attribute, a, b });
        }
    }
}

/// The last part of a path. Where results were written decides what comes before it.
fn file_name(path: &str) -> &str {
    path.rsplit(['/', '\\']).next().unwrap_or(path)
}

/// `|a − b|` over the larger magnitude; 0 for equal values, infinite where only one is a number.
fn relative(a: f32, b: f32) -> f64 {
    let (a, b) = (f64::from(a), f64::from(b));
    if a == b || a.is_nan() && b.is_nan() {
        return 0.0;
    }
    let difference = (a - b).abs() / a.abs().max(b.abs());
    if difference.is_nan() { f64::INFINITY } else { difference }
}

/// Euclidean distance; 0 for equal values, infinite where only one is a point.
fn distance(a: [f32; 3], b: [f32; 3]) -> f64 {
    if a.map(f32::to_bits) == b.map(f32::to_bits) {
        return 0.0;
    }
    let squared: f64 = a.iter().zip(b).map(|(a, b)| (f64::from(*a) - f64::from(b)).powi(2)).sum();
    if squared.is_nan() { f64::INFINITY } else { squared.sqrt() }
}

/// Angle between two directions, degrees; 0 for equal values, 180 where only one is a direction.
fn angle_deg(a: [f32; 3], b: [f32; 3]) -> f64 {
    if a == b {
        return 0.0;
    }
    let [a, b] = [a, b].map(|v| nalgebra::Vector3::from(v.map(f64::from)));
    let angle = a.cross(&b).norm().atan2(a.dot(&b)).to_degrees();
    if angle.is_nan() || a.norm() == 0.0 || b.norm() == 0.0 { 180.0 } else { angle }
}

/// Angle of the rotation from `a` to `b`, degrees; infinite where one is no matrix of numbers.
fn rotation_deg(a: &nalgebra::Matrix3<f64>, b: &nalgebra::Matrix3<f64>) -> f64 {
    if a == b {
        return 0.0;
    }
    // |A - B| (Frobenius) is 2 sqrt(2) sin(angle / 2), which is exact for small angles.
    let angle = 2.0 * ((a - b).norm() / 8f64.sqrt()).min(1.0).asin().to_degrees();
    if angle.is_nan() { f64::INFINITY } else { angle }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_are_values_of_the_nearest_rank() {
        let d = Differences::of((1..=20_000).rev().map(f64::from).collect()).unwrap();
        assert_eq!(
            (d.p50, d.p90, d.p99, d.p999, d.p9999),
            (10_000.0, 18_000.0, 19_800.0, 19_980.0, 19_998.0)
        );
        assert_eq!((d.compared, d.equal, d.max), (20_000, 0, 20_000.0));
        let within = Differences::of(vec![0.0, 1e-6, 1e-3, 0.01, 0.1]).unwrap().within;
        assert_eq!(within, [0.4, 0.6, 0.8]);
        let few = Differences::of(vec![0.0, 0.0, f64::INFINITY]).unwrap();
        assert_eq!((few.equal, few.p50, few.p90, few.max), (2, 0.0, f64::INFINITY, f64::INFINITY));
        assert_eq!(Differences::of(Vec::new()), None);
    }

    #[test]
    fn differences_are_counted_by_their_size() {
        let sizes = Differences::of(vec![0.0, 0.0, 1e-30, 0.001, 0.02, 0.05, 0.06, 0.1, f64::INFINITY]);
        let sizes = sizes.unwrap().sizes;
        assert_eq!((sizes.top, sizes.unbounded), (-2, 1));
        // 0.0316 to 0.1, 0.01 to 0.0316, ..., and everything below the least edge.
        assert_eq!((sizes.bars[23], sizes.bars[22], sizes.bars[20], sizes.bars[19]), (3, 1, 0, 1));
        assert_eq!((sizes.bars[0], sizes.bars.iter().sum::<usize>()), (1, 6));
        assert_eq!(Differences::of(vec![0.0]).unwrap().sizes, Sizes::default());
        let only = Differences::of(vec![f64::INFINITY, 3.0]).unwrap().sizes;
        assert_eq!((only.top, only.bars[23], only.unbounded), (1, 1, 1));
    }

    #[test]
    fn values_that_are_no_numbers_are_the_same_or_infinitely_apart() {
        assert_eq!((relative(f32::NAN, f32::NAN), relative(1.0, f32::NAN)), (0.0, f64::INFINITY));
        assert_eq!((relative(0.0, 0.0), relative(0.0, 2.0), relative(1.0, 0.5)), (0.0, 1.0, 0.5));
        let (p, nan) = ([1.0, 2.0, 3.0], [f32::NAN; 3]);
        assert_eq!(
            (distance(nan, nan), distance(p, nan), distance(p, [1.0, 2.0, 5.0])),
            (0.0, f64::INFINITY, 2.0)
        );
        let (x, y) = ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0]);
        assert_eq!((angle_deg(x, x), angle_deg(x, y), angle_deg(x, [0.0; 3])), (0.0, 90.0, 180.0));
        assert!(
            (angle_deg(x, [1.0, 1e-5, 0.0]) - 1e-5f64.to_degrees()).abs() < 1e-9,
            "small angles are exact"
        );
    }

    #[test]
    fn tolerances_are_checked() {
        assert!(Tolerance::default().check().is_ok());
        let bad = Tolerance { position: f64::NAN, ..Default::default() };
        assert!(bad.check().unwrap_err().to_string().contains("position"));
    }
}
