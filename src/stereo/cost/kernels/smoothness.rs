//! Smoothness: what the surround of a pixel says about its plane.

use super::contest::total;
use super::{LANE, Lanes, cut};
use crate::stereo::level::Level;
use crate::stereo::plane::{InversePlane, Pinhole};
use crate::stereo::tile::{CENTRE, HALO_X, Halo, Row, TILE_H, TILE_W, Tile};

/// 1 / (2 · 0.02²): relative distance from a neighbour's point to the plane.
const DEPTH: f32 = 1250.0;
/// 1 / (2 · (13°)²): angle between the normals, squared: twice one minus its cosine.
const NORMAL: f32 = 9.71;
/// Eighth roots of what agreement in depth, and in the normal, takes off the cost: 0.07 and 0.0672.
const DEPTH_ROOT: f32 = 0.717_195;
const NORMAL_ROOT: f32 = 0.713_544_66;
/// Length of plane vectors here, squared, so that their products are cosines times this.
const COSINES: f32 = NORMAL_ROOT * NORMAL / 4.0;
/// Inverse depth where there is no estimate: far from all others. The unit vector there is zero, at a right angle to all.
const NOWHERE: f32 = 1e18;

/// A row of planes as vectors of length √[`COSINES`] and inverse depths.
#[derive(Clone, Copy)]
struct Planes<L> {
    unit: [L; 3],
    w: L,
}

/// Smoothness factor between planes and a neighbouring pixel's own plane: below 1 where they agree. The planes have inverse
/// depths `w` at that pixel, and vectors in the same direction as `unit` whose lengths are one over `inverse_length`, but for
/// [`SCALES`].
///
/// `(1 - 0.07 e⁻ᵃ) (1 - 0.0672 e⁻ᵇ)` with `a = DEPTH·r²` of the relative distance r and `b = NORMAL·angle²`, where `c·e⁻⁸ˣ`
/// is taken to be `(c^⅛ (1 - x))⁸`, so that all factors come with the vectors.
#[inline(always)]
fn agreement<L: Lanes>(unit: [L; 3], inverse_length: L, w: L, there: Planes<L>) -> L {
    let one = L::splat(1.0);
    let r = (w - there.w) * inverse_length;
    let near = eighth_power(L::splat(DEPTH_ROOT) - r * r);
    let cosine = unit[0] * there.unit[0] + unit[1] * there.unit[1] + unit[2] * there.unit[2];
    let parallel = eighth_power(cosine + L::splat(NORMAL_ROOT - COSINES));
    (one - near) * (one - parallel)
}

/// `b⁸` where b is positive, else 0.
#[inline(always)]
fn eighth_power<L: Lanes>(b: L) -> L {
    let b = b.max(L::splat(0.0));
    let b = b * b;
    let b = b * b;
    b * b
}

/// What plane vectors are multiplied by, and what one over their lengths: √[`COSINES`] and √([`DEPTH_ROOT`]·[`DEPTH`]/8).
const SCALES: (f32, f32) = (1.316_104, 10.585_921);

const _: () = {
    let off = (SCALES.0 * SCALES.0 - COSINES, SCALES.1 * SCALES.1 - DEPTH_ROOT * DEPTH / 8.0);
    assert!(-1e-5 < off.0 && off.0 < 1e-5 && -1e-3 < off.1 && off.1 < 1e-3);
};

/// The vector of a plane.
#[derive(Clone, Copy)]
pub(super) struct PlaneVector {
    /// Of the length that vectors have here.
    unit: [f32; 3],
    /// One over the length that it had, scaled.
    inverse_length: f32,
}

impl PlaneVector {
    /// Of a plane anchored at the tile's centre.
    #[inline(always)]
    pub(super) fn new(tile: &Tile, level: &Level, p: InversePlane) -> Self {
        let m = level.pinhole.plane_vector(p, tile.x0 as f32 + CENTRE.0, tile.y0 as f32 + CENTRE.1);
        let inverse_length = 1.0 / (m[0] * m[0] + m[1] * m[1] + m[2] * m[2]).sqrt().max(1e-30);
        let scale = inverse_length * SCALES.0;
        PlaneVector { unit: m.map(|v| v * scale), inverse_length: inverse_length * SCALES.1 }
    }

    /// Gives it to pixels of row `y` of a tile.
    #[inline(always)]
    pub(super) fn take<L: Lanes>(self, halo: &mut Halo, y: usize, w: L, takers: L::Mask) {
        let Halo { nx, ny, nz, w: depths, inverse_length, .. } = halo;
        for (row, new) in [
            (&mut nx[y + 1], L::splat(self.unit[0])),
            (&mut ny[y + 1], L::splat(self.unit[1])),
            (&mut nz[y + 1], L::splat(self.unit[2])),
            (&mut depths[y + 1], w),
        ] {
            let old = cut(row, HALO_X);
            put(row, L::select(takers, new, old));
        }
        let row = &mut inverse_length[y];
        L::select(takers, L::splat(self.inverse_length), L::load(row)).store(row);
    }
}

/// What every pixel of the tile and its surround says about a candidate plane.
#[inline(always)]
pub(super) fn of_candidate<L: Lanes>(tile: &mut Tile, p: InversePlane, vector: PlaneVector) {
    let Tile { halo, scratch, .. } = tile;
    let (unit, inverse_length) = (vector.unit.map(L::splat), L::splat(vector.inverse_length));
    let (column, slope) = (L::load(&LANE) - L::splat(CENTRE.0), L::splat(p.wx));
    for y in 0..TILE_H + 2 {
        let there = Planes {
            unit: [cut(&halo.nx[y], HALO_X), cut(&halo.ny[y], HALO_X), cut(&halo.nz[y], HALO_X)],
            w: cut(&halo.w[y], HALO_X),
        };
        let w = L::splat(p.w + p.wy * (y as f32 - 1.0 - CENTRE.1)) + slope * column;
        put(&mut scratch.smooth[y], agreement(unit, inverse_length, w, there));
    }
    let s = &halo.sides;
    let there = Planes { unit: [L::load(&s.nx), L::load(&s.ny), L::load(&s.nz)], w: L::load(&s.w) };
    let w = L::splat(p.w) + slope * L::load(&SIDE_X) + L::splat(p.wy) * L::load(&SIDE_Y);
    let mut out = [0.0; TILE_W];
    agreement(unit, inverse_length, w, there).store(&mut out);
    for y in 0..TILE_H {
        scratch.smooth[y + 1][HALO_X - 1] = out[y];
        scratch.smooth[y + 1][HALO_X + TILE_W] = out[TILE_H + y];
    }
    let s = &scratch.smooth;
    for (y, factor) in scratch.factor.iter_mut().enumerate() {
        let (left, right): (L, L) = (cut(&s[y + 1], HALO_X - 1), cut(&s[y + 1], HALO_X + 1));
        ((left * right) * (cut::<L>(&s[y], HALO_X) * cut(&s[y + 2], HALO_X))).store(factor);
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

/// Vectors of planes anchored at `(x, y)`, and one over the lengths they had, scaled.
#[inline(always)]
fn vectors<L: Lanes>(pinhole: &Pinhole, x: L, y: L, [w, wx, wy]: [L; 3]) -> ([L; 3], L) {
    let m = [
        wx * L::splat(pinhole.fx),
        wy * L::splat(pinhole.fy),
        w - wx * (x - L::splat(pinhole.cx)) - wy * (y - L::splat(pinhole.cy)),
    ];
    let r = (m[0] * m[0] + m[1] * m[1] + m[2] * m[2]).max(L::splat(f32::MIN_POSITIVE)).inverse_sqrt();
    let scale = r * L::splat(SCALES.0);
    ([m[0] * scale, m[1] * scale, m[2] * scale], r * L::splat(SCALES.1))
}

/// Unit vectors and inverse depths of planes where they are `on`; elsewhere what agrees with nothing.
#[inline(always)]
fn known<L: Lanes>(unit: [L; 3], w: L, on: L) -> [L; 4] {
    let (zero, half) = (L::splat(0.0), L::splat(0.5));
    let known = L::both(zero.lt(w), half.lt(on));
    let [x, y, z] = unit;
    [
        L::select(known, x, zero),
        L::select(known, y, zero),
        L::select(known, z, zero),
        L::select(known, w, L::splat(NOWHERE)),
    ]
}

/// Turns the surround's slopes into unit vectors, and computes every pixel's total cost.
#[inline(always)]
pub(in crate::stereo::cost) fn begin<L: Lanes>(tile: &mut Tile, level: &Level) {
    let (x0, y0) = (tile.x0 as f32, tile.y0 as f32);
    let halo = &mut tile.halo;
    let column = L::splat(x0) + L::load(&LANE);
    for y in 0..TILE_H + 2 {
        let row = L::splat(y0 - 1.0 + y as f32);
        let planes: [L; 3] = [cut(&halo.w[y], HALO_X), cut(&halo.nx[y], HALO_X), cut(&halo.ny[y], HALO_X)];
        let (unit, r) = vectors(&level.pinhole, column, row, planes);
        let fields = [&mut halo.nx, &mut halo.ny, &mut halo.nz, &mut halo.w];
        for (to, field) in fields.into_iter().zip(known(unit, planes[0], cut(&halo.on[y], HALO_X))) {
            put(&mut to[y], field);
        }
        if let Some(to) = y.checked_sub(1).and_then(|y| halo.inverse_length.get_mut(y)) {
            r.store(to);
        }
    }
    let s = &mut halo.sides;
    let planes = [L::load(&s.w), L::load(&s.nx), L::load(&s.ny)];
    let x = L::splat(x0 + CENTRE.0) + L::load(&SIDE_X);
    let y = L::splat(y0 + CENTRE.1) + L::load(&SIDE_Y);
    let (unit, _) = vectors(&level.pinhole, x, y, planes);
    let fields = [&mut s.nx, &mut s.ny, &mut s.nz, &mut s.w];
    for (to, field) in fields.into_iter().zip(known(unit, planes[0], L::load(&s.on))) {
        field.store(to);
    }
    for y in 0..TILE_H {
        for (x, side) in [(HALO_X - 1, y), (HALO_X + TILE_W, TILE_H + y)] {
            halo.nx[y + 1][x] = s.nx[side];
            halo.ny[y + 1][x] = s.ny[side];
            halo.nz[y + 1][x] = s.nz[side];
            halo.w[y + 1][x] = s.w[side];
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
    if let Some(to) = row[HALO_X..].first_chunk_mut::<TILE_W>() {
        lanes.store(to);
    }
}

/// Brings agreements and totals up to date after pixels of the `changed` rows have taken another plane.
#[inline(always)]
pub(super) fn refresh<L: Lanes>(tile: &mut Tile, changed: u32) {
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
    let left = agreement(unit, r, w - slope, there(tile, y + 1, HALO_X - 1));
    let right = agreement(unit, r, w + slope, there(tile, y + 1, HALO_X + 1));
    (left * right).store(&mut tile.halo.beside[y]);
}

/// What the pixels above those of row `y` say about their planes.
#[inline(always)]
fn agree_above<L: Lanes>(tile: &mut Tile, y: usize) {
    let w = L::load(&tile.belief.w[y]) - L::load(&tile.belief.wy[y]);
    let (unit, r) = own::<L>(tile, y);
    agreement(unit, r, w, there(tile, y, HALO_X)).store(&mut tile.halo.above[y]);
}

/// What the pixels below those of row `y` say about their planes.
#[inline(always)]
fn agree_below<L: Lanes>(tile: &mut Tile, y: usize) {
    let w = L::load(&tile.belief.w[y]) + L::load(&tile.belief.wy[y]);
    let (unit, r) = own::<L>(tile, y);
    agreement(unit, r, w, there(tile, y + 2, HALO_X)).store(&mut tile.halo.below[y]);
}

/// Unit vectors of the planes of row `y` of the tile, and one over the lengths they had.
#[inline(always)]
fn own<L: Lanes>(tile: &Tile, y: usize) -> ([L; 3], L) {
    (there(tile, y + 1, HALO_X).unit, L::load(&tile.halo.inverse_length[y]))
}

/// Planes of row `y` of the surround from column `x` on.
#[inline(always)]
fn there<L: Lanes>(tile: &Tile, y: usize, x: usize) -> Planes<L> {
    let halo = &tile.halo;
    Planes { unit: [cut(&halo.nx[y], x), cut(&halo.ny[y], x), cut(&halo.nz[y], x)], w: cut(&halo.w[y], x) }
}

/// Total cost of row `y`: every pixel's own plane against its four neighbours.
#[inline(always)]
fn totals<L: Lanes>(tile: &mut Tile, y: usize) {
    let (halo, belief) = (&tile.halo, &mut tile.belief);
    let smooth = L::load(&halo.beside[y]) * (L::load(&halo.above[y]) * L::load(&halo.below[y]));
    let prior = (L::load(&belief.prior_z[y]), L::load(&belief.prior_k[y]));
    total(L::load(&belief.data[y]), smooth, L::load(&belief.w[y]), prior).store(&mut belief.total[y]);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stereo::cost::lanes::portable::Sixteen;

    /// [`agreement`] of planes `angle` radians apart and `off` relatively, in one lane.
    fn agreement_of(angle: f32, off: f32) -> f32 {
        let lanes = |v: f32| Sixteen::splat(v);
        let length = SCALES.0;
        let unit = [lanes(length), lanes(0.0), lanes(0.0)];
        let there = [lanes(length * angle.cos()), lanes(length * angle.sin()), lanes(0.0)];
        let mut out = [0.0; TILE_W];
        agreement(unit, lanes(SCALES.1), lanes(1.0 + off), Planes { unit: there, w: lanes(1.0) })
            .store(&mut out);
        out[3]
    }

    #[test]
    fn agreement_is_that_of_two_bells() {
        for angle in [0.0f32, 0.05, 0.15, 0.3, 0.6, 1.5, 3.0] {
            for off in [0.0, 0.01, -0.02, 0.05, 0.5] {
                let near = 0.07 * (1.0 - DEPTH / 8.0 * off * off).max(0.0).powi(8);
                let parallel = 0.0672 * (1.0 - NORMAL / 4.0 * (1.0 - angle.cos())).max(0.0).powi(8);
                let wanted = (1.0 - near) * (1.0 - parallel);
                let got = agreement_of(angle, off);
                assert!((got - wanted).abs() < 2e-6, "{angle} {off}: {got}, not {wanted}");
            }
        }
    }

    #[test]
    fn a_pixel_without_a_plane_agrees_with_nothing() {
        let (zero, one) = (Sixteen::splat(0.0), Sixteen::splat(1.0));
        let nowhere = Planes { unit: [zero; 3], w: Sixteen::splat(NOWHERE) };
        let mut out = [0.0; TILE_W];
        agreement([Sixteen::splat(SCALES.0), zero, zero], Sixteen::splat(1e12), one, nowhere).store(&mut out);
        assert_eq!(out, [1.0; TILE_W]);
    }
}
