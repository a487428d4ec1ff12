//! The source side: a window warped by the homography of a plane.

use crate::stereo::cost::math::fraction_and_index;
use crate::stereo::level::Source;
use crate::stereo::plane::InversePlane;
use crate::stereo::tile::{CENTRE, REACH, Scratch, WIN_H, WIN_W};

/// Grey 128 × 256, subtracted from samples so that sums of squares keep their digits.
const MID_SAMPLE: f32 = 32_768.0;
/// Depth ratio, corner of a window to its centre, below which a window is behind or beside the source.
const MIN_DEPTH_RATIO: f32 = 0.3;

/// How much of a warped window lies inside the source.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Coverage {
    None,
    Part,
    Whole,
}

/// The homography of a plane around an anchor pixel: source pixel of an offset `(ox, oy)` is
/// `centre + (ox·du_dx + oy·du_dy) / z` with `z = 1 + ox·z_dx + oy·z_dy`, likewise for v.
#[derive(Clone, Copy, Default)]
pub(super) struct Warp {
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
    pub(super) fn new(a: &[[f32; 3]; 3], b: &[f32; 3], x: f32, y: f32, p: InversePlane) -> Option<Self> {
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
    pub(super) fn at(&self, ox: f32, oy: f32) -> (f32, f32, f32) {
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
pub(super) fn warp(
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
pub(super) fn bilinear(quad: u64, fu: f32, fv: f32) -> f32 {
    let p = |shift: u32| ((quad >> shift) as u32 & 0xffff) as i32 as f32;
    let (p00, p10, p01, p11) = (p(0), p(16), p(32), p(48));
    let top = p00 + fu * (p10 - p00);
    let bottom = p01 + fu * (p11 - p01);
    top + fv * (bottom - top) - MID_SAMPLE
}

#[inline(always)]
pub(super) fn window_inside(m: &Warp, max_u: f32, max_v: f32) -> bool {
    const R: f32 = REACH as f32;
    [(-R, -R), (R, -R), (-R, R), (R, R)].iter().all(|&(sx, sy)| {
        let (u, v, z) = m.at(sx, sy);
        z >= MIN_DEPTH_RATIO && u >= 1.0 && v >= 1.0 && u <= max_u && v <= max_v
    })
}
