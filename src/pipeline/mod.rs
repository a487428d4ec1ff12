//! The jobs of the programs. The only module that knows the order of the stages.

mod actions;
pub mod compare;
mod convert;
mod convert_cloud;
mod densify;
mod diagnostics;
mod estimate;
mod evaluate;
mod export;
mod export_colmap;
mod export_rasters;
#[cfg(test)]
mod fault_tests;
mod filter;
mod filter_job;
mod finished;
mod forecast;
mod fuse;
mod fusing;
mod images;
mod import;
mod ingredients;
mod inputs;
pub mod inspect;
mod job;
mod label_votes;
mod labels_check;
mod labels_render;
mod masks;
mod memory_plan;
mod ordered_steps;
mod outputs;
mod page_parts;
mod prepare;
mod preview;
mod problem;
mod record;
mod report_page;
mod resume;
mod schedule;
mod skip;
mod sparse;
mod split;
mod tower;

pub use actions::{export_neighbors, export_roi, import_roi, is_project, is_readable};
pub use convert::{ConvertJob, convert};
pub use convert_cloud::{ConvertCloudJob, convert_cloud};
pub use densify::{DEPTH_MAP, densify};
pub use evaluate::{EvaluateJob, evaluate};
pub use export::{ExportSceneJob, SceneExport, export_scene};
pub use export_colmap::{ExportColmapJob, export_colmap};
pub use export_rasters::{ExportRastersJob, Planes, export_rasters};
pub use filter_job::{AcrossViews, FilterJob};
pub use finished::{CloudJob, CloudWork, finished_cloud};
pub use fuse::fuse;
pub use import::{ImportDepthsJob, ImportSceneJob, import_depths, import_scene};
pub use job::{
    DensifyJob, DepthMapsJob, FuseJob, LabelJob, MaskJob, Outputs, RoiJob, SceneArchive, SceneJob, TowerJob,
    TowerWork,
};
pub use labels_check::{CheckLabelsJob, check_labels};
pub use labels_render::{RenderLabelsJob, RenderedView, render_label_maps};
pub use preview::{PreviewJob, Previews, preview};
pub use report_page::{DEFAULT_POINTS, MOST_POINTS, ReportPageJob, WrittenPage, report_page};
pub use split::{SplitJob, split_scene};
