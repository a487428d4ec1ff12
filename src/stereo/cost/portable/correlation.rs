//! Bilaterally weighted zero-mean normalised cross-correlation, and the two best of several views.

use super::cut;
use crate::stereo::tile::{Patch, ROBUST_COST, Row, TILE_W, WIN_H, WinRow};

/// Products of variances below this cannot be compared (grey levels², source grey levels × 256).
const FLAT: f32 = 1e-3 * 65_536.0;
const ZERO: Row = [0.0; TILE_W];

/// Bilaterally weighted zero-mean normalised cross-correlation of every pixel of row `y`, as a cost 0..2.
#[inline(always)]
pub(super) fn zncc_row(patch: &Patch, warped: &[WinRow; WIN_H], y: usize) -> Row {
    let (mut sum, mut square, mut cross) = (ZERO, ZERO, ZERO);
    for i in 0..5 {
        let (warped, texel) = (&warped[y + 2 * i], &patch.texel[y + 2 * i]);
        for j in 0..5 {
            let (v, t, w) = (cut(warped, 2 * j), cut(texel, 2 * j), &patch.weight[y][5 * i + j]);
            for x in 0..TILE_W {
                let vw = v[x] * w[x];
                sum[x] += vw;
                square[x] += v[x] * vw;
                cross[x] += t[x] * vw;
            }
        }
    }
    finish_zncc(patch, y, &sum, &square, &cross)
}

#[inline(always)]
pub(super) fn finish_zncc(patch: &Patch, y: usize, sum: &Row, square: &Row, cross: &Row) -> Row {
    let mut cost = ZERO;
    for x in 0..TILE_W {
        let mean = sum[x] / patch.sum_weight[y][x];
        let norm = square[x] - mean * sum[x];
        let covariance = cross[x] - patch.mean[y][x] * sum[x];
        let q = norm * patch.norm[y][x];
        let c = 1.0 - (covariance / q.max(FLAT).sqrt()).min(1.0);
        cost[x] = if q > FLAT { c.min(2.0) } else { ROBUST_COST };
    }
    cost
}

#[inline(always)]
pub(super) fn two_best(best: &mut Row, second: &mut Row, cost: &Row) {
    for x in 0..TILE_W {
        second[x] = second[x].min(best[x].max(cost[x]));
        best[x] = best[x].min(cost[x]);
    }
}

/// Mean of the two best costs; the best alone where no second source could be compared.
#[inline(always)]
pub(super) fn merged(best: &Row, second: &Row) -> Row {
    let mut out = ZERO;
    for x in 0..TILE_W {
        let mean = 0.5 * (best[x] + second[x]);
        out[x] = (if second[x] >= ROBUST_COST { best[x] } else { mean }).min(2.0);
    }
    out
}
