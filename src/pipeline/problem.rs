//! What the estimator gets to know about one view.

use super::prepare::Prepared;
use super::skip::{planar, skipped};
use crate::error::{Error, Result};
use crate::geometry::{Camera, Size};
use crate::scene::{ImageId, LabelMap, Neighbor, SparseInit, SparsePoint, ViewIndex};
use crate::semantics::LabelEstimation;
use crate::stereo::{ProblemLabels, ReferenceImage, SourceImage, StereoProblem};
use std::sync::Arc;

/// Depths searched beyond those of the sparse points: below the nearest, above the farthest.
const DEPTH_MARGIN: (f32, f32) = (0.9, 1.1);
/// A source image whose scale differs by less is matched as it is.
const MIN_SCALE_DIFFERENCE: f32 = 0.15;

/// The problem of estimating `view`, at up to `halvings` coarser resolutions too; it must have source views.
///
/// # Errors
/// An image cannot be read.
pub(super) fn stereo_problem(prepared: &Prepared, view: ViewIndex, halvings: u32) -> Result<StereoProblem> {
    let camera = prepared.camera(view)?;
    let neighbors = prepared.neighbors[view.index()].matching();
    let sources = neighbors.iter().map(|n| source_image(prepared, n, halvings));
    let sources = sources.collect::<Result<Vec<SourceImage>>>()?;
    let (sparse, depth_range) = sparse_points(prepared, view, camera);
    let skip = skipped(view, camera.size(), prepared.masks.as_ref(), prepared.labels.as_ref())?;
    let labels = labels_of(prepared, view, camera, &sources)?;
    Ok(StereoProblem {
        reference: ReferenceImage {
            gray: prepared.images.gray(view, camera.size())?,
            camera: camera.clone(),
            id: prepared.id(view),
        },
        image_name: prepared.loaded.scene.views[view.index()].name.clone(),
        sources,
        depth_range,
        sparse,
        skip,
        labels,
        regions: planar(view, camera.size(), prepared.masks.as_ref(), prepared.labels.as_ref())?,
    })
}

/// The classes that the estimator heeds, if it is to.
fn labels_of(
    prepared: &Prepared,
    view: ViewIndex,
    camera: &Camera,
    sources: &[SourceImage],
) -> Result<Option<ProblemLabels>> {
    let Some(labels) = &prepared.labels else { return Ok(None) };
    let LabelEstimation::Aware { cost } = labels.rules().estimation else { return Ok(None) };
    let map = |view: ViewIndex, size: Size| -> Result<Arc<LabelMap>> {
        let (map, checked) = labels.maps(view, size)?;
        Ok(checked.unwrap_or(map))
    };
    let neighbors = prepared.neighbors[view.index()].matching();
    let of_sources = neighbors.iter().zip(sources).map(|(n, source)| map(n.view, source.texels.size()));
    Ok(Some(ProblemLabels {
        reference: map(view, camera.size())?,
        sources: of_sources.collect::<Result<_>>()?,
        cost,
    }))
}

/// The image of a neighbour, resized to the reference's footprint when the two differ much.
fn source_image(prepared: &Prepared, neighbor: &Neighbor, halvings: u32) -> Result<SourceImage> {
    let camera = prepared.camera(neighbor.view)?;
    let id: ImageId = prepared.id(neighbor.view);
    let texels = |scale| prepared.images.texels(neighbor.view, camera.size(), scale, halvings);
    if (neighbor.scale - 1.0).abs() < MIN_SCALE_DIFFERENCE || !usable_scale(neighbor.scale) {
        return Ok(SourceImage { texels: texels(1.0)?, camera: camera.clone(), id });
    }
    let texels = texels(neighbor.scale)?;
    let calibration = prepared.loaded.scene.views[neighbor.view.index()].calibration.as_ref();
    let calibration = calibration.ok_or_else(|| Error::invalid(format!("image {id} has no pose")))?;
    let camera = calibration.camera_at(texels.size());
    Ok(SourceImage { texels, camera, id })
}

/// Stored scores may hold anything; beyond a factor of 4 matching is hopeless at any size.
fn usable_scale(scale: f32) -> bool {
    (0.25..=4.0).contains(&scale)
}

/// The sparse points that start the depths of `view`, and the range of depths to search: that of these points,
/// else that of all points that project into the image.
pub(super) fn sparse_points(
    prepared: &Prepared,
    view: ViewIndex,
    camera: &Camera,
) -> (Vec<SparsePoint>, (f32, f32)) {
    let tracks = &prepared.loaded.scene.tracks;
    let start = SparseInit::new(tracks, &prepared.neighbors[view.index()].tracks, camera);
    if start.points.is_empty() {
        let range = depth_range(visible_depths(prepared, camera)).unwrap_or(start.range);
        return (start.points, range);
    }
    (start.points, start.range)
}

/// Depths of all sparse points in front of `camera` whose projection is inside its image.
fn visible_depths<'a>(prepared: &'a Prepared, camera: &'a Camera) -> impl Iterator<Item = f32> + 'a {
    let (width, height) = (camera.size().width as f32, camera.size().height as f32);
    let (sparse, made_up) = (&prepared.loaded.scene.tracks, &prepared.made_up);
    let tracks = if sparse.is_empty() { made_up } else { sparse };
    tracks.iter().filter_map(move |(point, _)| {
        let [x, y, depth] = camera.project_f32(point);
        let inside = (0.0..width).contains(&(x / depth)) && (0.0..height).contains(&(y / depth));
        (depth > 0.0 && inside).then_some(depth)
    })
}

/// The range of `depths` with its margin; `None` without depths.
fn depth_range(depths: impl Iterator<Item = f32>) -> Option<(f32, f32)> {
    let (min, max) = depths.fold((f32::MAX, 0.0f32), |(min, max), d| (min.min(d), max.max(d)));
    let (min, max) = (min * DEPTH_MARGIN.0, max * DEPTH_MARGIN.1);
    (min > 0.0 && max > min && max.is_finite()).then_some((min, max))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn depth_ranges_have_a_margin() {
        let (min, max) = depth_range([4.0, 2.0, 10.0].into_iter()).unwrap();
        assert!((min - 1.8).abs() < 1e-6 && (max - 11.0).abs() < 1e-5);
        assert_eq!(depth_range(std::iter::empty()), None);
    }
}
