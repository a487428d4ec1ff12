//! Planes worth trying on a tile.

use super::level::Level;
use super::plane::InversePlane;
use super::rng::Rng;
use super::state::State;
use super::tile::{CENTRE, TILE_H, TILE_W, Tile};

/// Columns of cells in a tile; a cell is 4×4 pixels.
const CELLS_X: usize = TILE_W / CELL;
/// Cells of a tile.
pub(crate) const CELLS: usize = CELLS_X * (TILE_H / CELL);
const CELL: usize = 4;
/// Cells are visited in steps of this, so that a few of them are spread over the tile.
const CELL_STEP: usize = 3;

/// Random change of inverse depth, in pixels of shift in the most distant source.
const SHIFT_RANGE: f32 = 0.45;
/// Random change of slope, in pixels of shift per pixel.
const SLOPE_RANGE: f32 = 0.06;
/// Steeper surfaces are shaken more: the slope's range grows with 1 + tan² of the tilt, up to this factor.
const STEEP: f32 = 12.0;
/// Largest slope of a random plane against the image plane (tangent of the tilt).
const MAX_SLOPE: f32 = 4.5;
/// A pixel farther than this, in pixels of shift, from the plane fitted does not take part.
const FIT_GATE: f32 = 1.5;
/// Pixels costlier than this do not take part in fits.
const FIT_COST: f32 = 0.9;
/// Fewest pixels of a fit.
const FIT_MIN: f32 = 8.0;

/// The pixel with the smallest total cost of cell `k`, and that cost; `None` if no pixel there is active.
pub(crate) fn best_of_cell(tile: &Tile, k: usize) -> Option<(usize, usize, f32)> {
    let k = k % CELLS;
    let (cx, cy) = (k % CELLS_X * CELL, k / CELLS_X * CELL);
    let b = &tile.belief;
    let mut best: Option<(usize, usize, f32)> = None;
    for y in cy..cy + CELL {
        for x in cx..cx + CELL {
            let cost = b.total[y][x];
            if b.active[y][x] > 0.5 && best.is_none_or(|(_, _, c)| cost < c) {
                best = Some((x, y, cost));
            }
        }
    }
    best
}

/// The active pixel with the smallest matching cost, if any is active.
pub(crate) fn likeliest(tile: &Tile) -> Option<(usize, usize)> {
    let b = &tile.belief;
    let mut best: Option<(usize, usize, f32)> = None;
    for y in 0..TILE_H {
        for x in 0..TILE_W {
            let cost = b.data[y][x];
            if b.active[y][x] > 0.5 && best.is_none_or(|(_, _, c)| cost < c) {
                best = Some((x, y, cost));
            }
        }
    }
    best.map(|(x, y, _)| (x, y))
}

/// The `k`th cell of a visit that starts at cell `first`.
pub(crate) fn spread(first: usize, k: usize) -> usize {
    (first + k * CELL_STEP) % CELLS
}

/// The best of four pixels drawn beside the tile on side `k % 4`, as a plane at the tile's centre, and its class.
pub(crate) fn beside(
    level: &Level,
    state: &State,
    tile: &Tile,
    k: usize,
    rng: &mut Rng,
) -> Option<(InversePlane, u32)> {
    let reach = if k < 4 { 6 } else { 24 };
    let (tw, th) = (TILE_W as i32, TILE_H as i32);
    let mut best: Option<(i32, i32, f32)> = None;
    for _ in 0..4 {
        let out = rng.below(reach) as i32;
        let (dx, dy) = match k % 4 {
            0 => (-1 - out, rng.below(TILE_H) as i32),
            1 => (tw + out, rng.below(TILE_H) as i32),
            2 => (rng.below(TILE_W) as i32, -1 - out),
            _ => (rng.below(TILE_W) as i32, th + out),
        };
        let (x, y) = (tile.x0 + dx, tile.y0 + dy);
        if x < 0 || y < 0 || x >= level.size.width as i32 || y >= level.size.height as i32 {
            continue;
        }
        let at = state.at(x, y);
        let cost = state.cost[at];
        if state.active[at] > 0.5 && cost < 0.9 && best.is_none_or(|(_, _, c)| cost < c) {
            best = Some((x, y, cost));
        }
    }
    best.map(|(x, y, _)| {
        let (cx, cy) = (tile.x0 as f32 + CENTRE.0, tile.y0 as f32 + CENTRE.1);
        let plane = state.plane(state.at(x, y)).moved(cx - x as f32, cy - y as f32);
        let class = level.labels.as_ref().map_or(0, |labels| u32::from(labels[(x as usize, y as usize)]));
        (plane, class)
    })
}

/// A random plane anywhere in the depth range, tilted in any direction; steep tilts are rarer than flat ones.
pub(crate) fn random(level: &Level, rng: &mut Rng) -> InversePlane {
    let (low, high) = level.w_range;
    let w = low + (high - low) * rng.unit();
    let (sx, sy) = (rng.signed(), rng.signed());
    let stretch = 1.0 / (1.0 + 1.0 / MAX_SLOPE - sx.abs().max(sy.abs()));
    InversePlane { w, wx: sx * stretch * w / level.pinhole.fx, wy: sy * stretch * w / level.pinhole.fy }
}

/// The plane of pixel `(x, y)`, shaken about that pixel, anchored at the tile's centre. `strength` 1 is the widest.
pub(crate) fn shaken(
    level: &Level,
    tile: &Tile,
    x: usize,
    y: usize,
    strength: f32,
    rng: &mut Rng,
) -> InversePlane {
    let p = tile.pixel_plane(x, y);
    let shift = strength * SHIFT_RANGE / level.pixels_per_w;
    let (gx, gy) = (p.wx * level.pinhole.fx / p.w, p.wy * level.pinhole.fy / p.w);
    let steepness = (1.0 + gx * gx + gy * gy).min(STEEP);
    let slope = strength * SLOPE_RANGE * steepness / level.pixels_per_w;
    InversePlane {
        w: p.w + shift * rng.signed(),
        wx: p.wx + slope * rng.signed(),
        wy: p.wy + slope * rng.signed(),
    }
    .moved(CENTRE.0 - x as f32, CENTRE.1 - y as f32)
}

/// The plane fitted by least squares to the inverse depths around pixel `(x, y)` that lie near its own plane,
/// anchored at the tile's centre. `None` where too few pixels agree.
pub(crate) fn fitted(level: &Level, tile: &Tile, x: usize, y: usize, radius: usize) -> Option<InversePlane> {
    let p = tile.pixel_plane(x, y);
    let gate = FIT_GATE / level.pixels_per_w;
    let b = &tile.belief;
    let mut s = Sums::default();
    for yy in y.saturating_sub(radius)..=(y + radius).min(TILE_H - 1) {
        for xx in x.saturating_sub(radius)..=(x + radius).min(TILE_W - 1) {
            let (dx, dy) = (xx as f32 - x as f32, yy as f32 - y as f32);
            let off = b.w[yy][xx] - p.moved(dx, dy).w;
            if off.abs() <= gate && b.data[yy][xx] <= FIT_COST && b.active[yy][xx] > 0.5 {
                s.add(dx, dy, off);
            }
        }
    }
    let (d, dx, dy) = s.solve()?;
    Some(
        InversePlane { w: p.w + d, wx: p.wx + dx, wy: p.wy + dy }
            .moved(CENTRE.0 - x as f32, CENTRE.1 - y as f32),
    )
}

/// Sums of a least-squares plane through (x, y, value).
#[derive(Default)]
struct Sums {
    n: f32,
    x: f32,
    y: f32,
    v: f32,
    xx: f32,
    xy: f32,
    yy: f32,
    xv: f32,
    yv: f32,
}

impl Sums {
    fn add(&mut self, x: f32, y: f32, v: f32) {
        self.n += 1.0;
        self.x += x;
        self.y += y;
        self.v += v;
        self.xx += x * x;
        self.xy += x * y;
        self.yy += y * y;
        self.xv += x * v;
        self.yv += y * v;
    }

    /// Value at the origin and slopes.
    fn solve(&self) -> Option<(f32, f32, f32)> {
        if self.n < FIT_MIN {
            return None;
        }
        let (mx, my, mv) = (self.x / self.n, self.y / self.n, self.v / self.n);
        let (cxx, cxy, cyy) =
            (self.xx / self.n - mx * mx, self.xy / self.n - mx * my, self.yy / self.n - my * my);
        let (cxv, cyv) = (self.xv / self.n - mx * mv, self.yv / self.n - my * mv);
        let det = cxx * cyy - cxy * cxy;
        if det < 1e-3 {
            return None;
        }
        let (dx, dy) = ((cxv * cyy - cyv * cxy) / det, (cyv * cxx - cxv * cxy) / det);
        Some((mv - dx * mx - dy * my, dx, dy))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn least_squares_finds_the_plane() {
        let mut s = Sums::default();
        for y in -3..=3 {
            for x in -2..=4 {
                s.add(x as f32, y as f32, 0.5 + 0.25 * x as f32 - 0.125 * y as f32);
            }
        }
        let (v, dx, dy) = s.solve().unwrap();
        assert!((v - 0.5).abs() < 1e-5 && (dx - 0.25).abs() < 1e-5 && (dy + 0.125).abs() < 1e-5);
    }

    #[test]
    fn a_line_of_points_is_no_plane() {
        let mut s = Sums::default();
        (0..20).for_each(|i| s.add(i as f32, 0.0, 1.0));
        assert!(s.solve().is_none());
    }
}
