//! The kernels, written once over [`Lanes`]; an instruction set supplies the lanes.

mod contest;
mod corners;
mod correlation;
mod geometric;
mod homographies;
mod label;
mod own;
mod patch;
mod smoothness;
mod warp;

pub(super) use own::score_own;
pub(super) use patch::prepare;
pub(super) use smoothness::begin;

use super::lanes::{Lanes, Pairs};
use crate::stereo::level::Level;
use crate::stereo::plane::InversePlane;
use crate::stereo::tile::{CENTRE, REACH, ROBUST_COST, Row, TILE_H, TILE_W, Tile, TileMap, UNSEEN, WinRow};
use geometric::geometric_term;
use label::label_term;
use smoothness::PlaneVector;
use warp::{Coverage, warp};

const ZERO: Row = [0.0; TILE_W];
/// The number of each lane.
const LANE: Row = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 11.0, 12.0, 13.0, 14.0, 15.0];

/// Centres of two by two pixels, eight in a row of them and eight in the next.
const PAIRS_X: Row = [0.5, 2.5, 4.5, 6.5, 8.5, 10.5, 12.5, 14.5, 0.5, 2.5, 4.5, 6.5, 8.5, 10.5, 12.5, 14.5];
const PAIRS_Y: Row = [0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 2.5, 2.5, 2.5, 2.5, 2.5, 2.5, 2.5, 2.5];

/// The 16 values from column `at`.
#[inline(always)]
fn cut<L: Lanes>(row: &[f32], at: usize) -> L {
    L::load(row[at..].first_chunk::<TILE_W>().unwrap_or(&ZERO))
}

/// Tries one plane on all pixels of the tile; pixels that it suits better take it. The plane is anchored at the
/// tile's centre. Returns whether any pixel took it.
#[inline(always)]
pub(super) fn try_plane<L: Lanes>(tile: &mut Tile, level: &Level, plane: InversePlane) -> bool {
    let (low, high) = level.w_range;
    let thinkable = plane.w >= low * 0.5 && plane.w <= high * 2.0;
    if !thinkable {
        return false;
    }
    let vector = PlaneVector::new(tile, level, plane);
    smoothness::of_candidate::<L>(tile, plane, vector);
    if !data_cost::<L>(tile, level, plane) {
        return false;
    }
    let changed = contest::accept::<L>(tile, plane, vector, (low, high));
    smoothness::refresh::<L>(tile, changed);
    changed != 0
}

/// Compares a plane with all views, to order them.
#[inline(always)]
pub(super) fn survey<L: Lanes>(tile: &mut Tile, level: &Level, plane: InversePlane) {
    data_cost::<L>(tile, level, plane);
}

/// Matching cost of a plane over the sources in use, as the best and second best per pixel. False if no source sees
/// it.
#[inline(always)]
fn data_cost<L: Lanes>(tile: &mut Tile, level: &Level, plane: InversePlane) -> bool {
    let Tile { x0, y0, classes, patch, scratch, order, views, view_cost, .. } = tile;
    scratch.best = [[UNSEEN; TILE_W]; TILE_H];
    scratch.second = [[UNSEEN; TILE_W]; TILE_H];
    // Views are only put in order by planes that all were compared with.
    let ranks = *views >= order.len();
    let (mut any, mut filled) = (false, usize::MAX);
    for &k in order.iter().take(*views) {
        let (source, lanes) = (&level.sources[k], k / TILE_W);
        if ranks {
            view_cost[k] = UNSEEN;
        }
        if lanes != filled {
            scratch.homographies.fill::<L>(&level.transfers[lanes], (*x0, *y0), plane);
            filled = lanes;
        }
        let coverage = warp::<L>(source, k % TILE_W, scratch);
        if coverage == Coverage::None {
            continue;
        }
        any = true;
        let mut terms = [L::splat(0.0); TILE_H / 2];
        if let Some(g) = &source.geometry {
            for y in (0..TILE_H).step_by(4) {
                let (x, y_in) = (L::load(&PAIRS_X), L::load(&PAIRS_Y) + L::splat(y as f32));
                let w = L::splat(plane.w)
                    + L::splat(plane.wx) * (x - L::splat(CENTRE.0))
                    + L::splat(plane.wy) * (y_in - L::splat(CENTRE.1));
                let at = (L::splat(*x0 as f32) + x, L::splat(*y0 as f32) + y_in);
                let two = L::doubled(geometric_term(g, at, w, level.geometric_weight));
                terms[y / 2] = two[0];
                terms[y / 2 + 1] = two[1];
            }
        }
        correlation::of_tile::<L>(patch, &scratch.warped, &mut scratch.cost);
        if coverage == Coverage::Part {
            reject_outside::<L>(&scratch.valid, &mut scratch.cost);
        }
        if let Some(labels) = &source.labels {
            for y in 0..TILE_H {
                let column = L::load(&LANE) - L::splat(CENTRE.0);
                let w = L::splat(plane.w + plane.wy * (y as f32 - CENTRE.1)) + L::splat(plane.wx) * column;
                let at = (*x0 as f32, (*y0 + y as i32) as f32);
                let term = label_term(source, labels, (classes, y), at, w, level.label_cost);
                let cost = L::load(&scratch.cost[y]);
                L::select(cost.lt(L::splat(ROBUST_COST)), cost + term, cost).store(&mut scratch.cost[y]);
            }
        }
        let (mut sum, with_terms) = (L::splat(0.0), source.geometry.is_some());
        for y in 0..TILE_H {
            let mut cost = L::load(&scratch.cost[y]);
            if with_terms {
                cost = L::select(cost.lt(L::splat(ROBUST_COST)), cost + terms[y / 2], cost);
            }
            let (best, second) = (L::load(&scratch.best[y]), L::load(&scratch.second[y]));
            second.min(best.max(cost)).store(&mut scratch.second[y]);
            best.min(cost).store(&mut scratch.best[y]);
            if ranks {
                sum = sum + cost;
            }
        }
        if ranks {
            view_cost[k] = sum.sum() / (TILE_W * TILE_H) as f32;
        }
    }
    any
}

/// Pixels whose matching window is not wholly inside the source get the robust cost.
#[inline(always)]
fn reject_outside<L: Lanes>(valid: &[WinRow], cost: &mut TileMap) {
    for y in 0..TILE_H {
        let (top, bottom) = (&valid[y], &valid[y + 2 * REACH]);
        let all = (cut::<L>(top, 0) * cut(top, 2 * REACH)) * (cut::<L>(bottom, 0) * cut(bottom, 2 * REACH));
        let inside = L::splat(0.5).lt(all);
        L::select(inside, L::load(&cost[y]), L::splat(ROBUST_COST)).store(&mut cost[y]);
    }
}
