//! The source side: a window warped by the homography of a plane.

use super::Lanes;
use crate::stereo::level::Source;
use crate::stereo::plane::InversePlane;
use crate::stereo::tile::{CENTRE, Row, Scratch, TILE_W, WIN_H, WIN_W};

/// Depth ratio, corner of a window to its centre, below which a window is behind or beside the source.
pub(super) const MIN_DEPTH_RATIO: f32 = 0.3;
/// Half the extent of the window.
const HALF: (f32, f32) = ((WIN_W as f32 - 1.0) / 2.0, (WIN_H as f32 - 1.0) / 2.0);
/// Change of the depth ratio within the window up to which its inverse is a short series: the error, in pixels, is
/// below a window's half extent times this to the fourth power.
const SERIES: f32 = 0.05;

/// How much of a warped window lies inside the source.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Coverage {
    None,
    Part,
    Whole,
}

/// The homography of a plane around an anchor pixel: source pixel of an offset `(ox, oy)` is
/// `centre + (ox·du_dx + oy·du_dy) / z` with `z = 1 + ox·z_dx + oy·z_dy`, likewise for v.
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

    /// Whether the depth ratio hardly changes within the window.
    #[inline(always)]
    fn nearly_affine(&self) -> bool {
        self.z_dx.abs() * HALF.0 + self.z_dy.abs() * HALF.1 < SERIES
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
    match (coverage, m.nearly_affine()) {
        (Coverage::None, _) => {}
        (Coverage::Whole, true) => sample::<L, true, true>(source, &m, scratch),
        (Coverage::Whole, false) => sample::<L, true, false>(source, &m, scratch),
        (Coverage::Part, _) => sample::<L, false, false>(source, &m, scratch),
    }
    coverage
}

/// Samples the window, 16 texels at a time in raster order; unless the `WHOLE` window is inside, samples are clamped
/// and marked.
#[inline(always)]
fn sample<L: Lanes, const WHOLE: bool, const SERIES: bool>(source: &Source, m: &Warp, scratch: &mut Scratch) {
    let (warped, _) = scratch.warped.as_flattened_mut().as_chunks_mut::<TILE_W>();
    let (valid, _) = scratch.valid.as_flattened_mut().as_chunks_mut::<TILE_W>();
    let one = L::splat(1.0);
    for (((ox, oy), out), valid) in OFFSET_X.iter().zip(&OFFSET_Y).zip(warped).zip(valid) {
        let (ox, oy) = (L::load(ox), L::load(oy));
        let e = ox * L::splat(m.z_dx) + oy * L::splat(m.z_dy);
        // 1 / (1 + e)
        let r = if SERIES { one - e * (one - e * (one - e)) } else { one / (one + e) };
        let mut u = L::splat(m.u) + (ox * L::splat(m.du_dx) + oy * L::splat(m.du_dy)) * r;
        let mut v = L::splat(m.v) + (ox * L::splat(m.dv_dx) + oy * L::splat(m.dv_dy)) * r;
        if !WHOLE {
            let inside;
            (u, v, inside) = clamped(source, u, v);
            L::select(inside, one, L::splat(0.0)).store(valid);
        }
        texels(source, u, v).store(out);
    }
}

/// Source pixels moved inside, and which were there before.
#[inline(always)]
pub(super) fn clamped<L: Lanes>(source: &Source, u: L, v: L) -> (L, L, L::Mask) {
    let one = L::splat(1.0);
    let ku = one.max(u).min(L::splat(source.width as f32 - 2.0));
    let kv = one.max(v).min(L::splat(source.height as f32 - 2.0));
    let off = (ku - u).abs() + (kv - v).abs();
    (ku, kv, off.le(L::splat(0.0)))
}

/// Bilinear samples of the source, 65536 per grey level, mid-grey is 0.
#[inline(always)]
pub(super) fn texels<L: Lanes>(source: &Source, u: L, v: L) -> L {
    let (fu, iu) = u.fraction_and_whole();
    let (fv, iv) = v.fraction_and_whole();
    let index = L::row_major(iu, iv, source.width);
    let (left, right) = L::fetch(&source.pairs, index);
    let (left, right) = (L::lerp_halves(left, fv), L::lerp_halves(right, fv));
    left + fu * (right - left)
}

/// Column offsets of the window's texels from its centre, in raster order.
const OFFSET_X: [Row; WIN_W * WIN_H / TILE_W] = offsets(true);
/// Row offsets.
const OFFSET_Y: [Row; WIN_W * WIN_H / TILE_W] = offsets(false);

const fn offsets(columns: bool) -> [Row; WIN_W * WIN_H / TILE_W] {
    let mut out = [[0.0; TILE_W]; WIN_W * WIN_H / TILE_W];
    let mut i = 0;
    while i < WIN_W * WIN_H {
        let (x, y) = ((i % WIN_W) as f32 - HALF.0, (i / WIN_W) as f32 - HALF.1);
        out[i / TILE_W][i % TILE_W] = if columns { x } else { y };
        i += 1;
    }
    out
}
