//! Smoothness, prior and the contest: which pixels a candidate wins.

use super::correlation::merged;
use super::cut;
use crate::stereo::cost::math::exp;
use crate::stereo::level::Level;
use crate::stereo::plane::InversePlane;
use crate::stereo::tile::{Belief, CENTRE, Halo, ROBUST_COST, Row, Scratch, TILE_H, TILE_W, Tile, WIN_W};

/// −1 / (2 · 0.02²): relative distance from a neighbour's point to the plane.
const SMOOTH_DEPTH: f32 = -1250.0;
/// −1 / (2 · (13°)²): angle between the normals.
const SMOOTH_NORMAL: f32 = -9.71;
const DEPTH_BONUS: f32 = 0.07;
const NORMAL_BONUS: f32 = 0.0672;
/// Most that disagreement with the coarser level can cost.
const PRIOR_CAP: f32 = 0.5;
const ZERO: Row = [0.0; TILE_W];

/// Smoothness factor between a plane with vector `m` (`inverse_length` = 1/|m|) and inverse depth `w` at a
/// neighbouring pixel, and that neighbour's own plane: below 1 where they agree.
#[inline(always)]
fn agreement(m: [f32; 3], inverse_length: f32, w: f32, n: [f32; 3], nw: f32, on: f32) -> f32 {
    let r = (w - nw) * inverse_length;
    let near = exp(r * r * SMOOTH_DEPTH);
    let cos = (m[0] * n[0] + m[1] * n[1] + m[2] * n[2]) * inverse_length;
    let o = (1.0 - cos).max(0.0);
    let angle2 = o + o + o * o * (1.0 / 3.0);
    let parallel = exp(angle2 * SMOOTH_NORMAL);
    (1.0 - on * DEPTH_BONUS * near) * (1.0 - on * NORMAL_BONUS * parallel)
}

/// What every pixel of the tile and its surround says about a candidate plane.
#[inline(always)]
pub(super) fn smooth_candidate(
    halo: &Halo,
    scratch: &mut Scratch,
    level: &Level,
    x0: i32,
    y0: i32,
    p: InversePlane,
) {
    let m = level.pinhole.plane_vector(p, x0 as f32 + CENTRE.0, y0 as f32 + CENTRE.1);
    let inverse_length = 1.0 / (m[0] * m[0] + m[1] * m[1] + m[2] * m[2]).sqrt().max(1e-30);
    for y in 0..TILE_H + 2 {
        let base = p.w + p.wy * (y as f32 - 1.0 - CENTRE.1);
        let (nx, ny, nz, nw, on) = (&halo.nx[y], &halo.ny[y], &halo.nz[y], &halo.w[y], &halo.on[y]);
        let out = &mut scratch.smooth[y];
        for x in 0..WIN_W {
            let w = base + p.wx * (x as f32 - 1.0 - CENTRE.0);
            out[x] = agreement(m, inverse_length, w, [nx[x], ny[x], nz[x]], nw[x], on[x]);
        }
    }
}

/// Gives the candidate to every pixel for which its total cost is lower.
#[inline(always)]
pub(super) fn accept(belief: &mut Belief, scratch: &Scratch, p: InversePlane, low: f32, high: f32) -> bool {
    let mut taken = 0.0f32;
    for y in 0..TILE_H {
        let data = merged(&scratch.best[y], &scratch.second[y]);
        let s = &scratch.smooth;
        let (left, right, up, down) =
            (cut(&s[y + 1], 0), cut(&s[y + 1], 2), cut(&s[y], 1), cut(&s[y + 2], 1));
        let mut any = ZERO;
        for x in 0..TILE_W {
            let w = p.w + p.wy * (y as f32 - CENTRE.1) + p.wx * (x as f32 - CENTRE.0);
            let smooth = (left[x] * right[x]) * (up[x] * down[x]);
            let t = total_cost(data[x], smooth, w, belief.prior_w[y][x], belief.prior_k[y][x]);
            let better = t < belief.total[y][x] && w >= low && w <= high && belief.active[y][x] > 0.5;
            any[x] = if better { 1.0 } else { 0.0 };
            belief.total[y][x] = if better { t } else { belief.total[y][x] };
            belief.data[y][x] = if better { data[x] } else { belief.data[y][x] };
            belief.w[y][x] = if better { w } else { belief.w[y][x] };
            belief.wx[y][x] = if better { p.wx } else { belief.wx[y][x] };
            belief.wy[y][x] = if better { p.wy } else { belief.wy[y][x] };
        }
        taken += any.iter().sum::<f32>();
    }
    taken > 0.0
}

/// Matching cost with smoothness, blended towards agreement with the coarser level where there is no texture.
#[inline(always)]
fn total_cost(data: f32, smooth: f32, w: f32, prior_w: f32, prior_k: f32) -> f32 {
    let t = if data < ROBUST_COST { data * smooth } else { data };
    let off = (prior_w / w.max(1e-30) - 1.0).abs().min(PRIOR_CAP);
    t + prior_k * (off - t)
}

/// Turns the surround's slopes into unit normals, and computes every pixel's total cost.
#[inline(always)]
pub(in crate::stereo::cost) fn begin(tile: &mut Tile, level: &Level) {
    let halo = &mut tile.halo;
    for y in 0..TILE_H + 2 {
        let row = (tile.y0 - 1 + y as i32) as f32;
        for x in 0..WIN_W {
            let column = (tile.x0 - 1 + x as i32) as f32;
            let p = InversePlane { w: halo.w[y][x], wx: halo.nx[y][x], wy: halo.ny[y][x] };
            let m = level.pinhole.plane_vector(p, column, row);
            let s = 1.0 / (m[0] * m[0] + m[1] * m[1] + m[2] * m[2]).sqrt().max(1e-30);
            halo.nx[y][x] = m[0] * s;
            halo.ny[y][x] = m[1] * s;
            halo.nz[y][x] = m[2] * s;
            halo.on[y][x] = if p.w > 0.0 { halo.on[y][x] } else { 0.0 };
        }
    }
    totals(tile, level);
}

/// Brings normals and totals up to date after pixels have changed.
#[inline(always)]
pub(super) fn refresh(tile: &mut Tile, level: &Level) {
    let (halo, belief) = (&mut tile.halo, &tile.belief);
    for y in 0..TILE_H {
        let row = (tile.y0 + y as i32) as f32;
        let (mut nx, mut ny, mut nz) = (ZERO, ZERO, ZERO);
        for x in 0..TILE_W {
            let column = (tile.x0 + x as i32) as f32;
            let p = InversePlane { w: belief.w[y][x], wx: belief.wx[y][x], wy: belief.wy[y][x] };
            let m = level.pinhole.plane_vector(p, column, row);
            let s = 1.0 / (m[0] * m[0] + m[1] * m[1] + m[2] * m[2]).sqrt().max(1e-30);
            (nx[x], ny[x], nz[x]) = (m[0] * s, m[1] * s, m[2] * s);
        }
        halo.nx[y + 1][1..=TILE_W].copy_from_slice(&nx);
        halo.ny[y + 1][1..=TILE_W].copy_from_slice(&ny);
        halo.nz[y + 1][1..=TILE_W].copy_from_slice(&nz);
        halo.w[y + 1][1..=TILE_W].copy_from_slice(&belief.w[y]);
    }
    totals(tile, level);
}

/// Total cost of every pixel's own plane against its four neighbours.
#[inline(always)]
fn totals(tile: &mut Tile, level: &Level) {
    let (halo, belief) = (&tile.halo, &mut tile.belief);
    for y in 0..TILE_H {
        let row = (tile.y0 + y as i32) as f32;
        let mut smooth = [1.0f32; TILE_W];
        for (r, c, sx, sy) in
            [(y + 1, 0, -1.0, 0.0), (y + 1, 2, 1.0, 0.0), (y, 1, 0.0, -1.0), (y + 2, 1, 0.0, 1.0)]
        {
            let (nx, ny, nz) = (cut(&halo.nx[r], c), cut(&halo.ny[r], c), cut(&halo.nz[r], c));
            let (nw, on) = (cut(&halo.w[r], c), cut(&halo.on[r], c));
            for x in 0..TILE_W {
                let p = InversePlane { w: belief.w[y][x], wx: belief.wx[y][x], wy: belief.wy[y][x] };
                let m = level.pinhole.plane_vector(p, (tile.x0 + x as i32) as f32, row);
                let s = 1.0 / (m[0] * m[0] + m[1] * m[1] + m[2] * m[2]).sqrt().max(1e-30);
                let w = p.w + p.wx * sx + p.wy * sy;
                smooth[x] *= agreement(m, s, w, [nx[x], ny[x], nz[x]], nw[x], on[x]);
            }
        }
        for x in 0..TILE_W {
            belief.total[y][x] = total_cost(
                belief.data[y][x],
                smooth[x],
                belief.w[y][x],
                belief.prior_w[y][x],
                belief.prior_k[y][x],
            );
        }
    }
}
