//! The options of `DensifyPointCloud` beyond the shared ones, as typed, and the order in which help lists all.

use super::tokens::Known;
use crate::cli::options::SharedOptions;
use clap::{ArgAction, CommandFactory, Parser};
use std::path::PathBuf;

/// Everything that may be typed after `DensifyPointCloud`.
#[derive(Clone, Debug, Parser)]
#[command(name = "DensifyPointCloud", disable_help_flag = true, no_binary_name = true)]
pub(crate) struct DropInArgs {
    /// Print this list
    #[arg(short, long, action = ArgAction::SetTrue)]
    pub(crate) help: bool,
    /// Print the version and the instruction set that the kernels use, and exit
    #[arg(long, action = ArgAction::SetTrue)]
    pub(crate) version: bool,
    /// File of options, "name = value" per line, in the working folder
    #[arg(short, long, value_name = "FILE", default_value = "DensifyPointCloud.cfg")]
    pub(crate) config_file: PathBuf,
    /// Kind of the .mvs written: -1 interface; 0 text, 1 binary, 2 zlib, 3 zstd project archive
    #[arg(long, value_name = "N", default_value_t = -1, allow_negative_numbers = true)]
    pub(crate) archive_type: i32,
    /// Process priority, -3 (lowest) to 3 (highest); below 0 leaves the machine usable
    #[arg(long, value_name = "N", default_value_t = -1, allow_negative_numbers = true)]
    pub(crate) process_priority: i32,
    /// 0 results only, 1 stages, 2 images, 3 everything
    #[arg(short, long, value_name = "N", default_value_t = 2, allow_negative_numbers = true)]
    pub(crate) verbosity: i32,
    /// CUDA device; accepted without effect, the CPU does the work
    #[arg(long, value_name = "N", default_value_t = -1, allow_negative_numbers = true)]
    pub(crate) cuda_device: i32,
    /// Scene (.mvs)
    #[arg(short, long, value_name = "FILE")]
    pub(crate) input_file: Option<PathBuf>,
    /// Base name of the results; its extension is dropped, but .las and .laz say what the cloud is written as [default:
    /// input file + "_dense"]
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output_file: Option<PathBuf>,
    /// Keep what OpenMVS does wrong where a pipeline may depend on it; docs/COMPATIBILITY.md lists it
    #[arg(long)]
    pub(crate) strict_openmvs: bool,
    /// As in OpenMVS 2.4: above 0 every point gets a class; the label maps are the images' masks
    #[arg(long, value_name = "N", default_value_t = 0, allow_negative_numbers = true)]
    pub(crate) estimate_segmentation: i32,
    #[command(flatten)]
    pub(crate) actions: Actions,
    #[command(flatten)]
    pub(crate) shared: SharedOptions,
}

/// Jobs other than densification that OpenMVS's program can do.
#[derive(Clone, Debug, clap::Args)]
pub(crate) struct Actions {
    /// Write the neighbour lists as text and exit
    #[arg(long, value_name = "FILE")]
    pub(crate) output_view_neighbors_file: Option<PathBuf>,
    /// Above 0: export the cloud with the pixel size at every point, times this, and exit
    #[arg(long, value_name = "S", default_value_t = 0.0, allow_negative_numbers = true)]
    pub(crate) estimate_scale: f32,
    /// Above 0: split the scene into parts of at most this area by its depth maps, and exit
    #[arg(long, value_name = "AREA", default_value_t = 0.0, allow_negative_numbers = true)]
    pub(crate) sub_scene_area: f32,
    /// Sample a mesh and exit: not available
    #[arg(long, value_name = "N", default_value_t = 0.0, allow_negative_numbers = true)]
    pub(crate) sample_mesh: f32,
    /// Below 0: remove the points of a finished cloud whose visibility is at most this, and exit; above 0: no effect
    #[arg(long, value_name = "N", default_value_t = 0, allow_negative_numbers = true)]
    pub(crate) filter_point_cloud: i32,
    /// Export the points seen by at least this many views and exit; below 0: the scene too
    #[arg(long, value_name = "N", default_value_t = 0, allow_negative_numbers = true)]
    pub(crate) export_number_views: i32,
    /// Mesh that neighbours are derived from: not available
    #[arg(long, value_name = "FILE", hide = true)]
    pub(crate) mesh_file: Option<PathBuf>,
    /// Write the region of interest as text and exit
    #[arg(long, value_name = "FILE", hide = true)]
    pub(crate) export_roi_file: Option<PathBuf>,
    /// Put this region of interest into the scene and exit
    #[arg(long, value_name = "FILE", hide = true)]
    pub(crate) import_roi_file: Option<PathBuf>,
    /// Render depth maps of a mesh and exit: not available
    #[arg(long, value_name = "NAME", hide = true)]
    pub(crate) export_depth_maps_name: Option<String>,
}

/// Options for the command line only; a config file that holds one is an error.
pub(crate) const GENERIC: &[&str] = &[
    "help",
    "working-folder",
    "config-file",
    "archive-type",
    "process-priority",
    "max-threads",
    "verbosity",
    "cuda-device",
];

/// Options for the command line and the config file.
pub(crate) const DENSIFY: &[&str] = &[
    "input-file",
    "pointcloud-file",
    "output-file",
    "view-neighbors-file",
    "output-view-neighbors-file",
    "resolution-level",
    "max-resolution",
    "min-resolution",
    "sub-resolution-levels",
    "number-views",
    "number-views-fuse",
    "ignore-mask-label",
    "mask-path",
    "iters",
    "geometric-iters",
    "estimate-colors",
    "estimate-normals",
    "estimate-scale",
    "sub-scene-area",
    "sample-mesh",
    "fusion-mode",
    "postprocess-dmaps",
    "filter-point-cloud",
    "export-number-views",
    "roi-border",
    "estimate-roi",
    "crop-to-roi",
    "remove-dmaps",
    "tower-mode",
];

/// Options that OpenMVS's help does not list.
#[cfg(test)]
pub(crate) const HIDDEN: &[&str] =
    &["mesh-file", "export-roi-file", "import-roi-file", "dense-config-file", "export-depth-maps-name"];

/// Options that OpenMVS does not have.
pub(crate) const BEYOND: &[&str] = &[
    "label-path",
    "class-table",
    "classes",
    "exclude-classes",
    "label-estimation",
    "label-cost",
    "label-consistency",
    "label-border",
    "label-votes",
    "label-smooth",
    "label-filter",
    "missing-labels",
    "unknown-label",
    "split-by-class",
    "color-by-label",
    "report",
    "ply-layout",
    "ply-doubles",
    "offset",
    "las-normals",
    "filter",
    "support",
    "quality",
    "max-memory",
    "strict",
    "force",
    "strict-openmvs",
    "estimate-segmentation",
    "version",
];

/// All options for the tokenizer.
pub(crate) fn known() -> Vec<Known> {
    let command = DropInArgs::command();
    command
        .get_arguments()
        .filter_map(|arg| {
            let long = arg.get_long()?;
            // OpenMVS 2.4's short name.
            let short = arg.get_short().or_else(|| (long == "mask-path").then_some('m'));
            Some(Known {
                long: long.to_owned(),
                short,
                takes_value: arg.get_action().takes_values(),
                openmvs: !BEYOND.contains(&long),
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_option_is_in_exactly_one_group() {
        let mut listed: Vec<&str> = [GENERIC, DENSIFY, HIDDEN, BEYOND].concat();
        listed.sort_unstable();
        let mut known: Vec<String> = known().into_iter().map(|k| k.long).collect();
        known.sort_unstable();
        assert_eq!(listed, known);
    }
}
