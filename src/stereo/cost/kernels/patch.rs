//! The reference side: bilateral weights and statistics of every pixel's patch.

use super::{Lanes, cut};
use crate::stereo::level::Level;
use crate::stereo::tile::{Patch, REACH, TAPS, TILE_H, TILE_W, Tile, WIN_H, WIN_W, WinRow};

/// 1 / (2 σ²) of the grey-level difference, σ = 0.068 of the range.
const GREY_FALLOFF: f32 = 109.0 / (255.0 * 255.0);
/// 1 / (2 σ²) of the distance in pixels, σ = 3.
const SPACE_FALLOFF: f32 = 1.0 / 18.0;
/// How fast the prior from the coarser level fades with texture.
const PRIOR_FALLOFF: f32 = 109.0 / (255.0 * 255.0);

/// Bilateral weights and patch statistics of every pixel of the tile.
#[inline(always)]
pub(in crate::stereo::cost) fn prepare<L: Lanes>(tile: &mut Tile, level: &Level) {
    let (w, h) = (level.size.width as i32, level.size.height as i32);
    let (x0, y0, reach) = (tile.x0, tile.y0, REACH as i32);
    let interior =
        x0 >= reach && y0 >= reach && x0 + (TILE_W as i32) + reach <= w && y0 + (TILE_H as i32) + reach <= h;
    if interior {
        (0..TILE_H).for_each(|y| row::<L, true>(&mut tile.patch, &tile.scratch.valid, y));
    } else {
        for (r, row) in tile.scratch.valid.iter_mut().enumerate() {
            for (c, v) in row.iter_mut().enumerate() {
                let (x, y) = (x0 - reach + c as i32, y0 - reach + r as i32);
                *v = if x >= 0 && y >= 0 && x < w && y < h { 1.0 } else { 0.0 };
            }
        }
        (0..TILE_H).for_each(|y| row::<L, false>(&mut tile.patch, &tile.scratch.valid, y));
    }
    let (patch, belief) = (&tile.patch, &mut tile.belief);
    for y in 0..TILE_H {
        let k = L::bell64(L::load(&patch.norm[y]) * L::splat(PRIOR_FALLOFF));
        let known = L::splat(0.0).lt(L::load(&belief.prior_w[y]));
        L::select(known, k, L::splat(0.0)).store(&mut belief.prior_k[y]);
    }
}

/// Row `y`; unless the tile is `INTERIOR`, texels that are not `inside` the image weigh nothing.
#[inline(always)]
fn row<L: Lanes, const INTERIOR: bool>(patch: &mut Patch, inside: &[WinRow; WIN_H], y: usize) {
    let centre: L = cut(&patch.texel[y + REACH], REACH);
    let [mut sum, mut first, mut second] = [L::splat(0.0); 3];
    for tap in 0..TAPS {
        let (i, j) = (tap / 5 * 2, tap % 5 * 2);
        let (dy, dx) = (i as f32 - 4.0, j as f32 - 4.0);
        let t: L = cut(&patch.texel[y + i], j);
        let d = t - centre;
        let away = d * d * L::splat(GREY_FALLOFF) + L::splat((dx * dx + dy * dy) * SPACE_FALLOFF);
        let mut w = L::bell64(away);
        if !INTERIOR {
            w = w * cut(&inside[y + i], j);
        }
        w.store(&mut patch.weight[y][tap]);
        let wt = w * t;
        sum = sum + w;
        first = first + wt;
        second = second + wt * t;
    }
    let inverse = L::splat(1.0) / sum.max(L::splat(1e-12));
    let mean = first * inverse;
    inverse.store(&mut patch.inverse_weight[y]);
    mean.store(&mut patch.mean[y]);
    (second - first * mean).max(L::splat(0.0)).store(&mut patch.norm[y]);
}

const _: () = assert!(WIN_W >= TILE_W + 2 * REACH);
