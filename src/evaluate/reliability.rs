//! What the confidence of labels is worth: points by their `label_confidence`, and the share of right labels among them.

use super::cloud::{LabelledPoints, distance};
use super::{rounded, rounded_option};
use crate::geometry::Nearest;
use serde::Serialize;

/// Lower ends of the bins; the last one ends at 1 and includes it.
const BINS: [f64; 10] = [0.0, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.98];

/// The points whose label confidence lies in `from..to`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ReliabilityBin {
    /// Smallest confidence.
    pub from: f64,
    /// The confidence at which the next bin begins; 1, included, in the last.
    pub to: f64,
    /// Share of the points judged, 0..1.
    #[serde(serialize_with = "rounded::<5, _>")]
    pub share: f64,
    /// Mean confidence; `None` without points.
    #[serde(serialize_with = "rounded_option::<5, _>")]
    pub confidence: Option<f64>,
    /// Share of right labels; `None` without points.
    #[serde(serialize_with = "rounded_option::<5, _>")]
    pub right: Option<f64>,
}

/// The bins, ascending, over cloud points nearer than `radius` to the truth; `None` unless both clouds have labels and the
/// cloud has confidences.
pub(super) fn reliability(
    cloud: &LabelledPoints,
    truth: &LabelledPoints,
    to_truth: &[Option<Nearest>],
    radius: f64,
) -> Option<Vec<ReliabilityBin>> {
    let (have, want) = (cloud.labels.as_ref()?, truth.labels.as_ref()?);
    let confidences = cloud.label_confidences.as_ref()?;
    let mut sums = [(0usize, 0usize, 0.0f64); BINS.len()];
    for ((label, confidence), nearest) in have.iter().zip(confidences).zip(to_truth) {
        let Some(nearest) = nearest.filter(|n| distance(Some(*n)) < radius) else { continue };
        let bin = BINS.iter().rposition(|&from| *confidence >= from as f32).unwrap_or(0);
        let (points, right, sum) = &mut sums[bin];
        *points += 1;
        *right += usize::from(*label == want[nearest.index as usize]);
        *sum += f64::from(*confidence);
    }
    let all = sums.iter().map(|(points, ..)| points).sum::<usize>().max(1) as f64;
    let ends = BINS.iter().skip(1).copied().chain([1.0]);
    let bin = |((&from, to), (points, right, sum)): ((&f64, f64), (usize, usize, f64))| {
        let mean = |total: f64| (points > 0).then(|| total / points as f64);
        ReliabilityBin {
            from,
            to,
            share: points as f64 / all,
            confidence: mean(sum),
            right: mean(right as f64),
        }
    };
    Some(BINS.iter().zip(ends).zip(sums).map(bin).collect())
}

#[cfg(test)]
mod tests {
    use crate::evaluate::{CloudScoreOptions, LabelledPoints, cloud_scores};

    fn points(labels: Vec<u16>, confidences: Option<Vec<f32>>) -> LabelledPoints {
        let positions = (0..labels.len()).map(|i| [i as f64, 0.0, 0.0]).collect();
        LabelledPoints { positions, labels: Some(labels), label_confidences: confidences }
    }

    fn options() -> CloudScoreOptions {
        CloudScoreOptions { thresholds: vec![0.1], ..CloudScoreOptions::default() }
    }

    #[test]
    fn points_are_counted_in_the_bin_of_their_confidence() {
        let cloud = points(vec![1, 1, 2, 2, 1], Some(vec![0.0, 0.95, 0.97, 1.0, 0.5]));
        let scores = cloud_scores(&cloud, &points(vec![2, 1, 1, 2, 1], None), &options()).unwrap();
        let bins = scores.labels.unwrap().reliability.unwrap();
        let filled: Vec<_> = bins.iter().filter(|b| b.share > 0.0).collect();
        let seen: Vec<_> = filled.iter().map(|b| (b.from, b.to, b.share, b.right.unwrap())).collect();
        assert_eq!(
            seen,
            [(0.0, 0.3, 0.2, 0.0), (0.5, 0.6, 0.2, 1.0), (0.95, 0.98, 0.4, 0.5), (0.98, 1.0, 0.2, 1.0)]
        );
        assert!((filled[2].confidence.unwrap() - 0.96).abs() < 1e-6);
        assert!(bins.iter().all(|b| b.right.is_some() == (b.share > 0.0)));
    }

    #[test]
    fn points_far_from_the_truth_do_not_count_and_without_confidences_there_are_no_bins() {
        let mut cloud = points(vec![1, 1], Some(vec![0.9, 0.1]));
        cloud.positions[1][1] = 5.0;
        let truth = points(vec![1, 1], None);
        let bins = cloud_scores(&cloud, &truth, &options()).unwrap().labels.unwrap().reliability.unwrap();
        assert_eq!(bins[0].share, 0.0);
        let without = cloud_scores(&points(vec![1, 1], None), &truth, &options()).unwrap();
        assert_eq!(without.labels.unwrap().reliability, None);
    }
}
