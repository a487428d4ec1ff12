//! `semvs convert`.

use super::cloud_path;
use crate::cli::resolve;
use crate::cli::semvs_args::ConvertArgs;
use crate::error::{Error, Result};
use crate::pipeline::{self, ConvertJob, Outputs, SceneArchive};
use crate::progress::Progress;
use std::path::Path;

/// Runs the command.
pub(crate) fn convert(args: &ConvertArgs, progress: &Progress) -> Result<()> {
    let asked = [
        (args.labels.label_consistency.is_some(), "--label-consistency"),
        (args.labels.label_border > 0, "--label-border"),
    ];
    if let Some((_, option)) = asked.iter().find(|(asked, _)| *asked) {
        return Err(Error::invalid(format!(
            "{option} has no meaning here: nothing is fused; use semvs fuse"
        )));
    }
    let as_typed = |path: &Path| path.to_owned();
    let job = ConvertJob {
        depth_maps: args.depth_maps.clone(),
        working_folder: args.working_folder.clone(),
        labels: resolve::labels(&args.labels, &as_typed)?,
        outputs: Outputs {
            cloud: cloud_path(&args.output)?,
            scene: None,
            archive: SceneArchive::Interface,
            layout: resolve::typed_layout(args.ply_layout),
            split_by_class: args.split_by_class,
            color_by_label: args.color_by_label,
            report: None,
            names_from_scene: true,
            sparse_cloud: false,
            allow_empty: false,
        },
    };
    crate::cli::print(&pipeline::convert(&job, progress)?.summary());
    Ok(())
}
