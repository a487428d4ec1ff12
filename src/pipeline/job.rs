//! Jobs: what the programs ask the pipeline to do, with every value resolved.

use super::filter_job::FilterJob;
use crate::error::{Error, Result};
use crate::fusion::FusionOptions;
use crate::report::OutputReport;
use crate::scene::{NeighborOptions, ResolutionOptions, RoiEstimation};
use crate::semantics::ClassRules;
use crate::stereo::StereoOptions;
use crate::store::cloud::{CloudFormat, PlyLayout};
use crate::store::colmap::Pass;
use crate::store::labels::LabelSources;
use semvs_formats::mvs::ArchiveKind;
use std::path::{Path, PathBuf};

/// The scene and everything that is done before depth maps come into play.
#[derive(Clone, Debug)]
pub struct SceneJob {
    /// The `.mvs` file.
    pub scene: PathBuf,
    /// First place of images named by the scene; the second is the scene's folder.
    pub working_folder: PathBuf,
    /// PLY with view lists that replaces the sparse points.
    pub pointcloud_file: Option<PathBuf>,
    /// Neighbour lists that replace those of the scene.
    pub view_neighbors_file: Option<PathBuf>,
    /// View selection.
    pub neighbors: NeighborOptions,
    /// Region of interest.
    pub roi: RoiJob,
    /// What to do when the cameras climb a tower; `None`: do not look for one.
    pub tower: Option<TowerJob>,
    /// Masks, if they are used.
    pub masks: Option<MaskJob>,
    /// Labels, if they are used.
    pub labels: Option<LabelJob>,
    /// An image or a depth map that cannot be used is an error.
    pub strict: bool,
    /// Reuse depth maps as OpenMVS does: those that exist are not estimated again, even where geometric passes follow.
    pub like_openmvs: bool,
    /// Threads; 0 = all of the machine.
    pub max_threads: usize,
    /// Bytes of memory that may be used; `None`: 70 % of what there is.
    pub max_memory: Option<u64>,
}

/// What part of the scene is wanted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RoiJob {
    /// When a scene without region of interest gets one.
    pub estimate: RoiEstimation,
    /// Above 0 the half extents are multiplied by it, below 0 they grow by its absolute value. Default 0.
    pub border: f32,
    /// Drop points outside. Default true.
    pub crop: bool,
}

/// `--tower-mode`: cameras that climb a tower.
#[derive(Clone, Debug, PartialEq)]
pub struct TowerJob {
    /// What the made-up points are for.
    pub work: TowerWork,
    /// Take it for a tower without looking at the cameras.
    pub unchecked: bool,
    /// A line of cameras in any direction may be a tower; else only one that rises.
    pub any_direction: bool,
    /// The cloud of the tower.
    pub cloud: PathBuf,
}

/// What the points of a tower are for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TowerWork {
    /// They replace the sparse points.
    Replace,
    /// They are added to the sparse points.
    Append,
    /// Neighbours are found from them.
    Neighbors,
    /// Neighbours are found from them, and they are added.
    NeighborsAndAppend,
}

/// Pixels without depth.
#[derive(Clone, Debug, PartialEq)]
pub struct MaskJob {
    /// Mask value of the pixels to ignore.
    pub ignore: u16,
    /// Folder of masks; `None`: those that the scene names, else beside the images.
    pub folder: Option<PathBuf>,
}

/// Semantic labels.
#[derive(Clone, Debug, PartialEq)]
pub struct LabelJob {
    /// Where label maps and classes come from.
    pub sources: LabelSources,
    /// What to keep and how labels restrict fusion.
    pub rules: ClassRules,
}

/// `densify`: everything.
#[derive(Clone, Debug)]
pub struct DensifyJob {
    /// The scene.
    pub input: SceneJob,
    /// Size at which images are matched.
    pub resolution: ResolutionOptions,
    /// Folder of the depth maps.
    pub depth_maps: PathBuf,
    /// Make all depth maps anew, whatever is there.
    pub force: bool,
    /// Leave pictures and a cloud of every depth map beside it, and a MeshLab project beside the cloud.
    pub pictures: bool,
    /// Estimation.
    pub stereo: StereoOptions,
    /// Cleaning.
    pub filter: FilterJob,
    /// Stop before fusion.
    pub depth_maps_only: bool,
    /// Delete the depth maps at the end.
    pub remove_depth_maps: bool,
    /// Fusion.
    pub fusion: FusionOptions,
    /// What to write.
    pub outputs: Outputs,
}

/// `fuse`: depth maps that exist.
#[derive(Clone, Debug)]
pub struct FuseJob {
    /// The scene.
    pub input: SceneJob,
    /// Size that the depth maps must have; `None`: any size that fits the image.
    pub resolution: Option<ResolutionOptions>,
    /// The depth maps.
    pub depth_maps: DepthMapsJob,
    /// Fusion.
    pub fusion: FusionOptions,
    /// What to write.
    pub outputs: Outputs,
}

/// Depth maps that exist.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum DepthMapsJob {
    /// The `depthNNNN.dmap` in a folder.
    Folder(PathBuf),
    /// Those that a pass of COLMAP left in the workspace that the scene is; `None`: the geometric pass if there are
    /// any of it, else the photometric one.
    Colmap(Option<Pass>),
}

/// Files to write.
#[derive(Clone, Debug, PartialEq)]
pub struct Outputs {
    /// The cloud; its other forms are named after it.
    pub cloud: PathBuf,
    /// The scene with its neighbours.
    pub scene: Option<PathBuf>,
    /// Archive that the scene is written as.
    pub archive: SceneArchive,
    /// Properties of the points.
    pub layout: PlyLayout,
    /// One cloud per class.
    pub split_by_class: bool,
    /// A cloud in class colours.
    pub color_by_label: bool,
    /// Where clouds with more than single precision go, from the scene's origin; `None` = where the scene's transform says.
    pub offset: Option<[f64; 3]>,
    /// 64-bit coordinates in PLY files.
    pub ply_doubles: bool,
    /// Normals in LAS and LAZ files.
    pub las_normals: bool,
    /// JSON summary.
    pub report: Option<PathBuf>,
    /// Page with pictures; the programs write it after the run.
    pub report_html: Option<PathBuf>,
    /// Name the images in the scene from the scene's folder, so that it can be used from anywhere; else from the
    /// working folder, as OpenMVS does.
    pub names_from_scene: bool,
    /// Write the sparse points as the cloud when only depth maps are wanted, as OpenMVS does.
    pub sparse_cloud: bool,
    /// A cloud without points is no error: then the scene alone is written.
    pub allow_empty: bool,
}

/// How a scene is written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SceneArchive {
    /// Interface archive with the sparse points.
    #[default]
    Interface,
    /// Project archive with the dense points.
    Project(ArchiveKind),
    /// The bare header of a project archive of an unknown kind, as OpenMVS leaves it.
    Header(i32),
}

impl Outputs {
    /// `cloud` alone, with the default of everything.
    pub fn of(cloud: PathBuf) -> Self {
        Outputs {
            cloud,
            scene: None,
            archive: SceneArchive::Interface,
            layout: PlyLayout::Plain,
            split_by_class: false,
            color_by_label: false,
            offset: None,
            ply_doubles: false,
            las_normals: true,
            report: None,
            report_html: None,
            names_from_scene: true,
            sparse_cloud: false,
            allow_empty: false,
        }
    }

    /// The same without what needs labels.
    pub(super) fn without_labels(&self) -> Outputs {
        Outputs { split_by_class: false, color_by_label: false, ..self.clone() }
    }

    /// Refuses outputs by class in a run without labels, and an offset that would cost digits.
    ///
    /// # Errors
    /// [`Error::Invalid`] naming the option.
    pub(super) fn check(&self, has_labels: bool) -> Result<()> {
        if let Some(offset) = self.offset.filter(|offset| *offset != [0.0; 3] && !self.are_precise()) {
            let [x, y, z] = offset;
            return Err(Error::invalid(format!(
                "--offset {x},{y},{z} needs coordinates of more than 32 bits: end the name of the cloud in .las or .laz, or \
                 add --ply-doubles"
            )));
        }
        let asked = [(self.split_by_class, "--split-by-class"), (self.color_by_label, "--color-by-label")];
        match asked.iter().find(|(asked, _)| *asked && !has_labels) {
            Some((_, option)) => Err(Error::invalid(format!(
                "{option} needs labels: give --label-path, the folder of the label maps, and --class-table unless they \
                 hold plain ids"
            ))),
            None => Ok(()),
        }
    }

    /// Whether the cloud's coordinates have more digits than single precision holds.
    pub(super) fn are_precise(&self) -> bool {
        self.ply_doubles || CloudFormat::of(&self.cloud).is_precise()
    }

    /// Folder of the cloud.
    pub(super) fn folder(&self) -> &Path {
        match self.cloud.parent() {
            Some(folder) if !folder.as_os_str().is_empty() => folder,
            _ => Path::new("."),
        }
    }

    /// The scene in a report.
    pub(super) fn scene_row(&self) -> Option<OutputReport> {
        let path = self.scene.as_ref()?.display().to_string();
        Some(OutputReport { path, content: "scene".to_owned(), points: None })
    }
}

impl SceneJob {
    fn check(&self) -> Result<()> {
        self.neighbors.check()?;
        if !self.roi.border.is_finite() {
            return Err(Error::invalid("--roi-border must be a finite number"));
        }
        Ok(())
    }
}

impl DensifyJob {
    /// Whether depth maps that exist are neither refined nor cleaned, as when parts of a scene are fused.
    pub(super) fn only_fuses(&self) -> bool {
        let FilterJob { speckles, gaps, across, .. } = &self.filter;
        self.stereo.geometric_iterations == 0 && !speckles && !gaps && across.is_none()
    }

    /// Checks all values that can be checked without files.
    ///
    /// # Errors
    /// [`Error::Invalid`] naming the option.
    pub fn check(&self) -> Result<()> {
        self.input.check()?;
        self.resolution.check()?;
        self.stereo.check()?;
        self.filter.options.check()?;
        self.fusion.check()?;
        self.outputs.check(self.input.labels.is_some())
    }
}

impl FuseJob {
    /// Checks all values that can be checked without files.
    ///
    /// # Errors
    /// [`Error::Invalid`] naming the option.
    pub fn check(&self) -> Result<()> {
        self.input.check()?;
        self.resolution.as_ref().map_or(Ok(()), ResolutionOptions::check)?;
        self.fusion.check()?;
        self.outputs.check(self.input.labels.is_some())
    }
}
