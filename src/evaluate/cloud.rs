//! Scores of a cloud against a ground-truth cloud.

use super::labels::{LabelScores, label_scores};
use super::{rounded, rounded_option};
use crate::error::{Error, Result};
use crate::geometry::{Nearest, NearestIndex};
use rayon::prelude::*;
use serde::Serialize;
use std::collections::BTreeMap;

/// A cloud as the scores see it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LabelledPoints {
    /// Positions in scene units; points that are not finite are left out of every score.
    pub positions: Vec<[f64; 3]>,
    /// Class id of every point, if the cloud has labels.
    pub labels: Option<Vec<u16>>,
    /// How sure the label of every point is, 0..1, if the cloud says so.
    pub label_confidences: Option<Vec<f32>>,
}

impl LabelledPoints {
    /// The points whose index `keep` accepts.
    fn filtered(&self, keep: impl Fn(usize) -> bool) -> Self {
        let chosen: Vec<usize> = (0..self.positions.len()).filter(|&i| keep(i)).collect();
        self.chosen(&chosen)
    }

    fn chosen(&self, indices: &[usize]) -> Self {
        LabelledPoints {
            positions: indices.iter().map(|&i| self.positions[i]).collect(),
            labels: self.labels.as_ref().map(|l| indices.iter().map(|&i| l[i]).collect()),
            label_confidences: self
                .label_confidences
                .as_ref()
                .map(|c| indices.iter().map(|&i| c[i]).collect()),
        }
    }

    /// The finite points on one of `classes`; on any class if there are none.
    fn of_classes(&self, classes: &[u16], whose: &str) -> Result<Self> {
        let counts = [self.labels.as_ref().map(Vec::len), self.label_confidences.as_ref().map(Vec::len)];
        if counts.into_iter().flatten().any(|count| count != self.positions.len()) {
            return Err(Error::invalid(format!("the {whose} has labels for some of its points only")));
        }
        let finite = |i: usize| self.positions[i].iter().all(|v| v.is_finite());
        match &self.labels {
            _ if classes.is_empty() => Ok(self.filtered(finite)),
            Some(labels) => Ok(self.filtered(|i| finite(i) && classes.contains(&labels[i]))),
            None => Err(Error::invalid(format!(
                "the {whose} has no labels to choose classes by; give a cloud with a label property"
            ))),
        }
    }
}

/// What to score and how.
#[derive(Clone, Debug, PartialEq)]
pub struct CloudScoreOptions {
    /// Distances in scene units, each > 0, at least one.
    pub thresholds: Vec<f64>,
    /// Edge of the voxels by which both clouds are thinned, scene units; 0 = not at all. Default: half the smallest
    /// threshold.
    pub voxel: Option<f64>,
    /// Truth classes left out of completeness and IoU.
    pub ignore_truth_labels: Vec<u16>,
    /// Truth classes that are kept, empty = all: cloud points on any other class count as wrong.
    pub truth_classes: Vec<u16>,
    /// Keep only cloud points of these classes, empty = all.
    pub cloud_classes: Vec<u16>,
    /// Also score every truth class alone.
    pub per_class: bool,
}

impl Default for CloudScoreOptions {
    fn default() -> Self {
        CloudScoreOptions {
            thresholds: vec![0.02, 0.05, 0.1],
            voxel: None,
            ignore_truth_labels: Vec::new(),
            truth_classes: Vec::new(),
            cloud_classes: Vec::new(),
            per_class: false,
        }
    }
}

impl CloudScoreOptions {
    /// # Errors
    /// [`Error::Invalid`] for no thresholds, or a threshold or voxel that is not a positive number.
    pub fn check(&self) -> Result<()> {
        if self.thresholds.is_empty() {
            return Err(Error::invalid("no distance threshold given; give at least one, such as 0.05"));
        }
        if let Some(t) = self.thresholds.iter().find(|t| !(t.is_finite() && **t > 0.0)) {
            return Err(Error::invalid(format!("threshold {t}: a distance must be greater than 0")));
        }
        match self.voxel {
            Some(v) if !(v.is_finite() && v >= 0.0) => {
                Err(Error::invalid(format!("voxel {v}: an edge must be 0 (no thinning) or greater")))
            }
            _ => Ok(()),
        }
    }
}

/// Scores of a cloud; serializes as `cloud_metrics.py` prints them.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CloudScores {
    /// Finite points of the chosen classes in the cloud.
    pub points: usize,
    /// Points of the cloud after thinning.
    pub thinned: usize,
    /// Points of the truth after thinning, ignored classes left out.
    pub truth: usize,
    /// Edge of the thinning voxels, scene units.
    pub voxel: f64,
    /// One entry per threshold, ascending.
    pub scores: Vec<DistanceScore>,
    /// By truth class, if asked for and the truth has labels.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub per_class: Option<BTreeMap<u16, ClassScores>>,
    /// If both clouds have labels.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub labels: Option<LabelScores>,
}

/// Scores at one distance threshold.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct DistanceScore {
    /// The threshold, scene units.
    pub t: f64,
    /// Share of cloud points nearer than `t` to the truth, 0..1.
    #[serde(serialize_with = "rounded::<5, _>")]
    pub accuracy: f64,
    /// Share of truth points nearer than `t` to the cloud, 0..1.
    #[serde(serialize_with = "rounded::<5, _>")]
    pub completeness: f64,
    /// Harmonic mean of the two (Knapitsch et al. 2017).
    #[serde(serialize_with = "rounded::<5, _>")]
    pub f1: f64,
    /// Share of cloud points farther than 10 `t` from the truth, 0..1.
    #[serde(serialize_with = "rounded::<6, _>")]
    pub gross: f64,
}

/// Scores of one truth class, one per threshold.
#[derive(Clone, Debug, PartialEq)]
pub struct ClassScores(pub Vec<ClassScore>);

/// Scores of one truth class at one threshold.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ClassScore {
    /// The threshold, scene units.
    #[serde(skip)]
    pub t: f64,
    /// Of the cloud points whose nearest truth point is of the class, the share nearer than `t`; `None` if there are no
    /// such points.
    #[serde(serialize_with = "rounded_option::<5, _>")]
    pub accuracy: Option<f64>,
    /// Share of the class's truth points nearer than `t` to any cloud point.
    #[serde(serialize_with = "rounded::<5, _>")]
    pub completeness: f64,
}

impl Serialize for ClassScores {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> std::result::Result<S::Ok, S::Error> {
        serializer.collect_map(self.0.iter().map(|s| (format!("{:?}", s.t), s)))
    }
}

/// Scores `cloud` against `truth`.
///
/// Both are thinned to the first point in each voxel, so that a denser cloud gains nothing. An empty cloud scores 0.
///
/// # Errors
/// [`Error::Invalid`] for bad options, a truth without points, classes to choose by in a cloud without labels.
pub fn cloud_scores(
    cloud: &LabelledPoints,
    truth: &LabelledPoints,
    options: &CloudScoreOptions,
) -> Result<CloudScores> {
    options.check()?;
    let mut thresholds = options.thresholds.clone();
    thresholds.sort_by(f64::total_cmp);
    let voxel = options.voxel.unwrap_or(thresholds[0] / 2.0);
    let largest = thresholds[thresholds.len() - 1];

    let truth = thinned(&truth.of_classes(&options.truth_classes, "truth")?, voxel);
    let cloud = cloud.of_classes(&options.cloud_classes, "cloud")?;
    let points = cloud.positions.len();
    let cloud = thinned(&cloud, voxel);
    let counts =
        |i: usize| !truth.labels.as_ref().is_some_and(|l| options.ignore_truth_labels.contains(&l[i]));
    let counted: Vec<bool> = (0..truth.positions.len()).map(counts).collect();
    let total = counted.iter().filter(|c| **c).count();
    if total == 0 {
        return Err(Error::invalid("the truth has no points left to compare with"));
    }

    let cut = 10.0 * largest;
    let (in_cloud, in_truth) =
        rayon::join(|| NearestIndex::new(&cloud.positions), || NearestIndex::new(&truth.positions));
    let to_truth = in_cloud.nearest_in(&in_truth, cut);
    let to_cloud: Vec<f64> = in_truth.nearest_in(&in_cloud, cut).into_iter().map(distance).collect();
    let scores = thresholds.iter().map(|&t| {
        let accuracy = share(to_truth.iter(), |n| distance(**n) < t).unwrap_or(0.0);
        let of_counted = to_cloud.iter().zip(&counted).filter(|c| *c.1).map(|c| c.0);
        let completeness = share(of_counted, |d| **d < t).unwrap_or(0.0);
        let f1 = 2.0 * accuracy * completeness / (accuracy + completeness).max(1e-12);
        let gross = share(to_truth.iter(), |n| distance(**n) > 10.0 * t).unwrap_or(0.0);
        DistanceScore { t, accuracy, completeness, f1, gross }
    });
    let found = Found { truth: &truth, to_truth: &to_truth, to_cloud: &to_cloud };
    Ok(CloudScores {
        points,
        thinned: cloud.positions.len(),
        truth: total,
        voxel,
        scores: scores.collect(),
        per_class: options.per_class.then(|| per_class(&found, &thresholds, options)).flatten(),
        labels: label_scores(&cloud, &truth, &to_truth, largest, &options.ignore_truth_labels),
    })
}

struct Found<'a> {
    truth: &'a LabelledPoints,
    to_truth: &'a [Option<Nearest>],
    to_cloud: &'a [f64],
}

fn per_class(
    found: &Found<'_>,
    thresholds: &[f64],
    options: &CloudScoreOptions,
) -> Option<BTreeMap<u16, ClassScores>> {
    let labels = found.truth.labels.as_ref()?;
    // distances by class: from cloud points to their nearest truth point, and from truth points
    let mut distances: BTreeMap<u16, (Vec<f64>, Vec<f64>)> = BTreeMap::new();
    for (label, d) in labels.iter().zip(found.to_cloud) {
        distances.entry(*label).or_default().1.push(*d);
    }
    for nearest in found.to_truth.iter().flatten() {
        distances.entry(labels[nearest.index as usize]).or_default().0.push(nearest.squared.sqrt());
    }
    let score = |(from_cloud, from_truth): &(Vec<f64>, Vec<f64>), t: f64| ClassScore {
        t,
        accuracy: share(from_cloud.iter(), |d| **d < t),
        completeness: share(from_truth.iter(), |d| **d < t).unwrap_or(0.0),
    };
    let classes = distances.iter().filter(|(class, _)| !options.ignore_truth_labels.contains(class));
    Some(classes.map(|(c, d)| (*c, ClassScores(thresholds.iter().map(|&t| score(d, t)).collect()))).collect())
}

/// One point per voxel of edge `voxel`: the first in the cloud's order.
fn thinned(cloud: &LabelledPoints, voxel: f64) -> LabelledPoints {
    if voxel <= 0.0 {
        return cloud.clone();
    }
    let key = |(p, i): (&[f64; 3], usize)| (p.map(|v| (v / voxel).floor() as i64), i);
    let mut keys: Vec<_> = cloud.positions.par_iter().zip(0..cloud.positions.len()).map(key).collect();
    keys.par_sort_unstable();
    keys.dedup_by_key(|k| k.0);
    let mut first: Vec<usize> = keys.iter().map(|k| k.1).collect();
    first.par_sort_unstable();
    cloud.chosen(&first)
}

pub(super) fn distance(nearest: Option<Nearest>) -> f64 {
    nearest.map_or(f64::INFINITY, |n| n.squared.sqrt())
}

/// Share of the items that satisfy `test`; `None` of no items.
fn share<T>(items: impl Iterator<Item = T>, test: impl Fn(&T) -> bool) -> Option<f64> {
    let (mut n, mut hits) = (0usize, 0usize);
    for item in items {
        n += 1;
        hits += usize::from(test(&item));
    }
    (n > 0).then(|| hits as f64 / n as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plane(step: f64, z: f64, label: u16) -> LabelledPoints {
        let positions = (0..400).map(|i| [f64::from(i % 20) * step, f64::from(i / 20) * step, z]);
        LabelledPoints {
            positions: positions.collect(),
            labels: Some(vec![label; 400]),
            ..Default::default()
        }
    }

    fn options(thresholds: &[f64]) -> CloudScoreOptions {
        CloudScoreOptions { thresholds: thresholds.to_vec(), voxel: Some(0.0), ..Default::default() }
    }

    #[test]
    fn a_shifted_plane_is_right_beyond_its_shift() {
        let scores =
            cloud_scores(&plane(1.0, 0.3, 1), &plane(1.0, 0.0, 1), &options(&[0.5, 0.2, 0.02])).unwrap();
        let at: Vec<_> =
            scores.scores.iter().map(|s| (s.t, s.accuracy, s.completeness, s.f1, s.gross)).collect();
        let expected = [(0.02, 0.0, 0.0, 0.0, 1.0), (0.2, 0.0, 0.0, 0.0, 0.0), (0.5, 1.0, 1.0, 1.0, 0.0)];
        assert_eq!(at, expected);
        assert_eq!(scores.labels.unwrap().accuracy, Some(1.0));
    }

    #[test]
    fn thinning_keeps_the_first_point_of_a_voxel_and_its_label() {
        let cloud = LabelledPoints {
            positions: vec![[0.1, 0.0, 0.0], [0.2, 0.0, 0.0], [-0.1, 0.0, 0.0], [f64::NAN, 0.0, 0.0]],
            labels: Some(vec![5, 6, 7, 8]),
            ..Default::default()
        };
        let finite = cloud.of_classes(&[], "cloud").unwrap();
        let thin = thinned(&finite, 1.0);
        assert_eq!(thin.labels, Some(vec![5, 7]));
        assert_eq!(thin.positions, [[0.1, 0.0, 0.0], [-0.1, 0.0, 0.0]]);
    }

    #[test]
    fn classes_choose_points_on_both_sides() {
        let mut truth = plane(1.0, 0.0, 1);
        let far = plane(1.0, 50.0, 2);
        truth.positions.extend(far.positions);
        truth.labels.as_mut().unwrap().extend(far.labels.unwrap());
        let cloud = plane(1.0, 0.0, 2);
        let all = cloud_scores(&cloud, &truth, &options(&[0.1])).unwrap();
        assert_eq!((all.scores[0].accuracy, all.scores[0].completeness), (1.0, 0.5));
        assert_eq!(all.labels.as_ref().unwrap().accuracy, Some(0.0));
        let ignored = CloudScoreOptions { ignore_truth_labels: vec![2], ..options(&[0.1]) };
        let ignored = cloud_scores(&cloud, &truth, &ignored).unwrap();
        assert_eq!((ignored.truth, ignored.scores[0].completeness), (400, 1.0));
        let only = CloudScoreOptions { truth_classes: vec![2], ..options(&[0.1]) };
        assert_eq!(cloud_scores(&cloud, &truth, &only).unwrap().scores[0].accuracy, 0.0);
        let none = CloudScoreOptions { cloud_classes: vec![1], ..options(&[0.1]) };
        let none = cloud_scores(&cloud, &truth, &none).unwrap();
        assert_eq!((none.points, none.scores[0].accuracy, none.scores[0].f1), (0, 0.0, 0.0));
        let each = CloudScoreOptions { per_class: true, ..options(&[0.1]) };
        let each = cloud_scores(&cloud, &truth, &each).unwrap().per_class.unwrap();
        assert_eq!((each[&1].0[0].accuracy, each[&1].0[0].completeness), (Some(1.0), 1.0));
        assert_eq!((each[&2].0[0].accuracy, each[&2].0[0].completeness), (None, 0.0));
    }

    #[test]
    fn json_has_the_keys_of_the_script() {
        let each = CloudScoreOptions { per_class: true, ..options(&[0.25, 2.0]) };
        let scores = cloud_scores(&plane(1.0, 0.3, 1), &plane(1.0, 0.0, 1), &each).unwrap();
        let json = serde_json::to_string(&scores).unwrap();
        assert_eq!(
            json,
            "{\"points\":400,\"thinned\":400,\"truth\":400,\"voxel\":0.0,\"scores\":[\
             {\"t\":0.25,\"accuracy\":0.0,\"completeness\":0.0,\"f1\":0.0,\"gross\":0.0},\
             {\"t\":2.0,\"accuracy\":1.0,\"completeness\":1.0,\"f1\":1.0,\"gross\":0.0}],\
             \"per_class\":{\"1\":{\"0.25\":{\"accuracy\":0.0,\"completeness\":0.0},\
             \"2.0\":{\"accuracy\":1.0,\"completeness\":1.0}}},\
             \"labels\":{\"accuracy\":1.0,\"miou\":1.0,\"iou\":{\"1\":1.0}}}"
        );
    }

    #[test]
    fn unusable_input_is_refused_with_the_reason() {
        let (cloud, empty) = (plane(1.0, 0.0, 1), LabelledPoints::default());
        let error = |truth: &LabelledPoints, options: &CloudScoreOptions| {
            cloud_scores(&cloud, truth, options).unwrap_err().to_string()
        };
        assert!(error(&empty, &options(&[0.1])).contains("truth has no points"));
        assert!(error(&cloud, &options(&[])).contains("threshold"));
        assert!(error(&cloud, &options(&[0.1, -1.0])).contains("-1"));
        assert!(
            error(&cloud, &CloudScoreOptions { voxel: Some(f64::NAN), ..options(&[0.1]) }).contains("NaN")
        );
        let by_class = CloudScoreOptions { truth_classes: vec![1], ..options(&[0.1]) };
        assert!(error(&LabelledPoints { labels: None, ..cloud.clone() }, &by_class).contains("no labels"));
        let ragged = LabelledPoints { labels: Some(vec![1]), ..cloud.clone() };
        assert!(error(&ragged, &options(&[0.1])).contains("some of its points"));
        assert_eq!(cloud_scores(&empty, &cloud, &options(&[0.1])).unwrap().scores[0].f1, 0.0);
    }
}
