//! Depth estimation: one [`StereoProblem`] in, one [`DepthEstimate`] out.
//!
//! PatchMatch (Bleyer et al. 2011) over tiles whose pixels share every hypothesis (Lu et al. 2013), from coarse to
//! fine, with bilaterally weighted zero-mean normalised cross-correlation over several source views, a smoothness
//! factor, and passes that compare hypotheses with the sources' own depth maps. Opens no file, prints nothing.

mod candidates;
mod confidence;
mod cost;
mod level;
mod options;
mod plane;
mod plane_fit;
mod problem;
mod proposals;
mod region_planes;
mod rng;
mod solver;
mod source_planes;
mod state;
#[cfg(test)]
mod tests;
mod texels;
mod tile;

pub use cost::CpuLevel;
pub use options::{Quality, StereoOptions};
pub use problem::{ProblemLabels, ReferenceImage, SourceImage, SparsePoint, StereoProblem};
pub use source_planes::SourcePlanes;
pub use texels::SourceTexels;

use crate::scene::DepthEstimate;
use crate::{Error, Result};
use cost::Kernels;
use level::{Level, MAX_SIDE, Weighting};
use plane::Pinhole;
use proposals::Proposals;
use region_planes::draw_to_planes;
use solver::{Pass, Solver, Start};
use state::State;
use std::sync::Arc;

/// Shortest image side of a coarser level, in pixels.
const MIN_LEVEL_SIDE: u32 = 32;
/// Factor on the keep threshold while geometric passes are still to come, which cost a hypothesis up to 0.4 more.
const RELAXED: f32 = 4.0 / 3.0;

/// Estimates depth, normals and confidence of the reference view by photometric matching.
///
/// Depths are in scene units along the reference's optical axis, normals in its camera frame, confidence is
/// (1 − cost)⁸. The result depends on the problem and the options alone. If geometric passes follow
/// (`options.geometric_iterations > 0`) the threshold on the cost is relaxed by a third.
///
/// # Errors
/// [`Error::Invalid`] if the problem has no source, an impossible depth range, or images and cameras of different sizes.
pub fn estimate(problem: &StereoProblem, options: &StereoOptions, cpu: CpuLevel) -> Result<DepthEstimate> {
    check(problem)?;
    options.check()?;
    let kernels = Kernels::of(cpu);
    let view = problem.reference.id.0;
    let coarsest = coarsest_level(problem, options.levels);
    let mut previous: Option<State> = None;
    let mut finished = None;
    for halvings in (0..=coarsest).rev() {
        let mut level = Level::new(problem, halvings);
        if halvings == 0 && options.geometric_iterations == 0 {
            level.weighting = Weighting::ALONE;
        }
        let mut state = match &previous {
            None => State::random(&level, problem, view, options.seed),
            Some(coarse) => State::refined(&level, coarse, problem.skip.as_ref()),
        };
        let mut solver = Solver::new(kernels, &level, options.seed, view, None);
        let spared = u32::from(halvings == 0 && coarsest > 0);
        for i in 0..options.iterations.saturating_sub(spared).max(1) {
            let start = match (i, halvings == coarsest) {
                (0, true) => Start::Random,
                (0, false) => Start::Coarser,
                _ => Start::Current,
            };
            solver.pass(
                &mut state,
                Pass {
                    key: halvings << 16 | i,
                    iteration: i,
                    shift: i as usize,
                    candidates: options.candidates as usize,
                    random: if start == Start::Random { 32 } else { 0 },
                    random_if_bad: if halvings == coarsest { 8 } else { 4 },
                    refinements: options.refinements as usize,
                    views: options.compared_views as usize,
                    start,
                },
            );
        }
        finished = (halvings == 0).then(|| {
            let relaxed = if options.geometric_iterations > 0 { RELAXED } else { 1.0 };
            let mut estimate = confidence::finish(problem, &level, &state, options.keep_cost * relaxed);
            if options.geometric_iterations == 0 {
                draw_to_planes(problem, kernels, &level, &state, options.seed, &mut estimate);
            }
            estimate
        });
        previous = Some(state);
    }
    finished.ok_or_else(|| Error::invalid("no level to estimate"))
}

/// One pass over an estimate that also compares hypotheses with the sources' own depth maps of the pass before.
///
/// `sources` runs parallel to `problem.sources`; a missing map switches the term off for that source. `pass` counts
/// from 0 and keys the random numbers.
///
/// # Errors
/// As [`estimate`]; also if `previous` has another size than the reference.
pub fn refine_geometric(
    problem: &StereoProblem,
    previous: &DepthEstimate,
    sources: &[Option<Arc<SourcePlanes>>],
    pass: usize,
    options: &StereoOptions,
    cpu: CpuLevel,
) -> Result<DepthEstimate> {
    check(problem)?;
    options.check()?;
    let size = problem.reference.gray.size();
    if previous.depth.size() != size {
        return Err(Error::invalid(format!(
            "{}: the depth map is {}, the image {size}",
            problem.image_name,
            previous.depth.size()
        )));
    }
    let level = Level::new(problem, 0).with_geometry(
        &problem.reference.camera,
        sources.iter().map(|s| s.as_deref()),
        options.geometric_weight,
    );
    let (fx, fy, cx, cy) = previous.camera.intrinsics();
    let pinhole = Pinhole { fx: fx as f32, fy: fy as f32, cx: cx as f32, cy: cy as f32 };
    let mut state = State::from_planes(&level, problem.skip.as_ref(), |x, y| {
        let depth = previous.depth[(x, y)];
        let normal = previous.normal.as_ref().map_or([0.0, 0.0, -1.0], |n| n[(x, y)]);
        let cost = previous.confidence.as_ref().map_or(1.0, |c| confidence::cost_of(c[(x, y)]));
        (depth > 0.0).then(|| (pinhole.plane(x as f32, y as f32, depth, normal), cost))
    });
    let kernels = Kernels::of(cpu);
    let maps = sources.iter().filter_map(|s| s.as_deref());
    let proposals = Proposals::new(&level, &state, &problem.reference.camera, maps);
    let view = problem.reference.id.0;
    let mut solver = Solver::new(kernels, &level, options.seed, view, Some(&proposals));
    solver.pass(
        &mut state,
        Pass {
            key: 0x8000_0000 | pass as u32,
            iteration: 1 + pass as u32,
            shift: if pass.is_multiple_of(2) { 2 } else { 3 },
            candidates: (2 * options.candidates as usize).div_ceil(5),
            random: 0,
            random_if_bad: 0,
            refinements: (4 * options.refinements as usize).div_ceil(5),
            views: options.compared_views as usize + 1,
            start: Start::Before,
        },
    );
    let mut estimate = confidence::finish(problem, &level, &state, options.keep_cost);
    if pass + 1 == options.geometric_iterations as usize {
        draw_to_planes(problem, kernels, &level, &state, options.seed, &mut estimate);
    }
    Ok(estimate)
}

/// Number of halvings of the coarsest level: as many as asked for, while the image stays large enough.
fn coarsest_level(problem: &StereoProblem, levels: u32) -> u32 {
    let size = problem.reference.gray.size();
    let side = size.width.min(size.height);
    let levels =
        problem.sources.iter().map(|s| s.texels.halvings()).min().map_or(levels, |of| of.min(levels));
    (0..=levels).rev().find(|&l| l == 0 || side >> l >= MIN_LEVEL_SIDE).unwrap_or(0)
}

fn check(problem: &StereoProblem) -> Result<()> {
    let fail = |what: String| Err(Error::invalid(format!("{}: {what}", problem.image_name)));
    if problem.sources.is_empty() {
        return fail("no view to match it with".into());
    }
    let (low, high) = problem.depth_range;
    if !(low > 0.0 && high > low && high.is_finite()) {
        return fail(format!("the depth range {low} to {high} is not usable"));
    }
    let reference = &problem.reference;
    let sources = problem.sources.iter().map(|s| (s.id, s.texels.size(), s.camera.size()));
    let all = std::iter::once((reference.id, reference.gray.size(), reference.camera.size())).chain(sources);
    for (id, of_image, of_camera) in all {
        let side = of_image.longest();
        if side > MAX_SIDE {
            return fail(format!(
                "image {id} has {side} pixels on a side, more than {MAX_SIDE}; halve the resolution"
            ));
        }
        if of_image != of_camera || of_image.area() == 0 {
            return fail(format!("image {id} is {of_image}, its camera is for {of_camera}"));
        }
    }
    Ok(())
}
