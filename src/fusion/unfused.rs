//! Points straight from depth maps, without any test: the plain merge.

use super::FusionMaps;
use crate::error::Result;
use crate::geometry::Lens;
use crate::scene::{CloudLayout, CloudPoint, PointSink, ViewIndex};
use crate::semantics::ClassPolicy;

/// Sends every pixel of a view that has a depth and, with a policy, a kept class to `sink`, in raster order:
/// `X = depth · Rᵀ K⁻¹ (x, y, 1) + C`, with the pixel's colour, world normal, confidence and label as far as
/// `layout` asks for them and the maps have them. The label confidence is 1, or 0 for void. Returns the number of
/// points.
///
/// # Errors
/// Those of `sink`, and maps of different sizes.
pub fn project_maps(
    view: ViewIndex,
    maps: &FusionMaps,
    policy: Option<&ClassPolicy>,
    layout: CloudLayout,
    sink: &mut dyn PointSink,
) -> Result<u64> {
    maps.check(view)?;
    let estimate = &maps.estimate;
    let (lens, width) = (Lens::new(&estimate.camera), estimate.depth.width());
    let labels = maps.labels.as_deref().map(|map| map.data());
    let colors = maps.color.as_deref().filter(|_| layout.colors).map(|map| map.data());
    let confidences = estimate.confidence.as_ref().filter(|_| layout.confidence).map(|map| map.data());
    let normals = estimate.normal.as_ref().map(|map| map.data());
    let certainties = maps.label_confidence.as_deref().map(|map| map.data());
    let certainty = |pixel: usize| certainties.map_or(1.0, |certainties| certainties[pixel]);
    let views = [view];
    let mut points = 0;
    for (pixel, &depth) in estimate.depth.data().iter().enumerate() {
        let label = labels.map_or(0, |labels| labels[pixel]);
        if depth <= 0.0 || policy.is_some_and(|policy| !policy.is_candidate(label)) {
            continue;
        }
        let (x, y) = ((pixel % width) as u32, (pixel / width) as u32);
        let normal = || normals.map_or([0.0, 0.0, -1.0], |normals| lens.world_direction(normals[pixel]));
        sink.push(&CloudPoint {
            position: lens.world_point(x, y, depth).map(|v| v as f32),
            normal: if layout.normals { normal() } else { [0.0; 3] },
            color: colors.map_or([0; 3], |colors| colors[pixel]),
            views: if layout.views { &views } else { &[] },
            weights: &[],
            confidence: confidences.map_or(0.0, |confidences| confidences[pixel]),
            label: if layout.labels { label } else { 0 },
            label_confidence: if layout.labels && label != 0 { certainty(pixel) } else { 0.0 },
        })?;
        points += 1;
    }
    Ok(points)
}
