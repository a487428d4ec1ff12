//! The label term: what a source view costs more where it shows another class than the reference.

use super::{LANE, Lanes};
use crate::stereo::level::Source;
use crate::stereo::tile::{TILE_H, Words};

/// `cost` for the pixels of a row of hypotheses with inverse depths `w`, from pixel `(x, y)` on, whose class in the source is
/// another than their own in `row` of `classes`; 0 for the others, for void, and outside the source, whose classes are `labels`.
#[inline(always)]
pub(super) fn label_term<L: Lanes>(
    source: &Source,
    labels: &[u32],
    (classes, row): (&[Words; TILE_H], usize),
    (x, y): (f32, f32),
    w: L,
    cost: f32,
) -> L {
    let column = L::splat(x) + L::load(&LANE);
    let (one, half, zero) = (L::splat(1.0), L::splat(0.5), L::splat(0.0));
    let near = L::splat(1e-6);
    let z = projected(source, 2, column, y, w);
    let r = one / near.max(z);
    let (u, v) = (projected(source, 0, column, y, w) * r, projected(source, 1, column, y, w) * r);
    let ku = zero.max(u).min(L::splat(source.width as f32 - 1.0));
    let kv = zero.max(v).min(L::splat(source.height as f32 - 1.0));
    let inside = L::both(L::both(ku.eq(u), kv.eq(v)), near.lt(z));
    let (_, iu) = ku.nearest();
    let (_, iv) = kv.nearest();
    let there = L::from_whole(L::gather(labels, L::row_major(iu, iv, source.width)));
    let here = L::from_whole(L::load_words(&classes[row]));
    let classed = L::both(half.lt(there), half.lt(here));
    let differs = L::both(L::both(inside, classed), half.lt((there - here).abs()));
    L::select(differs, L::splat(cost), zero)
}

/// Homogeneous coordinate `i` of the source pixels of a row of hypotheses.
#[inline(always)]
fn projected<L: Lanes>(source: &Source, i: usize, column: L, y: f32, w: L) -> L {
    let a = &source.a[i];
    L::splat(a[0]) * column + L::splat(a[1] * y + a[2]) + L::splat(source.b[i]) * w
}
