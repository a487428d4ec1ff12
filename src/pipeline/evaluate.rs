//! A cloud against the true surface, from files.

use crate::error::{Error, Result};
use crate::evaluate::{CloudScoreOptions, CloudScores, LabelledPoints, cloud_scores};
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
}

/// Runs `job`.
///
/// # Errors
/// An unreadable file, a cloud without points, options that do not fit the clouds.
pub fn evaluate(job: &EvaluateJob) -> Result<CloudScores> {
    job.options.check()?;
    let truth = read_points(&job.truth)?;
    let cloud = read_points(&job.cloud)?;
    let scores = cloud_scores(&cloud, &truth, &job.options)?;
    if scores.points == 0 {
        return Err(Error::content(&job.cloud, "the cloud has no points to judge"));
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
    Ok(LabelledPoints { positions, labels })
}
