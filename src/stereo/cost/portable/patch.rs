//! The reference side: bilateral weights and statistics of every pixel's patch.

use super::cut;
use crate::stereo::cost::math::exp;
use crate::stereo::level::Level;
use crate::stereo::tile::{Patch, REACH, TAPS, TILE_H, TILE_W, Tile, WIN_H, WIN_W, WinRow};

/// −1 / (2 σ²) of the grey-level difference, σ = 0.068 of the range.
const GREY_FALLOFF: f32 = -109.0 / (255.0 * 255.0);
/// −1 / (2 σ²) of the distance in pixels, σ = 3.
const SPACE_FALLOFF: f32 = -1.0 / 18.0;
/// How fast the prior from the coarser level fades with texture.
const PRIOR_FALLOFF: f32 = -109.0 / (255.0 * 255.0);

/// Bilateral weights and patch statistics of every pixel of the tile.
#[inline(always)]
pub(in crate::stereo::cost) fn prepare(tile: &mut Tile, level: &Level) {
    let (w, h) = (level.size.width as i32, level.size.height as i32);
    let (x0, y0, reach) = (tile.x0, tile.y0, REACH as i32);
    let interior =
        x0 >= reach && y0 >= reach && x0 + (TILE_W as i32) + reach <= w && y0 + (TILE_H as i32) + reach <= h;
    let mut inside = [[1.0f32; WIN_W]; WIN_H];
    if !interior {
        for (r, row) in inside.iter_mut().enumerate() {
            for (c, v) in row.iter_mut().enumerate() {
                let (x, y) = (x0 - reach + c as i32, y0 - reach + r as i32);
                *v = if x >= 0 && y >= 0 && x < w && y < h { 1.0 } else { 0.0 };
            }
        }
    }
    let patch = &mut tile.patch;
    for y in 0..TILE_H {
        prepare_row(patch, &inside, y);
    }
    let belief = &mut tile.belief;
    for y in 0..TILE_H {
        for x in 0..TILE_W {
            let k = exp(patch.norm[y][x] * PRIOR_FALLOFF);
            belief.prior_k[y][x] = if belief.prior_w[y][x] > 0.0 { k } else { 0.0 };
        }
    }
}

#[inline(always)]
fn prepare_row(patch: &mut Patch, inside: &[WinRow; WIN_H], y: usize) {
    let centre = *cut(&patch.texel[y + REACH], REACH);
    let (mut sum, mut first, mut second) = ([0.0; TILE_W], [0.0; TILE_W], [0.0; TILE_W]);
    for tap in 0..TAPS {
        let (i, j) = (tap / 5 * 2, tap % 5 * 2);
        let (dy, dx) = (i as f32 - 4.0, j as f32 - 4.0);
        let space = (dx * dx + dy * dy) * SPACE_FALLOFF;
        let t = cut(&patch.texel[y + i], j);
        let on = cut(&inside[y + i], j);
        let weight = &mut patch.weight[y][tap];
        for x in 0..TILE_W {
            let d = t[x] - centre[x];
            let w = exp(d * d * GREY_FALLOFF + space) * on[x];
            weight[x] = w;
            let wt = w * t[x];
            sum[x] += w;
            first[x] += wt;
            second[x] += wt * t[x];
        }
    }
    for x in 0..TILE_W {
        let s = sum[x].max(1e-12);
        patch.sum_weight[y][x] = s;
        patch.mean[y][x] = first[x] / s;
        patch.norm[y][x] = (second[x] - first[x] * (first[x] / s)).max(0.0);
    }
}
