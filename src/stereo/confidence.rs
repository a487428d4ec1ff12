//! From final costs to the maps that leave the estimator.

use super::level::Level;
use super::problem::StereoProblem;
use super::state::State;
use crate::scene::{DepthEstimate, Grid};

/// Depth, normal and confidence of every pixel whose matching cost is below `keep_cost`.
///
/// Confidence is `(1 − cost)⁸` of the evidence alone: smoothness and the prior from coarser levels chose the
/// hypothesis, but do not vouch for it. The power makes averages over views lean on the sharpest of them: the share of
/// depths within 0.1 % falls fast with the cost, and the error of a mean is governed by its worst members.
pub(crate) fn finish(problem: &StereoProblem, level: &Level, state: &State, keep_cost: f32) -> DepthEstimate {
    let size = level.size;
    let mut depth = Grid::filled(size, 0.0f32);
    let mut normal = Grid::filled(size, [0.0f32; 3]);
    let mut confidence = Grid::filled(size, 0.0f32);
    let (low, high) = problem.depth_range;
    for y in 0..size.height as usize {
        for x in 0..size.width as usize {
            let at = state.at(x as i32, y as i32);
            let d = 1.0 / state.w[at];
            let cost = state.cost[at];
            let kept = state.active[at] > 0.5 && cost < keep_cost && d >= low && d < high;
            if !kept {
                continue;
            }
            depth[(x, y)] = d;
            normal[(x, y)] = level.pinhole.normal(state.plane(at), x as f32, y as f32);
            confidence[(x, y)] = sharpened(cost);
        }
    }
    DepthEstimate {
        image_id: problem.reference.id,
        image_name: problem.image_name.clone(),
        source_ids: problem.sources.iter().map(|s| s.id).collect(),
        camera: problem.reference.camera.clone(),
        depth_range: problem.depth_range,
        depth,
        normal: Some(normal),
        confidence: Some(confidence),
    }
}

/// Confidence of a matching cost.
pub(crate) fn sharpened(cost: f32) -> f32 {
    let c = (1.0 - cost).clamp(0.0, 1.0);
    let c = (c * c) * (c * c);
    c * c
}

/// The matching cost, at most 1, of a confidence.
pub(crate) fn cost_of(confidence: f32) -> f32 {
    1.0 - confidence.max(0.0).sqrt().sqrt().sqrt()
}

#[cfg(test)]
mod tests {
    use super::{cost_of, sharpened};

    #[test]
    fn confidence_falls_from_one_to_zero() {
        assert_eq!(
            [sharpened(0.0), sharpened(0.5), sharpened(1.0), sharpened(1.2)],
            [1.0, 0.00390625, 0.0, 0.0]
        );
        assert_eq!([1.0, 0.00390625, 0.0].map(cost_of), [0.0, 0.5, 1.0]);
    }
}
