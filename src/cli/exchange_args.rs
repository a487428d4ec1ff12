//! The command lines of `semvs import` and `semvs export`, as typed.

use super::semvs_args::ColmapPass;
use super::values::boolean;
use clap::{ArgAction, Args, ValueEnum};
use std::path::PathBuf;

/// Turn what other programs made into scenes (.mvs) and depth maps (.dmap)
///
/// A COLMAP folder becomes a scene. With --scene, a folder of your own depths (PFM, NPY, 16-bit PNG) becomes depth
/// maps of that scene's images, ready for semvs fuse and OpenMVS. Depths are found by name: for images/a/DSC1.jpg
/// images/a/DSC1.pfm, a/DSC1.pfm or DSC1.pfm, then .npy, then .png. Confidence stays unknown.
#[derive(Clone, Debug, Args)]
#[command(after_help = IMPORT_EXAMPLES)]
pub(crate) struct ImportArgs {
    /// COLMAP's undistorted workspace or sparse model (PINHOLE cameras), or a folder of depths
    #[arg(value_name = "FOLDER")]
    pub(crate) input: PathBuf,
    /// Scene to write (.mvs); for depths the folder of the depth maps
    #[arg(short, long, visible_alias = "output-file", value_name = "OUT")]
    pub(crate) output: PathBuf,
    /// The folder holds depths of this scene's images: a .mvs file or a COLMAP workspace
    #[arg(long, value_name = "SCENE", conflicts_with_all = ["image_path", "mvs_version", "archive_type", "maps", "fused"])]
    pub(crate) scene: Option<PathBuf>,
    /// Folder of the undistorted images [default: images/ in or beside the model]
    #[arg(long, value_name = "DIR")]
    pub(crate) image_path: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) archive: ArchiveArgs,
    /// Also write COLMAP's depth and normal maps of this pass as depthNNNN.dmap beside the scene
    #[arg(long, value_name = "PASS", value_enum)]
    pub(crate) maps: Option<ColmapPass>,
    /// Also write COLMAP's fused.ply with the views of fused.ply.vis beside the scene: OUT.ply
    #[arg(long)]
    pub(crate) fused: bool,
    /// Values of PNG depths are depth times this; 1000: millimetres in a scene of metres
    #[arg(long, value_name = "S", default_value_t = 1000.0, requires = "scene")]
    pub(crate) depth_scale: f32,
    /// Compute normals from the depths
    #[arg(long, value_name = "0|1", default_value = "1", value_parser = boolean, action = ArgAction::Set, requires = "scene")]
    pub(crate) normals: bool,
    /// Folder that image names in --scene are relative to [default: the current folder, then the scene's]
    #[arg(short = 'w', long, value_name = "DIR", requires = "scene")]
    pub(crate) working_folder: Option<PathBuf>,
}

const IMPORT_EXAMPLES: &str = "\
Examples:
  semvs import colmap/dense -o scene.mvs
      COLMAP to OpenMVS; semvs densify takes colmap/dense as it is
  semvs import colmap/dense -o mvs/scene.mvs --maps geometric
      with its depth maps, as mvs/depthNNNN.dmap
  semvs import my_depths --scene scene.mvs -o depthmaps
      depths from another program or a network, then: semvs fuse scene.mvs --depth-maps depthmaps";

/// `--mvs-version`, `--archive-type`.
#[derive(Clone, Copy, Debug, Args)]
pub(crate) struct ArchiveArgs {
    /// Write an interface archive of this version, 0 to 7; older ones hold less, which a warning names
    #[arg(long, value_name = "V", value_parser = clap::value_parser!(u32).range(0..=7))]
    pub(crate) mvs_version: Option<u32>,
    /// Write a project archive: 0 = text, 1 = binary, 2 = zlib, 3 = zstd; -1 = interface archive
    #[arg(long, value_name = "TYPE", allow_negative_numbers = true, conflicts_with = "mvs_version",
        value_parser = clap::value_parser!(i32).range(-1..=3))]
    pub(crate) archive_type: Option<i32>,
}

/// Turn scenes and depth maps into what other programs read
///
/// What is written depends on --to. Inputs are never overwritten.
#[derive(Clone, Debug, Args)]
#[command(after_help = EXPORT_EXAMPLES)]
pub(crate) struct ExportArgs {
    /// A scene (.mvs or COLMAP workspace); for pfm, npy and png depth maps (.dmap)
    #[arg(value_name = "INPUT", required = true)]
    pub(crate) inputs: Vec<PathBuf>,
    /// What to write
    #[arg(long, value_name = "KIND", value_enum)]
    pub(crate) to: ExportKind,
    /// File to write; for colmap, pfm, npy and png a folder
    #[arg(short, long, visible_alias = "output-file", value_name = "OUT")]
    pub(crate) output: PathBuf,
    /// First place of images named by the scene [default: the current folder]; the second is the scene's folder
    #[arg(short = 'w', long, value_name = "DIR")]
    pub(crate) working_folder: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) archive: ArchiveArgs,
    /// colmap: the sparse model as text
    #[arg(long)]
    pub(crate) text: bool,
    /// colmap: also write these depth maps (depthNNNN.dmap) as those of COLMAP's geometric pass
    #[arg(long, value_name = "DIR")]
    pub(crate) depth_maps: Option<PathBuf>,
    /// colmap: also write this cloud (.ply with view_indices) as fused.ply with fused.ply.vis
    #[arg(short = 'p', long, value_name = "FILE")]
    pub(crate) pointcloud_file: Option<PathBuf>,
    /// colmap: copy the images into OUT/images
    #[arg(long)]
    pub(crate) copy_images: bool,
    /// pfm, npy: which maps; files are NAME.EXT, NAME.normal.EXT, NAME.confidence.EXT for image NAME.jpg
    #[arg(long, value_name = "A,B", value_enum, value_delimiter = ',', default_value = "depth")]
    pub(crate) planes: Vec<Plane>,
    /// png: values are depth times this; 1000: millimetres in a scene of metres
    #[arg(long, value_name = "S", default_value_t = 1000.0)]
    pub(crate) depth_scale: f32,
}

const EXPORT_EXAMPLES: &str = "\
Examples:
  semvs export scene.mvs --to mvs --mvs-version 6 -o old.mvs
      for programs that do not know version 7
  semvs export depthmaps/*.dmap --to npy --planes depth,normal,confidence -o arrays
  semvs export colmap/dense --to colmap --depth-maps colmap/dense/semvs -o colmap/dense
      our depth maps for `colmap stereo_fusion --input_type geometric`
  semvs export scene.mvs --to colmap --copy-images -o workspace
      a scene as a new COLMAP workspace";

/// `--to`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum ExportKind {
    /// a scene file; of the kind of the input, unless --mvs-version or --archive-type says otherwise
    Mvs,
    /// a COLMAP workspace
    Colmap,
    /// the region of interest as text
    Roi,
    /// the neighbours of every image as text, for --view-neighbors-file
    Neighbors,
    /// maps as portable float maps
    Pfm,
    /// maps as NumPy arrays
    Npy,
    /// depths as 16-bit grey PNG
    Png,
}

/// `--planes`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Plane {
    /// along the optical axis; 0 = none
    Depth,
    /// in the camera frame
    Normal,
    /// larger is better
    Confidence,
}
