//! Depth maps of several views to one cloud.

use super::{ClassTable, Cloud, DepthMap, LabelMap};
use crate::error::{Error, Result};
use crate::fusion::{
    self, AttributeSource, FusionInput, FusionMaps, FusionOptions, FusionView, MapInfo, MapSource, Support,
};
use crate::geometry::local_origin;
use crate::progress::Progress;
use crate::scene::{ColorImage, DepthEstimate, PointCloud, ResolutionOptions, ViewIndex};
use crate::semantics::{ClassPolicy, ClassRules, Consistency, nearest_labels};
use crate::store::images::load_working_color;
use std::path::Path;
use std::sync::Arc;

/// What [`fuse`] takes of one view.
#[derive(Clone, Debug)]
pub struct FuseView {
    map: DepthMap,
    color: Option<Arc<ColorImage>>,
    labels: Option<Arc<crate::scene::LabelMap>>,
}

/// How [`fuse`] works. Every setter takes the options and gives them back.
#[derive(Clone, Debug)]
pub struct FuseOptions {
    fusion: FusionOptions,
    classes: Option<ClassTable>,
    rules: ClassRules,
}

impl FuseView {
    /// A view with a depth map alone.
    pub fn new(map: DepthMap) -> Self {
        FuseView { map, color: None, labels: None }
    }

    /// The same with the colours of its photograph, which is scaled to the size of the map.
    ///
    /// # Errors
    /// [`Error`]: the photograph cannot be read, or has another shape than the depth map.
    pub fn with_photograph(mut self, path: impl AsRef<Path>) -> Result<Self> {
        let (path, size) = (path.as_ref(), self.map.0.depth.size());
        let resolution = ResolutionOptions { level: 0, min: 0, max: size.longest() };
        let color = load_working_color(path, &resolution)?;
        if color.size() != size {
            let what = format!(
                "{} pixels at the scale of its depth map, which has {size}: another photograph?",
                color.size()
            );
            return Err(Error::content(path, what));
        }
        self.color = Some(Arc::new(color));
        Ok(self)
    }

    /// The same with the classes of its pixels; a map of another size is scaled. They count only with [`FuseOptions::classes`].
    pub fn with_labels(mut self, labels: LabelMap) -> Self {
        self.labels = Some(Arc::new(nearest_labels(&labels.0, self.map.0.depth.size())));
        self
    }
}

impl Default for FuseOptions {
    fn default() -> Self {
        FuseOptions::new()
    }
}

impl FuseOptions {
    /// The defaults.
    pub fn new() -> Self {
        FuseOptions { fusion: FusionOptions::supporting(), classes: None, rules: ClassRules::default() }
    }

    /// Fewest views that must agree on a point, no more than there are; below 2 every depth becomes a point. Default: 3.
    pub fn min_views(mut self, views: u32) -> Self {
        self.fusion.number_views_fuse = views;
        self
    }

    /// Whether depths that are part of a point already support further points. Without it, and with tolerances of 0.01 and
    /// 25°, fusion is that of OpenMVS. Default: yes.
    pub fn claimed_depths_support(mut self, yes: bool) -> Self {
        self.fusion.support = if yes { Support::All } else { Support::Unclaimed };
        self
    }

    /// Relative difference below which two depths are the same. Default: 0.007.
    pub fn depth_tolerance(mut self, relative: f32) -> Self {
        self.fusion.depth_diff_threshold = relative;
        self
    }

    /// Largest angle between the normals of pixels that become one point, degrees. Default: 90.
    pub fn normal_tolerance_deg(mut self, degrees: f32) -> Self {
        self.fusion.normal_diff_threshold_deg = degrees;
        self
    }

    /// Lets the labels of the views take part; their numbers are classes of this table.
    pub fn classes(mut self, table: &ClassTable) -> Self {
        self.classes = Some(table.clone());
        self
    }

    /// The only classes that points may have, by name or number. Default: all that the table keeps.
    pub fn keep_classes<S: Into<String>>(mut self, names: impl IntoIterator<Item = S>) -> Self {
        self.rules.classes = names.into_iter().map(Into::into).collect();
        self
    }

    /// Classes that no point may have, by name or number.
    pub fn exclude_classes<S: Into<String>>(mut self, names: impl IntoIterator<Item = S>) -> Self {
        self.rules.exclude = names.into_iter().map(Into::into).collect();
        self
    }

    /// How labels restrict which pixels become one point. Default: [`Consistency::Support`].
    pub fn consistency(mut self, consistency: Consistency) -> Self {
        self.rules.consistency = consistency;
        self
    }
}

/// Makes one cloud of depth maps that agree; see the [crate's page](crate#fuse-two-views-and-label-the-cloud).
///
/// A view is compared with the views that its depth map was matched with, as far as they are here, best first; with all others
/// if it names none of them. Points have colours if all views have a photograph, normals if all maps have them, and labels if the
/// options have classes. All maps are held in memory: `semvs fuse` is for what does not fit.
///
/// # Errors
/// [`Error::Invalid`]: a threshold out of range, a class that the table lacks, two depth maps of one number.
pub fn fuse(views: &[FuseView], options: &FuseOptions) -> Result<Cloud> {
    let policy = match &options.classes {
        Some(table) => Some(ClassPolicy::new(&table.0, &options.rules)?),
        None if !options.rules.classes.is_empty() || !options.rules.exclude.is_empty() => {
            return Err(Error::invalid(
                "classes are kept or excluded, but there are none: give FuseOptions::classes, too",
            ));
        }
        None => None,
    };
    let origin = local_origin(views.iter().map(|view| *view.map.0.camera.center()));
    let source = InMemory(views.iter().map(|view| maps_of(view, &-origin)).collect());
    let plan = (0..views.len())
        .map(|i| {
            let neighbors = neighbors(views, i)?;
            let (maps, neighbor_count) = (Some(MapInfo::of(&source.0[i])), neighbors.len());
            Ok(FusionView { maps, neighbors, neighbor_count })
        })
        .collect::<Result<Vec<FusionView>>>()?;
    let has_colors = views.iter().all(|view| view.color.is_some());
    let colors = if has_colors { AttributeSource::DuringFusion } else { AttributeSource::None };
    let fusion = FusionOptions { estimate_colors: colors, ..options.fusion };
    let input = FusionInput { views: &plan, source: &source, policy: policy.as_ref() };
    let mut points = PointCloud::new(input.layout(&fusion));
    fusion::fuse(&input, &fusion, &Progress::silent(), &mut points)?;
    Ok(Cloud { points, origin: origin.into(), classes: options.classes.clone() })
}

/// The maps of a view, its camera moved by `shift`.
fn maps_of(view: &FuseView, shift: &nalgebra::Vector3<f64>) -> FusionMaps {
    let estimate = match shift.norm() == 0.0 {
        true => Arc::clone(&view.map.0),
        false => {
            let estimate = &view.map.0;
            Arc::new(DepthEstimate { camera: estimate.camera.moved(shift), ..DepthEstimate::clone(estimate) })
        }
    };
    FusionMaps { color: view.color.clone(), labels: view.labels.clone(), ..FusionMaps::new(estimate) }
}

/// The views that view `i` is compared with.
fn neighbors(views: &[FuseView], i: usize) -> Result<Vec<ViewIndex>> {
    let estimate = &views[i].map.0;
    let others = || (0..views.len()).filter(|&other| other != i);
    if others().any(|other| views[other].map.0.image_id == estimate.image_id) {
        return Err(Error::invalid(format!(
            "two depth maps of photograph {}; give each once",
            estimate.image_id
        )));
    }
    let here = |id| others().find(|&other| views[other].map.0.image_id == id);
    let named: Vec<usize> = estimate.source_ids.iter().filter_map(|&id| here(id)).collect();
    let chosen = if named.is_empty() { others().collect() } else { named };
    Ok(chosen.into_iter().map(|v| ViewIndex(v as u32)).collect())
}

struct InMemory(Vec<FusionMaps>);

impl MapSource for InMemory {
    fn load(&self, view: ViewIndex) -> Result<FusionMaps> {
        Ok(self.0[view.index()].clone())
    }
}
