//! From options about labels as typed to a job whose values are checked.

use super::label_options::{ConsistencyMode, EstimationMode, LabelInput, OnOff, VotersMode, WhenMissing};
use crate::error::{Error, Result};
use crate::pipeline::LabelJob;
use crate::semantics::{ClassRules, Consistency, LabelEstimation, Voters};
use crate::store::labels::{LabelSources, MissingLabels, UnknownLabel};
use std::path::{Path, PathBuf};

/// What the options ask to do with classes.
pub(crate) fn rules(typed: &LabelInput) -> ClassRules {
    let names = |list: &[String]| {
        list.iter().map(|n| n.trim().to_owned()).filter(|n| !n.is_empty()).collect::<Vec<String>>()
    };
    ClassRules {
        classes: names(&typed.classes),
        exclude: names(&typed.exclude_classes),
        estimation: match typed.label_estimation {
            Some(EstimationMode::Off) => LabelEstimation::Off,
            Some(EstimationMode::Skip) | None => LabelEstimation::Skip,
            Some(EstimationMode::Aware) => {
                LabelEstimation::Aware { cost: typed.label_cost.unwrap_or(LabelEstimation::DEFAULT_COST) }
            }
        },
        consistency: match typed.label_consistency {
            Some(ConsistencyMode::Off) => Consistency::Off,
            Some(ConsistencyMode::Strict) => Consistency::Strict,
            Some(ConsistencyMode::Support) | None => Consistency::Support,
        },
        border: typed.label_border,
        voters: match typed.label_votes {
            Some(VotersMode::Merged) => Voters::Merged,
            Some(VotersMode::All) | None => Voters::All,
        },
        smooth: typed.label_smooth,
        filter: match typed.label_filter {
            Some(filter) => filter == OnOff::On,
            None => typed.label_estimation == Some(EstimationMode::Aware),
        },
    }
}

/// Whether labels take part.
pub(super) fn has_labels(typed: &LabelInput) -> bool {
    typed.label_path.is_some() || typed.class_table.is_some()
}

/// The labels that the options ask for.
///
/// # Errors
/// Options about classes without labels.
pub(crate) fn labels(typed: &LabelInput, place: &dyn Fn(&Path) -> PathBuf) -> Result<Option<LabelJob>> {
    let sources = LabelSources {
        label_path: typed.label_path.as_deref().map(place),
        class_table: typed.class_table.as_deref().map(|name| table(name, place)),
        unknown: unknown(typed.unknown_label),
        missing: missing(typed.missing_labels),
    };
    if let Some(cost) = typed.label_cost {
        if !(0.0..=2.0).contains(&cost) {
            return Err(Error::invalid(format!("--label-cost {cost}: give a cost of 0 to 2")));
        }
        if has_labels(typed) && typed.label_estimation != Some(EstimationMode::Aware) {
            return Err(Error::invalid("--label-cost needs --label-estimation aware"));
        }
    }
    let rules = rules(typed);
    if has_labels(typed) {
        return Ok(Some(LabelJob { sources, rules }));
    }
    let asked = [
        (!rules.classes.is_empty(), "--classes"),
        (!rules.exclude.is_empty(), "--exclude-classes"),
        (typed.label_consistency.is_some(), "--label-consistency"),
        (typed.label_border > 0, "--label-border"),
        (typed.label_votes.is_some(), "--label-votes"),
        (typed.label_smooth > 0, "--label-smooth"),
        (typed.label_filter == Some(OnOff::On), "--label-filter"),
        (typed.label_estimation.is_some(), "--label-estimation"),
        (typed.label_cost.is_some(), "--label-cost"),
    ];
    match asked.iter().find(|(asked, _)| *asked) {
        Some((_, option)) => Err(Error::invalid(format!("{option} needs labels: {NEEDED}"))),
        None => Ok(None),
    }
}

/// `--unknown-label`.
pub(crate) fn unknown(typed: WhenMissing) -> UnknownLabel {
    match typed {
        WhenMissing::Error => UnknownLabel::Refuse,
        WhenMissing::Void => UnknownLabel::Void,
    }
}

/// `--missing-labels`.
pub(crate) fn missing(typed: WhenMissing) -> MissingLabels {
    match typed {
        WhenMissing::Error => MissingLabels::Refuse,
        WhenMissing::Void => MissingLabels::Void,
    }
}

/// How to give labels.
const NEEDED: &str =
    "give --label-path, the folder of the label maps, and --class-table unless they hold plain ids";

/// A class table as typed: a file if there is one of that name, else the name of a built-in table.
pub(crate) fn table(name: &str, place: &dyn Fn(&Path) -> PathBuf) -> String {
    let path = place(Path::new(name));
    let is_builtin = crate::semantics::ClassTable::builtin_names().any(|builtin| builtin == name);
    match path.to_str() {
        Some(path) if !is_builtin && Path::new(path).is_file() => path.to_owned(),
        _ => name.to_owned(),
    }
}
