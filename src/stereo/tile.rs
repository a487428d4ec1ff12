//! The working set of one 16×8 tile: everything a kernel reads and writes, a few tens of kilobytes.
//!
//! All pixels of a tile test the same plane, so that the source window is warped once for all of them
//! (Lu et al. 2013, PatchMatch Filter; Taniai et al. 2018, local expansion moves).

use super::level::Level;
use super::plane::InversePlane;
use super::state::State;

/// Columns of a tile.
pub(crate) const TILE_W: usize = 16;
/// Rows of a tile.
pub(crate) const TILE_H: usize = 8;
/// Reach of the matching window: 9×9 pixels, every second one sampled.
pub(crate) const REACH: usize = 4;
/// Columns of the tile and its window margin.
pub(crate) const WIN_W: usize = TILE_W + 2 * REACH;
/// Rows of the tile and its window margin.
pub(crate) const WIN_H: usize = TILE_H + 2 * REACH;
/// Columns of a matching window.
pub(crate) const TAP_COLUMNS: usize = 5;
/// Rows of a matching window, two by two; the last pair has one row only.
pub(crate) const TAP_ROWS: usize = 3;
/// Pairs of texels of a matching window, row by row.
pub(crate) const TAPS: usize = TAP_COLUMNS * TAP_ROWS;
/// Column and row of the tile's centre, where its planes are anchored.
pub(crate) const CENTRE: (f32, f32) = ((TILE_W as f32 - 1.0) / 2.0, (TILE_H as f32 - 1.0) / 2.0);
/// Cost of a view that cannot be compared: out of the image, or without texture.
pub(crate) const ROBUST_COST: f32 = 1.2;
/// Larger than any cost.
pub(crate) const UNSEEN: f32 = 9.0;

/// One value per pixel of a tile row.
pub(crate) type Row = [f32; TILE_W];
/// One value per column of the window.
pub(crate) type WinRow = [f32; WIN_W];
/// One pair of 16-bit numbers per pixel of a tile row.
pub(crate) type Words = [u32; TILE_W];
/// One pair per column of the window: a texel in the low half, the one two rows below it in the high half.
pub(crate) type WinWords = [u32; WIN_W];
/// One value per pixel of the tile.
pub(crate) type TileMap = [Row; TILE_H];
/// Where in its row of a [`HaloMap`] the tile begins: whole vectors are aligned there.
pub(crate) const HALO_X: usize = TILE_W;
/// One value per pixel of the tile and its one-pixel surround: pixel (x, y) is at `[y + 1][HALO_X + x]`.
pub(crate) type HaloMap = [[f32; 3 * TILE_W]; TILE_H + 2];

/// The reference window and the statistics of every pixel's patch.
#[repr(align(64))]
pub(crate) struct Patch {
    /// Grey levels 0..255 minus mid-grey, in 1/64.
    pub(crate) texel: [WinRow; WIN_H],
    /// The same as pairs.
    pub(crate) pairs: [WinWords; WIN_H],
    /// Bilateral weights of the pairs of every pixel's window, 32767 = 1; 0 outside the image.
    pub(crate) weight: [[Words; TAPS]; TILE_H],
    /// One over the sum of the weights.
    pub(crate) inverse_weight: TileMap,
    /// Weighted mean of the texels.
    pub(crate) mean: TileMap,
    /// Weighted sum of squared deviations.
    pub(crate) norm: TileMap,
}

/// What is currently believed about the tile's pixels.
#[repr(align(64))]
pub(crate) struct Belief {
    /// Inverse depth.
    pub(crate) w: TileMap,
    /// Change of inverse depth per column.
    pub(crate) wx: TileMap,
    /// Change of inverse depth per row.
    pub(crate) wy: TileMap,
    /// Matching cost, with the geometric term, without smoothness and prior.
    pub(crate) data: TileMap,
    /// Cost with smoothness and prior: what candidates compete with.
    pub(crate) total: TileMap,
    /// Depth at the coarser level; 0 = none.
    pub(crate) prior_z: TileMap,
    /// Weight of the prior, 0..1: near 1 where there is no texture.
    pub(crate) prior_k: TileMap,
    /// 1 for pixels that are estimated, 0 for skipped ones and outside the image.
    pub(crate) active: TileMap,
}

/// Planes of the tile's pixels and their surround, as vectors of one length and inverse depths.
#[repr(align(64))]
pub(crate) struct Halo {
    /// First component of the plane vector.
    pub(crate) nx: HaloMap,
    /// Second component.
    pub(crate) ny: HaloMap,
    /// Third component.
    pub(crate) nz: HaloMap,
    /// Inverse depth.
    pub(crate) w: HaloMap,
    /// 1 where there may be an estimate, else 0.
    pub(crate) on: HaloMap,
    /// One over the lengths that the vectors of the tile's own pixels had, scaled as the kernels of smoothness want it.
    pub(crate) inverse_length: TileMap,
    /// Smoothness factor of every pixel's own plane by the pixels to its left and right.
    pub(crate) beside: TileMap,
    /// The same by the pixel above.
    pub(crate) above: TileMap,
    /// The same by the pixel below.
    pub(crate) below: TileMap,
    /// The surround's columns beside the tile once more.
    pub(crate) sides: Sides,
}

/// The columns beside a tile: the left one from top to bottom, then the right one. Fields as in [`Halo`].
#[repr(align(64))]
pub(crate) struct Sides {
    pub(crate) nx: Row,
    pub(crate) ny: Row,
    pub(crate) nz: Row,
    pub(crate) w: Row,
    pub(crate) on: Row,
}

/// Scratch of one candidate.
#[repr(align(64))]
pub(crate) struct Scratch {
    /// The candidate's homographies to sixteen sources.
    pub(crate) homographies: Homographies,
    /// Source window warped by the candidate, about 1/64 grey levels from mid-grey.
    pub(crate) warped: [WinWords; WIN_H],
    /// 1 where the warped sample lies inside the source.
    pub(crate) valid: [WinRow; WIN_H],
    /// Cost of the view at hand.
    pub(crate) cost: TileMap,
    /// Smallest cost over the views so far.
    pub(crate) best: TileMap,
    /// Second smallest.
    pub(crate) second: TileMap,
    /// Smoothness factor that a surround pixel contributes to its neighbours.
    pub(crate) smooth: HaloMap,
    /// Smoothness factor of every pixel.
    pub(crate) factor: TileMap,
}

/// Homographies around the centre of a tile: the source pixel of an offset `(ox, oy)` is
/// `at + (ox·dx + oy·dy) / z` with `z = 1 + ox·z_dx + oy·z_dy`, for both coordinates.
pub(crate) struct Homographies {
    /// Column and row.
    pub(crate) at: [Row; 2],
    pub(crate) dx: [Row; 2],
    pub(crate) dy: [Row; 2],
    pub(crate) z_dx: Row,
    pub(crate) z_dy: Row,
    /// 1 where the centre is in front of the source.
    pub(crate) in_front: Row,
    /// 1 where the depth ratio hardly changes within the window, and all of it is inside for sure: few are inside that
    /// fail this.
    pub(crate) well_inside: Row,
    /// Whole part of `at`.
    pub(crate) pixel: [Words; 2],
    /// Rows of sixteen source pixels that hold sixteen texels and their neighbours where a window is well inside: 4, 8, or 0
    /// if they do not.
    pub(crate) rows: Row,
    /// Column and row of such windows, in fixed point.
    pub(crate) quadratic: [Quadratic; 2],
}

/// A coordinate in fixed point where it is quadratic in the offset: `at + (ox·dx + oy·dy)·(1 − e)` with
/// `e = ox·z_dx + oy·z_dy`.
pub(crate) struct Quadratic {
    pub(crate) at: Row,
    pub(crate) dx: Row,
    pub(crate) dy: Row,
    /// Change over two rows at the centre, and how it changes by column and by row.
    pub(crate) step: Row,
    pub(crate) step_dx: Row,
    pub(crate) step_dy: Row,
    /// Its change over two rows, a whole number.
    pub(crate) bend: Words,
    /// The low end of where the texels of a vector are whose first one is at the centre.
    pub(crate) corner: Row,
}

/// The working set of one tile.
pub(crate) struct Tile {
    /// Column of the first pixel; may be negative.
    pub(crate) x0: i32,
    /// Row of the first pixel; may be negative.
    pub(crate) y0: i32,
    /// Class of every pixel, if labels are heeded; else, and for void, 0.
    pub(crate) classes: [Words; TILE_H],
    pub(crate) patch: Patch,
    pub(crate) belief: Belief,
    pub(crate) halo: Halo,
    pub(crate) scratch: Scratch,
    /// The level's sources, the one that suits the tile best first.
    pub(crate) order: Vec<usize>,
    /// How many of them, from the first, candidates are compared with.
    pub(crate) views: usize,
    /// Mean cost in each source of the last plane that was compared with all of them.
    pub(crate) view_cost: Vec<f32>,
}

const ZERO_ROW: Row = [0.0; TILE_W];
const ZERO_TILE: TileMap = [ZERO_ROW; TILE_H];
const ZERO_HALO: HaloMap = [[0.0; 3 * TILE_W]; TILE_H + 2];
const ZERO_WIN: [WinRow; WIN_H] = [[0.0; WIN_W]; WIN_H];
const ZERO_WORDS: [WinWords; WIN_H] = [[0; WIN_W]; WIN_H];

impl Quadratic {
    const ZERO: Self = Quadratic {
        at: ZERO_ROW,
        dx: ZERO_ROW,
        dy: ZERO_ROW,
        step: ZERO_ROW,
        step_dx: ZERO_ROW,
        step_dy: ZERO_ROW,
        bend: [0; TILE_W],
        corner: ZERO_ROW,
    };
}

impl Homographies {
    const NONE: Self = Homographies {
        at: [ZERO_ROW; 2],
        dx: [ZERO_ROW; 2],
        dy: [ZERO_ROW; 2],
        z_dx: ZERO_ROW,
        z_dy: ZERO_ROW,
        in_front: ZERO_ROW,
        well_inside: ZERO_ROW,
        pixel: [[0; TILE_W]; 2],
        rows: ZERO_ROW,
        quadratic: [Quadratic::ZERO; 2],
    };
}

impl Tile {
    /// A tile of zeros on the heap.
    pub(crate) fn boxed(sources: usize) -> Box<Tile> {
        Box::new(Tile {
            x0: 0,
            y0: 0,
            classes: [[0; TILE_W]; TILE_H],
            patch: Patch {
                texel: ZERO_WIN,
                pairs: ZERO_WORDS,
                weight: [[[0; TILE_W]; TAPS]; TILE_H],
                inverse_weight: ZERO_TILE,
                mean: ZERO_TILE,
                norm: ZERO_TILE,
            },
            belief: Belief {
                w: ZERO_TILE,
                wx: ZERO_TILE,
                wy: ZERO_TILE,
                data: ZERO_TILE,
                total: ZERO_TILE,
                prior_z: ZERO_TILE,
                prior_k: ZERO_TILE,
                active: ZERO_TILE,
            },
            halo: Halo {
                nx: ZERO_HALO,
                ny: ZERO_HALO,
                nz: ZERO_HALO,
                w: ZERO_HALO,
                on: ZERO_HALO,
                inverse_length: ZERO_TILE,
                beside: ZERO_TILE,
                above: ZERO_TILE,
                below: ZERO_TILE,
                sides: Sides { nx: ZERO_ROW, ny: ZERO_ROW, nz: ZERO_ROW, w: ZERO_ROW, on: ZERO_ROW },
            },
            scratch: Scratch {
                homographies: Homographies::NONE,
                warped: ZERO_WORDS,
                valid: ZERO_WIN,
                cost: ZERO_TILE,
                best: ZERO_TILE,
                second: ZERO_TILE,
                smooth: ZERO_HALO,
                factor: ZERO_TILE,
            },
            order: (0..sources).collect(),
            views: sources,
            view_cost: vec![UNSEEN; sources],
        })
    }

    /// Orders the views by how well the last plane that was compared with all of them suited them.
    pub(crate) fn rank_views(&mut self) {
        let Tile { order, view_cost, .. } = self;
        order.sort_by(|&a, &b| view_cost[a].total_cmp(&view_cost[b]).then(a.cmp(&b)));
    }

    /// The plane of pixel `(x, y)` of the tile, anchored at the tile's centre.
    pub(crate) fn plane_at(&self, x: usize, y: usize) -> InversePlane {
        self.pixel_plane(x, y).moved(CENTRE.0 - x as f32, CENTRE.1 - y as f32)
    }

    /// The plane of pixel `(x, y)` of the tile, anchored there.
    pub(crate) fn pixel_plane(&self, x: usize, y: usize) -> InversePlane {
        let b = &self.belief;
        InversePlane { w: b.w[y][x], wx: b.wx[y][x], wy: b.wy[y][x] }
    }

    /// Copies texels and estimates of the tile at `(x0, y0)` from the level and its state.
    pub(crate) fn load(&mut self, level: &Level, state: &State, x0: i32, y0: i32) {
        (self.x0, self.y0) = (x0, y0);
        for (r, row) in self.patch.texel.iter_mut().enumerate() {
            let (x, y) = (x0 - REACH as i32, y0 - REACH as i32 + r as i32);
            row.copy_from_slice(level.reference.window(x, y, WIN_W));
        }
        if let Some(labels) = &level.labels {
            for (y, row) in self.classes.iter_mut().enumerate() {
                for (x, class) in row.iter_mut().enumerate() {
                    let (px, py) = (x0 + x as i32, y0 + y as i32);
                    let id = usize::try_from(px).ok().zip(usize::try_from(py).ok());
                    *class = id.and_then(|(x, y)| labels.get(x, y)).map_or(0, |&id| u32::from(id));
                }
            }
        }
        let b = &mut self.belief;
        for y in 0..TILE_H {
            let at = state.at(x0, y0 + y as i32);
            let cut = at..at + TILE_W;
            b.w[y].copy_from_slice(&state.w[cut.clone()]);
            b.wx[y].copy_from_slice(&state.wx[cut.clone()]);
            b.wy[y].copy_from_slice(&state.wy[cut.clone()]);
            b.data[y].copy_from_slice(&state.cost[cut.clone()]);
            b.prior_z[y].copy_from_slice(&state.prior[cut.clone()]);
            b.active[y].copy_from_slice(&state.active[cut]);
        }
        for y in 0..TILE_H + 2 {
            let at = state.at(x0 - 1, y0 - 1 + y as i32);
            let (from, to) = (at..at + TILE_W + 2, HALO_X - 1..HALO_X + TILE_W + 1);
            self.halo.w[y][to.clone()].copy_from_slice(&state.w[from.clone()]);
            self.halo.nx[y][to.clone()].copy_from_slice(&state.wx[from.clone()]);
            self.halo.ny[y][to.clone()].copy_from_slice(&state.wy[from.clone()]);
            self.halo.on[y][to].copy_from_slice(&state.active[from]);
        }
        let Halo { nx, ny, w, on, sides, .. } = &mut self.halo;
        for (from, to) in [(nx, &mut sides.nx), (ny, &mut sides.ny), (w, &mut sides.w), (on, &mut sides.on)] {
            for y in 0..TILE_H {
                to[y] = from[y + 1][HALO_X - 1];
                to[TILE_H + y] = from[y + 1][HALO_X + TILE_W];
            }
        }
    }

    /// Writes the estimates back.
    pub(crate) fn store(&self, state: &mut State) {
        let b = &self.belief;
        for y in 0..TILE_H {
            let at = state.at(self.x0, self.y0 + y as i32);
            let cut = at..at + TILE_W;
            state.w[cut.clone()].copy_from_slice(&b.w[y]);
            state.wx[cut.clone()].copy_from_slice(&b.wx[y]);
            state.wy[cut.clone()].copy_from_slice(&b.wy[y]);
            state.cost[cut].copy_from_slice(&b.data[y]);
        }
    }
}

const _: () = assert!(2 * TILE_H == TILE_W && WIN_W >= TILE_W + 2);
