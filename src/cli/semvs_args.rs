//! The command line of `semvs`, as typed.

use super::exchange_args::{ExportArgs, ImportArgs};
use super::install_args::{CompletionsArgs, DemoArgs, ManArgs};
use super::label_options::{CloudForms, LabelInput};
use super::labels_args::LabelsArgs;
use super::options::SharedOptions;
use super::page_args::{PageOption, PreviewArgs, ReportArgs};
use crate::store::colmap::Pass;
use clap::{ArgAction, Args, Parser, Subcommand, ValueEnum};
use std::path::PathBuf;

/// Oriented photographs to dense, semantically labelled point clouds.
#[derive(Clone, Debug, Parser)]
#[command(name = "semvs", version, after_help = EXAMPLES)]
pub(crate) struct SemvsArgs {
    #[command(subcommand)]
    pub(crate) command: Command,
    /// Say more on stderr; twice for everything
    #[arg(short, long, global = true, action = ArgAction::Count, help_heading = "Messages")]
    pub(crate) verbose: u8,
    /// Say only warnings and errors; twice for errors alone
    #[arg(
        short,
        long,
        global = true,
        action = ArgAction::Count,
        conflicts_with = "verbose",
        help_heading = "Messages"
    )]
    pub(crate) quiet: u8,
}

const EXAMPLES: &str = "\
Examples:
  semvs densify scene.mvs -o cloud.ply -w depthmaps
      photographs to a dense cloud; the depth maps stay in depthmaps/
  semvs densify scene.mvs -o cloud.ply --label-path labels --class-table 3dom-facade \\
      --exclude-classes sky,obstacle --split-by-class
      the same with a class for every point, without sky and obstacles, and one cloud per class
  semvs fuse scene.mvs --depth-maps depthmaps -o cloud.ply --number-views-fuse 2
      fuse depth maps that exist, from here or from OpenMVS
  semvs densify colmap/dense
      the same from COLMAP's undistorted workspace, without conversion
  semvs report out
      a page about the results in out/, with pictures and a 3D view
  semvs inspect depthmaps/depth0000.dmap
      what is in a file";

/// What to do.
#[derive(Clone, Debug, Subcommand)]
pub(crate) enum Command {
    Densify(Box<DensifyArgs>),
    Fuse(Box<FuseArgs>),
    Convert(ConvertArgs),
    Import(ImportArgs),
    Export(ExportArgs),
    Inspect(InspectArgs),
    Evaluate(EvaluateArgs),
    Compare(CompareArgs),
    Labels(LabelsArgs),
    Report(ReportArgs),
    Preview(PreviewArgs),
    Demo(DemoArgs),
    Completions(CompletionsArgs),
    Man(ManArgs),
}

/// Make a dense cloud from a scene: depth maps, filters, fusion
///
/// Writes the cloud, the scene beside it (OUT.mvs), and one depth map per image into the working folder.
#[derive(Clone, Debug, Args)]
#[command(after_help = DENSIFY_EXAMPLES)]
pub(crate) struct DensifyArgs {
    /// Scene with cameras, image names and sparse points: OpenMVS's .mvs, or the folder of COLMAP's
    /// image_undistorter
    #[arg(value_name = "SCENE.mvs")]
    pub(crate) scene: PathBuf,
    /// Cloud to write, .ply, .las or .laz [default: SCENE_dense.ply beside the scene; semvs/dense.ply in a COLMAP folder, with the
    /// depth maps]
    #[arg(short, long, visible_alias = "output-file", value_name = "OUT", help_heading = "Output")]
    pub(crate) output: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) page: PageOption,
    #[command(flatten)]
    pub(crate) shared: SharedOptions,
}

const DENSIFY_EXAMPLES: &str = "\
Examples:
  semvs densify scene.mvs -o out/cloud.ply -w out
      everything into the folder out/
  semvs densify scene.mvs -o draft.ply --resolution-level 2 --number-views 3 --geometric-iters 1
      a quick look
  semvs densify colmap/dense
      COLMAP's undistorted workspace; everything goes into colmap/dense/semvs
  semvs densify scene.mvs -o cloud.ply --label-path labels --class-table classes.toml
      with classes of your own: classes.toml has entries [[class]] with id, name and color";

/// Fuse depth maps that exist into a cloud, without estimating anything
///
/// Takes the depth maps of semvs and of OpenMVS (depthNNNN.dmap), and those that COLMAP left in its workspace, which have
/// no confidence: all their depths count alike, but for their distance. The depth maps are only read.
#[derive(Clone, Debug, Args)]
#[command(
    after_help = FUSE_EXAMPLES,
    mut_args(|arg| if NOT_FOR_FUSE.contains(&arg.get_id().as_str()) { arg.hide(true) } else { arg })
)]
pub(crate) struct FuseArgs {
    /// Scene that the depth maps belong to: OpenMVS's .mvs, or the folder of COLMAP's dense stage
    #[arg(value_name = "SCENE.mvs")]
    pub(crate) scene: PathBuf,
    /// Folder of the depth maps [default: the working folder; of a COLMAP folder its own maps]
    #[arg(long, value_name = "DIR")]
    pub(crate) depth_maps: Option<PathBuf>,
    /// Which maps of a COLMAP folder [default: geometric, if there are any]
    #[arg(long, value_name = "PASS", value_enum, conflicts_with = "depth_maps")]
    pub(crate) maps: Option<ColmapPass>,
    /// Cloud to write, .ply, .las or .laz [default: SCENE_dense.ply beside the scene; semvs/dense.ply in a COLMAP folder]
    #[arg(short, long, visible_alias = "output-file", value_name = "OUT", help_heading = "Output")]
    pub(crate) output: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) page: PageOption,
    #[command(flatten)]
    pub(crate) shared: SharedOptions,
}

/// `--maps`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum ColmapPass {
    /// of the final pass, which compares depth maps with each other
    Geometric,
    /// of the first pass
    Photometric,
}

impl From<ColmapPass> for Pass {
    fn from(typed: ColmapPass) -> Self {
        match typed {
            ColmapPass::Geometric => Pass::Geometric,
            ColmapPass::Photometric => Pass::Photometric,
        }
    }
}

/// Shared options that have no effect when nothing is estimated; taken all the same, so that a command line can be
/// reused.
const NOT_FOR_FUSE: &[&str] = &[
    "number_views",
    "quality",
    "sub_resolution_levels",
    "iters",
    "geometric_iters",
    "fusion_mode",
    "postprocess_dmaps",
    "label_filter",
    "label_estimation",
    "label_cost",
    "filter",
    "remove_dmaps",
    "force",
];

const FUSE_EXAMPLES: &str = "\
Examples:
  semvs fuse scene.mvs --depth-maps depthmaps -o cloud.ply
  semvs fuse colmap/dense --maps geometric -o cloud.ply --label-path labels --class-table cityscapes
      COLMAP's depth maps, made on a GPU, to a labelled cloud
  semvs fuse scene.mvs --depth-maps depthmaps -o facade.ply --label-path labels \\
      --class-table 3dom-facade --classes building,window,door --label-consistency strict";

/// Turn depth maps into a cloud, every depth a point, without fusion; or a cloud into other formats
#[derive(Clone, Debug, Args)]
#[command(
    after_help = CONVERT_EXAMPLES,
    mut_args(|arg| if NOT_FOR_CONVERT.contains(&arg.get_id().as_str()) { arg.hide(true) } else { arg })
)]
pub(crate) struct ConvertArgs {
    /// Depth maps (.dmap), or one cloud (.ply)
    #[arg(value_name = "FILE", required = true)]
    pub(crate) depth_maps: Vec<PathBuf>,
    /// Cloud to write, .ply, .las or .laz
    #[arg(short, long, visible_alias = "output-file", value_name = "OUT")]
    pub(crate) output: PathBuf,
    /// Folder that the image names in the depth maps are relative to [default: the folder of each depth map,
    /// then the current folder]
    #[arg(short = 'w', long, value_name = "DIR")]
    pub(crate) working_folder: Option<PathBuf>,
    /// Pixels with this value in an image's mask become no points; negative = no masks
    #[arg(long, value_name = "VALUE", default_value_t = -1, allow_negative_numbers = true)]
    pub(crate) ignore_mask_label: i32,
    /// Folder of masks named like the images: DSC1.jpg -> DSC1.mask.png
    #[arg(long, value_name = "DIR")]
    pub(crate) mask_path: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) labels: LabelInput,
    #[command(flatten)]
    pub(crate) clouds: CloudForms,
}

/// Label options that say how labels restrict fusion; refused where nothing is fused.
const NOT_FOR_CONVERT: &[&str] = &[
    "label_estimation",
    "label_cost",
    "label_consistency",
    "label_border",
    "label_votes",
    "label_smooth",
    "label_filter",
];

const CONVERT_EXAMPLES: &str = "\
Examples:
  semvs convert depthmaps/depth0000.dmap -o view0.ply
  semvs convert depthmaps/*.dmap -o all.ply --label-path labels --class-table 3dom-facade
  semvs convert cloud.ply -o cloud.laz --class-table 3dom-facade --offset 500000,5200000,0
      a labelled cloud as LAZ, with the classification codes of the table, in its place in the world";

/// Say what a file holds: scene, depth map, cloud, class table, label map
#[derive(Clone, Debug, Args)]
#[command(after_help = INSPECT_EXAMPLES)]
pub(crate) struct InspectArgs {
    /// The file
    #[arg(value_name = "FILE")]
    pub(crate) file: PathBuf,
    /// As JSON
    #[arg(long)]
    pub(crate) json: bool,
}

const INSPECT_EXAMPLES: &str = "\
Examples:
  semvs inspect scene.mvs
  semvs inspect depthmaps/depth0000.dmap --json";

/// Hold a cloud against the true surface: accuracy, completeness, F1, gross errors, labels
#[derive(Clone, Debug, Args)]
#[command(after_help = EVALUATE_EXAMPLES)]
pub(crate) struct EvaluateArgs {
    /// Cloud to judge (.ply)
    #[arg(value_name = "CLOUD.ply")]
    pub(crate) cloud: PathBuf,
    /// Points of the true surface (.ply); labels are judged when both clouds have them
    #[arg(long, value_name = "TRUTH.ply")]
    pub(crate) truth: PathBuf,
    /// Distances at which a point counts as right, in scene units
    #[arg(
        long,
        value_name = "D",
        num_args = 1..,
        value_delimiter = ',',
        required = true,
        allow_negative_numbers = true
    )]
    pub(crate) thresholds: Vec<f64>,
    /// Both clouds are thinned to one point per cube of this edge; 0 = not at all [default: half the smallest
    /// threshold]
    #[arg(long, value_name = "EDGE", allow_negative_numbers = true)]
    pub(crate) voxel: Option<f64>,
    /// Ids of the true classes that count: a point on any other class is wrong
    #[arg(long, value_name = "ID", num_args = 1.., value_delimiter = ',')]
    pub(crate) truth_classes: Vec<u16>,
    /// Ids of the cloud's classes that are judged
    #[arg(long, value_name = "ID", num_args = 1.., value_delimiter = ',')]
    pub(crate) cloud_classes: Vec<u16>,
    /// Ids of true classes left out of completeness and IoU
    #[arg(long, value_name = "ID", num_args = 1.., value_delimiter = ',')]
    pub(crate) ignore_truth_labels: Vec<u16>,
    /// Also accuracy and completeness of every true class
    #[arg(long)]
    pub(crate) per_class: bool,
    /// Draw how right labels are by their label_confidence
    #[arg(long, value_name = "FILE.png")]
    pub(crate) reliability_diagram: Option<PathBuf>,
    /// As JSON
    #[arg(long)]
    pub(crate) json: bool,
}

const EVALUATE_EXAMPLES: &str = "\
Example:
  semvs evaluate cloud.ply --truth truth.ply --thresholds 0.02 0.05 0.1";

/// Say how two results differ: scenes, depth maps or folders of them, clouds
///
/// A is the result in question, B what it should be. Folders hold depth maps, which are paired by file name. Files may
/// be compressed (.zst). Reported are counts, shares and percentiles of the differences, and the first element that
/// differs.
///
/// Exit code: 0 if the two can be compared and, with --expect, all figures are within their limits; 1 if one is
/// outside; 2 if the two cannot be compared or the expect file is at fault.
#[derive(Clone, Debug, Args)]
#[command(after_help = COMPARE_EXAMPLES)]
pub(crate) struct CompareArgs {
    /// Scene (.mvs), depth map (.dmap), folder of depth maps, or cloud (.ply)
    #[arg(value_name = "A")]
    pub(crate) a: PathBuf,
    /// What A is compared with, of the same kind
    #[arg(value_name = "B")]
    pub(crate) b: PathBuf,
    /// Limits on the figures, which decide the exit code; see docs/regression-testing.md
    #[arg(long, value_name = "FILE.toml")]
    pub(crate) expect: Option<PathBuf>,
    /// Scene of the clouds: distances are reported relative to depth too
    #[arg(long, value_name = "SCENE.mvs")]
    pub(crate) scene: Option<PathBuf>,
    /// Write a page to be opened in a browser: pictures of the differences, histograms, limits
    #[arg(long, value_name = "FILE.html")]
    pub(crate) html: Option<PathBuf>,
    /// As JSON
    #[arg(long)]
    pub(crate) json: bool,
}

const COMPARE_EXAMPLES: &str = "\
Examples:
  semvs compare depthmaps reference/depthmaps --expect depth-maps.toml
  semvs compare depthmaps reference/depthmaps --html differences.html
  semvs compare cloud.ply reference/cloud.ply.zst --scene scene.mvs --json
  semvs compare scene_dense.mvs reference/scene_dense.mvs";
