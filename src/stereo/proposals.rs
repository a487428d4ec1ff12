//! Planes that the sources' depth maps propose: what other views have found may be what this one has missed.

use super::level::Level;
use super::plane::{InversePlane, Pinhole};
use super::source_planes::SourcePlanes;
use super::state::{State, UNKNOWN};
use super::tile::{CENTRE, TILE_H, TILE_W, Tile};
use crate::geometry::{Camera, Size};
use nalgebra::{Matrix3, Vector3};

/// Side of a cell in pixels.
const CELL: i32 = 4;
/// Every so many columns and rows of a source, a pixel makes a proposal.
const STEP: usize = 2;
/// Planes this close at a pixel, in pixels of shift, are the same.
const SAME: f32 = 1.0;
/// Proposals kept per cell.
const KEPT: usize = 2;

/// A plane anchored at a pixel of the reference.
#[derive(Clone, Copy, Debug, Default)]
struct Proposal {
    x: i32,
    y: i32,
    plane: InversePlane,
    /// Pixels of the sources that propose it; 0 = there is none.
    votes: u32,
}

/// Proposals for a reference view, by cell.
pub(crate) struct Proposals {
    columns: i32,
    rows: i32,
    cells: Vec<[Proposal; KEPT]>,
}

/// A proposal for a tile.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Proposed {
    votes: u32,
    /// Anchored at the tile's centre.
    pub(crate) plane: InversePlane,
    /// Class of the pixel that it is for.
    pub(crate) class: u32,
}

impl Proposals {
    /// What `maps`, in their order, show in the reference other than `state` does.
    pub(crate) fn new<'a>(
        level: &Level,
        state: &State,
        reference: &Camera,
        maps: impl Iterator<Item = &'a SourcePlanes>,
    ) -> Self {
        let mut proposals = Proposals::none(level.size);
        for map in maps {
            let view = SourceView::new(reference, map);
            for y in (0..map.size.height as usize).step_by(STEP) {
                for x in (0..map.size.width as usize).step_by(STEP) {
                    if let Some(plane) = map.trusted(x, y)
                        && let Some((x, y, plane)) = view.seen_in(level, x as f32, y as f32, plane)
                    {
                        let at = state.at(x, y);
                        let same = SAME / level.pixels_per_w;
                        let known = state.cost[at] < UNKNOWN && (state.w[at] - plane.w).abs() < same;
                        if state.active[at] > 0.5 && !known {
                            proposals.add(x, y, plane, same);
                        }
                    }
                }
            }
        }
        proposals
    }

    fn none(size: Size) -> Self {
        let (columns, rows) = (size.width.div_ceil(CELL as u32), size.height.div_ceil(CELL as u32));
        let cells = vec![Default::default(); columns as usize * rows as usize];
        Proposals { columns: columns as i32, rows: rows as i32, cells }
    }

    /// Adds a plane at pixel `(x, y)`, or a vote to the one there that is within `same` of it. Where there is place for
    /// neither, all planes of the cell lose a vote (Misra and Gries 1982): what most pixels propose stays.
    fn add(&mut self, x: i32, y: i32, plane: InversePlane, same: f32) {
        let cell = &mut self.cells[(y / CELL * self.columns + x / CELL) as usize];
        for slot in cell.iter_mut() {
            if slot.votes == 0 {
                *slot = Proposal { x, y, plane, votes: 1 };
                return;
            }
            if (slot.plane.moved((x - slot.x) as f32, (y - slot.y) as f32).w - plane.w).abs() < same {
                slot.votes += 1;
                return;
            }
        }
        cell.iter_mut().for_each(|slot| slot.votes -= 1);
    }

    /// Puts the proposals for pixels of the tile into `out`, those of most votes first.
    pub(crate) fn on(&self, tile: &Tile, out: &mut Vec<Proposed>) {
        out.clear();
        let (right, bottom) = (tile.x0 + TILE_W as i32 - 1, tile.y0 + TILE_H as i32 - 1);
        for cy in tile.y0.max(0) / CELL..=(bottom / CELL).min(self.rows - 1) {
            for cx in tile.x0.max(0) / CELL..=(right / CELL).min(self.columns - 1) {
                for p in &self.cells[(cy * self.columns + cx) as usize] {
                    let (x, y) = (p.x - tile.x0, p.y - tile.y0);
                    let inside = (0..TILE_W as i32).contains(&x) && (0..TILE_H as i32).contains(&y);
                    if p.votes > 0 && inside {
                        let plane = p.plane.moved(CENTRE.0 - x as f32, CENTRE.1 - y as f32);
                        out.push(Proposed {
                            votes: p.votes,
                            plane,
                            class: tile.classes[y as usize][x as usize],
                        });
                    }
                }
            }
        }
        out.sort_by_key(|proposed| std::cmp::Reverse(proposed.votes));
    }
}

/// The way from a source into the reference.
struct SourceView {
    pinhole: Pinhole,
    /// Direction in the reference's frame = `turn` · direction in the source's.
    turn: Matrix3<f32>,
    /// The source's centre in the reference's frame.
    centre: Vector3<f32>,
}

impl SourceView {
    fn new(reference: &Camera, map: &SourcePlanes) -> Self {
        let (fx, fy, cx, cy) = map.camera.intrinsics();
        SourceView {
            pinhole: Pinhole { fx: fx as f32, fy: fy as f32, cx: cx as f32, cy: cy as f32 },
            turn: (reference.rotation() * map.camera.rotation().transpose()).cast(),
            centre: (reference.rotation() * (map.camera.center() - reference.center())).cast(),
        }
    }

    /// The pixel of the reference where the surface at pixel `(x, y)` of the source falls, and its plane anchored there;
    /// `None` outside the image, the depth range or behind the camera, and where the reference sees its back.
    fn seen_in(
        &self,
        level: &Level,
        x: f32,
        y: f32,
        plane: InversePlane,
    ) -> Option<(i32, i32, InversePlane)> {
        let (from, to) = (&self.pinhole, &level.pinhole);
        let ray = Vector3::new((x - from.cx) / from.fx, (y - from.cy) / from.fy, 1.0);
        let point = self.turn * (ray / plane.w) + self.centre;
        if point.z <= 0.0 {
            return None;
        }
        let (u, v) = (point.x / point.z * to.fx + to.cx, point.y / point.z * to.fy + to.cy);
        let (width, height) = (level.size.width as f32, level.size.height as f32);
        if !(u > -0.5 && v > -0.5 && u < width - 0.5 && v < height - 0.5) {
            return None;
        }
        // m · X = 1 for the points X of the plane, so m' = T m / (1 + T m · C) for T X + C.
        let turned = self.turn * Vector3::from(from.plane_vector(plane, x, y));
        let facing = 1.0 + turned.dot(&self.centre);
        if facing <= 0.0 {
            return None;
        }
        let m = turned / facing;
        let (x, y) = (u.round(), v.round());
        let w = m.x * (x - to.cx) / to.fx + m.y * (y - to.cy) / to.fy + m.z;
        let (low, high) = level.w_range;
        (w > low && w < high)
            .then(|| (x as i32, y as i32, InversePlane { w, wx: m.x / to.fx, wy: m.y / to.fy }))
    }
}

#[cfg(test)]
#[path = "proposals_tests.rs"]
mod tests;
