//! Where in the source the texels of a vector lie, so that they can be looked up in a few of its rows.

use super::Lanes;
use super::homographies::{COLUMNS, HALF};
use crate::stereo::tile::{Homographies, Quadratic, Row, TILE_W, WIN_H};

/// Vectors of a column of the window.
pub(super) const STEPS: usize = WIN_H / 2;
/// Numbers of vectors of the window, in whole registers.
const CORNERS: usize = 2 * TILE_W;

/// For every vector of the window, a corner of the source before all of its texels.
pub(super) struct Corners {
    /// Position in the source, row by row.
    pub(super) offset: [u32; CORNERS],
    /// Less its column and sixteen times its row.
    pub(super) origin: [u32; CORNERS],
}

impl Corners {
    pub(super) const NONE: Self = Corners { offset: [0; CORNERS], origin: [0; CORNERS] };

    /// Of the window in the source of lane `k`.
    #[inline(always)]
    pub(super) fn new<L: Lanes>(m: &Homographies, k: usize, width: usize) -> Self {
        let mut out = Corners::NONE;
        let [columns, rows] = &m.quadratic;
        let oy = L::load(&CORNER_Y);
        for half in 0..CORNERS / TILE_W {
            let ox = L::load(&CORNER_X) + L::splat((2 * half * COLUMNS) as f32);
            let near = L::splat(1.0) - (ox * L::splat(m.z_dx[k]) + oy * L::splat(m.z_dy[k]));
            let u = corner(columns, k, (ox, oy), near);
            let v = corner(rows, k, (ox, oy), near);
            let cut = half * TILE_W;
            for (words, to) in [
                (L::place(u, v, width as u32), &mut out.offset),
                (L::negated(L::place(u, v, 16)), &mut out.origin),
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
/// `near` is one over how much farther away they are.
#[inline(always)]
fn corner<L: Lanes>(q: &Quadratic, k: usize, (ox, oy): (L, L), near: L) -> L::Bits {
    let straight = ox * L::splat(q.dx[k]) + oy * L::splat(q.dy[k]);
    (L::splat(q.corner[k]) + straight * near).max(L::splat(0.0)).truncated()
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
