//! Bilaterally weighted zero-mean normalised cross-correlation, and the two best of several views.

use super::{Lanes, cut};
use crate::stereo::tile::{Patch, ROBUST_COST, Row, TILE_H, TileMap, WIN_H, WinRow};

/// Grey levels of a source sample: values are 65536 times the grey level.
const SAMPLE: f32 = 65_536.0;
/// Products of variances below this cannot be compared (grey levels², squared sample units).
const FLAT: f32 = 1e-3 * SAMPLE * SAMPLE;

/// Weighted sums of a row of pixels over their windows: source, source squared, source times reference.
pub(super) type Sums<L> = [L; 3];

/// Correlation cost 0..2 of every pixel of the tile against the warped window.
#[inline(always)]
pub(super) fn of_tile<L: Lanes>(patch: &Patch, warped: &[WinRow; WIN_H], cost: &mut TileMap) {
    match L::ROWS {
        4 => of_rows::<L, 4>(patch, warped, cost),
        2 => of_rows::<L, 2>(patch, warped, cost),
        _ => of_rows::<L, 1>(patch, warped, cost),
    }
}

/// Rows `y`, `y + 2`, … share the window rows they see, so `N` of them are summed together.
#[inline(always)]
fn of_rows<L: Lanes, const N: usize>(patch: &Patch, warped: &[WinRow; WIN_H], cost: &mut TileMap) {
    let mut first = 0;
    while first < TILE_H {
        let mut sums = [[L::splat(0.0); 3]; N];
        window_row::<L, N, 0>(patch, warped, first, &mut sums);
        window_row::<L, N, 1>(patch, warped, first, &mut sums);
        window_row::<L, N, 2>(patch, warped, first, &mut sums);
        window_row::<L, N, 3>(patch, warped, first, &mut sums);
        window_row::<L, N, 4>(patch, warped, first, &mut sums);
        window_row::<L, N, 5>(patch, warped, first, &mut sums);
        window_row::<L, N, 6>(patch, warped, first, &mut sums);
        window_row::<L, N, 7>(patch, warped, first, &mut sums);
        for (k, sums) in sums.into_iter().enumerate() {
            let y = first + 2 * k;
            finish(patch, y, sums).store(&mut cost[y]);
        }
        // 0, 1 for four rows at a time; 0, 1, 4, 5 for two; every row for one
        first += if N == 1 || first.is_multiple_of(2) { 1 } else { 2 * N - 1 };
    }
}

/// Adds every second texel of window row `first + 2 R` to the rows that see it.
#[inline(always)]
fn window_row<L: Lanes, const N: usize, const R: usize>(
    patch: &Patch,
    warped: &[WinRow; WIN_H],
    first: usize,
    sums: &mut [Sums<L>; N],
) {
    if R >= N + 4 {
        return;
    }
    let (source, reference) = (&warped[(first + 2 * R) % WIN_H], &patch.texel[(first + 2 * R) % WIN_H]);
    for j in 0..5 {
        let (v, t): (L, L) = (cut(source, 2 * j), cut(reference, 2 * j));
        for (k, sums) in sums.iter_mut().enumerate() {
            if R >= k && R - k < 5 {
                let w = L::load(&patch.weight[(first + 2 * k) % TILE_H][5 * (R - k) + j]);
                add(sums, v, t, w);
            }
        }
    }
}

#[inline(always)]
pub(super) fn add<L: Lanes>(sums: &mut Sums<L>, v: L, t: L, w: L) {
    let vw = v * w;
    sums[0] = sums[0] + vw;
    sums[1] = sums[1] + v * vw;
    sums[2] = sums[2] + t * vw;
}

/// Cost from the weighted sums of row `y`.
#[inline(always)]
pub(super) fn finish<L: Lanes>(patch: &Patch, y: usize, [sum, square, cross]: Sums<L>) -> L {
    let mean = sum * L::load(&patch.inverse_weight[y]);
    let norm = square - mean * sum;
    let covariance = cross - L::load(&patch.mean[y]) * sum;
    let product = norm * L::load(&patch.norm[y]);
    let flat = L::splat(FLAT);
    let correlation = (covariance / product.max(flat).sqrt()).min(L::splat(1.0));
    let cost = (L::splat(1.0) - correlation).min(L::splat(2.0));
    L::select(flat.lt(product), cost, L::splat(ROBUST_COST))
}

/// Mean of the two best costs; the best alone where no second source could be compared.
#[inline(always)]
pub(super) fn merged<L: Lanes>(best: &Row, second: &Row) -> L {
    let (best, second) = (L::load(best), L::load(second));
    let mean = L::splat(0.5) * (best + second);
    L::select(second.lt(L::splat(ROBUST_COST)), mean, best).min(L::splat(2.0))
}
