//! From options as typed to jobs whose values are checked.

use super::dense_config::{self, DenseConfig};
use super::label_options::{CloudForms, PlyLayout as TypedLayout};
use super::options::{FilterKind, SharedOptions};
use super::resolve_labels::has_labels;
pub(crate) use super::resolve_labels::{labels, missing, rules, table, unknown};
use crate::depth_filter::{DepthFilterOptions, UnbiasedFilterOptions};
use crate::error::{Error, Result};
use crate::fusion::{AttributeSource, FusionOptions, Support};
use crate::pipeline::{AcrossViews, FilterJob, MaskJob, Outputs, RoiJob, SceneJob, TowerJob, TowerWork};
use crate::scene::{NeighborOptions, OutsideRoi, PairingOptions, ResolutionOptions, RoiEstimation};
use crate::semantics::Consistency;
use crate::stereo::{CpuLevel, Quality, StereoOptions};
use crate::store::cloud::PlyLayout;
use std::path::{Path, PathBuf};

/// What the options say, paths resolved by `place`.
pub(crate) struct Resolver<'a> {
    options: &'a SharedOptions,
    config: DenseConfig,
    /// Remarks about the dense config file.
    pub(crate) remarks: Vec<String>,
    /// Makes a typed path a usable one.
    place: &'a dyn Fn(&Path) -> PathBuf,
}

impl<'a> Resolver<'a> {
    /// Reads the dense config file, if there is one.
    ///
    /// # Errors
    /// As [`dense_config::load`].
    pub(crate) fn new(options: &'a SharedOptions, place: &'a dyn Fn(&Path) -> PathBuf) -> Result<Self> {
        let file = options.estimation.dense_config_file.as_deref().map(place);
        let (config, remarks) = match &file {
            Some(path) => dense_config::load(path)?,
            None => Default::default(),
        };
        let named = |remark| format!("{}: {remark}", file.as_deref().unwrap_or(Path::new("")).display());
        let remarks = remarks.into_iter().map(named).collect();
        Ok(Resolver { options, config, remarks, place })
    }

    /// The scene at `scene` (a usable path).
    ///
    /// # Errors
    /// A value out of range; options that need labels without labels.
    pub(crate) fn scene(&self, scene: PathBuf, working_folder: PathBuf) -> Result<SceneJob> {
        let images = &self.options.images;
        let tower = tower(self.options.roi.tower_mode, working_folder.join("tower.ply"))?;
        let path = |typed: &Option<PathBuf>| typed.as_deref().map(self.place);
        Ok(SceneJob {
            scene,
            working_folder,
            pointcloud_file: path(&images.pointcloud_file),
            view_neighbors_file: path(&images.view_neighbors_file),
            neighbors: self.neighbors()?,
            roi: self.roi()?,
            masks: masks(images.ignore_mask_label, images.mask_path.clone())?,
            labels: labels(&self.options.labels.input, self.place)?,
            tower,
            strict: self.options.run.strict,
            like_openmvs: false,
            max_threads: self.options.run.max_threads as usize,
            max_memory: self.options.run.max_memory,
        })
    }

    fn neighbors(&self) -> Result<NeighborOptions> {
        let config = &self.config;
        let options = NeighborOptions {
            number_views: self.options.images.number_views as usize,
            min_views: config.min_views as usize,
            max_views: config.max_views as usize,
            min_views_trust_point: config.min_views_trust_point as usize,
            outside_roi: match config.point_inside_roi {
                0 => OutsideRoi::Count,
                1 => OutsideRoi::Discount,
                2 => OutsideRoi::Drop,
                other => {
                    return Err(Error::invalid(format!("'Point Inside ROI' is {other}, expected 0, 1 or 2")));
                }
            },
            min_score: config.view_min_score,
            min_score_ratio: config.view_min_score_ratio,
            min_area: config.min_area,
            min_angle_deg: config.min_angle_deg,
            best_angle_deg: config.optim_angle_deg,
            max_angle_deg: config.max_angle_deg,
            pairing: PairingOptions {
                pairwise: config.pairwise_mul,
                eps: config.optimizer_eps,
                max_iterations: config.optimizer_max_iters as usize,
            },
        };
        options.check()?;
        Ok(options)
    }

    fn roi(&self) -> Result<RoiJob> {
        let typed = &self.options.roi;
        let estimate = match typed.estimate_roi {
            0 => RoiEstimation::Off,
            1 => RoiEstimation::Always,
            2 => RoiEstimation::ObjectScan,
            other => {
                return Err(Error::invalid(format!("--estimate-roi {other}: give 0 (no), 1 (always) or 2")));
            }
        };
        Ok(RoiJob { estimate, border: typed.roi_border, crop: typed.crop_to_roi })
    }

    /// Size at which images are matched.
    ///
    /// # Errors
    /// Values out of range.
    pub(crate) fn resolution(&self) -> Result<ResolutionOptions> {
        let images = &self.options.images;
        let options = ResolutionOptions {
            level: images.resolution_level,
            min: images.min_resolution,
            max: images.max_resolution,
        };
        options.check()?;
        Ok(options)
    }

    /// Estimation; `default`: the quality when none is typed.
    ///
    /// # Errors
    /// Values out of range.
    pub(crate) fn stereo(&self, default: Quality, filter: &FilterJob) -> Result<StereoOptions> {
        let typed = &self.options.estimation;
        let own = StereoOptions::of(typed.quality.map_or(default, Quality::from));
        let (config, openmvs) = (&self.config, DenseConfig::default());
        let options = StereoOptions {
            levels: typed.sub_resolution_levels,
            iterations: typed.iters,
            geometric_iterations: typed.geometric_iters,
            keep_cost: asked(
                config.ncc_threshold_keep,
                openmvs.ncc_threshold_keep,
                filter.keep_cost(own.keep_cost),
            ),
            geometric_weight: asked(config.geometric_weight, openmvs.geometric_weight, own.geometric_weight),
            ..own
        };
        options.check()?;
        Ok(options)
    }

    /// Cleaning; "Optimize" of the dense config file counts when `bits_are_typed` is false. `default`: the filter
    /// across views when none is typed.
    ///
    /// # Errors
    /// Values out of range.
    pub(crate) fn filter(&self, bits_are_typed: bool, default: FilterKind) -> Result<FilterJob> {
        let config = &self.config;
        let own = match self.options.fusion.filter.unwrap_or(default) {
            FilterKind::Openmvs => FilterJob::openmvs(),
            FilterKind::Unbiased => FilterJob::unbiased(),
        };
        let typed = self.options.fusion.postprocess_dmaps.unwrap_or(own.bits());
        let is_own = |bits: &u32| *bits != FilterJob::openmvs().bits() || own.bits() == *bits;
        let bits = config.optimize.filter(|_| !bits_are_typed).filter(is_own).unwrap_or(typed);
        let options = DepthFilterOptions {
            depth_diff_threshold: config.depth_diff_threshold,
            speckle_size: config.speckle_size,
            interpolate_gap_size: config.interpolate_gap_size,
            min_views_filter: config.min_views_filter,
            min_views_filter_adjust: config.min_views_filter_adjust,
            filter_adjust: config.filter_adjust != 0,
        };
        options.check()?;
        let across = match own.across {
            Some(AcrossViews::Unbiased(own)) => AcrossViews::Unbiased(UnbiasedFilterOptions {
                max_depth_diff: config.depth_diff_threshold,
                min_confirming: config.min_views_filter_adjust,
                ..own
            }),
            Some(AcrossViews::OpenMvs) | None => AcrossViews::OpenMvs,
        };
        FilterJob::from_bits(bits, across, options)
    }

    /// Fusion; `support`: what counts unless typed; `agreeing_on_class`: the fewest images of a point where labels are
    /// compared, if not what is typed.
    ///
    /// # Errors
    /// Values out of range.
    pub(crate) fn fusion(&self, support: Support, agreeing_on_class: Option<u32>) -> Result<FusionOptions> {
        let typed = &self.options.fusion;
        let compared = has_labels(&self.options.labels.input)
            && rules(&self.options.labels.input).consistency != Consistency::Off;
        let fewest = agreeing_on_class.filter(|_| compared).unwrap_or(typed.number_views_fuse);
        let source = |level: u32, option: &str| {
            AttributeSource::from_level(level).ok_or_else(|| {
                Error::invalid(format!("{option} {level}: give 0 (none), 1 (after fusion) or 2"))
            })
        };
        let own = match typed.support.map_or(support, Support::from) {
            Support::All => FusionOptions::supporting(),
            Support::Unclaimed => FusionOptions::default(),
        };
        let (config, openmvs) = (&self.config, DenseConfig::default());
        let options = FusionOptions {
            number_views_fuse: fewest,
            depth_diff_threshold: asked(
                config.depth_diff_threshold,
                openmvs.depth_diff_threshold,
                own.depth_diff_threshold,
            ),
            normal_diff_threshold_deg: asked(
                config.normal_diff_threshold_deg,
                openmvs.normal_diff_threshold_deg,
                own.normal_diff_threshold_deg,
            ),
            estimate_colors: source(typed.estimate_colors, "--estimate-colors")?,
            estimate_normals: source(typed.estimate_normals, "--estimate-normals")?,
            ..own
        };
        options.check()?;
        Ok(options)
    }
}

/// A value of the dense config file, or `own`: OpenMVS's defaults suit its methods; a file that repeats them asks for
/// nothing.
fn asked(value: f32, openmvs: f32, own: f32) -> f32 {
    if value == openmvs { own } else { value }
}

/// What `--tower-mode` asks for; the cloud of a tower goes to `cloud`.
fn tower(mode: i32, cloud: PathBuf) -> Result<Option<TowerJob>> {
    let work = match mode.unsigned_abs() {
        0 => return Ok(None),
        1 => TowerWork::Replace,
        2 => TowerWork::Append,
        3 => TowerWork::Neighbors,
        4 => TowerWork::NeighborsAndAppend,
        _ => return Err(Error::invalid(format!("--tower-mode {mode}: give -4 to 4"))),
    };
    Ok(Some(TowerJob { work, unchecked: mode < 0, any_direction: false, cloud }))
}

/// The masks that the options ask for.
///
/// # Errors
/// A value that no mask has.
pub(crate) fn masks(ignore: i32, folder: Option<PathBuf>) -> Result<Option<MaskJob>> {
    if ignore < 0 {
        return Ok(None);
    }
    let ignore = u16::try_from(ignore)
        .map_err(|_| Error::invalid(format!("--ignore-mask-label {ignore}: mask values are 0 to 65535")))?;
    Ok(Some(MaskJob { ignore, folder }))
}

/// The outputs of a run that writes `cloud` alone, in the forms that are typed, with `layout` where none is.
pub(crate) fn outputs(typed: &CloudForms, cloud: PathBuf, layout: PlyLayout) -> Outputs {
    Outputs {
        layout: match typed.ply_layout {
            Some(TypedLayout::Plain) => PlyLayout::Plain,
            Some(TypedLayout::Openmvs) => PlyLayout::OpenMvs,
            Some(TypedLayout::Odm) => PlyLayout::Odm,
            None => layout,
        },
        split_by_class: typed.split_by_class,
        color_by_label: typed.color_by_label,
        offset: typed.offset,
        ply_doubles: typed.ply_doubles,
        las_normals: typed.las_normals,
        ..Outputs::of(cloud)
    }
}

/// The instruction set that `SEMVS_CPU` names, else the best of this processor.
///
/// # Errors
/// The variable names none or one that the processor lacks.
pub(crate) fn cpu() -> Result<CpuLevel> {
    match std::env::var_os("SEMVS_CPU") {
        Some(name) if !name.is_empty() => {
            name.to_string_lossy().parse().map_err(|e: Error| Error::invalid(format!("SEMVS_CPU: {e}")))
        }
        _ => Ok(CpuLevel::detect()),
    }
}

/// The line of `--version` about the kernels.
pub(crate) fn kernels(level: CpuLevel) -> String {
    format!("kernels: {}\n", level.name())
}
