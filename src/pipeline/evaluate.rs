//! A cloud against the true surface, from files.

use crate::error::{Error, Result};
use crate::evaluate::{CloudScoreOptions, CloudScores, LabelledPoints, cloud_scores};
use crate::store::reliability_diagram::{Bar, write_reliability_diagram};
use semvs_formats::{Limits, ply};
use std::fs::File;
use std::path::{Path, PathBuf};

/// `evaluate`.
#[derive(Clone, Debug, PartialEq)]
pub struct EvaluateJob {
    /// The cloud to judge.
    pub cloud: PathBuf,
    /// Points of the true surface.
    pub truth: PathBuf,
    /// What to score.
    pub options: CloudScoreOptions,
    /// A picture (.png) of how right labels are by their confidence.
    pub reliability_diagram: Option<PathBuf>,
}

/// Runs `job`.
///
/// # Errors
/// An unreadable file, a cloud without points, options that do not fit the clouds, a picture that cannot be written or
/// drawn.
pub fn evaluate(job: &EvaluateJob) -> Result<CloudScores> {
    job.options.check()?;
    let truth = read_points(&job.truth)?;
    let cloud = read_points(&job.cloud)?;
    let scores = cloud_scores(&cloud, &truth, &job.options)?;
    if scores.points == 0 {
        return Err(Error::content(&job.cloud, "the cloud has no points to judge"));
    }
    if let Some(path) = &job.reliability_diagram {
        let bins = scores.labels.as_ref().and_then(|labels| labels.reliability.as_deref());
        let bins = bins.ok_or_else(|| {
            Error::content(
                &job.cloud,
                "no reliability diagram: the cloud needs label and label_confidence, the truth label",
            )
        })?;
        let bars: Vec<Bar> = bins.iter().map(|b| Bar { from: b.from, to: b.to, right: b.right }).collect();
        write_reliability_diagram(path, &bars)?;
    }
    Ok(scores)
}

fn read_points(path: &Path) -> Result<LabelledPoints> {
    let file = File::open(path).map_err(|e| Error::io(path, "open", e))?;
    let cloud = ply::read_cloud(file, &Limits::default()).map_err(|e| Error::format(path, e))?;
    if cloud.is_empty() {
        return Err(Error::content(path, "the cloud has no points"));
    }
    let positions = match cloud.positions_f64.is_empty() {
        true => cloud.positions.iter().map(|p| p.map(f64::from)).collect(),
        false => cloud.positions_f64,
    };
    let labels = (!cloud.labels.is_empty()).then_some(cloud.labels);
    let label_confidences = (!cloud.label_confidence.is_empty()).then_some(cloud.label_confidence);
    Ok(LabelledPoints { positions, labels, label_confidences })
}
