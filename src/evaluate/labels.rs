//! How well the labels of a cloud agree with those of the truth.

use super::cloud::{LabelledPoints, distance};
use super::reliability::{ReliabilityBin, reliability};
use super::rounded_option;
use crate::geometry::Nearest;
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};

/// Label quality over the cloud points within the largest threshold of the truth; a point should have the label of its
/// nearest truth point.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LabelScores {
    /// Share of points with the right label; `None` if no point is near the truth.
    #[serde(serialize_with = "rounded_option::<5, _>")]
    pub accuracy: Option<f64>,
    /// Mean of `iou` over the classes that have one.
    #[serde(serialize_with = "rounded_option::<5, _>")]
    pub miou: Option<f64>,
    /// Intersection over union of every truth class except void (0) and ignored ones; `None` if no point has or should
    /// have the label.
    pub iou: BTreeMap<u16, Option<f64>>,
    /// By label confidence, ascending, if the cloud has it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reliability: Option<Vec<ReliabilityBin>>,
}

/// `None` unless both clouds have labels.
pub(super) fn label_scores(
    cloud: &LabelledPoints,
    truth: &LabelledPoints,
    to_truth: &[Option<Nearest>],
    radius: f64,
    ignored: &[u16],
) -> Option<LabelScores> {
    let (have, want) = (cloud.labels.as_ref()?, truth.labels.as_ref()?);
    let near = have.iter().zip(to_truth).filter(|(_, n)| distance(**n) < radius);
    let mut counts: BTreeMap<(u16, u16), usize> = BTreeMap::new();
    for (label, nearest) in near {
        if let Some(nearest) = nearest {
            *counts.entry((*label, want[nearest.index as usize])).or_default() += 1;
        }
    }
    let sum = |test: &dyn Fn(u16, u16) -> bool| {
        counts.iter().filter(|((h, w), _)| test(*h, *w)).map(|c| *c.1).sum::<usize>()
    };
    let ratio = |part: usize, whole: usize| (whole > 0).then(|| part as f64 / whole as f64);
    let classes: BTreeSet<u16> = want.iter().copied().filter(|c| *c != 0 && !ignored.contains(c)).collect();
    let iou = |c: u16| {
        let intersection = sum(&|h, w| h == c && w == c);
        ratio(intersection, sum(&|h, w| h == c || w == c)).map(super::round_to::<4>)
    };
    let iou: BTreeMap<u16, Option<f64>> = classes.into_iter().map(|c| (c, iou(c))).collect();
    let known: Vec<f64> = iou.values().copied().flatten().collect();
    let miou = (!known.is_empty()).then(|| known.iter().sum::<f64>() / known.len() as f64);
    let accuracy = ratio(sum(&|h, w| h == w), sum(&|_, _| true));
    Some(LabelScores { accuracy, miou, iou, reliability: reliability(cloud, truth, to_truth, radius) })
}
