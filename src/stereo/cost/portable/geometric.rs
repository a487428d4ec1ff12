//! The geometric term: agreement with the source views' own depth maps.

use crate::stereo::cost::math::fraction_and_index;
use crate::stereo::level::SourceGeometry;
use crate::stereo::tile::{ROBUST_COST, Row, TILE_W};

/// A source depth farther than this from the hypothesis, relatively, says nothing about it but "disagrees".
const GEOMETRIC_GATE: f32 = 0.03;
/// Most pixels of disagreement that count.
const GEOMETRIC_CAP: f32 = 4.0;
const ZERO: Row = [0.0; TILE_W];

/// Adds the geometric term to the costs of one row: how far, in pixels, the source's own depth map disagrees,
/// sampled backwards with its plane at the exact position, so that the term pulls neither way.
#[inline(always)]
pub(super) fn geometric_row(g: &SourceGeometry, x0: f32, y: f32, w: &Row, weight: f32, cost: &mut Row) {
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
