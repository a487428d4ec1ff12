//! Where in the source the texels of a vector lie, so that they can be looked up in a few of its rows.

use super::Lanes;
use super::warp::{COLUMNS, FIXED, HALF, SLACK, Warp};
use crate::stereo::tile::{Row, TILE_W, WIN_H};

/// Vectors of a column of the window.
pub(super) const STEPS: usize = WIN_H / 2;
/// Numbers of vectors of the window, in whole registers.
const CORNERS: usize = 2 * TILE_W;

/// For every vector of the window, a corner of the source before all of its texels.
pub(super) struct Corners {
    /// Position in the source, row by row.
    pub(super) offset: [u32; CORNERS],
    /// What takes fixed-point columns to those from the corner on.
    pub(super) back: [u32; CORNERS],
    /// The same for rows.
    pub(super) up: [u32; CORNERS],
}

impl Corners {
    pub(super) const NONE: Self = Corners { offset: [0; CORNERS], back: [0; CORNERS], up: [0; CORNERS] };

    #[inline(always)]
    pub(super) fn new<L: Lanes>(m: &Warp, width: usize) -> Self {
        let mut out = Corners::NONE;
        let low =
            [Footprint::of(m, m.du_dx, m.du_dy).low_fixed(), Footprint::of(m, m.dv_dx, m.dv_dy).low_fixed()];
        let step = L::load(&CORNER_Y);
        for half in 0..CORNERS / TILE_W {
            let ox = L::load(&CORNER_X) + L::splat((2 * half * COLUMNS) as f32);
            let e = ox * L::splat(m.z_dx) + step * L::splat(m.z_dy);
            let u = corner(m.u, m.du_dx, m.du_dy, low[0], (ox, step, e));
            let v = corner(m.v, m.dv_dx, m.dv_dy, low[1], (ox, step, e));
            let cut = half * TILE_W;
            for (words, to) in [
                (L::place(u, v, width as u32), &mut out.offset),
                (L::negated(L::masked(u, 0xffff_0000)), &mut out.back),
                (L::negated(L::masked(v, 0xffff_0000)), &mut out.up),
            ] {
                if let Some(to) = to[cut..].first_chunk_mut() {
                    L::store_words(words, to);
                }
            }
        }
        out
    }
}

/// The low end of where the texels of vectors are whose first ones have offsets `(ox, oy)` from the centre, in fixed point;
/// `e` is how much farther away they are.
#[inline(always)]
fn corner<L: Lanes>(centre: f32, dx: f32, dy: f32, low: f32, (ox, oy, e): (L, L, L)) -> L::Bits {
    let straight = ox * L::splat(dx * FIXED) + oy * L::splat(dy * FIXED);
    let at = L::splat(centre * FIXED + low) + straight * (L::splat(1.0) - e);
    at.max(L::splat(0.0)).truncated()
}

/// Offsets of the first texels of vectors from the window's centre: two columns of it, from top to bottom.
const CORNER_X: Row = corner_offsets(true);
const CORNER_Y: Row = corner_offsets(false);

const fn corner_offsets(columns: bool) -> Row {
    let mut out = [0.0; TILE_W];
    let mut i = 0;
    while i < TILE_W {
        out[i] =
            if columns { (i / STEPS * COLUMNS) as f32 - HALF.0 } else { (i % STEPS * 2) as f32 - HALF.1 };
        i += 1;
    }
    out
}

/// How far source pixels of eight columns of two rows can be from the first one, one coordinate.
pub(super) struct Footprint {
    low: f32,
    high: f32,
}

impl Footprint {
    /// Of `centre + (ox·dx + oy·dy)·(1 − e)`.
    #[inline(always)]
    fn of(m: &Warp, dx: f32, dy: f32) -> Self {
        let (zx, zy) = (m.z_dx.abs(), m.z_dy.abs());
        let (e, far) = (zx * HALF.0 + zy * HALF.1, dx.abs() * HALF.0 + dy.abs() * HALF.1);
        let (bend_x, bend_y) = (dx.abs() * e + far * zx, dy.abs() * e + far * zy);
        let reach = (COLUMNS - 1) as f32;
        Footprint {
            low: reach * (dx - bend_x).min(0.0) + (dy - bend_y).min(0.0),
            high: reach * (dx + bend_x).max(0.0) + (dy + bend_y).max(0.0),
        }
    }

    #[inline(always)]
    fn extent(&self) -> f32 {
        self.high - self.low + SLACK
    }

    #[inline(always)]
    fn low_fixed(&self) -> f32 {
        (self.low - 0.5 * SLACK) * FIXED
    }

    /// Rows of sixteen source pixels that hold sixteen texels and their neighbours: 4, 8, or 0 if they do not.
    #[inline(always)]
    pub(super) fn rows<L: Lanes>(m: &Warp) -> usize {
        if !L::LOOKUP || Footprint::of(m, m.du_dx, m.du_dy).extent() > 14.0 {
            return 0;
        }
        match Footprint::of(m, m.dv_dx, m.dv_dy).extent() {
            rows if rows < 2.0 => 4,
            rows if rows < 6.0 => 8,
            _ => 0,
        }
    }
}
