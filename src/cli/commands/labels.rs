//! `semvs labels`.

use crate::cli::labels_args::{CheckLabelsArgs, LabelsArgs, LabelsCommand, RenderLabelsArgs};
use crate::cli::resolve;
use crate::error::{Error, Result};
use crate::pipeline::{self, CheckLabelsJob, RenderLabelsJob};
use crate::progress::Progress;
use crate::store::label_names::label_names;
use crate::store::labels::LabelSources;
use std::path::Path;

/// Runs the command.
pub(crate) fn labels(args: &LabelsArgs, progress: &Progress) -> Result<()> {
    match &args.command {
        LabelsCommand::Check(args) => check(args, progress),
        LabelsCommand::Render(args) => render(args, progress),
    }
}

fn check(args: &CheckLabelsArgs, progress: &Progress) -> Result<()> {
    let job = CheckLabelsJob {
        scene: args.scene.clone(),
        working_folder: args.working_folder.clone().unwrap_or_default(),
        sources: LabelSources {
            label_path: args.label_path.clone(),
            class_table: args.class_table.as_deref().map(|name| resolve::table(name, &Path::to_path_buf)),
            unknown: resolve::unknown(args.unknown_label),
            missing: resolve::missing(args.missing_labels),
        },
        depth_maps: args.depth_maps.clone(),
        max_threads: args.max_threads as usize,
    };
    let found = pipeline::check_labels(&job, progress)?;
    let text = match args.json {
        true => {
            serde_json::to_string_pretty(&found).map_err(|e| Error::invalid(format!("no JSON: {e}")))? + "\n"
        }
        false => found.text(),
    };
    crate::cli::print(&text);
    match found.faults {
        0 => Ok(()),
        _ if found.views.iter().all(|view| view.file.is_none()) => {
            let place = args.label_path.as_deref().map(|folder| format!(" in {}", folder.display()));
            Err(Error::invalid(format!(
                "no image has a label map; that of DSC1.jpg is {}{}",
                label_names(Path::new("DSC1.jpg")),
                place.as_deref().unwrap_or(" in the folder that --label-path names"),
            )))
        }
        n => Err(Error::invalid(format!(
            "{n} of {} label maps are missing or cannot be used; see above",
            found.views.len()
        ))),
    }
}

fn render(args: &RenderLabelsArgs, progress: &Progress) -> Result<()> {
    let job = RenderLabelsJob {
        scene: args.scene.clone(),
        working_folder: args.working_folder.clone().unwrap_or_default(),
        cloud: args.cloud.clone(),
        class_table: args.class_table.as_deref().map(|name| resolve::table(name, &Path::to_path_buf)),
        ids: args.ids,
        output: args.output.clone(),
        max_threads: args.max_threads as usize,
    };
    let written = pipeline::render_label_maps(&job, progress)?;
    let mut text = String::new();
    for view in &written {
        text.push_str(&format!("{}  {:.1} % labelled\n", view.path.display(), 100.0 * view.labelled));
    }
    crate::cli::print(&text);
    Ok(())
}
