//! The contest: which pixels a candidate wins.

use super::correlation::merged;
use super::smoothness::PlaneVector;
use super::{LANE, Lanes};
use crate::stereo::plane::InversePlane;
use crate::stereo::tile::{CENTRE, ROBUST_COST, TILE_H, Tile};

/// Most that disagreement with the coarser level can cost.
const PRIOR_CAP: f32 = 0.5;

/// Matching cost with smoothness, blended towards agreement with the coarser level where there is no texture.
/// `prior` is the depth there and its weight.
#[inline(always)]
pub(super) fn total<L: Lanes>(data: L, smooth: L, w: L, prior: (L, L)) -> L {
    let t = L::select(data.lt(L::splat(ROBUST_COST)), data * smooth, data);
    let off = (w * prior.0 - L::splat(1.0)).abs().min(L::splat(PRIOR_CAP));
    t + prior.1 * (off - t)
}

/// Gives the candidate to every pixel for which its total cost is lower. One bit per row that changed.
#[inline(always)]
pub(super) fn accept<L: Lanes>(
    tile: &mut Tile,
    p: InversePlane,
    vector: PlaneVector,
    (low, high): (f32, f32),
) -> u32 {
    let Tile { belief, halo, scratch, .. } = tile;
    let mut changed = 0;
    let along = L::splat(p.wx) * (L::load(&LANE) - L::splat(CENTRE.0));
    let mut takers = [L::splat(0.0).lt(L::splat(0.0)); TILE_H];
    for (y, takers) in takers.iter_mut().enumerate() {
        let data: L = merged(&scratch.best[y], &scratch.second[y]);
        let w = L::splat(p.w + p.wy * (y as f32 - CENTRE.1)) + along;
        let prior = (L::load(&belief.prior_z[y]), L::load(&belief.prior_k[y]));
        let t = total(data, L::load(&scratch.factor[y]), w, prior);
        let possible = L::both(L::splat(low).le(w), w.le(L::splat(high)));
        let open = L::both(possible, L::splat(0.5).lt(L::load(&belief.active[y])));
        *takers = L::both(t.lt(L::load(&belief.total[y])), open);
        data.store(&mut scratch.best[y]);
        t.store(&mut scratch.cost[y]);
        changed |= u32::from(L::any(*takers)) << y;
    }
    let mut rows = changed;
    while rows != 0 {
        let y = rows.trailing_zeros() as usize % TILE_H;
        rows &= rows - 1;
        let better = takers[y];
        let w = L::splat(p.w + p.wy * (y as f32 - CENTRE.1)) + along;
        vector.take(halo, y, w, better);
        for (row, new) in [
            (&mut belief.total[y], L::load(&scratch.cost[y])),
            (&mut belief.data[y], L::load(&scratch.best[y])),
            (&mut belief.w[y], w),
            (&mut belief.wx[y], L::splat(p.wx)),
            (&mut belief.wy[y], L::splat(p.wy)),
        ] {
            L::select(better, new, L::load(row)).store(row);
        }
    }
    changed
}
