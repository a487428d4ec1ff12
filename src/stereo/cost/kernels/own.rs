//! Every pixel's own plane: nothing is shared, so an evaluation costs several times that of a shared plane.

use super::correlation::{Sums, add, finish, merged};
use super::geometric::geometric_term;
use super::warp::{MIN_DEPTH_RATIO, clamped, texels};
use super::{LANE, Lanes, cut};
use crate::stereo::level::{Level, Source};
use crate::stereo::tile::{Patch, REACH, ROBUST_COST, TAPS, TILE_H, TILE_W, Tile, UNSEEN};

/// Matching cost of every pixel's own plane.
#[inline(always)]
pub(in crate::stereo::cost) fn score_own<L: Lanes>(tile: &mut Tile, level: &Level) {
    let Tile { x0, y0, patch, belief, .. } = tile;
    for y in 0..TILE_H {
        let at = (*x0 as f32, (*y0 + y as i32) as f32);
        let planes = [L::load(&belief.w[y]), L::load(&belief.wx[y]), L::load(&belief.wy[y])];
        let (mut best, mut second) = ([UNSEEN; TILE_W], [UNSEEN; TILE_W]);
        for source in level.sources.iter().filter(|s| s.width > 2 && s.height > 2) {
            let mut cost = of_row(patch, source, at, planes, y);
            if let Some(g) = &source.geometry {
                let term = geometric_term(g, at, planes[0], level.geometric_weight);
                cost = L::select(cost.lt(L::splat(ROBUST_COST)), cost + term, cost);
            }
            let (b, s) = (L::load(&best), L::load(&second));
            s.min(b.max(cost)).store(&mut second);
            b.min(cost).store(&mut best);
        }
        merged::<L>(&best, &second).store(&mut belief.data[y]);
    }
}

/// Correlation cost of a row of pixels, each with its own window in the source.
#[inline(always)]
fn of_row<L: Lanes>(patch: &Patch, source: &Source, at: (f32, f32), planes: [L; 3], y: usize) -> L {
    let warps = WarpRow::new(source, at, planes);
    let inside = warps.inside(source);
    let sums = match L::all(inside) {
        true => correlated::<L, true>(patch, source, &warps, y),
        false => correlated::<L, false>(patch, source, &warps, y),
    };
    L::select(inside, finish(patch, y, sums), L::splat(ROBUST_COST))
}

/// Sums over the windows of row `y`; unless they are all `INSIDE` the source, samples are clamped.
#[inline(always)]
fn correlated<L: Lanes, const INSIDE: bool>(
    patch: &Patch,
    source: &Source,
    warps: &WarpRow<L>,
    y: usize,
) -> Sums<L> {
    let mut sums: Sums<L> = [L::splat(0.0); 3];
    for tap in 0..TAPS {
        let (i, j) = (tap / 5 * 2, tap % 5 * 2);
        let (mut u, mut v) = warps.near(j as f32 - REACH as f32, i as f32 - REACH as f32);
        if !INSIDE {
            (u, v, _) = clamped(source, u, v);
        }
        let t = cut(&patch.texel[y + i], j);
        add(&mut sums, texels(source, u, v), t, L::load(&patch.weight[y][tap]));
    }
    sums
}

/// The homographies of a row of pixels, each anchored at its pixel: source pixel of an offset `(ox, oy)` is
/// `centre + (ox·d_dx + oy·d_dy) / z` with `z = 1 + ox·z_dx + oy·z_dy`.
struct WarpRow<L: Lanes> {
    centre: [L; 2],
    d_dx: [L; 2],
    d_dy: [L; 2],
    z_dx: L,
    z_dy: L,
    /// Depth in the source, times inverse depth.
    z: L,
}

impl<L: Lanes> WarpRow<L> {
    #[inline(always)]
    fn new(Source { a, b, .. }: &Source, (x, y): (f32, f32), [w, wx, wy]: [L; 3]) -> Self {
        let column = L::splat(x) + L::load(&LANE);
        let c = |r: usize| L::splat(a[r][0]) * column + L::splat(a[r][1] * y + a[r][2]) + L::splat(b[r]) * w;
        let dx = |r: usize| L::splat(a[r][0]) + L::splat(b[r]) * wx;
        let dy = |r: usize| L::splat(a[r][1]) + L::splat(b[r]) * wy;
        let z = c(2);
        let r = L::splat(1.0) / L::splat(1e-6).max(z);
        let centre = [c(0) * r, c(1) * r];
        WarpRow {
            centre,
            d_dx: [(dx(0) - centre[0] * dx(2)) * r, (dx(1) - centre[1] * dx(2)) * r],
            d_dy: [(dy(0) - centre[0] * dy(2)) * r, (dy(1) - centre[1] * dy(2)) * r],
            z_dx: dx(2) * r,
            z_dy: dy(2) * r,
            z,
        }
    }

    /// Source pixels of an offset, and the depth ratios there.
    #[inline(always)]
    fn at(&self, ox: f32, oy: f32) -> (L, L, L) {
        let (ox, oy) = (L::splat(ox), L::splat(oy));
        let z = L::splat(1.0) + ox * self.z_dx + oy * self.z_dy;
        let r = L::splat(1.0) / z;
        let along = |k: usize| self.centre[k] + (ox * self.d_dx[k] + oy * self.d_dy[k]) * r;
        (along(0), along(1), z)
    }

    /// Source pixels of an offset within the matching window, where 1 / z is 1 − e + e² for any usable plane.
    #[inline(always)]
    fn near(&self, ox: f32, oy: f32) -> (L, L) {
        let (ox, oy, one) = (L::splat(ox), L::splat(oy), L::splat(1.0));
        let e = ox * self.z_dx + oy * self.z_dy;
        let r = one - e * (one - e);
        let along = |k: usize| self.centre[k] + (ox * self.d_dx[k] + oy * self.d_dy[k]) * r;
        (along(0), along(1))
    }

    /// Where the whole matching window lies inside the source and in front of it.
    #[inline(always)]
    fn inside(&self, source: &Source) -> L::Mask {
        const R: f32 = REACH as f32;
        let mut all = L::splat(1e-6).lt(self.z);
        for (ox, oy) in [(-R, -R), (R, -R), (-R, R), (R, R)] {
            let (u, v, z) = self.at(ox, oy);
            let (_, _, within) = clamped(source, u, v);
            all = L::both(all, L::both(within, L::splat(MIN_DEPTH_RATIO).le(z)));
        }
        all
    }
}
