//! `semvs preview`.

use crate::cli::page_args::PreviewArgs;
use crate::cli::resolve;
use crate::error::Result;
use crate::pipeline::{self, PreviewJob};
use crate::progress::Progress;
use crate::store::labels::LabelSources;
use std::path::Path;

/// Runs the command.
pub(crate) fn preview(args: &PreviewArgs, progress: &Progress) -> Result<()> {
    let class_table = args.class_table.as_deref().map(|name| resolve::table(name, &Path::to_path_buf));
    let labels = (args.label_path.is_some() || class_table.is_some()).then(|| LabelSources {
        label_path: args.label_path.clone(),
        class_table,
        missing: resolve::missing(args.missing_labels),
        ..LabelSources::default()
    });
    let written = pipeline::preview(
        &PreviewJob {
            maps: args.maps.clone(),
            output: args.output.clone(),
            working_folder: args.working_folder.clone(),
            labels,
            scale: args.depth_range,
            max_threads: args.max_threads as usize,
        },
        progress,
    )?;
    let mut text = String::new();
    for path in &written.files {
        text.push_str(&format!("{}\n", path.display()));
    }
    text.push_str(&format!("depths from {} (bright) to {} (dark)\n", written.scale.0, written.scale.1));
    crate::cli::print(&text);
    Ok(())
}
