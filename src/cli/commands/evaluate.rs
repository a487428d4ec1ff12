//! `semvs evaluate`.

use crate::cli::semvs_args::EvaluateArgs;
use crate::error::{Error, Result};
use crate::evaluate::{CloudScoreOptions, CloudScores, ReliabilityBin};
use crate::pipeline::{self, EvaluateJob};
use std::fmt::Write;

/// Runs the command.
pub(crate) fn evaluate(args: &EvaluateArgs) -> Result<()> {
    let scores = pipeline::evaluate(&EvaluateJob {
        cloud: args.cloud.clone(),
        truth: args.truth.clone(),
        options: CloudScoreOptions {
            thresholds: args.thresholds.clone(),
            voxel: args.voxel,
            ignore_truth_labels: args.ignore_truth_labels.clone(),
            truth_classes: args.truth_classes.clone(),
            cloud_classes: args.cloud_classes.clone(),
            per_class: args.per_class,
        },
        reliability_diagram: args.reliability_diagram.clone(),
    })?;
    let text = match args.json {
        true => serde_json::to_string(&scores).map_err(|e| Error::invalid(format!("no JSON: {e}")))? + "\n",
        false => text(&scores),
    };
    crate::cli::print(&text);
    Ok(())
}

fn text(scores: &CloudScores) -> String {
    let mut out = format!(
        "{} points, {} after thinning to one per {}; truth {}\n\n",
        scores.points, scores.thinned, scores.voxel, scores.truth
    );
    out.push_str("distance  accuracy  completeness      F1     gross\n");
    for s in &scores.scores {
        let _ = writeln!(
            out,
            "{:<8}  {:>8.4}  {:>12.4}  {:>6.4}  {:>8.5}",
            s.t, s.accuracy, s.completeness, s.f1, s.gross
        );
    }
    for (class, scores) in scores.per_class.iter().flatten() {
        for s in &scores.0 {
            let accuracy = s.accuracy.map_or("-".to_owned(), |a| format!("{a:.4}"));
            let _ = writeln!(
                out,
                "class {class} at {}: accuracy {accuracy}, completeness {:.4}",
                s.t, s.completeness
            );
        }
    }
    if let Some(labels) = &scores.labels {
        let number = |v: Option<f64>| v.map_or("-".to_owned(), |v| format!("{v:.4}"));
        let _ = write!(out, "\nlabels: {} right, mean IoU {}", number(labels.accuracy), number(labels.miou));
        for (class, iou) in &labels.iou {
            let _ = write!(out, ", class {class} {}", number(*iou));
        }
        out.push('\n');
        labels.reliability.iter().for_each(|bins| add_reliability(&mut out, bins));
    }
    out
}

/// The share of right labels by confidence.
fn add_reliability(out: &mut String, bins: &[ReliabilityBin]) {
    out.push_str("\nlabel_confidence  points     right\n");
    for bin in bins {
        let right = bin.right.map_or("-".to_owned(), |right| format!("{right:.4}"));
        let _ =
            writeln!(out, "{:.2} to {:.2}      {:>6.2} %  {right:>6}", bin.from, bin.to, 100.0 * bin.share);
    }
}
