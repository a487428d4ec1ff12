//! The options that `semvs densify`, `semvs fuse` and `DensifyPointCloud` share, as typed.
//! Names, meanings and defaults are those of OpenMVS 2.3.0.

use super::values::{boolean, bytes};
use crate::fusion::Support;
use crate::stereo::Quality;
use clap::{Args, ValueEnum};
use std::path::PathBuf;

/// Where to work and how hard.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "General")]
pub(crate) struct RunOptions {
    /// Folder of the depth maps, and the first place where images named by the scene are looked for; the
    /// second is the folder of the scene [default: the current folder]
    #[arg(short = 'w', long, value_name = "DIR")]
    pub(crate) working_folder: Option<PathBuf>,
    /// Number of threads; 0 = all that the machine has. Results do not depend on it
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) max_threads: u32,
    /// Most memory that may be used, 4G or 512M; fewer images are worked on at a time where it is short [default: 70 % of what the
    /// machine, or the control group, has]
    #[arg(long, value_name = "SIZE", value_parser = bytes)]
    pub(crate) max_memory: Option<u64>,
    /// Stop when an image or a depth map cannot be used, instead of going on without it
    #[arg(long)]
    pub(crate) strict: bool,
    /// Make all depth maps anew, also those of an earlier run with the same input and options
    #[arg(long)]
    pub(crate) force: bool,
}

/// Which images, at which size, with which neighbours.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Images and views")]
pub(crate) struct ImageOptions {
    /// Halve the images this many times before estimation
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub(crate) resolution_level: u32,
    /// Longest image side after scaling, in pixels
    #[arg(long, value_name = "PIXELS", default_value_t = 2560)]
    pub(crate) max_resolution: u32,
    /// Do not halve below this longest side, in pixels
    #[arg(long, value_name = "PIXELS", default_value_t = 640)]
    pub(crate) min_resolution: u32,
    /// Number of neighbour images each image is matched with; 0 = all good ones (at most 12),
    /// 1 = one each, chosen for all images together
    #[arg(long, value_name = "N", default_value_t = 5)]
    pub(crate) number_views: u32,
    /// Text file "ID n0 n1 ..." per line; replaces the neighbours of these images
    #[arg(long, value_name = "FILE")]
    pub(crate) view_neighbors_file: Option<PathBuf>,
    /// PLY with view lists; replaces the scene's sparse points
    #[arg(short = 'p', long, value_name = "FILE")]
    pub(crate) pointcloud_file: Option<PathBuf>,
    /// Pixels with this value in an image's mask get no depth; negative = no masks
    #[arg(long, value_name = "VALUE", default_value_t = -1, allow_negative_numbers = true)]
    pub(crate) ignore_mask_label: i32,
    /// Folder of masks named like the images: DSC1.jpg -> DSC1.mask.png
    #[arg(long, value_name = "DIR")]
    pub(crate) mask_path: Option<PathBuf>,
}

/// How depths are estimated.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Depth estimation")]
pub(crate) struct EstimationOptions {
    /// How much is tried for every depth [default: normal in semvs, high in DensifyPointCloud]
    #[arg(long, value_name = "QUALITY", value_enum)]
    pub(crate) quality: Option<QualityName>,
    /// Coarser levels that estimation starts from
    #[arg(long, value_name = "N", default_value_t = 2)]
    pub(crate) sub_resolution_levels: u32,
    /// Iterations per level
    #[arg(long, value_name = "N", default_value_t = 3)]
    pub(crate) iters: u32,
    /// Passes that make the depth maps agree with each other; 0 = also keep the depth maps that exist
    #[arg(long, value_name = "N", default_value_t = 2)]
    pub(crate) geometric_iters: u32,
    /// What to do: 0 = everything, 1 = depth maps only
    #[arg(long, value_name = "MODE", default_value_t = 0, allow_negative_numbers = true)]
    pub(crate) fusion_mode: i32,
    /// File of further parameters, "Title = value" per line; written with the defaults when it does not exist
    #[arg(long, value_name = "FILE")]
    pub(crate) dense_config_file: Option<PathBuf>,
}

/// How depth maps are cleaned and fused.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Filtering and fusion")]
pub(crate) struct FusionOptions {
    /// Filters on the depth maps, a sum of: 1 = remove speckles, 2 = fill gaps, 4 = filter across views [default: 4
    /// with the unbiased filter, 7 with OpenMVS's]
    #[arg(long, value_name = "BITS")]
    pub(crate) postprocess_dmaps: Option<u32>,
    /// The filter across views [default: unbiased in semvs, openmvs in DensifyPointCloud]
    #[arg(long, value_name = "FILTER", value_enum)]
    pub(crate) filter: Option<FilterKind>,
    /// Fewest images that must agree on a point (unless given, 2 in semvs where they must agree on its class, too); below 2 every
    /// depth becomes a point
    #[arg(long, value_name = "N", default_value_t = 3)]
    pub(crate) number_views_fuse: u32,
    /// Depths of other images that count towards a point [default: all in semvs, unclaimed in DensifyPointCloud]
    #[arg(long, value_name = "DEPTHS", value_enum)]
    pub(crate) support: Option<SupportKind>,
    /// Colours: 0 = none, 1 = of the nearest image after fusion, 2 = averaged during fusion
    #[arg(long, value_name = "MODE", default_value_t = 2)]
    pub(crate) estimate_colors: u32,
    /// Normals: 0 = none, 1 = of the points around after fusion, 2 = averaged during fusion
    #[arg(long, value_name = "MODE", default_value_t = 2)]
    pub(crate) estimate_normals: u32,
    /// Delete the depth maps at the end
    #[arg(long, value_name = "0|1", default_value = "0", value_parser = boolean, action = clap::ArgAction::Set)]
    pub(crate) remove_dmaps: bool,
}

/// `--filter`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum QualityName {
    /// for a look: about two thirds of the normal time
    Draft,
    /// depth maps that match OpenMVS's
    Normal,
    /// for the last details: about 1.5 times the normal time
    High,
}

impl From<QualityName> for Quality {
    fn from(name: QualityName) -> Self {
        match name {
            QualityName::Draft => Quality::Draft,
            QualityName::Normal => Quality::Normal,
            QualityName::High => Quality::High,
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum FilterKind {
    /// OpenMVS's: depths move towards those of the neighbours
    Openmvs,
    /// depths stay as they are or are dropped
    Unbiased,
}

/// `--support`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum SupportKind {
    /// all that agree: a depth makes one point and can support others
    All,
    /// OpenMVS's: those that no other point has claimed
    Unclaimed,
}

impl From<SupportKind> for Support {
    fn from(kind: SupportKind) -> Self {
        match kind {
            SupportKind::All => Support::All,
            SupportKind::Unclaimed => Support::Unclaimed,
        }
    }
}

/// What part of the scene is wanted.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Region of interest")]
pub(crate) struct RoiOptions {
    /// Region of interest from the cameras, for scenes without one: 0 = no, 1 = always, 2 = if the cameras
    /// surround an object
    #[arg(long, value_name = "MODE", default_value_t = 2)]
    pub(crate) estimate_roi: i32,
    /// Border of the region: above 0 its size is multiplied by this, below 0 its half size grows by the amount
    #[arg(long, value_name = "B", default_value_t = 0.0, allow_negative_numbers = true)]
    pub(crate) roi_border: f32,
    /// Points made up for cameras that climb a tower: 0 = none, 1 = replace the sparse points, 2 = add to them, 3 = find
    /// neighbours by them, 4 = both; below 0 the cameras are not asked
    #[arg(long, value_name = "MODE", default_value_t = 4, allow_negative_numbers = true)]
    pub(crate) tower_mode: i32,
    /// Drop the points outside the region
    #[arg(long, value_name = "0|1", default_value = "1", value_parser = boolean, action = clap::ArgAction::Set)]
    pub(crate) crop_to_roi: bool,
}

/// The whole shared set.
#[derive(Clone, Debug, Args)]
pub(crate) struct SharedOptions {
    #[command(flatten)]
    pub(crate) images: ImageOptions,
    #[command(flatten)]
    pub(crate) estimation: EstimationOptions,
    #[command(flatten)]
    pub(crate) fusion: FusionOptions,
    #[command(flatten)]
    pub(crate) roi: RoiOptions,
    #[command(flatten)]
    pub(crate) labels: super::label_options::LabelOptions,
    #[command(flatten)]
    pub(crate) run: RunOptions,
}
