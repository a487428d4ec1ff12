//! Fusion from the first view to the last: maps come in, points go out, neither is ever complete in memory.

use super::correspond::Matching;
use super::merge::Merger;
use super::participant::Participant;
use super::pipe::Pipe;
use super::plan::FusionPlan;
use super::state::PixelStates;
use super::summary::{FusionSummary, Tally};
use super::unfused::project_maps;
use super::working_set::{WorkingSet, load_checked};
use super::{AttributeSource, FusionOptions, FusionView, MapSource};
use crate::error::{Error, Result};
use crate::progress::{Progress, Stage, Steps};
use crate::scene::{CloudLayout, PointSink, ViewIndex};
use crate::semantics::ClassPolicy;

/// What is fused.
#[derive(Clone, Copy)]
pub struct FusionInput<'a> {
    /// All views of the scene, in the scene's order.
    pub views: &'a [FusionView],
    /// Their maps.
    pub source: &'a dyn MapSource,
    /// What to do with each class; `None`: there are no labels. Views without a label map are void then.
    pub policy: Option<&'a ClassPolicy>,
}

impl FusionInput<'_> {
    /// Attributes of the points that [`fuse`] makes of this input.
    pub fn layout(&self, options: &FusionOptions) -> CloudLayout {
        let all_have_normals = self.views.iter().filter_map(|view| view.maps).all(|maps| maps.normals);
        CloudLayout {
            normals: all_have_normals && options.estimate_normals == AttributeSource::DuringFusion,
            colors: options.estimate_colors != AttributeSource::None,
            views: true,
            weights: options.number_views_fuse >= 2,
            confidence: false,
            labels: self.policy.is_some(),
        }
    }
}

/// Merges the depth maps of all views into points and sends them to `sink` in their final order.
///
/// Views take turns by decreasing number of neighbours. A pixel that no point has claimed starts a point; a pixel of
/// a neighbour at its projection joins when depth and normal are similar and, with a policy, the classes agree; whether
/// it may be claimed already is up to [`FusionOptions::support`]. With enough views the point is kept and its pixels are
/// claimed; surfaces of neighbours behind it are discarded. Position, colour and normal are means weighted by
/// `1 / (max(1 − confidence, 0.03) depth²)`. With the default options the result is that of OpenMVS 2.3.0, point for
/// point; the class check follows Stathopoulou and Remondino 2019, Algorithm 1.
///
/// # Errors
/// Those of the source and the sink; maps of different sizes; missing images where colours are wanted.
pub fn fuse(
    input: &FusionInput<'_>,
    options: &FusionOptions,
    progress: &Progress,
    sink: &mut dyn PointSink,
) -> Result<FusionSummary> {
    options.check()?;
    let plan = FusionPlan::new(input.views, options);
    let mut tally = Tally::new(input.policy.is_some());
    let stage = if options.number_views_fuse < 2 { Stage::Merge } else { Stage::Fuse };
    let done = progress.start(stage, plan.steps.len());
    let depths = match stage {
        Stage::Merge => merge_plainly(input, &plan, options, &mut tally, (progress, &done), sink)?,
        _ => fuse_by_turns(input, &plan, options, &mut tally, (progress, &done), sink)?,
    };
    Ok(tally.into_summary(plan.steps.len(), depths))
}

/// Every depth becomes a point; returns the number of depths.
fn merge_plainly(
    input: &FusionInput<'_>,
    plan: &FusionPlan,
    options: &FusionOptions,
    tally: &mut Tally,
    (progress, done): (&Progress, &Steps),
    sink: &mut dyn PointSink,
) -> Result<u64> {
    let mut depths = 0;
    for step in &plan.steps {
        progress.check()?;
        let maps = load_checked(input.views, plan, input.source, step.view)?;
        require_color(step.view, &maps.estimate.image_name, maps.color.is_some(), options)?;
        let labels = maps.labels.as_ref().map(|labels| labels.data());
        depths += count_pixels(maps.estimate.depth.data().iter().copied(), labels, input.policy, tally);
        tally.points += project_maps(step.view, &maps, input.policy, input.layout(options), sink)?;
        done.step();
    }
    Ok(depths)
}

/// Views take turns to start points; returns the number of depths that were not invalidated before their turn.
fn fuse_by_turns(
    input: &FusionInput<'_>,
    plan: &FusionPlan,
    options: &FusionOptions,
    tally: &mut Tally,
    (progress, done): (&Progress, &Steps),
    sink: &mut dyn PointSink,
) -> Result<u64> {
    let min_views = (options.number_views_fuse as usize).min(input.views.len());
    let matching = Matching {
        max_depth_diff: options.depth_diff_threshold,
        min_cos_normal: options.min_cos_normal(),
        policy: input.policy,
    };
    let merger = Merger::new(min_views, input.policy);
    let mut pipe = Pipe::new(matching, merger, options.estimate_colors, input.layout(options));
    let mut maps = WorkingSet::new(input, plan, options);
    let mut depths = 0;
    for (i, step) in plan.steps.iter().enumerate() {
        progress.check()?;
        maps.prepare(i)?;
        let views: Vec<ViewIndex> = step.views().collect();
        let reference = maps.maps(step.view)?;
        require_color(step.view, &reference.name, reference.has_color(), options)?;
        depths +=
            count_pixels(reference.pixels.iter().map(|p| p.depth), reference.labels(), input.policy, tally);
        depths -= maps.invalidated(step.view);
        let mut states = views.iter().map(|&v| maps.take_states(v)).collect::<Vec<_>>();
        tally.invalidated.clear();
        tally.invalidated.resize(views.len(), 0);
        let participants =
            views.iter().map(|&v| Ok(Participant::new(v, maps.maps(v)?))).collect::<Result<Vec<_>>>()?;
        count_rejected(&participants, &states, input.policy, tally);
        let mut turn = Ok(());
        let mut next = Vec::new();
        rayon::in_place_scope(|scope| {
            scope.spawn(|_| next = maps.load_ahead(i + 1));
            turn = pipe.take_turn(&participants, &mut states, tally, sink);
        });
        turn?;
        for ((&view, states), &invalidated) in views.iter().zip(states).zip(&tally.invalidated) {
            maps.restore(view, states);
            maps.add_invalidated(view, invalidated);
        }
        maps.finish(i);
        maps.insert(next)?;
        done.step();
    }
    Ok(depths)
}

/// Counts the free pixels of the first view that start no point because of their class.
fn count_rejected(
    views: &[Participant<'_>],
    states: &[PixelStates],
    policy: Option<&ClassPolicy>,
    tally: &mut Tally,
) {
    let Some(policy) = policy.filter(|policy| !policy.keeps_everything()) else { return };
    for pixel in states[0].free_in_range(0, views[0].pixels.len()) {
        let label = views[0].label(pixel);
        if !policy.is_candidate(label) {
            tally.class(label).rejected_by_class += 1;
        }
    }
}

fn require_color(view: ViewIndex, name: &str, has_color: bool, options: &FusionOptions) -> Result<()> {
    if options.estimate_colors == AttributeSource::None || has_color {
        return Ok(());
    }
    Err(Error::invalid(format!(
        "view {} ({name}): no image to take colours from; provide it, or give --estimate-colors 0",
        view.0
    )))
}

/// Counts the pixels of a view by class; returns the number of depths.
fn count_pixels(
    depths: impl Iterator<Item = f32>,
    labels: Option<&[u16]>,
    policy: Option<&ClassPolicy>,
    tally: &mut Tally,
) -> u64 {
    if policy.is_none() {
        return depths.map(|d| u64::from(d > 0.0)).sum();
    }
    let mut count = 0;
    for (i, depth) in depths.enumerate() {
        let class = tally.class(labels.map_or(0, |l| l[i]));
        class.pixels += 1;
        class.depths += u64::from(depth > 0.0);
        count += u64::from(depth > 0.0);
    }
    count
}
