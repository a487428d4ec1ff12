//! Points straight from depth maps, without any test: the plain merge.

use super::FusionMaps;
use super::correspond::Participant;
use crate::error::Result;
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
    let pixels = Participant::new(view, maps, true);
    let views = [view];
    let mut points = 0;
    for (pixel, &depth) in pixels.depth.iter().enumerate() {
        let label = pixels.label(pixel);
        if depth <= 0.0 || policy.is_some_and(|policy| !policy.is_kept(label)) {
            continue;
        }
        let (x, y) = (pixel as u32 % pixels.width, pixel as u32 / pixels.width);
        let color = pixels.color.filter(|_| layout.colors).map(|c| c[pixel]);
        let confidence = pixels.confidence.filter(|_| layout.confidence).map(|c| c[pixel]);
        sink.push(&CloudPoint {
            position: pixels.lens.world_point(x, y, depth).map(|v| v as f32),
            normal: if layout.normals { pixels.normal_in_world(pixel) } else { [0.0; 3] },
            color: color.unwrap_or_default(),
            views: if layout.views { &views } else { &[] },
            weights: &[],
            confidence: confidence.unwrap_or_default(),
            label: if layout.labels { label } else { 0 },
            label_confidence: if layout.labels && label != 0 { 1.0 } else { 0.0 },
        })?;
        points += 1;
    }
    Ok(points)
}
