//! Depth maps to a cloud without fusion.

use super::inputs::{Classes, check_mask_folder};
use super::job::{LabelJob, MaskJob, Outputs};
use super::masks::{MaskRequest, Masks};
use super::outputs::{check_places, cloud_rows, write_cloud};
use super::skip::Labels;
use crate::error::{Error, Result};
use crate::fusion::{FusionMaps, project_maps};
use crate::geometry::{Placement, Size};
use crate::progress::Progress;
use crate::report::{OutputReport, RunReport};
use crate::scene::{CloudLayout, PointSource, ResolutionOptions, ViewIndex};
use crate::store::depth_store::{read_depth_header, read_depth_map};
use crate::store::images::{image_size, load_working_color};
use crate::store::import::check_working_folder;
use crate::store::labels::LabelRequest;
use crate::store::masks::default_mask_name;
use crate::store::paths::SearchPath;
use crate::store::spool::{DEFAULT_SPOOL_MEMORY, PointSpool};
use semvs_formats::Limits;
use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// `convert`: every depth becomes a point.
#[derive(Clone, Debug)]
pub struct ConvertJob {
    /// The depth maps, in the order of their points.
    pub depth_maps: Vec<PathBuf>,
    /// First place of the images that the depth maps name; the second is each depth map's folder.
    pub working_folder: Option<PathBuf>,
    /// Masks, if they are used.
    pub masks: Option<MaskJob>,
    /// Labels, if they are used.
    pub labels: Option<LabelJob>,
    /// What to write.
    pub outputs: Outputs,
}

/// Runs `job`: `X = depth · Rᵀ K⁻¹ (x, y, 1) + C` for every pixel that has a depth and a kept class. Colours and
/// normals are there when every depth map has them.
///
/// # Errors
/// An unreadable file, or an output that cannot be written.
pub fn convert(job: &ConvertJob, progress: &Progress) -> Result<RunReport> {
    job.outputs.check(job.labels.is_some())?;
    job.working_folder.as_deref().map_or(Ok(()), check_working_folder)?;
    let classes = job.labels.as_ref().map(Classes::of).transpose()?;
    check_places(&job.outputs, classes.as_ref().map(Classes::parts))?;
    check_once_each(&job.depth_maps)?;
    let maps = job.depth_maps.iter().map(|path| Source::new(path, job)).collect::<Result<Vec<Source>>>()?;
    let labels = job.labels.as_ref().map(|labels| open_labels(labels, &maps, progress)).transpose()?;
    check_places(&job.outputs, labels.as_ref().map(Labels::classes))?;
    let masks =
        job.masks.as_ref().map(|masks| open_masks(masks, &maps, labels.as_ref(), progress)).transpose()?;
    for map in maps.iter().filter(|map| map.color.is_none()) {
        let image = map.image.display();
        progress.warn(format!("{image}: no such image; the cloud gets no colours"));
    }
    let layout = CloudLayout {
        normals: maps.iter().all(|m| m.normals),
        colors: maps.iter().all(|m| m.color.is_some()),
        views: true,
        weights: false,
        confidence: maps.iter().all(|m| m.confidence),
        labels: labels.is_some(),
    };
    let mut spool = PointSpool::new(layout, None, job.outputs.folder(), DEFAULT_SPOOL_MEMORY);
    for (i, map) in maps.iter().enumerate() {
        let view = ViewIndex(i as u32);
        let loaded = map.load(view, layout.colors, labels.as_ref(), masks.as_ref())?;
        let policy = labels.as_ref().map(Labels::policy);
        let points = project_maps(view, &loaded, policy, layout, &mut spool)?;
        progress.detail(format!("{}: {points} points", map.path.display()));
    }
    let cloud = spool.finish()?;
    let written = write_cloud(&job.outputs, &cloud, labels.as_ref(), Placement::default(), progress)?;
    let outputs: Vec<OutputReport> = cloud_rows(&written, labels.as_ref().map(Labels::table));
    Ok(RunReport { points: cloud.len(), outputs, ..RunReport::default() })
}

/// Refuses a depth map that is given twice: its points would be there twice.
fn check_once_each(maps: &[PathBuf]) -> Result<()> {
    let mut seen = HashSet::new();
    let repeated =
        maps.iter().find(|path| !seen.insert(path.canonicalize().unwrap_or_else(|_| path.to_path_buf())));
    match repeated {
        Some(path) => Err(Error::content(path, "this depth map is given twice")),
        None => Ok(()),
    }
}

/// A depth map and its image.
struct Source {
    path: PathBuf,
    image: PathBuf,
    mask: Option<PathBuf>,
    /// Size of the image, if it can be read.
    color: Option<Size>,
    normals: bool,
    confidence: bool,
}

impl Source {
    fn new(path: &Path, job: &ConvertJob) -> Result<Self> {
        let header = read_depth_header(path, Limits::default())?;
        let name = String::from_utf8_lossy(&header.image_name).into_owned();
        let folder = path.parent().unwrap_or(Path::new(""));
        let first = job.working_folder.as_deref().unwrap_or(folder);
        let mut image = SearchPath::new(first, path).find(&name);
        if !image.exists() {
            let here = PathBuf::from(&name);
            if here.exists() {
                image = here;
            }
        }
        let color = image_size(&image).ok();
        let (normals, confidence) = (header.has_normal, header.has_confidence);
        Ok(Source { path: path.to_owned(), image, mask: None, color, normals, confidence })
    }

    fn load(
        &self,
        view: ViewIndex,
        colors: bool,
        labels: Option<&Labels>,
        masks: Option<&Masks>,
    ) -> Result<FusionMaps> {
        let mut estimate = Arc::new(read_depth_map(&self.path, Limits::default())?);
        if let Some(masks) = masks {
            estimate = masks.unmasked(view, estimate)?;
        }
        let size = estimate.depth.size();
        let mut maps = FusionMaps::new(estimate);
        if colors {
            let at = ResolutionOptions { level: 0, max: size.longest(), ..ResolutionOptions::default() };
            let image = load_working_color(&self.image, &at)?;
            if image.size() != size {
                let what = format!("scales to {} pixels, its depth map has {size}", image.size());
                return Err(Error::content(&self.image, what));
            }
            maps.color = Some(Arc::new(image));
        }
        if let Some(labels) = labels {
            maps.labels = Some(labels.maps(view, size)?.0);
        }
        Ok(maps)
    }
}

fn open_labels(job: &LabelJob, maps: &[Source], progress: &Progress) -> Result<Labels> {
    let requests: Vec<LabelRequest> = maps
        .iter()
        .enumerate()
        .map(|(i, map)| LabelRequest {
            view: ViewIndex(i as u32),
            image: map.image.clone(),
            mask: map.mask.clone(),
            size: map.color,
        })
        .collect();
    Labels::open_requests(job, &requests, progress)
}

fn open_masks(job: &MaskJob, maps: &[Source], labels: Option<&Labels>, progress: &Progress) -> Result<Masks> {
    check_mask_folder(job)?;
    let request = |map: &Source| {
        let mask = PathBuf::from(default_mask_name(&map.image.to_string_lossy()));
        Some(MaskRequest {
            image_name: map.image.to_string_lossy().into_owned(),
            image: map.image.clone(),
            mask,
        })
    };
    Masks::open(job, &maps.iter().map(request).collect::<Vec<_>>(), labels, progress)
}
