//! Fusion from the first view to the last: maps come in, points go out, neither is ever complete in memory.

use super::accumulate::Accumulator;
use super::correspond::{Matching, Participant, RowMatches};
use super::merge::{Merger, RowClaims};
use super::plan::FusionPlan;
use super::summary::{FusionSummary, Tally};
use super::unfused::project_maps;
use super::working_set::WorkingSet;
use super::{AttributeSource, FusionMaps, FusionOptions, FusionView, MapSource};
use crate::error::{Error, Result};
use crate::progress::{Progress, Stage};
use crate::scene::{CloudLayout, PointCloud, PointSink, PointSource, ViewIndex};
use crate::semantics::ClassPolicy;
use rayon::prelude::*;

/// Free pixels of the reference view that are worked on at a time.
const BAND_PIXELS: usize = 1 << 16;

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
/// a neighbour at its projection joins when depth and normal are similar and, with a policy, the classes agree. With
/// enough views the point is kept and its pixels are claimed; surfaces of neighbours behind it are discarded.
/// Position, colour and normal are means weighted by `1 / (max(1 − confidence, 0.03) depth²)`. The result is that of
/// OpenMVS 2.3.0, point for point; the class check follows Stathopoulou and Remondino 2019, Algorithm 1.
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
    let mut maps = WorkingSet::new(input.views, &plan, input.source, options.map_memory);
    let mut tally = Tally::new(input.policy.is_some());
    let mut turn = Turn::new(input, &plan, options);
    let mut depths = 0;
    let stage = if options.number_views_fuse < 2 { Stage::Merge } else { Stage::Fuse };
    let done = progress.start(stage, plan.steps.len());
    for (i, step) in plan.steps.iter().enumerate() {
        maps.prepare(i)?;
        let reference = maps.maps(step.view)?;
        require_color(step.view, reference, options)?;
        depths += count_pixels(reference, input.policy, &mut tally) - maps.invalidated(step.view);
        if options.number_views_fuse < 2 {
            tally.points += project_maps(step.view, reference, input.policy, input.layout(options), sink)?;
        } else {
            turn.take(&step.views().collect::<Vec<_>>(), &mut maps, &mut tally, sink)?;
        }
        maps.finish(i);
        done.step();
    }
    Ok(tally.into_summary(plan.steps.len(), depths))
}

fn require_color(view: ViewIndex, maps: &FusionMaps, options: &FusionOptions) -> Result<()> {
    if options.estimate_colors == AttributeSource::None || maps.color.is_some() {
        return Ok(());
    }
    Err(Error::invalid(format!(
        "view {} ({}): no image to take colours from; provide it, or give --estimate-colors 0",
        view.0, maps.estimate.image_name
    )))
}

/// Counts the pixels of a view by class; returns the number of depths.
fn count_pixels(maps: &FusionMaps, policy: Option<&ClassPolicy>, tally: &mut Tally) -> u64 {
    let depths = maps.estimate.depth.data();
    if policy.is_some() {
        let labels = maps.labels.as_ref().map(|labels| labels.data());
        for (i, &depth) in depths.iter().enumerate() {
            let class = tally.class(labels.map_or(0, |l| l[i]));
            class.pixels += 1;
            class.depths += u64::from(depth > 0.0);
        }
    }
    depths.iter().map(|&d| u64::from(d > 0.0)).sum()
}

/// Buffers for one row, reused from band to band.
#[derive(Default)]
struct RowWork {
    matches: RowMatches,
    claims: RowClaims,
    sums: Accumulator,
    points: PointCloud,
}

/// One view's turn to start points.
struct Turn<'a> {
    matching: Matching<'a>,
    merger: Merger<'a>,
    colors: AttributeSource,
    use_normals: bool,
    rows: Vec<RowWork>,
    layout: CloudLayout,
}

impl<'a> Turn<'a> {
    fn new(input: &FusionInput<'a>, plan: &FusionPlan, options: &FusionOptions) -> Self {
        let min_views = (options.number_views_fuse as usize).min(input.views.len());
        Turn {
            matching: Matching {
                max_depth_diff: options.depth_diff_threshold,
                min_cos_normal: options.min_cos_normal(),
                policy: input.policy,
            },
            merger: Merger::new(min_views, input.policy),
            colors: options.estimate_colors,
            use_normals: plan.normals,
            rows: Vec::new(),
            layout: input.layout(options),
        }
    }

    /// Makes points of the free pixels of the first of `views` and the matching ones of the others.
    fn take(
        &mut self,
        views: &[ViewIndex],
        maps: &mut WorkingSet<'_>,
        tally: &mut Tally,
        sink: &mut dyn PointSink,
    ) -> Result<()> {
        let mut free: Vec<_> = views.iter().map(|&v| maps.take_free(v)).collect();
        tally.invalidated.clear();
        tally.invalidated.resize(views.len(), 0);
        let participants = views
            .iter()
            .map(|&v| Ok(Participant::new(v, maps.maps(v)?, self.use_normals)))
            .collect::<Result<Vec<_>>>()?;
        if let Some(policy) = self.matching.policy.filter(|policy| !policy.keeps_everything()) {
            for pixel in free[0].in_range(0, participants[0].depth.len()) {
                let label = participants[0].label(pixel);
                if !policy.is_candidate(label) {
                    tally.class(label).rejected_by_class += 1;
                }
            }
        }
        let (width, height) = (participants[0].width as usize, participants[0].height as usize);
        let band = (BAND_PIXELS / width.max(1)).clamp(1, height.max(1));
        for top in (0..height).step_by(band) {
            let rows = top as u32..(top + band).min(height) as u32;
            self.band(&participants, rows, &mut free, tally, sink)?;
        }
        for ((&view, free), &invalidated) in views.iter().zip(free).zip(&tally.invalidated) {
            maps.restore(view, free);
            maps.add_invalidated(view, invalidated);
        }
        Ok(())
    }

    fn band(
        &mut self,
        views: &[Participant<'_>],
        rows: std::ops::Range<u32>,
        free: &mut [super::state::FreePixels],
        tally: &mut Tally,
        sink: &mut dyn PointSink,
    ) -> Result<()> {
        let (top, layout, colors) = (rows.start, self.layout, self.colors);
        self.rows.resize_with(rows.len().max(self.rows.len()), RowWork::default);
        let work = &mut self.rows[..rows.len()];
        let (matching, snapshot) = (&self.matching, &*free);
        work.par_iter_mut().enumerate().for_each(|(i, row)| {
            row.matches.compute(views, snapshot, top + i as u32, matching);
        });
        for (i, row) in work.iter_mut().enumerate() {
            self.merger.merge_row(views, top + i as u32, &row.matches, free, &mut row.claims, tally);
        }
        work.par_iter_mut().enumerate().try_for_each(|(i, row)| {
            row.points.reset(layout);
            let y = top + i as u32;
            row.sums.emit_row(views, y, &row.matches, &row.claims, colors, &mut row.points)
        })?;
        work.iter().try_for_each(|row| row.points.for_each(&mut |point| sink.push(point)))
    }
}
