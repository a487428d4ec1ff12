//! The command lines of `semvs report` and `semvs preview`, as typed.

use super::label_options::WhenMissing;
use super::values::range;
use clap::Args;
use std::path::PathBuf;

/// Write one HTML page about a run: depth maps, cloud, view graph, classes, times
///
/// The page holds everything it shows and asks the network for nothing. Scene, cloud, depth maps and the summary of the run
/// (--report) are found in the folder; what is elsewhere can be named.
#[derive(Clone, Debug, Args)]
#[command(after_help = REPORT_EXAMPLES)]
pub(crate) struct ReportArgs {
    /// Folder with the results of a run
    #[arg(value_name = "DIR")]
    pub(crate) folder: PathBuf,
    /// Page to write [default: DIR/report.html]
    #[arg(short, long, value_name = "FILE.html")]
    pub(crate) output: Option<PathBuf>,
    /// Scene [default: the one in the folder]
    #[arg(long, value_name = "SCENE.mvs")]
    pub(crate) scene: Option<PathBuf>,
    /// Cloud [default: the one named like the scene, else the only one in the folder]
    #[arg(long, value_name = "CLOUD.ply")]
    pub(crate) cloud: Option<PathBuf>,
    /// Folder of the depth maps [default: DIR]
    #[arg(long, value_name = "DIR")]
    pub(crate) depth_maps: Option<PathBuf>,
    /// Folder of label maps [default: that of the run, if its summary is there]
    #[arg(long, value_name = "DIR")]
    pub(crate) label_path: Option<PathBuf>,
    /// Classes: a TOML file, or a built-in table: 3dom-facade, cityscapes, ade20k, openmvs-aerial, ids
    #[arg(long, value_name = "TABLE")]
    pub(crate) class_table: Option<String>,
    /// Most points of the 3D view, up to 2000000
    #[arg(long, value_name = "N", default_value_t = crate::pipeline::DEFAULT_POINTS)]
    pub(crate) points: usize,
    /// First place of images that the scene names; the second is its folder [default: the current folder]
    #[arg(short = 'w', long, value_name = "DIR")]
    pub(crate) working_folder: Option<PathBuf>,
    /// Number of threads; 0 = all that the machine has
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) max_threads: u32,
}

const REPORT_EXAMPLES: &str = "\
Examples:
  semvs report out
      writes out/report.html: open it in a browser
  semvs report out -o page.html --points 2000000
  semvs report out --scene scene.mvs --depth-maps depthmaps --label-path labels \\
      --class-table 3dom-facade";

/// `--report-html` of the commands that make a cloud.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Output")]
pub(crate) struct PageOption {
    /// Write a page about the run, with pictures and a 3D view, to be opened in a browser; see semvs report
    #[arg(long, value_name = "FILE.html")]
    pub(crate) report_html: Option<PathBuf>,
}

/// Draw depth maps as PNG pictures: depths, normals, confidences, labels over the photograph
///
/// Writes NAME.depth.png, NAME.normal.png, NAME.confidence.png and, with label maps, NAME.labels.png for every depth map.
/// Colours mean the same in all pictures of a call; depth-scale.png shows the scale of the depths. Near is bright; normals are
/// red to the right, green up, blue towards the camera; what has no depth is grey.
#[derive(Clone, Debug, Args)]
#[command(after_help = PREVIEW_EXAMPLES)]
pub(crate) struct PreviewArgs {
    /// Depth map, or folder of depth maps
    #[arg(value_name = "FILE.dmap|DIR")]
    pub(crate) maps: PathBuf,
    /// Folder to write [default: that of the depth maps]
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: Option<PathBuf>,
    /// Depths of the two ends of the scale [default: those of the depth maps, but for outliers]
    #[arg(long, value_name = "MIN,MAX", value_parser = range, allow_hyphen_values = true)]
    pub(crate) depth_range: Option<(f32, f32)>,
    /// Folder of label maps
    #[arg(long, value_name = "DIR")]
    pub(crate) label_path: Option<PathBuf>,
    /// Classes: a TOML file, or a built-in table: 3dom-facade, cityscapes, ade20k, openmvs-aerial, ids
    #[arg(long, value_name = "TABLE")]
    pub(crate) class_table: Option<String>,
    /// A view without a label map
    #[arg(long, value_name = "WHAT", value_enum, default_value_t = WhenMissing::Error)]
    pub(crate) missing_labels: WhenMissing,
    /// First place of the images that the depth maps name; the second is their folder [default: their folder]
    #[arg(short = 'w', long, value_name = "DIR")]
    pub(crate) working_folder: Option<PathBuf>,
    /// Number of threads; 0 = all that the machine has
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) max_threads: u32,
}

const PREVIEW_EXAMPLES: &str = "\
Examples:
  semvs preview depthmaps -o pictures
  semvs preview depthmaps/depth0003.dmap --depth-range 4,9
  semvs preview depthmaps -o pictures --label-path labels --class-table 3dom-facade";
