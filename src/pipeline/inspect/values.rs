//! Summaries of many numbers.

use serde::Serialize;

/// Smallest, largest and mean of the finite numbers.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Range {
    /// Smallest.
    pub min: f64,
    /// Largest.
    pub max: f64,
    /// Arithmetic mean.
    pub mean: f64,
}

/// Gathers a [`Range`].
#[derive(Clone, Copy, Debug)]
pub(super) struct RangeOf {
    min: f64,
    max: f64,
    sum: f64,
    count: u64,
}

impl RangeOf {
    pub(super) fn new() -> Self {
        RangeOf { min: f64::INFINITY, max: f64::NEG_INFINITY, sum: 0.0, count: 0 }
    }

    pub(super) fn add(&mut self, value: f64) {
        if value.is_finite() {
            self.min = self.min.min(value);
            self.max = self.max.max(value);
            self.sum += value;
            self.count += 1;
        }
    }

    /// `None` without numbers.
    pub(super) fn range(&self) -> Option<Range> {
        (self.count > 0).then(|| Range { min: self.min, max: self.max, mean: self.sum / self.count as f64 })
    }
}

/// A bar of a histogram.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Bar {
    /// Values from here on,
    pub from: f64,
    /// to here.
    pub to: f64,
    /// Pixels with such a value.
    pub pixels: u64,
}

/// Bars of a histogram.
const BARS: usize = 10;

/// A histogram of `values` from `from` to `to`; the first and the last bar hold what lies beyond. Empty without values.
pub(super) fn histogram(values: impl Iterator<Item = f32>, from: f64, to: f64) -> Vec<Bar> {
    let mut counts = [0u64; BARS];
    for value in values {
        let share = (f64::from(value) - from) / (to - from).max(f64::MIN_POSITIVE);
        counts[((share.clamp(0.0, 1.0) * BARS as f64) as usize).min(BARS - 1)] += 1;
    }
    let edge = |i: usize| from + (to - from) * i as f64 / BARS as f64;
    match counts.iter().sum::<u64>() {
        0 => Vec::new(),
        _ => (0..BARS).map(|i| Bar { from: edge(i), to: edge(i + 1), pixels: counts[i] }).collect(),
    }
}

/// Corners of the axis-aligned box around points.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Bounds {
    /// Smallest coordinates.
    pub min: [f64; 3],
    /// Largest coordinates.
    pub max: [f64; 3],
}

impl Bounds {
    /// Around the points whose coordinates are finite; `None` without any.
    pub(super) fn of(points: impl IntoIterator<Item = [f64; 3]>) -> Option<Self> {
        points.into_iter().fold(None, |bounds: Option<Bounds>, p| match bounds {
            _ if p.iter().any(|v| !v.is_finite()) => bounds,
            None => Some(Bounds { min: p, max: p }),
            Some(b) => Some(Bounds {
                min: std::array::from_fn(|i| b.min[i].min(p[i])),
                max: std::array::from_fn(|i| b.max[i].max(p[i])),
            }),
        })
    }

    /// Around both.
    pub(super) fn join(a: Option<Self>, b: Option<Self>) -> Option<Self> {
        Bounds::of([a, b].into_iter().flatten().flat_map(|b| [b.min, b.max]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_and_bounds_leave_out_what_is_not_finite() {
        let mut range = RangeOf::new();
        [1.0, f64::NAN, 4.0, f64::INFINITY].into_iter().for_each(|v| range.add(v));
        assert_eq!(range.range(), Some(Range { min: 1.0, max: 4.0, mean: 2.5 }));
        assert_eq!(RangeOf::new().range(), None);
        let bounds = Bounds::of([[1.0, 2.0, 3.0], [f64::NAN; 3], [0.0, 5.0, 3.0]]);
        assert_eq!(bounds, Some(Bounds { min: [0.0, 2.0, 3.0], max: [1.0, 5.0, 3.0] }));
        assert_eq!(Bounds::join(bounds, None), bounds);
    }
}
