//! Points by the direction in which a camera sees them.

use nalgebra::Vector3;
use rayon::prelude::*;

/// Bits per coordinate of a cell.
const BITS: u32 = 21;
/// Smallest edge of a cell: one for every value of a coordinate.
const MIN_CELL: f64 = 2.5 / (1u64 << BITS) as f64;

/// Directions in cells of the unit sphere's bounding cube.
#[derive(Debug)]
pub(super) struct Directions {
    cell: f64,
    /// Cell and point, ascending.
    entries: Vec<(u64, u32)>,
}

impl Directions {
    /// Sorts `points`, seen in unit directions, so that those within `angle` (radians) of a direction are found.
    pub(super) fn new(points: impl ParallelIterator<Item = (u32, Vector3<f64>)>, angle: f64) -> Self {
        let cell = (2.0 * (angle / 2.0).sin() * (1.0 + 1e-9)).max(MIN_CELL);
        let mut entries: Vec<(u64, u32)> =
            points.map(|(point, direction)| (key(cells(&direction, cell)), point)).collect();
        entries.par_sort_unstable();
        Directions { cell, entries }
    }

    /// Calls `visit` with all points within the angle of `direction`, and others near it.
    pub(super) fn around(&self, direction: &Vector3<f64>, mut visit: impl FnMut(u32)) {
        let [x, y, z] = cells(direction, self.cell);
        for near_x in x - 1..=x + 1 {
            for near_y in y - 1..=y + 1 {
                let (first, last) = (key([near_x, near_y, z - 1]), key([near_x, near_y, z + 1]));
                let start = self.entries.partition_point(|(key, _)| *key < first);
                let found = self.entries[start..].iter().take_while(|(key, _)| *key <= last);
                found.for_each(|(_, point)| visit(*point));
            }
        }
    }
}

/// The cell of a unit vector, counted from 1 so that every cell has one before it.
fn cells(direction: &Vector3<f64>, cell: f64) -> [u64; 3] {
    std::array::from_fn(|i| ((direction[i] + 1.0).max(0.0) / cell) as u64 + 1)
}

fn key([x, y, z]: [u64; 3]) -> u64 {
    x << (2 * BITS) | y << BITS | z
}
