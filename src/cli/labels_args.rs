//! The command line of `semvs labels`, as typed.

use super::label_options::WhenMissing;
use clap::{Args, Subcommand};
use std::path::PathBuf;

/// Check label maps, or make them from a labelled cloud
#[derive(Clone, Debug, Args)]
#[command(after_help = LABELS_EXAMPLES, arg_required_else_help = true)]
pub(crate) struct LabelsArgs {
    #[command(subcommand)]
    pub(crate) command: LabelsCommand,
}

const LABELS_EXAMPLES: &str = "\
Examples:
  semvs labels check scene.mvs --label-path labels --class-table 3dom-facade
      what is missing or wrong, and which views are at odds with the others
  semvs labels render scene.mvs --cloud cloud.ply -o cleaned
      correct a few label maps, fuse, and get consistent maps for all images";

/// What to do with labels.
#[derive(Clone, Debug, Subcommand)]
pub(crate) enum LabelsCommand {
    Check(CheckLabelsArgs),
    Render(RenderLabelsArgs),
}

/// Find label maps that are missing, of another shape than their image, or hold unknown colours; say what share each
/// class has in each view, and which views are most at odds with the others
///
/// Views are compared by depth maps if there are any, else by the scene's sparse points. Exit code 1 if a label map is
/// missing or cannot be used.
#[derive(Clone, Debug, Args)]
pub(crate) struct CheckLabelsArgs {
    /// Scene: OpenMVS's .mvs, or a COLMAP folder
    #[arg(value_name = "SCENE.mvs")]
    pub(crate) scene: PathBuf,
    /// Folder of label maps [default: those that the scene names, else IMAGE.mask.png beside the images]
    #[arg(long, value_name = "DIR")]
    pub(crate) label_path: Option<PathBuf>,
    /// Classes: a TOML file, or a built-in table: 3dom-facade, cityscapes, ade20k, openmvs-aerial, ids
    #[arg(long, value_name = "TABLE")]
    pub(crate) class_table: Option<String>,
    /// A view without a label map
    #[arg(long, value_name = "WHAT", value_enum, default_value_t = WhenMissing::Error)]
    pub(crate) missing_labels: WhenMissing,
    /// A colour or id that the class table does not hold
    #[arg(long, value_name = "WHAT", value_enum, default_value_t = WhenMissing::Error)]
    pub(crate) unknown_label: WhenMissing,
    /// Folder of depth maps by which views are compared [default: the working folder, if it has any]
    #[arg(long, value_name = "DIR")]
    pub(crate) depth_maps: Option<PathBuf>,
    /// First place of images that the scene names [default: the current folder]
    #[arg(short = 'w', long, value_name = "DIR")]
    pub(crate) working_folder: Option<PathBuf>,
    /// Number of threads; 0 = all that the machine has
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) max_threads: u32,
    /// As JSON
    #[arg(long)]
    pub(crate) json: bool,
}

/// Make a label map for every image from a labelled cloud: the class of the nearest surface, void where there is none
///
/// The maps are named IMAGE.png, have the size of the images, and can be given back with --label-path.
#[derive(Clone, Debug, Args)]
pub(crate) struct RenderLabelsArgs {
    /// Scene: OpenMVS's .mvs, or a COLMAP folder
    #[arg(value_name = "SCENE.mvs")]
    pub(crate) scene: PathBuf,
    /// The labelled cloud (.ply)
    #[arg(long, value_name = "CLOUD.ply")]
    pub(crate) cloud: PathBuf,
    /// Folder to write
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: PathBuf,
    /// Classes and their colours [default: those that the cloud names]
    #[arg(long, value_name = "TABLE")]
    pub(crate) class_table: Option<String>,
    /// Write ids as grey values, not colours
    #[arg(long)]
    pub(crate) ids: bool,
    /// First place of images that the scene names [default: the current folder]
    #[arg(short = 'w', long, value_name = "DIR")]
    pub(crate) working_folder: Option<PathBuf>,
    /// Number of threads; 0 = all that the machine has
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) max_threads: u32,
}
