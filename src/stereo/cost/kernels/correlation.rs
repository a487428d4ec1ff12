//! Bilaterally weighted zero-mean normalised cross-correlation, and the two best of several views.

use super::{Lanes, Pairs};
use crate::stereo::level::STEPS;
use crate::stereo::tile::{
    Patch, ROBUST_COST, Row, TAP_COLUMNS, TAP_ROWS, TAPS, TILE_H, TILE_W, TileMap, WIN_H, WinWords, Words,
};

/// Source samples per grey level, as [`Lanes::bilinear`] gives them.
const SAMPLES: f32 = 255.0 * 255.0 / 2048.0;
/// Products of variances below this cannot be compared: 0.001 grey levels⁴.
const FLAT: f32 = 1e-3 * STEPS * STEPS * SAMPLES * SAMPLES;

/// Rounded weights leave about this many times a window's mean in the variance of a window without texture.
const ROUNDING: f32 = 1.0;
/// Weighted sums over matching windows: source, source squared, source times reference.
type Sums<P> = [P; 3];

/// Weighted sums of a row of pixels as whole numbers.
pub(super) type SumRows = [Words; 3];

/// Correlation cost 0..2 of every pixel of the tile against the warped window.
#[inline(always)]
pub(super) fn of_tile<L: Lanes>(patch: &Patch, warped: &[WinWords; WIN_H], cost: &mut TileMap) {
    for first in 0..TILE_H / 2 {
        let mut rows: [SumRows; 2] = [[[0; TILE_W]; 3]; 2];
        two_rows::<L::Pairs, 0>(patch, warped, first, &mut rows);
        if L::Pairs::WIDTH < 16 {
            two_rows::<L::Pairs, 8>(patch, warped, first, &mut rows);
        }
        if L::Pairs::WIDTH < 8 {
            two_rows::<L::Pairs, 4>(patch, warped, first, &mut rows);
            two_rows::<L::Pairs, 12>(patch, warped, first, &mut rows);
        }
        for (k, sums) in rows.iter().enumerate() {
            let y = first + 4 * k;
            finish::<L>(patch, y, sums).store(&mut cost[y]);
        }
    }
}

/// Sums of rows `first` and `first + 4`, which share window rows, from column `X` on.
#[inline(always)]
fn two_rows<P: Pairs, const X: usize>(
    patch: &Patch,
    warped: &[WinWords; WIN_H],
    first: usize,
    to: &mut [SumRows; 2],
) {
    let mut sums = [[P::splat(0); 3]; 2];
    window_rows::<P, X, 0>(patch, warped, first, &mut sums);
    window_rows::<P, X, 1>(patch, warped, first, &mut sums);
    window_rows::<P, X, 2>(patch, warped, first, &mut sums);
    window_rows::<P, X, 3>(patch, warped, first, &mut sums);
    for (sums, to) in sums.into_iter().zip(to) {
        for (sum, to) in sums.into_iter().zip(to) {
            sum.store(to, X);
        }
    }
}

/// Adds window rows `first + 4 G` and the ones below them.
#[inline(always)]
fn window_rows<P: Pairs, const X: usize, const G: usize>(
    patch: &Patch,
    warped: &[WinWords; WIN_H],
    first: usize,
    sums: &mut [Sums<P>; 2],
) {
    let row = (first + 4 * G) % WIN_H;
    let [upper, lower] = sums;
    let [mut upper_weighted, mut lower_weighted] = [[P::splat(0); TAP_COLUMNS]; 2];
    for (j, (of_upper, of_lower)) in upper_weighted.iter_mut().zip(&mut lower_weighted).enumerate() {
        let v = P::load(&warped[row], X + 2 * j);
        let t = P::load(&patch.pairs[row], X + 2 * j);
        if G < TAP_ROWS {
            let weight = P::load(&patch.weight[first % TILE_H][TAP_COLUMNS * G + j], X);
            *of_upper = add_products(upper, v, t, weight);
        }
        if G > 0 {
            let weight = P::load(&patch.weight[(first + 4) % TILE_H][TAP_COLUMNS * (G - 1) + j], X);
            *of_lower = add_products(lower, v, t, weight);
        }
    }
    if G < TAP_ROWS {
        add(upper, upper_weighted);
    }
    if G > 0 {
        add(lower, lower_weighted);
    }
}

/// Correlation sums of row `y` with every pixel's own samples.
#[inline(always)]
pub(super) fn of_samples<L: Lanes>(patch: &Patch, y: usize, samples: &[Words; TAPS]) -> SumRows {
    let mut out = [[0; TILE_W]; 3];
    for x in (0..TILE_W).step_by(L::Pairs::WIDTH) {
        let mut sums = [L::Pairs::splat(0); 3];
        for (i, samples) in samples.chunks_exact(TAP_COLUMNS).enumerate() {
            let mut weighted = [L::Pairs::splat(0); TAP_COLUMNS];
            for (j, samples) in samples.iter().enumerate() {
                let t = L::Pairs::load(&patch.pairs[y + 4 * i], x + 2 * j);
                let weight = L::Pairs::load(&patch.weight[y][TAP_COLUMNS * i + j], x);
                weighted[j] = add_products(&mut sums, L::Pairs::load(samples, x), t, weight);
            }
            add(&mut sums, weighted);
        }
        for (sum, to) in sums.into_iter().zip(&mut out) {
            sum.store(to, x);
        }
    }
    out
}

/// Adds the products of pairs of texels of source and reference with their weights. Returns weighted source texels.
#[inline(always)]
fn add_products<P: Pairs>(sums: &mut Sums<P>, source: P, reference: P, weight: P) -> P {
    let weighted = weight.scaled(source);
    sums[1] = sums[1].plus_dot(weighted, source);
    sums[2] = sums[2].plus_dot(weighted, reference);
    weighted
}

/// Adds pairs of weighted source texels. Differences of grey levels are below 255: four of them fit 16 bits.
#[inline(always)]
fn add<P: Pairs>(sums: &mut Sums<P>, [a, b, c, d, e]: [P; TAP_COLUMNS]) {
    let ones = P::splat(0x0001_0001);
    sums[0] = sums[0].plus_dot(a.plus(b).plus(c.plus(d)), ones).plus_dot(e, ones);
}

const _: () = assert!(4.0 * 255.0 * SAMPLES < i16::MAX as f32);

/// Cost from the weighted sums of row `y`.
#[inline(always)]
pub(super) fn finish<L: Lanes>(patch: &Patch, y: usize, [sum, square, cross]: &SumRows) -> L {
    let sum = L::from_whole(L::load_words(sum));
    let square = L::from_whole(L::load_words(square));
    let cross = L::from_whole(L::load_words(cross));
    let mean = sum * L::load(&patch.inverse_weight[y]);
    let norm = square - mean * sum;
    let covariance = cross - L::load(&patch.mean[y]) * sum;
    let product = norm * L::load(&patch.norm[y]);
    let flat = L::splat(FLAT);
    let cost = (L::splat(1.0) - covariance * product.inverse_sqrt()).max(L::splat(0.0));
    let textured = L::both(flat.lt(product), (mean.abs() * L::splat(ROUNDING)).lt(norm));
    L::select(textured, cost, L::splat(ROBUST_COST))
}

const _: () = assert!(TILE_H == 8 && WIN_H == 4 * (TAP_ROWS + 1));

/// Mean of the two best costs; the best alone where no second source could be compared.
#[inline(always)]
pub(super) fn merged<L: Lanes>(best: &Row, second: &Row) -> L {
    let (best, second) = (L::load(best), L::load(second));
    let mean = L::splat(0.5) * (best + second);
    L::select(second.lt(L::splat(ROBUST_COST)), mean, best).min(L::splat(2.0))
}
