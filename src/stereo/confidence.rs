//! From final costs to the maps that leave the estimator.

use super::level::Level;
use super::problem::StereoProblem;
use super::state::State;
use crate::scene::{DepthEstimate, Grid};

/// Depth, normal and confidence of every pixel whose cost is below `keep_cost`; confidence = 1 − cost, at least 0.
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
            let cost = state.total[at];
            if state.active[at] < 0.5 || !(cost < keep_cost) || !(d >= low && d < high) {
                continue;
            }
            depth[(x, y)] = d;
            normal[(x, y)] = level.pinhole.normal(state.plane(at), x as f32, y as f32);
            confidence[(x, y)] = (1.0 - cost).clamp(0.0, 1.0);
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
