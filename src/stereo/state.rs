//! The current estimate of every pixel of a level, as padded planes.

use super::level::{Level, PAD};
use super::plane::InversePlane;
use super::problem::{SparsePoint, StereoProblem};
use super::rng::Rng;
use crate::geometry::Size;
use crate::scene::Grid;

/// Pass number that keys the random numbers of the initialisation.
const INIT_PASS: u32 = u32::MAX;

/// Cost of what is not known: the largest there is.
pub(crate) const UNKNOWN: f32 = 2.0;

/// Estimates of a level; pixel (x, y) is at [`State::at`].
pub(crate) struct State {
    size: Size,
    stride: usize,
    /// Inverse depth.
    pub(crate) w: Vec<f32>,
    /// Change of inverse depth per column.
    pub(crate) wx: Vec<f32>,
    /// Change of inverse depth per row.
    pub(crate) wy: Vec<f32>,
    /// Matching cost.
    pub(crate) cost: Vec<f32>,
    /// Depth at the coarser level; 0 = none.
    pub(crate) prior: Vec<f32>,
    /// 1 for pixels to estimate, 0 for skipped ones and the margin.
    pub(crate) active: Vec<f32>,
}

impl State {
    fn empty(size: Size, skip: Option<&Grid<bool>>) -> Self {
        let stride = size.width as usize + 2 * PAD;
        let n = stride * (size.height as usize + 2 * PAD);
        let zeros = || vec![0.0f32; n];
        let mut s = State {
            size,
            stride,
            w: zeros(),
            wx: zeros(),
            wy: zeros(),
            cost: vec![UNKNOWN; n],
            prior: zeros(),
            active: zeros(),
        };
        for y in 0..size.height as usize {
            let at = s.at(0, y as i32);
            for x in 0..size.width as usize {
                let skipped = skip.is_some_and(|m| nearest(m, x, y, size));
                s.active[at + x] = if skipped { 0.0 } else { 1.0 };
            }
        }
        s
    }

    /// Position of column `x`, row `y`, which may lie up to [`PAD`] outside.
    #[inline]
    pub(crate) fn at(&self, x: i32, y: i32) -> usize {
        (y + PAD as i32) as usize * self.stride + (x + PAD as i32) as usize
    }

    /// The plane anchored at the pixel at position `at`.
    #[inline]
    pub(crate) fn plane(&self, at: usize) -> InversePlane {
        InversePlane { w: self.w[at], wx: self.wx[at], wy: self.wy[at] }
    }

    fn set(&mut self, at: usize, p: InversePlane) {
        (self.w[at], self.wx[at], self.wy[at]) = (p.w, p.wx, p.wy);
    }

    /// The start at the coarsest level: random planes, then the planes of the sparse points.
    pub(crate) fn random(level: &Level, problem: &StereoProblem, view: u32, seed: u64) -> Self {
        let mut s = State::empty(level.size, problem.skip.as_ref());
        for y in 0..level.size.height as i32 {
            let mut rng = Rng::keyed(seed, view, INIT_PASS, y as u32);
            for x in 0..level.size.width as i32 {
                let at = s.at(x, y);
                s.set(at, super::candidates::random(level, &mut rng));
            }
        }
        let full = problem.reference.gray.size();
        for point in &problem.sparse {
            s.splat(level, point, full);
        }
        s
    }

    /// Writes a sparse point's plane to the pixels around its projection.
    fn splat(&mut self, level: &Level, point: &SparsePoint, full: Size) {
        let scale = |v: f32, n: u32, of: u32| (v + 0.5) * n as f32 / of as f32 - 0.5;
        let x = scale(point.x, self.size.width, full.width);
        let y = scale(point.y, self.size.height, full.height);
        let plane = level.pinhole.plane(x, y, point.depth, point.normal.unwrap_or([0.0, 0.0, -1.0]));
        for (dx, dy) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            let (px, py) = (x.floor() as i32 + dx, y.floor() as i32 + dy);
            if px < 0 || py < 0 || px >= self.size.width as i32 || py >= self.size.height as i32 {
                continue;
            }
            let at = self.at(px, py);
            self.set(at, plane.moved(px as f32 - x, py as f32 - y));
        }
    }

    /// The start of a finer level: every pixel takes the plane of the coarser pixel over it.
    pub(crate) fn refined(level: &Level, coarse: &State, skip: Option<&Grid<bool>>) -> Self {
        let mut s = State::empty(level.size, skip);
        let rx = coarse.size.width as f32 / level.size.width as f32;
        let ry = coarse.size.height as f32 / level.size.height as f32;
        for y in 0..level.size.height as usize {
            let cy = (y as f32 + 0.5) * ry - 0.5;
            let iy = (cy.round() as i32).clamp(0, coarse.size.height as i32 - 1);
            for x in 0..level.size.width as usize {
                let cx = (x as f32 + 0.5) * rx - 0.5;
                let ix = (cx.round() as i32).clamp(0, coarse.size.width as i32 - 1);
                let p = coarse.plane(coarse.at(ix, iy)).moved(cx - ix as f32, cy - iy as f32);
                let at = s.at(x as i32, y as i32);
                let w = p.w.clamp(level.w_range.0, level.w_range.1);
                s.set(at, InversePlane { w, wx: p.wx * rx, wy: p.wy * ry });
                s.prior[at] = 1.0 / w;
                s.cost[at] = coarse.cost[coarse.at(ix, iy)];
            }
        }
        s
    }

    /// The start of a geometric pass: planes and costs of an estimate; pixels without one start in the middle of the range.
    pub(crate) fn from_planes(
        level: &Level,
        skip: Option<&Grid<bool>>,
        plane_of: impl Fn(usize, usize) -> Option<(InversePlane, f32)>,
    ) -> Self {
        let mut s = State::empty(level.size, skip);
        let middle = 0.5 * (level.w_range.0 + level.w_range.1);
        for y in 0..level.size.height as usize {
            for x in 0..level.size.width as usize {
                let at = s.at(x as i32, y as i32);
                let unknown = InversePlane { w: middle, wx: 0.0, wy: 0.0 };
                let (plane, cost) = plane_of(x, y).unwrap_or((unknown, UNKNOWN));
                s.set(at, plane);
                s.cost[at] = cost;
            }
        }
        s
    }
}

/// Nearest sample of `mask` for pixel `(x, y)` of a raster of `size`.
fn nearest(mask: &Grid<bool>, x: usize, y: usize, size: Size) -> bool {
    let sx = x * mask.width() / size.width as usize;
    let sy = y * mask.height() / size.height as usize;
    mask.get(sx, sy).copied().unwrap_or(false)
}
