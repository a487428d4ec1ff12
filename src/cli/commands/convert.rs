//! `semvs convert`.

use super::cloud_path;
use crate::cli::resolve;
use crate::cli::semvs_args::ConvertArgs;
use crate::error::{Error, Result};
use crate::pipeline::{self, ConvertJob};
use crate::progress::Progress;
use crate::store::cloud::PlyLayout;
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
        masks: resolve::masks(args.ignore_mask_label, args.mask_path.clone())?,
        labels: resolve::labels(&args.labels, &as_typed)?,
        outputs: resolve::outputs(&args.clouds, cloud_path(&args.output)?, PlyLayout::Plain),
    };
    crate::cli::print(&pipeline::convert(&job, progress)?.summary());
    Ok(())
}
