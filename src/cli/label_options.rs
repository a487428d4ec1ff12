//! The options about semantic labels and the labelled outputs, as typed.

use super::values::{boolean, offset};
use clap::{Args, ValueEnum};
use std::path::PathBuf;

/// What labels are and what they decide.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Labels")]
pub(crate) struct LabelInput {
    /// Folder of label maps, one PNG per image: for DSC1.jpg the first of DSC1.png, DSC1.jpg.png, DSC1_l.png,
    /// DSC1.label.png, DSC1.mask.png
    #[arg(long, value_name = "DIR")]
    pub(crate) label_path: Option<PathBuf>,
    /// Classes: a TOML file, or a built-in table: 3dom-facade, cityscapes, ade20k, openmvs-aerial, ids
    #[arg(long, value_name = "TABLE")]
    pub(crate) class_table: Option<String>,
    /// Keep only these classes: names or ids, separated by commas
    #[arg(long, value_name = "A,B", value_delimiter = ',')]
    pub(crate) classes: Vec<String>,
    /// Drop these classes: names or ids, separated by commas
    #[arg(long, value_name = "A,B", value_delimiter = ',')]
    pub(crate) exclude_classes: Vec<String>,
    /// What labels decide in estimation [default: skip, when there are labels]
    #[arg(long, value_name = "MODE", value_enum)]
    pub(crate) label_estimation: Option<EstimationMode>,
    /// What a source view that shows another class costs in estimation, 0 to 2, with --label-estimation aware [default: 0.2]
    #[arg(long, value_name = "COST", allow_negative_numbers = true)]
    pub(crate) label_cost: Option<f32>,
    /// What labels decide in fusion [default: support, when there are labels]
    #[arg(long, value_name = "MODE", value_enum)]
    pub(crate) label_consistency: Option<ConsistencyMode>,
    /// Width in pixels of the band along class borders whose labels decide nothing
    #[arg(long, value_name = "PIXELS", default_value_t = 0)]
    pub(crate) label_border: u32,
    /// Whose labels a point's label is voted from [default: all, when there are labels]
    #[arg(long, value_name = "WHOSE", value_enum)]
    pub(crate) label_votes: Option<VotersMode>,
    /// Let the K nearest points on the same surface vote on the label of each point once more; 0 = no
    #[arg(long, value_name = "K", default_value_t = 0)]
    pub(crate) label_smooth: u32,
    /// Whether the filter across views compares pixels of one class only [default: off; on with --label-estimation aware]
    #[arg(long, value_name = "WHETHER", value_enum)]
    pub(crate) label_filter: Option<OnOff>,
    /// A view without a label map
    #[arg(long, value_name = "WHAT", value_enum, default_value_t = WhenMissing::Error)]
    pub(crate) missing_labels: WhenMissing,
    /// A colour or id that the class table does not hold
    #[arg(long, value_name = "WHAT", value_enum, default_value_t = WhenMissing::Error)]
    pub(crate) unknown_label: WhenMissing,
}

/// The forms of the clouds that are written.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Output")]
pub(crate) struct CloudForms {
    /// Also write one cloud per class: OUT.<class>.ply
    #[arg(long)]
    pub(crate) split_by_class: bool,
    /// Also write the cloud in the colours of its classes: OUT.labels.ply
    #[arg(long)]
    pub(crate) color_by_label: bool,
    /// What a PLY cloud holds of every point besides its label [default: plain in semvs, openmvs in
    /// DensifyPointCloud]
    #[arg(long, value_name = "LAYOUT", value_enum)]
    pub(crate) ply_layout: Option<PlyLayout>,
    /// Write PLY clouds with 64-bit coordinates
    #[arg(long)]
    pub(crate) ply_doubles: bool,
    /// Add this to the coordinates of clouds that have the digits for it (.las, .laz, --ply-doubles), such as
    /// 500000,5200000,0 [default: where the scene's transform says]
    #[arg(long, value_name = "X,Y,Z", value_parser = offset, allow_hyphen_values = true)]
    pub(crate) offset: Option<[f64; 3]>,
    /// Normals in .las and .laz clouds, as extra bytes
    #[arg(long, value_name = "0|1", default_value = "1", value_parser = boolean, action = clap::ArgAction::Set)]
    pub(crate) las_normals: bool,
}

/// What is written besides the scene, and how.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Output")]
pub(crate) struct LabelOutput {
    #[command(flatten)]
    pub(crate) clouds: CloudForms,
    /// Write a summary of the run as JSON
    #[arg(long, value_name = "FILE")]
    pub(crate) report: Option<PathBuf>,
}

/// Both groups.
#[derive(Clone, Debug, Args)]
pub(crate) struct LabelOptions {
    #[command(flatten)]
    pub(crate) input: LabelInput,
    #[command(flatten)]
    pub(crate) output: LabelOutput,
}

/// `--label-estimation`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum EstimationMode {
    /// nothing: every pixel is estimated
    Off,
    /// pixels of unwanted classes are not estimated
    Skip,
    /// that, and depths do not spread across class borders
    Aware,
}

/// `--label-consistency`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum ConsistencyMode {
    /// nothing; points still get the label that most of their pixels have
    Off,
    /// a pixel of another class does not support a point
    Support,
    /// a pixel of another class rejects the point
    Strict,
}

/// `--label-votes`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum VotersMode {
    /// of all views that see the surface
    All,
    /// of the pixels merged into the point
    Merged,
}

/// `--label-filter`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum OnOff {
    /// yes
    On,
    /// no
    Off,
}

/// `--missing-labels`, `--unknown-label`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum WhenMissing {
    /// stop with a message
    Error,
    /// counts as unlabelled
    Void,
}

/// `--ply-layout`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum PlyLayout {
    /// position, colour, normal: opens everywhere
    Plain,
    /// and lists of views and weights, as OpenMVS's other programs need them
    Openmvs,
    /// the columns of OpenDroneMap's point filter: with the number of views, without label
    Odm,
}
