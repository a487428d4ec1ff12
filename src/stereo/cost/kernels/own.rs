//! Every pixel's own plane: nothing is shared, so an evaluation costs several times that of a shared plane.

use super::correlation::{SumRows, finish, merged, of_samples};
use super::geometric::geometric_term;
use super::homographies::{FIXED, SMOOTH};
use super::label::label_term;
use super::warp::{MIN_DEPTH_RATIO, clamped, texels};
use super::{LANE, Lanes};
use crate::stereo::level::{Level, Source};
use crate::stereo::tile::{
    Patch, REACH, ROBUST_COST, TAP_COLUMNS, TAP_ROWS, TAPS, TILE_H, TILE_W, Tile, UNSEEN,
};

/// Matching cost of every pixel's own plane over the views in use.
#[inline(always)]
pub(in crate::stereo::cost) fn score_own<L: Lanes>(tile: &mut Tile, level: &Level) {
    let Tile { x0, y0, classes, patch, belief, order, views, .. } = tile;
    for y in 0..TILE_H {
        let at = (*x0 as f32, (*y0 + y as i32) as f32);
        let column = L::splat(at.0) + L::load(&LANE);
        let planes = [L::load(&belief.w[y]), L::load(&belief.wx[y]), L::load(&belief.wy[y])];
        let (mut best, mut second) = ([UNSEEN; TILE_W], [UNSEEN; TILE_W]);
        for &k in order.iter().take(*views) {
            let source = &level.sources[k];
            if source.width <= 2 || source.height <= 2 {
                continue;
            }
            let mut cost = of_row(patch, source, at, planes, y);
            if let Some(g) = &source.geometry {
                let term = geometric_term(g, (column, L::splat(at.1)), planes[0], level.geometric_weight);
                cost = L::select(cost.lt(L::splat(ROBUST_COST)), cost + term, cost);
            }
            if let Some(labels) = &source.labels {
                let term = label_term(source, labels, (classes, y), at, planes[0], level.label_cost);
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
    let sums = match L::all(L::both(inside, warps.nearly_quadratic())) {
        true => smooth::<L>(patch, source, &warps, y),
        false => correlated::<L>(patch, source, &warps, y),
    };
    L::select(inside, finish::<L>(patch, y, &sums), L::splat(ROBUST_COST))
}

/// Sums over the windows of row `y`; samples are clamped.
#[inline(always)]
fn correlated<L: Lanes>(patch: &Patch, source: &Source, warps: &WarpRow<L>, y: usize) -> SumRows {
    let base = below_zero::<L>(sample::<L>(source, warps, 2, 2, L::whole(0)));
    let mut samples = [[0; TILE_W]; TAPS];
    for (tap, samples) in samples.iter_mut().enumerate() {
        let (i, j) = (tap / TAP_COLUMNS, tap % TAP_COLUMNS);
        let below =
            if i + 1 < TAP_ROWS { sample::<L>(source, warps, 2 * i + 1, j, base) } else { L::whole(0) };
        let here = sample::<L>(source, warps, 2 * i, j, base);
        L::store_words(L::paired(here, below), samples);
    }
    of_samples::<L>(patch, y, &samples)
}

/// What takes samples from a zero at `level`, a sample itself.
#[inline(always)]
fn below_zero<L: Lanes>(level: L::Bits) -> L::Bits {
    L::shifted_right::<5>(L::negated(level))
}

/// Samples of row `i`, column `j` of the matching windows.
#[inline(always)]
fn sample<L: Lanes>(source: &Source, warps: &WarpRow<L>, i: usize, j: usize, base: L::Bits) -> L::Bits {
    let (u, v) = warps.near((2 * j) as f32 - REACH as f32, (2 * i) as f32 - REACH as f32);
    let (u, v, _) = clamped(source, u, v);
    texels::<L>(source, u.truncated(), v.truncated(), base)
}

/// Sums over the windows of row `y`, which are inside the source, by warps that are quadratic in the offset.
#[inline(always)]
fn smooth<L: Lanes>(patch: &Patch, source: &Source, warps: &WarpRow<L>, y: usize) -> SumRows {
    let [u, v] = warps.centre;
    let base = below_zero::<L>(texels::<L>(source, u.truncated(), v.truncated(), L::whole(0)));
    let mut samples = [[0; TILE_W]; TAPS];
    for (i, samples) in samples.chunks_exact_mut(TAP_COLUMNS).enumerate() {
        let mut upper = TapRow::new(warps, 2 * i);
        let mut lower = TapRow::new(warps, 2 * i + 1);
        for samples in samples {
            let here = texels::<L>(source, upper.at[0], upper.at[1], base);
            upper.advance();
            let below = if i + 1 < TAP_ROWS {
                texels::<L>(source, lower.at[0], lower.at[1], base)
            } else {
                L::whole(0)
            };
            lower.advance();
            L::store_words(L::paired(here, below), samples);
        }
    }
    of_samples::<L>(patch, y, &samples)
}

/// Source pixels, in fixed point, of a row of the matching windows, tap after tap, by second differences.
struct TapRow<L: Lanes> {
    at: [L::Bits; 2],
    step: [L::Bits; 2],
    bend: [L::Bits; 2],
}

impl<L: Lanes> TapRow<L> {
    #[inline(always)]
    fn new(warps: &WarpRow<L>, i: usize) -> Self {
        let oy = (2 * i) as f32 - REACH as f32;
        let [u, v] = [Self::coordinate(warps, 0, oy), Self::coordinate(warps, 1, oy)];
        TapRow { at: [u[0], v[0]], step: [u[1], v[1]], bend: [u[2], v[2]] }
    }

    /// `centre + (ox·dx + oy·dy)·(1 − e)` at the first tap, and its differences.
    #[inline(always)]
    fn coordinate(warps: &WarpRow<L>, k: usize, oy: f32) -> [L::Bits; 3] {
        let (dx, dy) = (warps.d_dx[k], warps.d_dy[k]);
        let (first, oy, two) = (L::splat(-(REACH as f32)), L::splat(oy), L::splat(2.0));
        let e = first * warps.z_dx + oy * warps.z_dy;
        let straight = first * dx + oy * dy;
        let at = warps.centre[k] + straight * (L::splat(1.0) - e);
        // (ox + 2, e + 2 z_dx) less (ox, e): 2 dx (1 − e) − 2 z_dx (straight + 2 dx).
        let step = two * (dx * (L::splat(1.0) - e) - warps.z_dx * (straight + two * dx));
        let bend = L::splat(-8.0) * dx * warps.z_dx;
        [at.truncated(), step.truncated(), bend.truncated()]
    }

    #[inline(always)]
    fn advance(&mut self) {
        for k in 0..2 {
            self.at[k] = L::plus(self.at[k], self.step[k]);
            self.step[k] = L::plus(self.step[k], self.bend[k]);
        }
    }
}

/// The homographies of a row of pixels, each anchored at its pixel: source pixel, in fixed point, of an offset `(ox, oy)` is
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
        let (mut c, mut dx, mut dy) = ([w; 3], [w; 3], [w; 3]);
        for i in 0..3 {
            c[i] = L::splat(a[i][0]) * column + L::splat(a[i][1] * y + a[i][2]) + L::splat(b[i]) * w;
            dx[i] = L::splat(a[i][0]) + L::splat(b[i]) * wx;
            dy[i] = L::splat(a[i][1]) + L::splat(b[i]) * wy;
        }
        let z = c[2];
        let s = L::splat(1.0) / L::splat(1e-6).max(z);
        let r = s * L::splat(FIXED);
        let centre = [c[0] * r, c[1] * r];
        WarpRow {
            centre,
            d_dx: [dx[0] * r - centre[0] * dx[2] * s, dx[1] * r - centre[1] * dx[2] * s],
            d_dy: [dy[0] * r - centre[0] * dy[2] * s, dy[1] * r - centre[1] * dy[2] * s],
            z_dx: dx[2] * s,
            z_dy: dy[2] * s,
            z,
        }
    }

    /// Source pixels of an offset, and the depth ratios there.
    #[inline(always)]
    fn at(&self, ox: f32, oy: f32) -> (L, L, L) {
        let (ox, oy) = (L::splat(ox), L::splat(oy));
        let z = L::splat(1.0) + ox * self.z_dx + oy * self.z_dy;
        let r = L::splat(1.0) / z;
        let (u, v) = self.along(ox, oy, r);
        (u, v, z)
    }

    /// Where the depth ratio hardly changes within the matching window.
    #[inline(always)]
    fn nearly_quadratic(&self) -> L::Mask {
        ((self.z_dx.abs() + self.z_dy.abs()) * L::splat(REACH as f32)).lt(L::splat(SMOOTH))
    }

    /// Source pixels of an offset within the matching window, where 1 / z is 1 − e + e² for any usable plane.
    #[inline(always)]
    fn near(&self, ox: f32, oy: f32) -> (L, L) {
        let (ox, oy, one) = (L::splat(ox), L::splat(oy), L::splat(1.0));
        let e = ox * self.z_dx + oy * self.z_dy;
        let r = one - e * (one - e);
        self.along(ox, oy, r)
    }

    #[inline(always)]
    fn along(&self, ox: L, oy: L, r: L) -> (L, L) {
        let [u, v] = self.centre;
        let [u_dx, v_dx] = self.d_dx;
        let [u_dy, v_dy] = self.d_dy;
        (u + (ox * u_dx + oy * u_dy) * r, v + (ox * v_dx + oy * v_dy) * r)
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
