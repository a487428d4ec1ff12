//! The schedule: levels, passes over shifted tiles, and what each visit tries.

use super::candidates::{self, CELLS};
use super::cost::Kernels;
use super::level::Level;
use super::plane::InversePlane;
use super::proposals::{Proposals, Proposed};
use super::rng::Rng;
use super::state::State;
use super::tile::{CENTRE, TILE_H, TILE_W, Tile};

/// Planes of a tile's pixels closer than this at all four corners, in pixels of shift, count as the same.
const SAME_PLANE: f32 = 0.03;
/// The same for planes from beside the tile: they are to bring other surfaces, details are refined anyway.
const SAME_SURFACE: f32 = 0.5;
/// The same for planes that other views propose.
const SAME_PROPOSAL: f32 = 0.25;
/// Shift of the tile grid in successive passes.
const SHIFTS: [(i32, i32); 4] = [(0, 0), (-8, -4), (-4, -2), (-12, -6)];
/// Planes tried that the sources' depth maps propose for a tile.
const PROPOSALS: usize = 16;
/// Mean cost above which a tile is tried with random planes.
const BAD_TILE: f32 = 0.5;

/// What a pass over all tiles does.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pass {
    /// Keys the random numbers; different for every pass over a view.
    pub(crate) key: u32,
    /// Iteration within the level: later ones shake less.
    pub(crate) iteration: u32,
    /// Which shift of the tile grid.
    pub(crate) shift: usize,
    /// Planes of the tile's own pixels, and planes from beside it.
    pub(crate) candidates: usize,
    /// Shaken planes, and fitted ones.
    pub(crate) refinements: usize,
    /// Random planes tried on every tile.
    pub(crate) random: usize,
    /// Random planes tried on tiles that match badly.
    pub(crate) random_if_bad: usize,
    /// Source views, the best of the tile, that planes are compared with.
    pub(crate) views: usize,
    /// What the estimates that the pass starts from are worth.
    pub(crate) start: Start,
}

/// What the estimates that a pass starts from are worth.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Start {
    /// Random planes without costs. Every cell's plane is tried, against all views.
    Random,
    /// Planes of a coarser level, with its costs. Every cell's plane is tried.
    Coarser,
    /// Planes of a pass without, or with other, maps of the sources; costs do not compare with the ones to come.
    Before,
    /// The same level and the same kind of costs.
    Current,
}

/// Own planes are scored with so many of a tile's best views: an evaluation costs several times that of a shared plane.
const OWN_VIEWS: usize = 3;
/// The same for planes of a coarser level, few of which stay.
const COARSER_VIEWS: usize = 2;

/// Estimates one view: holds what the passes share.
pub(crate) struct Solver<'a> {
    pub(crate) kernels: Kernels,
    pub(crate) level: &'a Level,
    pub(crate) seed: u64,
    pub(crate) view: u32,
    proposals: Option<&'a Proposals>,
    /// Those on the tile.
    proposed: Vec<Proposed>,
    tile: Box<Tile>,
    /// Planes tried at this visit, at the tile's corners, and the class they were tried on.
    tried: Vec<([f32; 4], u32)>,
}

impl<'a> Solver<'a> {
    /// `proposals`: what other views see, if they have been estimated.
    pub(crate) fn new(
        kernels: Kernels,
        level: &'a Level,
        seed: u64,
        view: u32,
        proposals: Option<&'a Proposals>,
    ) -> Self {
        Solver {
            kernels,
            level,
            seed,
            view,
            proposals,
            proposed: Vec::new(),
            tile: Tile::boxed(level.sources.len()),
            tried: Vec::with_capacity(64),
        }
    }

    /// One pass over all tiles; every second pass goes backwards.
    pub(crate) fn pass(&mut self, state: &mut State, pass: Pass) {
        let mut order = tiles(self.level, SHIFTS[pass.shift % SHIFTS.len()]);
        if pass.iteration % 2 == 1 {
            order.reverse();
        }
        for (i, (x0, y0)) in order.into_iter().enumerate() {
            self.tile.load(self.level, state, x0, y0);
            if self.tile.belief.active.iter().flatten().all(|&a| a < 0.5) {
                continue;
            }
            let mut rng = Rng::keyed(self.seed, self.view, pass.key, i as u32);
            self.visit(state, pass, &mut rng);
            self.tile.store(state);
        }
    }

    fn visit(&mut self, state: &State, pass: Pass, rng: &mut Rng) {
        (self.kernels.prepare)(&mut self.tile, self.level);
        let ranked = self.score(pass);
        (self.kernels.begin)(&mut self.tile, self.level);
        self.tried.clear();
        let first = rng.below(CELLS);
        self.try_own(pass, first, ranked);
        for k in 0..pass.candidates {
            if let Some((p, class)) = candidates::beside(self.level, state, &self.tile, k, rng) {
                self.offer(p, class, SAME_SURFACE);
            }
        }
        self.try_proposals();
        let cost = self.mean_cost();
        let bad = if cost > BAD_TILE { pass.random_if_bad } else { 0 };
        for _ in 0..pass.random + bad {
            let p = candidates::random(self.level, rng);
            (self.kernels.try_plane)(&mut self.tile, self.level, p);
        }
        for k in 0..pass.refinements {
            self.shake(pass, first, k, rng);
        }
        for k in 0..pass.refinements {
            self.fit(first, k);
        }
    }

    /// Scores the pixels' own planes where the pass starts from others' costs. Returns whether views are in order.
    fn score(&mut self, pass: Pass) -> bool {
        let all = self.level.sources.len();
        self.tile.views = all;
        match pass.start {
            Start::Current => return false,
            Start::Random => {}
            Start::Coarser | Start::Before => {
                let Some((x, y)) = candidates::likeliest(&self.tile) else { return false };
                let plane = self.tile.plane_at(x, y);
                (self.kernels.survey)(&mut self.tile, self.level, plane);
                self.tile.rank_views();
                let views = if pass.start == Start::Coarser { COARSER_VIEWS } else { OWN_VIEWS };
                self.tile.views = views.min(all);
            }
        }
        (self.kernels.score_own)(&mut self.tile, self.level);
        pass.start != Start::Random
    }

    /// Tries planes of the tile's own pixels. Unless views are in order, the first one puts them in order.
    fn try_own(&mut self, pass: Pass, first: usize, mut ranked: bool) {
        let all = self.level.sources.len();
        let own = match pass.start {
            Start::Random | Start::Coarser => CELLS,
            Start::Before | Start::Current => pass.candidates.min(CELLS),
        };
        for k in 0..own {
            self.tile.views = if ranked { pass.views.min(all) } else { all };
            if let Some((x, y, cost)) = candidates::best_of_cell(&self.tile, candidates::spread(first, k))
                && cost < 1.5
            {
                self.offer(self.tile.plane_at(x, y), self.tile.classes[y][x], SAME_PLANE);
            }
            if !ranked {
                self.tile.rank_views();
                ranked = true;
            }
        }
        self.tile.views = pass.views.min(all);
    }

    /// Tries what the sources' depth maps propose here.
    fn try_proposals(&mut self) {
        let Some(proposals) = self.proposals else { return };
        let mut proposed = std::mem::take(&mut self.proposed);
        proposals.on(&self.tile, &mut proposed);
        for &Proposed { plane, class, .. } in proposed.iter().take(PROPOSALS) {
            self.offer(plane, class, SAME_PROPOSAL);
        }
        self.proposed = proposed;
    }

    fn shake(&mut self, pass: Pass, first: usize, k: usize, rng: &mut Rng) {
        let Some((x, y, cost)) = candidates::best_of_cell(&self.tile, candidates::spread(first, k)) else {
            return;
        };
        if cost > 1.5 {
            return;
        }
        let halvings = (k % 3) as i32 + pass.iteration as i32;
        let strength = if cost > 0.6 { 1.0 } else { 0.5f32.powi(halvings) };
        let p = candidates::shaken(self.level, &self.tile, x, y, strength, rng);
        self.try_on(p, self.tile.classes[y][x]);
    }

    fn fit(&mut self, first: usize, k: usize) {
        let Some((x, y, cost)) = candidates::best_of_cell(&self.tile, candidates::spread(first, k)) else {
            return;
        };
        let radius = if k.is_multiple_of(2) { 3 } else { 5 };
        if cost <= 1.0
            && let Some(p) = candidates::fitted(self.level, &self.tile, x, y, radius)
        {
            self.offer(p, self.tile.classes[y][x], SAME_PLANE);
        }
    }

    /// Tries a plane unless one within `same` pixels of shift was tried at this visit.
    fn offer(&mut self, p: InversePlane, class: u32, same: f32) {
        let same = same / self.level.pixels_per_w;
        let (cx, cy) = CENTRE;
        let corners = [(-cx, -cy), (cx, -cy), (-cx, cy), (cx, cy)].map(|(dx, dy)| p.moved(dx, dy).w);
        let known = |(t, of): &([f32; 4], u32)| {
            *of == class && t.iter().zip(&corners).all(|(a, b)| (a - b).abs() < same)
        };
        if self.tried.iter().any(known) {
            return;
        }
        self.tried.push((corners, class));
        self.try_on(p, class);
    }

    /// Tries a plane on the pixels of `class` and on those without class; on all if it is 0.
    fn try_on(&mut self, p: InversePlane, class: u32) {
        if class == 0 {
            (self.kernels.try_plane)(&mut self.tile, self.level, p);
            return;
        }
        let active = self.tile.belief.active;
        let classes = self.tile.classes.as_flattened();
        for (active, &of) in self.tile.belief.active.as_flattened_mut().iter_mut().zip(classes) {
            *active *= if of == class || of == 0 { 1.0 } else { 0.0 };
        }
        (self.kernels.try_plane)(&mut self.tile, self.level, p);
        self.tile.belief.active = active;
    }

    fn mean_cost(&self) -> f32 {
        let b = &self.tile.belief;
        let (mut sum, mut n) = (0.0f32, 0.0f32);
        for (data, active) in b.data.iter().flatten().zip(b.active.iter().flatten()) {
            sum += data.min(super::tile::ROBUST_COST) * active;
            n += active;
        }
        sum / n.max(1.0)
    }
}

/// First pixels of the tiles that cover the level, row by row, with the grid moved by `shift`.
fn tiles(level: &Level, shift: (i32, i32)) -> Vec<(i32, i32)> {
    let (w, h) = (level.size.width as i32, level.size.height as i32);
    let mut out = Vec::new();
    for y in (shift.1..h).step_by(TILE_H) {
        for x in (shift.0..w).step_by(TILE_W) {
            out.push((x, y));
        }
    }
    out
}
