//! The reference side: bilateral weights and statistics of every pixel's patch.

use super::{Lanes, cut};
use crate::stereo::level::{Level, STEPS, Weighting};
use crate::stereo::tile::{Patch, REACH, TAP_COLUMNS, TAPS, TILE_H, TILE_W, Tile, WIN_H, WIN_W, WinRow};

/// Its 64th power is 32,767, the largest weight as a 16-bit number.
const ROOT_OF_FULL_WEIGHT: f32 = 1.176_396_4;
/// What a 16-bit weight counts in units of products, as [`Pairs::scaled`](super::Pairs::scaled) multiplies.
const WEIGHT_UNIT: f32 = 1.0 / 32_768.0;
/// Rows of a matching window.
const WINDOW_ROWS: usize = TAP_COLUMNS;
/// How fast the prior from the coarser level fades with texture.
const PRIOR_FALLOFF: f32 = 109.0 / (255.0 * 255.0 * STEPS * STEPS);

/// Bilateral weights and patch statistics of every pixel of the tile.
#[inline(always)]
pub(in crate::stereo::cost) fn prepare<L: Lanes>(tile: &mut Tile, level: &Level) {
    let (w, h) = (level.size.width as i32, level.size.height as i32);
    let (x0, y0, reach) = (tile.x0, tile.y0, REACH as i32);
    let interior =
        x0 >= reach && y0 >= reach && x0 + (TILE_W as i32) + reach <= w && y0 + (TILE_H as i32) + reach <= h;
    if interior {
        for y in 0..TILE_H {
            row::<L, true>(&mut tile.patch, &tile.scratch.valid, level.weighting, y);
        }
    } else {
        for (r, row) in tile.scratch.valid.iter_mut().enumerate() {
            for (c, v) in row.iter_mut().enumerate() {
                let (x, y) = (x0 - reach + c as i32, y0 - reach + r as i32);
                *v = if x >= 0 && y >= 0 && x < w && y < h { 1.0 } else { 0.0 };
            }
        }
        for y in 0..TILE_H {
            row::<L, false>(&mut tile.patch, &tile.scratch.valid, level.weighting, y);
        }
    }
    for y in 0..WIN_H {
        pair_up::<L>(&mut tile.patch, y);
    }
    let (patch, belief) = (&tile.patch, &mut tile.belief);
    for y in 0..TILE_H {
        let k = L::bell64(L::load(&patch.norm[y]) * L::splat(PRIOR_FALLOFF));
        let known = L::splat(0.0).lt(L::load(&belief.prior_z[y]));
        L::select(known, k, L::splat(0.0)).store(&mut belief.prior_k[y]);
    }
}

/// Row `y`; unless the tile is `INTERIOR`, texels that are not `inside` the image weigh nothing.
#[inline(always)]
fn row<L: Lanes, const INTERIOR: bool>(
    patch: &mut Patch,
    inside: &[WinRow; WIN_H],
    weighting: Weighting,
    y: usize,
) {
    let grey = L::splat(weighting.grey / (STEPS * STEPS) * (ROOT_OF_FULL_WEIGHT / 64.0));
    let centre: L = cut(&patch.texel[y + REACH], REACH);
    let [mut sum, mut first, mut second] = [L::splat(0.0); 3];
    for pair in 0..TAPS {
        let (i, j) = (pair / TAP_COLUMNS * 4, pair % TAP_COLUMNS * 2);
        let mut halves = [L::whole(0); 2];
        for (below, half) in halves.iter_mut().enumerate().take(WINDOW_ROWS - i / 2) {
            let i = i + 2 * below;
            let (dy, dx) = (i as f32 - REACH as f32, j as f32 - REACH as f32);
            let t: L = cut(&patch.texel[y + i], j);
            let d = t - centre;
            let away = (dx * dx + dy * dy) * weighting.space * (1.0 / 64.0);
            let mut w = L::bell64_of(L::splat(ROOT_OF_FULL_WEIGHT * (1.0 - away)) - d * d * grey);
            if !INTERIOR {
                w = w * cut(&inside[y + i], j);
            }
            *half = (w + L::splat(0.5)).truncated();
            let wt = w * t;
            sum = sum + w;
            first = first + wt;
            second = second + wt * t;
        }
        let [low, high] = halves;
        L::store_words(
            L::paired(L::shifted_left::<16>(low), L::shifted_left::<16>(high)),
            &mut patch.weight[y][pair],
        );
    }
    let inverse = L::splat(1.0) / sum.max(L::splat(1e-12));
    let mean = first * inverse;
    (inverse * L::splat(1.0 / WEIGHT_UNIT)).store(&mut patch.inverse_weight[y]);
    mean.store(&mut patch.mean[y]);
    ((second - first * mean).max(L::splat(0.0)) * L::splat(WEIGHT_UNIT)).store(&mut patch.norm[y]);
}

/// Packs window row `y` with the one two rows below it.
#[inline(always)]
fn pair_up<L: Lanes>(patch: &mut Patch, y: usize) {
    for at in [0, WIN_W - TILE_W] {
        let low = L::shifted_left::<16>(cut::<L>(&patch.texel[y], at).truncated());
        let high = L::shifted_left::<16>(cut::<L>(&patch.texel[(y + 2) % WIN_H], at).truncated());
        let pairs = L::paired(low, high);
        if let Some(to) = patch.pairs[y][at..].first_chunk_mut() {
            L::store_words(pairs, to);
        }
    }
}

const _: () = assert!(WIN_W >= TILE_W + 2 * REACH);
