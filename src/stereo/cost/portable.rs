//! Kernels in plain safe code that the compiler vectorises: the readable truth, and the oracle of every other path.
//!
//! No fused multiply-add and no reassociation: the same bytes come out at every instruction-set level.

use super::super::level::{Level, Source, SourceGeometry};
use super::super::plane::InversePlane;
use super::super::tile::{
    Belief, CENTRE, Halo, Patch, REACH, ROBUST_COST, Row, Scratch, TAPS, TILE_H, TILE_W, Tile, UNSEEN, WIN_H,
    WIN_W, WinRow,
};
use super::math::{exp, fraction_and_index};

/// −1 / (2 σ²) of the grey-level difference, σ = 0.1 of the range (spec of the bilateral weight).
const GREY_FALLOFF: f32 = -50.0 / (255.0 * 255.0);
/// −1 / (2 σ²) of the distance in pixels, σ = 3.
const SPACE_FALLOFF: f32 = -1.0 / 18.0;
/// −1 / (2 · 0.02²): relative distance from a neighbour's point to the plane.
const SMOOTH_DEPTH: f32 = -1250.0;
/// −1 / (2 · (13°)²): angle between the normals.
const SMOOTH_NORMAL: f32 = -9.71;
const DEPTH_BONUS: f32 = 0.07;
const NORMAL_BONUS: f32 = 0.0672;
/// Products of variances below this cannot be compared (grey levels², source grey levels × 256).
const FLAT: f32 = 1e-3 * 65_536.0;
/// How fast the prior from the coarser level fades with texture.
const PRIOR_FALLOFF: f32 = -50.0 / (255.0 * 255.0);
const PRIOR_CAP: f32 = 0.5;
/// A source depth farther than this from the hypothesis, relatively, says nothing about it but "disagrees".
const GEOMETRIC_GATE: f32 = 0.03;
/// Most pixels of disagreement that count.
const GEOMETRIC_CAP: f32 = 4.0;
/// Grey 128 × 256, subtracted from samples so that sums of squares keep their digits.
const MID_SAMPLE: f32 = 32_768.0;
/// Depth ratio, corner of a window to its centre, below which a window is behind or beside the source.
const MIN_DEPTH_RATIO: f32 = 0.3;

const ZERO: Row = [0.0; TILE_W];

/// The 16 values from column `at`.
#[inline(always)]
fn cut(row: &WinRow, at: usize) -> &Row {
    row[at..].first_chunk::<TILE_W>().unwrap_or(&ZERO)
}

/// Bilateral weights and patch statistics of every pixel of the tile.
#[inline(always)]
pub(super) fn prepare(tile: &mut Tile, level: &Level) {
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
    let (mut sum, mut first, mut second) = (ZERO, ZERO, ZERO);
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

/// How much of a warped window lies inside the source.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Coverage {
    None,
    Part,
    Whole,
}

/// The homography of a plane around an anchor pixel: source pixel of an offset `(ox, oy)` is
/// `centre + (ox·du_dx + oy·du_dy) / z` with `z = 1 + ox·z_dx + oy·z_dy`, likewise for v.
#[derive(Clone, Copy, Default)]
struct Warp {
    u: f32,
    v: f32,
    du_dx: f32,
    du_dy: f32,
    dv_dx: f32,
    dv_dy: f32,
    z_dx: f32,
    z_dy: f32,
}

impl Warp {
    #[inline(always)]
    fn new(a: &[[f32; 3]; 3], b: &[f32; 3], x: f32, y: f32, p: InversePlane) -> Option<Self> {
        let (mut c, mut dx, mut dy) = ([0.0f32; 3], [0.0f32; 3], [0.0f32; 3]);
        for i in 0..3 {
            c[i] = a[i][0] * x + a[i][1] * y + a[i][2] + b[i] * p.w;
            dx[i] = a[i][0] + b[i] * p.wx;
            dy[i] = a[i][1] + b[i] * p.wy;
        }
        if c[2] <= 1e-6 {
            return None;
        }
        let r = 1.0 / c[2];
        let (u, v) = (c[0] * r, c[1] * r);
        Some(Warp {
            u,
            v,
            du_dx: (dx[0] - u * dx[2]) * r,
            du_dy: (dy[0] - u * dy[2]) * r,
            dv_dx: (dx[1] - v * dx[2]) * r,
            dv_dy: (dy[1] - v * dy[2]) * r,
            z_dx: dx[2] * r,
            z_dy: dy[2] * r,
        })
    }

    /// Source pixel of an offset, and the depth ratio there.
    #[inline(always)]
    fn at(&self, ox: f32, oy: f32) -> (f32, f32, f32) {
        let z = 1.0 + ox * self.z_dx + oy * self.z_dy;
        let r = 1.0 / z;
        let u = self.u + (ox * self.du_dx + oy * self.du_dy) * r;
        let v = self.v + (ox * self.dv_dx + oy * self.dv_dy) * r;
        (u, v, z)
    }

    /// Coverage of the tile's window.
    #[inline(always)]
    fn coverage(&self, max_u: f32, max_v: f32) -> Coverage {
        const HX: f32 = (WIN_W as f32 - 1.0) / 2.0;
        const HY: f32 = (WIN_H as f32 - 1.0) / 2.0;
        let mut inside = 0;
        let mut out = [0; 4];
        for (sx, sy) in [(-HX, -HY), (HX, -HY), (-HX, HY), (HX, HY)] {
            let (u, v, z) = self.at(sx, sy);
            if z < MIN_DEPTH_RATIO || !u.is_finite() || !v.is_finite() {
                return Coverage::None;
            }
            inside += u32::from(u >= 1.0 && v >= 1.0 && u <= max_u && v <= max_v);
            out[0] += u32::from(u < 1.0);
            out[1] += u32::from(v < 1.0);
            out[2] += u32::from(u > max_u);
            out[3] += u32::from(v > max_v);
        }
        match inside {
            4 => Coverage::Whole,
            _ if out.contains(&4) => Coverage::None,
            _ => Coverage::Part,
        }
    }
}

/// Warps the source window of the tile by a plane.
#[inline(always)]
fn warp(source: &Source, x0: i32, y0: i32, plane: InversePlane, scratch: &mut Scratch) -> Coverage {
    let (xc, yc) = (x0 as f32 + CENTRE.0, y0 as f32 + CENTRE.1);
    let Some(m) = Warp::new(&source.a, &source.b, xc, yc, plane) else { return Coverage::None };
    let (max_u, max_v) = (source.width as f32 - 2.0, source.height as f32 - 2.0);
    let coverage = if max_u < 1.0 || max_v < 1.0 { Coverage::None } else { m.coverage(max_u, max_v) };
    if coverage == Coverage::None {
        return coverage;
    }
    for r in 0..WIN_H {
        if coverage == Coverage::Whole {
            warp_row::<true>(source, &m, r, max_u, max_v, scratch);
        } else {
            warp_row::<false>(source, &m, r, max_u, max_v, scratch);
        }
    }
    coverage
}

/// Samples one row of the window; unless the `WHOLE` window is inside, samples are clamped and marked.
#[inline(always)]
fn warp_row<const WHOLE: bool>(
    source: &Source,
    m: &Warp,
    r: usize,
    max_u: f32,
    max_v: f32,
    scratch: &mut Scratch,
) {
    let oy = r as f32 - (WIN_H as f32 - 1.0) / 2.0;
    let (mut fu, mut fv, mut index, mut quad) = ([0f32; WIN_W], [0f32; WIN_W], [0u32; WIN_W], [0u64; WIN_W]);
    for c in 0..WIN_W {
        let ox = c as f32 - (WIN_W as f32 - 1.0) / 2.0;
        let (mut u, mut v, _) = m.at(ox, oy);
        if !WHOLE {
            let (ku, kv) = (u.max(1.0).min(max_u), v.max(1.0).min(max_v));
            scratch.valid[r][c] = if ku == u && kv == v { 1.0 } else { 0.0 };
            (u, v) = (ku, kv);
        }
        let (iu, iv);
        (fu[c], iu) = fraction_and_index(u);
        (fv[c], iv) = fraction_and_index(v);
        index[c] = iv.wrapping_mul(source.width as u32).wrapping_add(iu);
    }
    for c in 0..WIN_W {
        quad[c] = source.quads.get(index[c] as usize).copied().unwrap_or(0);
    }
    let out = &mut scratch.warped[r];
    for c in 0..WIN_W {
        out[c] = bilinear(quad[c], fu[c], fv[c]);
    }
}

#[inline(always)]
fn bilinear(quad: u64, fu: f32, fv: f32) -> f32 {
    let p = |shift: u32| ((quad >> shift) as u32 & 0xffff) as i32 as f32;
    let (p00, p10, p01, p11) = (p(0), p(16), p(32), p(48));
    let top = p00 + fu * (p10 - p00);
    let bottom = p01 + fu * (p11 - p01);
    top + fv * (bottom - top) - MID_SAMPLE
}

/// Bilaterally weighted zero-mean normalised cross-correlation of every pixel of row `y`, as a cost 0..2.
#[inline(always)]
fn zncc_row(patch: &Patch, warped: &[WinRow; WIN_H], y: usize) -> Row {
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
fn finish_zncc(patch: &Patch, y: usize, sum: &Row, square: &Row, cross: &Row) -> Row {
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

/// Tries one plane on all pixels of the tile; pixels that it suits better take it. The plane is anchored at the
/// tile's centre. Returns whether any pixel took it.
#[inline(always)]
pub(super) fn try_plane(tile: &mut Tile, level: &Level, plane: InversePlane) -> bool {
    let (low, high) = level.w_range;
    if !(plane.w >= low * 0.5 && plane.w <= high * 2.0) || !data_cost(tile, level, plane) {
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
    let Tile { x0, y0, patch, scratch, .. } = tile;
    scratch.best = [[UNSEEN; TILE_W]; TILE_H];
    scratch.second = [[UNSEEN; TILE_W]; TILE_H];
    let mut any = false;
    for source in &level.sources {
        let coverage = warp(source, *x0, *y0, plane, scratch);
        if coverage == Coverage::None {
            continue;
        }
        any = true;
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
        }
    }
    any
}

#[inline(always)]
fn two_best(best: &mut Row, second: &mut Row, cost: &Row) {
    for x in 0..TILE_W {
        second[x] = second[x].min(best[x].max(cost[x]));
        best[x] = best[x].min(cost[x]);
    }
}

/// Mean of the two best costs; the best alone where no second source could be compared.
#[inline(always)]
fn merged(best: &Row, second: &Row) -> Row {
    let mut out = ZERO;
    for x in 0..TILE_W {
        let mean = 0.5 * (best[x] + second[x]);
        out[x] = (if second[x] >= ROBUST_COST { best[x] } else { mean }).min(2.0);
    }
    out
}

/// Adds the geometric term to the costs of one row: how far, in pixels, the source's own depth map disagrees,
/// sampled backwards with its plane at the exact position, so that the term pulls neither way.
#[inline(always)]
fn geometric_row(g: &SourceGeometry, x0: f32, y: f32, w: &Row, weight: f32, cost: &mut Row) {
    let (max_u, max_v) = (g.width as f32 - 2.0, g.height as f32 - 2.0);
    let (mut fu, mut fv, mut ws, mut index) = (ZERO, ZERO, ZERO, [0u32; TILE_W]);
    let mut inside = ZERO;
    for i in 0..TILE_W {
        let x = x0 + i as f32;
        let c = |r: usize| g.a[r][0] * x + (g.a[r][1] * y + g.a[r][2]) + g.b[r] * w[i];
        let z = c(2);
        let r = 1.0 / z.max(1e-6);
        let (u, v) = (c(0) * r, c(1) * r);
        let (ku, kv) = (u.max(1.0).min(max_u), v.max(1.0).min(max_v));
        inside[i] = if ku == u && kv == v && z > 1e-6 { 1.0 } else { 0.0 };
        let (au, iu) = fraction_and_index(ku + 0.5);
        let (av, iv) = fraction_and_index(kv + 0.5);
        (fu[i], fv[i]) = (au - 0.5, av - 0.5);
        index[i] = iv.wrapping_mul(g.width as u32).wrapping_add(iu);
        ws[i] = w[i] * r;
    }
    let (mut p0, mut px, mut py) = (ZERO, ZERO, ZERO);
    for i in 0..TILE_W {
        let p = g.planes.get(index[i] as usize).copied().unwrap_or([0.0; 4]);
        (p0[i], px[i], py[i]) = (p[0], p[1], p[2]);
    }
    for i in 0..TILE_W {
        let there = p0[i] + px[i] * fu[i] + py[i] * fv[i];
        let d = (there - ws[i]).abs();
        let e = d * g.pixels_per_w;
        let pixels = (e * (e + 2.0)).sqrt().min(GEOMETRIC_CAP);
        let known = inside[i] > 0.5 && p0[i] > 0.0 && d < ws[i] * GEOMETRIC_GATE;
        let term = weight * (if known { pixels } else { GEOMETRIC_CAP });
        cost[i] = if cost[i] < ROBUST_COST { cost[i] + term } else { cost[i] };
    }
}

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
fn smooth_candidate(halo: &Halo, scratch: &mut Scratch, level: &Level, x0: i32, y0: i32, p: InversePlane) {
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
fn accept(belief: &mut Belief, scratch: &Scratch, p: InversePlane, low: f32, high: f32) -> bool {
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
pub(super) fn begin(tile: &mut Tile, level: &Level) {
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
fn refresh(tile: &mut Tile, level: &Level) {
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

/// Matching cost of every pixel's own plane: no sharing, so several times dearer than a shared plane.
#[inline(always)]
pub(super) fn score_own(tile: &mut Tile, level: &Level) {
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
        for tap in 0..TAPS {
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

#[inline(always)]
fn window_inside(m: &Warp, max_u: f32, max_v: f32) -> bool {
    const R: f32 = REACH as f32;
    [(-R, -R), (R, -R), (-R, R), (R, R)].iter().all(|&(sx, sy)| {
        let (u, v, z) = m.at(sx, sy);
        z >= MIN_DEPTH_RATIO && u >= 1.0 && v >= 1.0 && u <= max_u && v <= max_v
    })
}
