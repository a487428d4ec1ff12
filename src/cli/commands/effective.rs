//! Every option in effect, for reports.

use crate::fusion::{FusionOptions, Support};
use crate::pipeline::{AcrossViews, FilterJob, Outputs, SceneJob};
use crate::semantics::LabelEstimation;
use crate::store::cloud::PlyLayout;
use clap::{ArgMatches, Args, Command};
use serde_json::{Map, Value};
use std::path::Path;

/// Every option of `A` under its long name with its value, typed or by default; `null` where it has none.
pub(crate) fn options_in_effect<A: Args>(matches: &ArgMatches) -> Map<String, Value> {
    let command = A::augment_args(Command::new("options"));
    let options = command.get_arguments().filter(|arg| !["help", "version"].contains(&arg.get_id().as_str()));
    options
        .map(|arg| {
            let id = arg.get_id().as_str();
            let name = arg.get_long().map_or_else(|| id.replace('_', "-"), str::to_owned);
            (name, value(matches, id))
        })
        .collect()
}

/// Numbers and switches as such, everything else as typed; a list separated by commas.
fn value(matches: &ArgMatches, id: &str) -> Value {
    if let Ok(Some(&on)) = matches.try_get_one::<bool>(id) {
        return on.into();
    }
    let Ok(Some(raw)) = matches.try_get_raw(id) else { return Value::Null };
    let text = raw.map(|value| value.to_string_lossy().into_owned()).collect::<Vec<_>>().join(",");
    let is_whole = matches.try_get_one::<u32>(id).is_ok() || matches.try_get_one::<i32>(id).is_ok();
    let is_real = matches.try_get_one::<f32>(id).is_ok() || matches.try_get_one::<f64>(id).is_ok();
    let number = match (is_whole, is_real) {
        (true, _) => text.parse::<i64>().ok().map(Value::from),
        (_, true) => text.parse::<f64>().ok().map(Value::from),
        _ => None,
    };
    number.unwrap_or(Value::String(text))
}

/// Fills in what an option without a value means in this run, and what a config file decided.
pub(crate) fn resolve(
    options: &mut Map<String, Value>,
    input: &SceneJob,
    outputs: &Outputs,
    depth_maps: Option<&Path>,
    filter: Option<&FilterJob>,
    fusion: &FusionOptions,
) {
    let path = |path: &Path| Value::String(path.display().to_string());
    let layout = match outputs.layout {
        PlyLayout::Plain => "plain",
        PlyLayout::OpenMvs | PlyLayout::OpenMvsProject => "openmvs",
        PlyLayout::Odm => "odm",
    };
    let support = match fusion.support {
        Support::All => "all",
        Support::Unclaimed => "unclaimed",
    };
    let folder =
        if input.working_folder.as_os_str().is_empty() { Path::new(".") } else { &input.working_folder };
    let mut meant = vec![
        ("output", path(&outputs.cloud)),
        ("output-file", path(&outputs.cloud)),
        ("working-folder", path(folder)),
        ("ply-layout", layout.into()),
        ("support", support.into()),
    ];
    meant.extend(depth_maps.map(|folder| ("depth-maps", path(folder))));
    if let Some(labels) = &input.labels {
        meant.push(("label-estimation", labels.rules.estimation.name().into()));
        if let LabelEstimation::Aware { cost } = labels.rules.estimation {
            meant.push(("label-cost", f64::from(cost).into()));
        }
        meant.push(("label-filter", if labels.rules.filter { "on" } else { "off" }.into()));
        meant.push(("label-consistency", labels.rules.consistency.name().into()));
        meant.push(("label-votes", labels.rules.voters.name().into()));
    }
    options.insert("number-views-fuse".to_owned(), fusion.number_views_fuse.into());
    if let Some(filter) = filter {
        options.insert("postprocess-dmaps".to_owned(), filter.bits().into());
        meant.extend(filter.across.map(|across| match across {
            AcrossViews::OpenMvs => ("filter", "openmvs".into()),
            AcrossViews::Unbiased(_) => ("filter", "unbiased".into()),
        }));
    }
    for (name, value) in meant {
        if let Some(option) = options.get_mut(name).filter(|option| option.is_null()) {
            *option = value;
        }
    }
}
