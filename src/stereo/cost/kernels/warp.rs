//! The source side: a window warped by the homography of a plane.

use super::Lanes;
use super::corners::{Corners, STEPS};
use super::homographies::{COLUMNS, FIXED, HALF};
use crate::stereo::level::Source;
use crate::stereo::tile::{Homographies, Quadratic, Row, Scratch, TILE_W, WIN_H, WIN_W, WinRow, WinWords};

/// Depth ratio, corner of a window to its centre, below which a window is behind or beside the source.
pub(super) const MIN_DEPTH_RATIO: f32 = 0.3;
const LANE_X: Row = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0];
const LANE_Y: Row = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0];

/// How much of a warped window lies inside the source.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Coverage {
    None,
    Part,
    Whole,
}

/// The homography to one source, as in [`Homographies`].
struct Warp {
    at: [f32; 2],
    dx: [f32; 2],
    dy: [f32; 2],
    z_dx: f32,
    z_dy: f32,
}

impl Warp {
    /// That of lane `k`.
    #[inline(always)]
    fn new(m: &Homographies, k: usize) -> Self {
        Warp {
            at: [m.at[0][k], m.at[1][k]],
            dx: [m.dx[0][k], m.dx[1][k]],
            dy: [m.dy[0][k], m.dy[1][k]],
            z_dx: m.z_dx[k],
            z_dy: m.z_dy[k],
        }
    }

    /// Source pixel of an offset, and the depth ratio there.
    #[inline(always)]
    fn at(&self, ox: f32, oy: f32) -> (f32, f32, f32) {
        let z = 1.0 + ox * self.z_dx + oy * self.z_dy;
        let r = 1.0 / z;
        let u = self.at[0] + (ox * self.dx[0] + oy * self.dy[0]) * r;
        let v = self.at[1] + (ox * self.dx[1] + oy * self.dy[1]) * r;
        (u, v, z)
    }

    /// Coverage of the tile's window in a source of these last columns and rows.
    #[inline(always)]
    fn coverage(&self, max_u: f32, max_v: f32) -> Coverage {
        let mut inside = 0;
        let mut out = [0; 4];
        for (sx, sy) in [(-HALF.0, -HALF.1), (HALF.0, -HALF.1), (-HALF.0, HALF.1), HALF] {
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

    /// Source pixels, in fixed point, of eight columns of two rows of the window.
    #[inline(always)]
    fn lanes<L: Lanes>(&self, c: usize, k: usize) -> (L, L) {
        let (ox, oy) = offsets::<L>(c, k);
        let r = L::splat(1.0) / (L::splat(1.0) + ox * L::splat(self.z_dx) + oy * L::splat(self.z_dy));
        let du = ox * L::splat(self.dx[0] * FIXED) + oy * L::splat(self.dy[0] * FIXED);
        let dv = ox * L::splat(self.dx[1] * FIXED) + oy * L::splat(self.dy[1] * FIXED);
        (L::splat(self.at[0] * FIXED) + du * r, L::splat(self.at[1] * FIXED) + dv * r)
    }
}

/// Warps the window of the tile in the source of lane `k`.
#[inline(always)]
pub(super) fn warp<L: Lanes>(source: &Source, k: usize, scratch: &mut Scratch) -> Coverage {
    let Scratch { homographies: m, warped, valid, .. } = scratch;
    if m.well_inside[k] > 0.5 {
        match m.rows[k] as u32 {
            4 => smooth::<L, 4>(source, m, k, warped),
            8 => smooth::<L, 8>(source, m, k, warped),
            _ => smooth::<L, 0>(source, m, k, warped),
        }
        return Coverage::Whole;
    }
    let (max_u, max_v) = (source.width as f32 - 2.0, source.height as f32 - 2.0);
    if m.in_front[k] < 0.5 || max_u < 1.0 || max_v < 1.0 {
        return Coverage::None;
    }
    let base = L::whole(base(source, m, k));
    let warp = Warp::new(m, k);
    let coverage = warp.coverage(max_u, max_v);
    match coverage {
        Coverage::None => {}
        Coverage::Whole => sample::<L, true>(source, &warp, base, warped, valid),
        Coverage::Part => sample::<L, false>(source, &warp, base, warped, valid),
    }
    coverage
}

/// What takes texels of the window to about mid-grey.
#[inline(always)]
fn base(source: &Source, m: &Homographies, k: usize) -> u32 {
    source.level_at(m.pixel[0][k], m.pixel[1][k]).wrapping_neg()
}

/// Samples the window; unless the `WHOLE` window is inside, samples are clamped and marked.
///
/// Sixteen texels at a time: eight columns of two rows, then of the next two rows, so that rows pair up lane by lane.
#[inline(always)]
fn sample<L: Lanes, const WHOLE: bool>(
    source: &Source,
    m: &Warp,
    base: L::Bits,
    warped: &mut [WinWords; WIN_H],
    valid: &mut [WinRow; WIN_H],
) {
    for c in 0..WIN_W / COLUMNS {
        let mut above = L::whole(0);
        for k in 0..WIN_H / 2 {
            let (mut u, mut v) = m.lanes::<L>(c, k);
            if !WHOLE {
                let inside;
                (u, v, inside) = clamped(source, u, v);
                let mut marks = [0.0; TILE_W];
                L::select(inside, L::splat(1.0), L::splat(0.0)).store(&mut marks);
                for (row, marks) in valid[2 * k..].iter_mut().zip(marks.chunks_exact(COLUMNS)) {
                    row[c * COLUMNS..][..COLUMNS].copy_from_slice(marks);
                }
            }
            let texels = texels::<L>(source, u.truncated(), v.truncated(), base);
            if k > 0 {
                put::<L>(L::paired(above, texels), &mut warped[2 * k - 2..], c);
            }
            above = texels;
        }
        put::<L>(L::paired(above, L::whole(0)), &mut warped[WIN_H - 2..], c);
    }
}

/// Samples a window that is wholly inside by a warp that is quadratic in the offset. Sixteen texels lie within `ROWS`
/// rows of the source, 0 if that is not known.
#[inline(always)]
fn smooth<L: Lanes, const ROWS: usize>(
    source: &Source,
    m: &Homographies,
    k: usize,
    warped: &mut [WinWords; WIN_H],
) {
    let base = L::whole(base(source, m, k));
    let (width, bytes, quads) = (source.width, &source.bytes[..], &source.quads[..]);
    let corners = if ROWS > 0 { Corners::new::<L>(m, k, width) } else { Corners::NONE };
    for c in 0..WIN_W / COLUMNS {
        let mut column = Column::<L>::new(m, k, c);
        let mut above = L::whole(0);
        for step in 0..STEPS {
            let [u, v] = column.at;
            let quads = if ROWS == 0 {
                L::gather(quads, L::place(u, v, width as u32))
            } else {
                let i = c * STEPS + step;
                L::lookup::<ROWS>(bytes, (corners.offset[i] as usize, corners.origin[i]), width, u, v)
            };
            let texels = L::bilinear(quads, u, v, base);
            column.advance();
            if step > 0 {
                put::<L>(L::paired(above, texels), &mut warped[2 * step - 2..], c);
            }
            above = texels;
        }
        put::<L>(L::paired(above, L::whole(0)), &mut warped[WIN_H - 2..], c);
    }
}

/// Writes eight columns of two rows.
#[inline(always)]
fn put<L: Lanes>(words: L::Bits, rows: &mut [WinWords], c: usize) {
    if let [first, second, ..] = rows
        && let Some(first) = first[c * COLUMNS..].first_chunk_mut()
        && let Some(second) = second[c * COLUMNS..].first_chunk_mut()
    {
        L::store_halves(words, first, second);
    }
}

/// Source pixels of eight columns of the window, two rows after two rows, by second differences.
struct Column<L: Lanes> {
    at: [L::Bits; 2],
    step: [L::Bits; 2],
    bend: [L::Bits; 2],
}

impl<L: Lanes> Column<L> {
    /// Of column `c` of vectors in the source of lane `k`.
    #[inline(always)]
    fn new(m: &Homographies, k: usize, c: usize) -> Self {
        let offset = offsets::<L>(c, 0);
        let near = L::splat(1.0) - (offset.0 * L::splat(m.z_dx[k]) + offset.1 * L::splat(m.z_dy[k]));
        let [u, v] = &m.quadratic;
        Column {
            at: [Self::start(u, k, offset, near), Self::start(v, k, offset, near)],
            step: [Self::step_of(u, k, offset), Self::step_of(v, k, offset)],
            bend: [L::whole(u.bend[k]), L::whole(v.bend[k])],
        }
    }

    #[inline(always)]
    fn start(q: &Quadratic, k: usize, (ox, oy): (L, L), near: L) -> L::Bits {
        let straight = ox * L::splat(q.dx[k]) + oy * L::splat(q.dy[k]);
        (L::splat(q.at[k]) + straight * near).truncated()
    }

    /// The change of that to the next pair of rows.
    #[inline(always)]
    fn step_of(q: &Quadratic, k: usize, (ox, oy): (L, L)) -> L::Bits {
        (L::splat(q.step[k]) - ox * L::splat(q.step_dx[k]) - oy * L::splat(q.step_dy[k])).truncated()
    }

    #[inline(always)]
    fn advance(&mut self) {
        for i in 0..2 {
            self.at[i] = L::plus(self.at[i], self.step[i]);
            self.step[i] = L::plus(self.step[i], self.bend[i]);
        }
    }
}

/// Offsets from the window's centre of eight columns of two rows.
#[inline(always)]
fn offsets<L: Lanes>(c: usize, k: usize) -> (L, L) {
    let x = L::load(&LANE_X) + L::splat((c * COLUMNS) as f32 - HALF.0);
    let y = L::load(&LANE_Y) + L::splat((2 * k) as f32 - HALF.1);
    (x, y)
}

/// Source pixels moved inside, and which were there before; in fixed point.
#[inline(always)]
pub(super) fn clamped<L: Lanes>(source: &Source, u: L, v: L) -> (L, L, L::Mask) {
    let one = L::splat(FIXED);
    let ku = one.max(u).min(L::splat((source.width as f32 - 2.0) * FIXED));
    let kv = one.max(v).min(L::splat((source.height as f32 - 2.0) * FIXED));
    (ku, kv, L::both(ku.eq(u), kv.eq(v)))
}

/// Bilinear samples of the source at fixed-point pixels, above `base`; see [`Lanes::bilinear`].
#[inline(always)]
pub(super) fn texels<L: Lanes>(source: &Source, u: L::Bits, v: L::Bits, base: L::Bits) -> L::Bits {
    let index = L::place(u, v, source.width as u32);
    L::bilinear(L::gather(&source.quads, index), u, v, base)
}
