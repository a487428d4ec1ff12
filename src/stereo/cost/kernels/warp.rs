//! The source side: a window warped by the homography of a plane.

use super::Lanes;
use super::corners::{Corners, Footprint, STEPS};
use crate::stereo::level::Source;
use crate::stereo::plane::InversePlane;
use crate::stereo::tile::{CENTRE, Row, Scratch, TILE_W, WIN_H, WIN_W, WinWords};

/// Depth ratio, corner of a window to its centre, below which a window is behind or beside the source.
pub(super) const MIN_DEPTH_RATIO: f32 = 0.3;
/// Half the extent of the window.
pub(super) const HALF: (f32, f32) = ((WIN_W as f32 - 1.0) / 2.0, (WIN_H as f32 - 1.0) / 2.0);
/// Change of the depth ratio within the window up to which a warp is quadratic: the error, in pixels, is below a window's
/// half extent times the square of this.
pub(super) const SMOOTH: f32 = 0.03;
/// Steps per pixel of fixed-point source pixels.
pub(super) const FIXED: f32 = 65_536.0;
/// Added to the extent of footprints for rounding, in pixels.
pub(super) const SLACK: f32 = 0.02;
/// Columns of the window in one vector, of two rows.
pub(super) const COLUMNS: usize = TILE_W / 2;
const LANE_X: Row = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0];
const LANE_Y: Row = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0];

/// How much of a warped window lies inside the source.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Coverage {
    None,
    Part,
    Whole,
}

/// The homography of a plane around an anchor pixel: source pixel of an offset `(ox, oy)` is
/// `centre + (ox·du_dx + oy·du_dy) / z` with `z = 1 + ox·z_dx + oy·z_dy`, likewise for v.
pub(super) struct Warp {
    pub(super) u: f32,
    pub(super) v: f32,
    pub(super) du_dx: f32,
    pub(super) du_dy: f32,
    pub(super) dv_dx: f32,
    pub(super) dv_dy: f32,
    pub(super) z_dx: f32,
    pub(super) z_dy: f32,
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

    /// Whether the tile's window is inside for sure: a cheap test that few windows inside fail.
    #[inline(always)]
    fn well_inside(&self, max_u: f32, max_v: f32) -> bool {
        let far_u = (self.du_dx.abs() * HALF.0 + self.du_dy.abs() * HALF.1) * (1.0 + 2.0 * SMOOTH) + SLACK;
        let far_v = (self.dv_dx.abs() * HALF.0 + self.dv_dy.abs() * HALF.1) * (1.0 + 2.0 * SMOOTH) + SLACK;
        self.nearly_quadratic()
            && self.u - far_u >= 1.0
            && self.v - far_v >= 1.0
            && self.u + far_u <= max_u
            && self.v + far_v <= max_v
    }

    /// Coverage of the tile's window.
    #[inline(always)]
    fn coverage(&self, max_u: f32, max_v: f32) -> Coverage {
        if self.well_inside(max_u, max_v) {
            return Coverage::Whole;
        }
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
        let du = ox * L::splat(self.du_dx * FIXED) + oy * L::splat(self.du_dy * FIXED);
        let dv = ox * L::splat(self.dv_dx * FIXED) + oy * L::splat(self.dv_dy * FIXED);
        (L::splat(self.u * FIXED) + du * r, L::splat(self.v * FIXED) + dv * r)
    }

    /// Whether the depth ratio hardly changes within the window.
    #[inline(always)]
    fn nearly_quadratic(&self) -> bool {
        self.z_dx.abs() * HALF.0 + self.z_dy.abs() * HALF.1 < SMOOTH
    }
}

/// Warps the source window of the tile by a plane.
#[inline(always)]
pub(super) fn warp<L: Lanes>(
    source: &Source,
    x0: i32,
    y0: i32,
    plane: InversePlane,
    scratch: &mut Scratch,
) -> Coverage {
    let (xc, yc) = (x0 as f32 + CENTRE.0, y0 as f32 + CENTRE.1);
    let Some(m) = Warp::new(&source.a, &source.b, xc, yc, plane) else { return Coverage::None };
    let (max_u, max_v) = (source.width as f32 - 2.0, source.height as f32 - 2.0);
    let coverage = if max_u < 1.0 || max_v < 1.0 { Coverage::None } else { m.coverage(max_u, max_v) };
    match (coverage, m.nearly_quadratic()) {
        (Coverage::None, _) => {}
        (Coverage::Whole, true) => match Footprint::rows::<L>(&m) {
            4 => smooth::<L, 4>(source, &m, scratch),
            8 => smooth::<L, 8>(source, &m, scratch),
            _ => smooth::<L, 0>(source, &m, scratch),
        },
        (Coverage::Whole, false) => sample::<L, true>(source, &m, scratch),
        (Coverage::Part, _) => sample::<L, false>(source, &m, scratch),
    }
    coverage
}

/// Samples the window; unless the `WHOLE` window is inside, samples are clamped and marked.
///
/// Sixteen texels at a time: eight columns of two rows, then of the next two rows, so that rows pair up lane by lane.
#[inline(always)]
fn sample<L: Lanes, const WHOLE: bool>(source: &Source, m: &Warp, scratch: &mut Scratch) {
    let base = L::whole(source.level_at(m.u, m.v).wrapping_neg());
    for c in 0..WIN_W / COLUMNS {
        let mut above = L::whole(0);
        for k in 0..WIN_H / 2 {
            let (mut u, mut v) = m.lanes::<L>(c, k);
            if !WHOLE {
                let inside;
                (u, v, inside) = clamped(source, u, v);
                let mut marks = [0.0; TILE_W];
                L::select(inside, L::splat(1.0), L::splat(0.0)).store(&mut marks);
                for (row, marks) in scratch.valid[2 * k..].iter_mut().zip(marks.chunks_exact(COLUMNS)) {
                    row[c * COLUMNS..][..COLUMNS].copy_from_slice(marks);
                }
            }
            let texels = texels::<L>(source, u.truncated(), v.truncated(), base);
            if k > 0 {
                put::<L>(L::paired(above, texels), &mut scratch.warped[2 * k - 2..], c);
            }
            above = texels;
        }
        put::<L>(L::paired(above, L::whole(0)), &mut scratch.warped[WIN_H - 2..], c);
    }
}

/// Samples a window that is wholly inside by a warp that is quadratic in the offset. Sixteen texels lie within `ROWS`
/// rows of the source, 0 if that is not known.
#[inline(always)]
fn smooth<L: Lanes, const ROWS: usize>(source: &Source, m: &Warp, scratch: &mut Scratch) {
    let base = L::whole(source.level_at(m.u, m.v).wrapping_neg());
    let (width, bytes, quads) = (source.width, &source.bytes[..], &source.quads[..]);
    let corners = if ROWS > 0 { Corners::new::<L>(m, width) } else { Corners::NONE };
    for c in 0..WIN_W / COLUMNS {
        let mut column = Column::<L>::new(m, c);
        let mut above = L::whole(0);
        for k in 0..WIN_H / 2 {
            let [u, v] = column.at;
            let quads = if ROWS == 0 {
                L::gather(quads, L::place(u, v, width as u32))
            } else {
                let (i, first) = (c * STEPS + k, corners.offset[c * STEPS + k] as usize);
                let (right, down) =
                    (L::plus(u, L::whole(corners.back[i])), L::plus(v, L::whole(corners.up[i])));
                L::lookup::<ROWS>(bytes, first, width, right, down)
            };
            let texels = L::bilinear(quads, u, v, base);
            column.advance();
            if k > 0 {
                put::<L>(L::paired(above, texels), &mut scratch.warped[2 * k - 2..], c);
            }
            above = texels;
        }
        put::<L>(L::paired(above, L::whole(0)), &mut scratch.warped[WIN_H - 2..], c);
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
    #[inline(always)]
    fn new(m: &Warp, c: usize) -> Self {
        let (ox, oy) = offsets::<L>(c, 0);
        let e = ox * L::splat(m.z_dx) + oy * L::splat(m.z_dy);
        Column {
            at: [
                Self::start(m.u, m.du_dx, m.du_dy, ox, oy, e),
                Self::start(m.v, m.dv_dx, m.dv_dy, ox, oy, e),
            ],
            step: [Self::step_of(m, m.du_dx, m.du_dy, ox, oy), Self::step_of(m, m.dv_dx, m.dv_dy, ox, oy)],
            bend: [m.du_dy, m.dv_dy].map(|dy| L::splat(-8.0 * dy * m.z_dy * FIXED).truncated()),
        }
    }

    /// `centre + (ox·dx + oy·dy)·(1 − e)`.
    #[inline(always)]
    fn start(centre: f32, dx: f32, dy: f32, ox: L, oy: L, e: L) -> L::Bits {
        let straight = ox * L::splat(dx * FIXED) + oy * L::splat(dy * FIXED);
        (L::splat(centre * FIXED) + straight * (L::splat(1.0) - e)).truncated()
    }

    /// The change of that to the next pair of rows.
    #[inline(always)]
    fn step_of(m: &Warp, dx: f32, dy: f32, ox: L, oy: L) -> L::Bits {
        let mixed = 2.0 * (dx * m.z_dy + dy * m.z_dx);
        let square = 4.0 * dy * m.z_dy;
        let level = L::splat((2.0 * dy - square) * FIXED);
        (level - ox * L::splat(mixed * FIXED) - oy * L::splat(square * FIXED)).truncated()
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
