//! The geometric term: agreement with the source views' own depth maps.

use super::Lanes;
use crate::stereo::level::SourceGeometry;

/// A source depth farther than this from the hypothesis, relatively, says nothing about it but "disagrees".
const GATE: f32 = 0.03;
/// Most pixels of disagreement that count.
const CAP: f32 = 4.0;

/// What disagreement adds to the costs of a row of hypotheses with inverse depths `w` from pixel `(x, y)` on: how
/// far, in pixels, the source's own depth map is off, sampled backwards with its plane at the exact position, so that
/// the term pulls neither way.
#[inline(always)]
pub(super) fn geometric_term<L: Lanes>(g: &SourceGeometry, at: (L, L), w: L, weight: f32) -> L {
    let (one, near) = (L::splat(1.0), L::splat(1e-6));
    let z = projected(g, 2, at, w);
    let r = one / near.max(z);
    let (u, v) = (projected(g, 0, at, w) * r, projected(g, 1, at, w) * r);
    let ku = one.max(u).min(L::splat(g.width as f32 - 2.0));
    let kv = one.max(v).min(L::splat(g.height as f32 - 2.0));
    let inside = L::both(L::both(ku.eq(u), kv.eq(v)), near.lt(z));
    let (du, iu) = ku.nearest();
    let (dv, iv) = kv.nearest();
    let index = L::row_major(iu, iv, g.width);
    let (p, slopes) = L::fetch(&g.planes, L::shifted_left::<1>(index));
    let p = L::from_bits(p);
    let wx = L::from_bits(L::shifted_left::<16>(slopes));
    let wy = L::from_bits(L::masked(slopes, 0xffff_0000));
    let there = p + wx * du + wy * dv;
    let here = w * r;
    let d = (there - here).abs();
    let e = d * L::splat(g.pixels_per_w);
    let square = e * (e + L::splat(2.0));
    let pixels = (square * square.inverse_sqrt()).min(L::splat(CAP));
    let known = L::both(L::splat(0.0).lt(p), d.lt(here * L::splat(GATE)));
    L::select(L::both(inside, known), pixels, L::splat(CAP)) * L::splat(weight)
}

/// Homogeneous coordinate `r` of the source pixels of a row of hypotheses. Not a closure: those are compiled without the
/// instructions of the kernel that calls them.
#[inline(always)]
fn projected<L: Lanes>(g: &SourceGeometry, r: usize, (x, y): (L, L), w: L) -> L {
    L::splat(g.a[r][0]) * x + (L::splat(g.a[r][1]) * y + L::splat(g.a[r][2])) + L::splat(g.b[r]) * w
}
