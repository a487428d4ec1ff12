//! Smoothness: what the surround of a pixel says about its plane.

use super::contest::total;
use super::{LANE, Lanes, cut};
use crate::stereo::level::Level;
use crate::stereo::plane::{InversePlane, Pinhole};
use crate::stereo::tile::{CENTRE, Row, TILE_H, TILE_W, Tile};

/// 1 / (2 · 0.02²): relative distance from a neighbour's point to the plane.
const DEPTH: f32 = 1250.0;
/// 1 / (2 · (13°)²): angle between the normals.
const NORMAL: f32 = 9.71;
const DEPTH_BONUS: f32 = 0.07;
const NORMAL_BONUS: f32 = 0.0672;

/// A row of planes as unit vectors and inverse depths; `on` is 1 where there is an estimate, else 0.
#[derive(Clone, Copy)]
struct Planes<L> {
    unit: [L; 3],
    w: L,
    on: L,
}

/// Smoothness factor between planes with `unit` vectors, once `1 / inverse_length` long, and inverse depths `w` at a
/// neighbouring pixel, and that neighbour's own plane: below 1 where they agree.
#[inline(always)]
fn agreement<L: Lanes>(unit: [L; 3], inverse_length: L, w: L, there: Planes<L>) -> L {
    let (one, zero) = (L::splat(1.0), L::splat(0.0));
    let r = (w - there.w) * inverse_length;
    let near = L::bell8(r * r * L::splat(DEPTH));
    let cos = unit[0] * there.unit[0] + unit[1] * there.unit[1] + unit[2] * there.unit[2];
    let o = (one - cos).max(zero);
    let angle2 = o + o + o * o * L::splat(1.0 / 3.0);
    let parallel = L::bell8(angle2 * L::splat(NORMAL));
    (one - there.on * L::splat(DEPTH_BONUS) * near) * (one - there.on * L::splat(NORMAL_BONUS) * parallel)
}

/// What every pixel of the tile and its surround says about a candidate plane.
#[inline(always)]
pub(super) fn of_candidate<L: Lanes>(tile: &mut Tile, level: &Level, p: InversePlane) {
    let Tile { x0, y0, halo, scratch, .. } = tile;
    let m = level.pinhole.plane_vector(p, *x0 as f32 + CENTRE.0, *y0 as f32 + CENTRE.1);
    let inverse_length = 1.0 / (m[0] * m[0] + m[1] * m[1] + m[2] * m[2]).sqrt().max(1e-30);
    let (unit, inverse_length) = (m.map(|v| L::splat(v * inverse_length)), L::splat(inverse_length));
    let (column, slope) = (L::load(&LANE) - L::splat(CENTRE.0), L::splat(p.wx));
    for y in 0..TILE_H + 2 {
        let there = Planes {
            unit: [cut(&halo.nx[y], 1), cut(&halo.ny[y], 1), cut(&halo.nz[y], 1)],
            w: cut(&halo.w[y], 1),
            on: cut(&halo.on[y], 1),
        };
        let w = L::splat(p.w + p.wy * (y as f32 - 1.0 - CENTRE.1)) + slope * column;
        let mut out = [0.0; TILE_W];
        agreement(unit, inverse_length, w, there).store(&mut out);
        scratch.smooth[y][1..=TILE_W].copy_from_slice(&out);
    }
    let s = &halo.sides;
    let there = Planes {
        unit: [L::load(&s.nx), L::load(&s.ny), L::load(&s.nz)],
        w: L::load(&s.w),
        on: L::load(&s.on),
    };
    let w = L::splat(p.w) + slope * L::load(&SIDE_X) + L::splat(p.wy) * L::load(&SIDE_Y);
    let mut out = [0.0; TILE_W];
    agreement(unit, inverse_length, w, there).store(&mut out);
    for y in 0..TILE_H {
        scratch.smooth[y + 1][0] = out[y];
        scratch.smooth[y + 1][TILE_W + 1] = out[TILE_H + y];
    }
    let s = &scratch.smooth;
    for (y, factor) in scratch.factor.iter_mut().enumerate() {
        let (left, right): (L, L) = (cut(&s[y + 1], 0), cut(&s[y + 1], 2));
        ((left * right) * (cut::<L>(&s[y], 1) * cut(&s[y + 2], 1))).store(factor);
    }
}

/// Offsets of the side pixels from the tile's centre: the left column from top to bottom, then the right one.
const SIDE_X: Row = sides(true);
const SIDE_Y: Row = sides(false);

const fn sides(columns: bool) -> Row {
    let mut out = [0.0; TILE_W];
    let mut i = 0;
    while i < TILE_W {
        let x = if i < TILE_H { -1.0 - CENTRE.0 } else { CENTRE.0 + 1.0 };
        out[i] = if columns { x } else { (i % TILE_H) as f32 - CENTRE.1 };
        i += 1;
    }
    out
}

/// Unit vectors of planes anchored at `(x, y)`, and one over the lengths they had.
#[inline(always)]
fn vectors<L: Lanes>(pinhole: &Pinhole, x: L, y: L, [w, wx, wy]: [L; 3]) -> ([L; 3], L) {
    let m = [
        wx * L::splat(pinhole.fx),
        wy * L::splat(pinhole.fy),
        w - wx * (x - L::splat(pinhole.cx)) - wy * (y - L::splat(pinhole.cy)),
    ];
    let r = (m[0] * m[0] + m[1] * m[1] + m[2] * m[2]).max(L::splat(f32::MIN_POSITIVE)).inverse_sqrt();
    ([m[0] * r, m[1] * r, m[2] * r], r)
}

/// Turns the surround's slopes into unit vectors, and computes every pixel's total cost.
#[inline(always)]
pub(in crate::stereo::cost) fn begin<L: Lanes>(tile: &mut Tile, level: &Level) {
    let (x0, y0) = (tile.x0 as f32, tile.y0 as f32);
    let halo = &mut tile.halo;
    let column = L::splat(x0) + L::load(&LANE);
    for y in 0..TILE_H + 2 {
        let row = L::splat(y0 - 1.0 + y as f32);
        let planes: [L; 3] = [cut(&halo.w[y], 1), cut(&halo.nx[y], 1), cut(&halo.ny[y], 1)];
        let (unit, r) = vectors(&level.pinhole, column, row, planes);
        for (to, unit) in [&mut halo.nx, &mut halo.ny, &mut halo.nz].into_iter().zip(unit) {
            put(&mut to[y], unit);
        }
        if let Some(to) = y.checked_sub(1).and_then(|y| halo.inverse_length.get_mut(y)) {
            r.store(to);
        }
        let known = L::select(L::splat(0.0).lt(planes[0]), cut(&halo.on[y], 1), L::splat(0.0));
        put(&mut halo.on[y], known);
    }
    let s = &mut halo.sides;
    let planes = [L::load(&s.w), L::load(&s.nx), L::load(&s.ny)];
    let x = L::splat(x0 + CENTRE.0) + L::load(&SIDE_X);
    let y = L::splat(y0 + CENTRE.1) + L::load(&SIDE_Y);
    let (unit, _) = vectors(&level.pinhole, x, y, planes);
    for (to, unit) in [&mut s.nx, &mut s.ny, &mut s.nz].into_iter().zip(unit) {
        unit.store(to);
    }
    L::select(L::splat(0.0).lt(planes[0]), L::load(&s.on), L::splat(0.0)).store(&mut s.on);
    for y in 0..TILE_H {
        for (x, side) in [(0, y), (TILE_W + 1, TILE_H + y)] {
            halo.nx[y + 1][x] = s.nx[side];
            halo.ny[y + 1][x] = s.ny[side];
            halo.nz[y + 1][x] = s.nz[side];
            halo.on[y + 1][x] = s.on[side];
        }
    }
    for y in 0..TILE_H {
        agree_beside::<L>(tile, y);
        agree_above::<L>(tile, y);
        agree_below::<L>(tile, y);
        totals::<L>(tile, y);
    }
}

#[inline(always)]
fn put<L: Lanes>(row: &mut [f32], lanes: L) {
    if let Some(to) = row[1..].first_chunk_mut::<TILE_W>() {
        lanes.store(to);
    }
}

/// Brings vectors, agreements and totals up to date after pixels of the `changed` rows have taken another plane.
#[inline(always)]
pub(super) fn refresh<L: Lanes>(tile: &mut Tile, level: &Level, changed: u32) {
    let column = L::splat(tile.x0 as f32) + L::load(&LANE);
    for y in (0..TILE_H).filter(|y| changed >> y & 1 != 0) {
        let (halo, belief) = (&mut tile.halo, &tile.belief);
        let row = L::splat((tile.y0 + y as i32) as f32);
        let planes = [L::load(&belief.w[y]), L::load(&belief.wx[y]), L::load(&belief.wy[y])];
        let (unit, r) = vectors(&level.pinhole, column, row, planes);
        for (to, unit) in [&mut halo.nx, &mut halo.ny, &mut halo.nz].into_iter().zip(unit) {
            put(&mut to[y + 1], unit);
        }
        r.store(&mut halo.inverse_length[y]);
        put(&mut halo.w[y + 1], planes[0]);
    }
    let (below, above) = (changed | changed << 1, changed | changed >> 1);
    for y in (0..TILE_H).filter(|y| (below | above) >> y & 1 != 0) {
        if changed >> y & 1 != 0 {
            agree_beside::<L>(tile, y);
        }
        if below >> y & 1 != 0 {
            agree_above::<L>(tile, y);
        }
        if above >> y & 1 != 0 {
            agree_below::<L>(tile, y);
        }
        totals::<L>(tile, y);
    }
}

/// What the pixels beside those of row `y` say about their planes.
#[inline(always)]
fn agree_beside<L: Lanes>(tile: &mut Tile, y: usize) {
    let (w, slope) = (L::load(&tile.belief.w[y]), L::load(&tile.belief.wx[y]));
    let (unit, r) = own::<L>(tile, y);
    let left = agreement(unit, r, w - slope, there(tile, y + 1, 0));
    let right = agreement(unit, r, w + slope, there(tile, y + 1, 2));
    (left * right).store(&mut tile.halo.beside[y]);
}

/// What the pixels above those of row `y` say about their planes.
#[inline(always)]
fn agree_above<L: Lanes>(tile: &mut Tile, y: usize) {
    let w = L::load(&tile.belief.w[y]) - L::load(&tile.belief.wy[y]);
    let (unit, r) = own::<L>(tile, y);
    agreement(unit, r, w, there(tile, y, 1)).store(&mut tile.halo.above[y]);
}

/// What the pixels below those of row `y` say about their planes.
#[inline(always)]
fn agree_below<L: Lanes>(tile: &mut Tile, y: usize) {
    let w = L::load(&tile.belief.w[y]) + L::load(&tile.belief.wy[y]);
    let (unit, r) = own::<L>(tile, y);
    agreement(unit, r, w, there(tile, y + 2, 1)).store(&mut tile.halo.below[y]);
}

/// Unit vectors of the planes of row `y` of the tile, and one over the lengths they had.
#[inline(always)]
fn own<L: Lanes>(tile: &Tile, y: usize) -> ([L; 3], L) {
    (there(tile, y + 1, 1).unit, L::load(&tile.halo.inverse_length[y]))
}

/// Planes of row `y` of the surround from column `x` on.
#[inline(always)]
fn there<L: Lanes>(tile: &Tile, y: usize, x: usize) -> Planes<L> {
    let halo = &tile.halo;
    Planes {
        unit: [cut(&halo.nx[y], x), cut(&halo.ny[y], x), cut(&halo.nz[y], x)],
        w: cut(&halo.w[y], x),
        on: cut(&halo.on[y], x),
    }
}

/// Total cost of row `y`: every pixel's own plane against its four neighbours.
#[inline(always)]
fn totals<L: Lanes>(tile: &mut Tile, y: usize) {
    let (halo, belief) = (&tile.halo, &mut tile.belief);
    let smooth = L::load(&halo.beside[y]) * (L::load(&halo.above[y]) * L::load(&halo.below[y]));
    let prior = (L::load(&belief.prior_z[y]), L::load(&belief.prior_k[y]));
    total(L::load(&belief.data[y]), smooth, L::load(&belief.w[y]), prior).store(&mut belief.total[y]);
}
