//! Kernels in plain safe code that the compiler vectorises: the readable truth, and the oracle of every other path.
//!
//! No fused multiply-add and no reassociation: the same bytes come out at every instruction-set level.

#![expect(clippy::needless_range_loop, reason = "x counts the pixels of several rows at once")]

mod correlation;
mod geometric;
mod patch;
mod smoothness;
mod warp;

pub(super) use patch::prepare;
pub(super) use smoothness::begin;

use super::math::fraction_and_index;
use crate::stereo::level::Level;
use crate::stereo::plane::InversePlane;
use crate::stereo::tile::{CENTRE, REACH, ROBUST_COST, Row, TILE_H, TILE_W, Tile, UNSEEN, WinRow};
use correlation::{finish_zncc, merged, two_best, zncc_row};
use geometric::geometric_row;
use smoothness::{accept, refresh, smooth_candidate};
use warp::{Coverage, Warp, bilinear, warp, window_inside};

const ZERO: Row = [0.0; TILE_W];

/// The 16 values from column `at`.
#[inline(always)]
fn cut(row: &WinRow, at: usize) -> &Row {
    row[at..].first_chunk::<TILE_W>().unwrap_or(&ZERO)
}

/// Tries one plane on all pixels of the tile; pixels that it suits better take it. The plane is anchored at the
/// tile's centre. Returns whether any pixel took it.
#[inline(always)]
pub(in crate::stereo::cost) fn try_plane(tile: &mut Tile, level: &Level, plane: InversePlane) -> bool {
    let (low, high) = level.w_range;
    let thinkable = plane.w >= low * 0.5 && plane.w <= high * 2.0;
    if !thinkable || !data_cost(tile, level, plane) {
        return false;
    }
    smooth_candidate(&tile.halo, &mut tile.scratch, level, tile.x0, tile.y0, plane);
    let taken = accept(&mut tile.belief, &tile.scratch, plane, low, high);
    if taken {
        refresh(tile, level);
    }
    taken
}

/// Matching cost of a plane over all sources, as the best and second best per pixel. False if no source sees it.
#[inline(always)]
fn data_cost(tile: &mut Tile, level: &Level, plane: InversePlane) -> bool {
    let Tile { x0, y0, patch, scratch, views, .. } = tile;
    scratch.best = [[UNSEEN; TILE_W]; TILE_H];
    scratch.second = [[UNSEEN; TILE_W]; TILE_H];
    let mut any = false;
    for (source, view) in level.sources.iter().zip(views.iter_mut()).filter(|(_, view)| view.on) {
        view.cost = UNSEEN;
        let coverage = warp(source, *x0, *y0, plane, scratch);
        if coverage == Coverage::None {
            continue;
        }
        any = true;
        let mut sum = ZERO;
        for y in 0..TILE_H {
            let mut cost = zncc_row(patch, &scratch.warped, y);
            if coverage == Coverage::Part {
                let v = &scratch.valid;
                let corners = [
                    cut(&v[y], 0),
                    cut(&v[y], 2 * REACH),
                    cut(&v[y + 2 * REACH], 0),
                    cut(&v[y + 2 * REACH], 2 * REACH),
                ];
                for x in 0..TILE_W {
                    let all = corners[0][x] * corners[1][x] * corners[2][x] * corners[3][x];
                    cost[x] = if all > 0.5 { cost[x] } else { ROBUST_COST };
                }
            }
            if let Some(g) = &source.geometry {
                let (mut w, yy) = (ZERO, (*y0 + y as i32) as f32);
                for x in 0..TILE_W {
                    w[x] = plane.w + plane.wx * (x as f32 - CENTRE.0) + plane.wy * (y as f32 - CENTRE.1);
                }
                geometric_row(g, *x0 as f32, yy, &w, level.geometric_weight, &mut cost);
            }
            two_best(&mut scratch.best[y], &mut scratch.second[y], &cost);
            for x in 0..TILE_W {
                sum[x] += cost[x];
            }
        }
        view.cost = sum.iter().sum::<f32>() / (TILE_W * TILE_H) as f32;
    }
    any
}

/// Matching cost of every pixel's own plane: no sharing, so several times dearer than a shared plane.
#[inline(always)]
pub(in crate::stereo::cost) fn score_own(tile: &mut Tile, level: &Level) {
    for y in 0..TILE_H {
        score_own_row(tile, level, y);
    }
}

#[inline(always)]
fn score_own_row(tile: &mut Tile, level: &Level, y: usize) {
    let Tile { x0, y0, patch, belief, .. } = tile;
    let (row, w) = ((*y0 + y as i32) as f32, belief.w[y]);
    let (mut best, mut second) = ([UNSEEN; TILE_W], [UNSEEN; TILE_W]);
    for source in &level.sources {
        let (max_u, max_v) = (source.width as f32 - 2.0, source.height as f32 - 2.0);
        if max_u < 1.0 || max_v < 1.0 {
            continue;
        }
        let mut warps = [Warp::default(); TILE_W];
        let mut valid = ZERO;
        for x in 0..TILE_W {
            let p = InversePlane { w: w[x], wx: belief.wx[y][x], wy: belief.wy[y][x] };
            if let Some(m) = Warp::new(&source.a, &source.b, (*x0 + x as i32) as f32, row, p) {
                valid[x] = if window_inside(&m, max_u, max_v) { 1.0 } else { 0.0 };
                warps[x] = m;
            }
        }
        let (mut sum, mut square, mut cross) = (ZERO, ZERO, ZERO);
        for tap in 0..25 {
            let (i, j) = (tap / 5 * 2, tap % 5 * 2);
            let t = cut(&patch.texel[y + i], j);
            let weight = &patch.weight[y][tap];
            for x in 0..TILE_W {
                let (u, v, _) = warps[x].at(j as f32 - 4.0, i as f32 - 4.0);
                let (fu, iu) = fraction_and_index(u.max(1.0).min(max_u));
                let (fv, iv) = fraction_and_index(v.max(1.0).min(max_v));
                let index = iv.wrapping_mul(source.width as u32).wrapping_add(iu);
                let s = bilinear(source.quads.get(index as usize).copied().unwrap_or(0), fu, fv);
                let sw = s * weight[x];
                sum[x] += sw;
                square[x] += s * sw;
                cross[x] += t[x] * sw;
            }
        }
        let mut cost = finish_zncc(patch, y, &sum, &square, &cross);
        for x in 0..TILE_W {
            cost[x] = if valid[x] > 0.5 { cost[x] } else { ROBUST_COST };
        }
        if let Some(g) = &source.geometry {
            geometric_row(g, *x0 as f32, row, &w, level.geometric_weight, &mut cost);
        }
        two_best(&mut best, &mut second, &cost);
    }
    belief.data[y] = merged(&best, &second);
}
