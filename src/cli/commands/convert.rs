//! `semvs convert`.

use super::cloud_path;
use crate::cli::label_options::OnOff;
use crate::cli::resolve;
use crate::cli::semvs_args::ConvertArgs;
use crate::error::{Error, Result};
use crate::pipeline::{self, ConvertCloudJob, ConvertJob};
use crate::progress::Progress;
use crate::store::cloud::PlyLayout;
use std::path::Path;

/// Runs the command.
pub(crate) fn convert(args: &ConvertArgs, progress: &Progress) -> Result<()> {
    let asked = [
        (args.labels.label_consistency.is_some(), "--label-consistency"),
        (args.labels.label_border > 0, "--label-border"),
        (args.labels.label_votes.is_some(), "--label-votes"),
        (args.labels.label_smooth > 0, "--label-smooth"),
        (args.labels.label_filter == Some(OnOff::On), "--label-filter"),
        (args.labels.label_estimation.is_some(), "--label-estimation"),
        (args.labels.label_cost.is_some(), "--label-cost"),
    ];
    if let Some((_, option)) = asked.iter().find(|(asked, _)| *asked) {
        return Err(Error::invalid(format!(
            "{option} has no meaning here: nothing is fused; use semvs fuse"
        )));
    }
    if let [cloud] = args.depth_maps.as_slice()
        && cloud.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("ply"))
    {
        return convert_cloud(args, cloud, progress);
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

fn convert_cloud(args: &ConvertArgs, cloud: &Path, progress: &Progress) -> Result<()> {
    let asked = [
        (args.labels.label_path.is_some(), "--label-path"),
        (args.mask_path.is_some() || args.ignore_mask_label >= 0, "--mask-path, --ignore-mask-label"),
        (args.working_folder.is_some(), "--working-folder"),
    ];
    if let Some((_, option)) = asked.iter().find(|(asked, _)| *asked) {
        return Err(Error::invalid(format!("{option} has no meaning for a cloud, which has no images")));
    }
    let job = ConvertCloudJob {
        cloud: cloud.to_owned(),
        class_table: args.labels.class_table.clone(),
        rules: resolve::rules(&args.labels),
        outputs: resolve::outputs(&args.clouds, cloud_path(&args.output)?, PlyLayout::Plain),
    };
    crate::cli::print(&pipeline::convert_cloud(&job, progress)?.summary());
    Ok(())
}
