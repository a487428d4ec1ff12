//! One view's turn: bands of rows go through the passes one behind the other, several bands at a time.
//!
//! While the claims of one band are made, which only one thread can do, the other threads look for the
//! correspondences of the next band and sum up the points of the one before.

use super::accumulate::Accumulator;
use super::correspond::{Matching, RowMatches, RowScratch};
use super::merge::{Merger, RowClaims};
use super::options::AttributeSource;
use super::participant::Participant;
use super::state::PixelStates;
use super::summary::Tally;
use crate::error::Result;
use crate::scene::{CloudLayout, PointCloud, PointSink, PointSource};
use rayon::prelude::*;

/// Pixels of the reference view in a band, by thread: few enough for what one pass has read to be in the cache for the
/// next.
const BAND_PIXELS: usize = 1 << 11;

/// Passes, and so bands under way: correspondences, claims, sums, points to the sink.
const PASSES: usize = 4;

/// Buffers for one row, reused from band to band.
#[derive(Default)]
struct RowWork {
    y: u32,
    matches: RowMatches,
    claims: RowClaims,
    points: PointCloud,
}

/// Rows that go through a pass together.
type Band = Vec<RowWork>;

/// How points are made, and the buffers for it.
pub(super) struct Pipe<'a> {
    pub(super) matching: Matching<'a>,
    pub(super) merger: Merger<'a>,
    pub(super) colors: AttributeSource,
    pub(super) layout: CloudLayout,
    /// The bands under way, by number modulo [`PASSES`].
    bands: [Band; PASSES],
    /// The states when the turn began.
    before: Vec<PixelStates>,
}

impl<'a> Pipe<'a> {
    pub(super) fn new(
        matching: Matching<'a>,
        merger: Merger<'a>,
        colors: AttributeSource,
        layout: CloudLayout,
    ) -> Self {
        Pipe { matching, merger, colors, layout, bands: Default::default(), before: Vec::new() }
    }

    /// Makes points of the free pixels of the first of `views` and the matching ones of the others. `states` are parallel
    /// to `views`; so are the counts of invalidated pixels that `tally` has afterwards.
    ///
    /// # Errors
    /// Those of `sink`.
    pub(super) fn take_turn(
        &mut self,
        views: &[Participant<'_>],
        states: &mut [PixelStates],
        tally: &mut Tally,
        sink: &mut dyn PointSink,
    ) -> Result<()> {
        let Some(reference) = views.first() else { return Ok(()) };
        self.before.resize_with(states.len(), PixelStates::default);
        self.before.iter_mut().zip(&*states).for_each(|(before, states)| before.copy(states));
        let (width, height) = (reference.width as usize, reference.height as usize);
        let threads = rayon::current_num_threads();
        let rows = (threads * BAND_PIXELS / width.max(1)).max(threads).min(height.max(1));
        let count = height.div_ceil(rows);
        for tick in 0..count + PASSES - 1 {
            self.tick(tick, count, rows, views, states, tally, sink)?;
        }
        Ok(())
    }

    /// Every band under way goes through its next pass.
    #[allow(clippy::too_many_arguments, reason = "all that a turn consists of")]
    fn tick(
        &mut self,
        tick: usize,
        count: usize,
        rows: usize,
        views: &[Participant<'_>],
        states: &mut [PixelStates],
        tally: &mut Tally,
        sink: &mut dyn PointSink,
    ) -> Result<()> {
        let Pipe { matching, merger, colors, layout, bands, before } = self;
        bands.rotate_right(1);
        let [matched, claimed, summed, pushed] = bands;
        let is_on = |pass: usize| (pass..pass + count).contains(&tick);
        if is_on(0) {
            start_band(matched, tick * rows, rows, views[0].height as usize);
        }
        let mut sums = Ok(());
        let mut pushes = Ok(());
        rayon::in_place_scope(|scope| {
            let (matching, before, colors, layout, sums) =
                (&*matching, &*before, *colors, *layout, &mut sums);
            if is_on(2) {
                scope.spawn(move |_| *sums = sum_band(summed, views, colors, layout));
            }
            if is_on(0) {
                scope.spawn(move |_| match_band(matched, views, before, matching));
            }
            if is_on(1) {
                for row in claimed.iter_mut() {
                    merger.merge_row(views, row.y, &row.matches, states, &mut row.claims, tally);
                }
            }
            if is_on(3) {
                pushes = pushed.iter().try_for_each(|row| row.points.for_each(&mut |point| sink.push(point)));
            }
        });
        sums.and(pushes)
    }
}

fn start_band(band: &mut Band, top: usize, rows: usize, height: usize) {
    band.resize_with(rows.min(height - top), RowWork::default);
    band.iter_mut().zip(top as u32..).for_each(|(row, y)| row.y = y);
}

fn match_band(band: &mut Band, views: &[Participant<'_>], states: &[PixelStates], matching: &Matching<'_>) {
    band.par_iter_mut().for_each_init(RowScratch::default, |scratch, row| {
        row.matches.compute(scratch, views, states, row.y, matching);
    });
}

fn sum_band(
    band: &mut Band,
    views: &[Participant<'_>],
    colors: AttributeSource,
    layout: CloudLayout,
) -> Result<()> {
    band.par_iter_mut().try_for_each_init(Accumulator::default, |sums, row| {
        row.points.reset(layout);
        sums.emit_row(views, row.y, &row.matches, &row.claims, colors, &mut row.points)
    })
}
