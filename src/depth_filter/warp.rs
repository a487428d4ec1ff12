//! Forward warp of one view's depths into another view.

use super::FilterView;
use crate::geometry::{Lens, Size};

/// What a neighbour sees along the rays of the reference's pixels.
///
/// Every cell holds the nearest depth that fell on it, as bits, above the neighbour's pixel that it is from, counted
/// backwards: of positive numbers the least has the least bits, so the least cell is the nearest, and of equal depths the
/// last in raster order.
pub(super) struct Warped {
    size: Size,
    /// With a border of one pixel, so that pixels beside the image need no special care.
    cells: Vec<u64>,
    row: Projected,
}

/// The neighbour sees nothing here.
const NOTHING: u64 = u64::MAX;

/// What a neighbour sees along the ray of a reference pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Seen {
    /// Depth in the reference camera.
    pub(super) depth: f32,
    /// The neighbour's pixel.
    pub(super) pixel: usize,
}

impl Warped {
    /// For a reference of `size` pixels.
    pub(super) fn new(size: Size) -> Self {
        let cells = (size.width as usize + 2) * (size.height as usize + 2);
        Warped { size, cells: vec![NOTHING; cells], row: Projected::default() }
    }

    /// What is seen along the rays of row `y`.
    pub(super) fn row(&self, y: usize) -> impl Iterator<Item = Option<Seen>> + '_ {
        let width = self.size.width as usize;
        self.cells[(y + 1) * (width + 2) + 1..][..width].iter().map(|&cell| seen(cell))
    }

    /// What is seen at column `x`, row `y`; nothing outside.
    pub(super) fn get(&self, x: usize, y: usize) -> Option<Seen> {
        let inside = x < self.size.width as usize && y < self.size.height as usize;
        if inside { seen(self.cells[(y + 1) * (self.size.width as usize + 2) + x + 1]) } else { None }
    }

    /// Writes every depth of `neighbor` to the up to four pixels of the reference around its projection, in place of what
    /// was here. With label maps on both sides, a pixel is not written where the two labels are different classes.
    pub(super) fn fill(&mut self, reference: &FilterView<'_>, neighbor: &FilterView<'_>) {
        self.cells.fill(NOTHING);
        let (from, to) = (Lens::new(&neighbor.estimate.camera), Lens::new(&reference.estimate.camera));
        let depths = &neighbor.estimate.depth;
        let stride = self.size.width as usize + 2;
        let labels = reference.labels.zip(neighbor.labels);
        for y in 0..depths.height() {
            self.row.project(&from, &to, y as u32, depths.row(y), self.size);
            let first = y * depths.width();
            let Projected { targets, steps, keys, .. } = &self.row;
            for (x, ((&target, step), &key)) in targets.iter().zip(steps).zip(keys).enumerate() {
                let (corner, right, below) = (target as usize, step[0] as usize, step[1] as usize * stride);
                let key = key - (first + x) as u64;
                for cell in [corner, corner + below, corner + right, corner + right + below] {
                    let differs = || {
                        labels.is_some_and(|(own, other)| {
                            let target =
                                own.get((cell % stride).wrapping_sub(1), (cell / stride).wrapping_sub(1));
                            target.is_some_and(|&label| differ(label, other.data()[first + x]))
                        })
                    };
                    if labels.is_none() || !differs() {
                        self.cells[cell] = self.cells[cell].min(key);
                    }
                }
            }
        }
    }
}

#[inline]
fn seen(cell: u64) -> Option<Seen> {
    let seen = Seen { depth: f32::from_bits((cell >> 32) as u32), pixel: (u32::MAX - cell as u32) as usize };
    (cell < NO_DEPTH).then_some(seen)
}

/// Cells from here on are of pixels without a depth: no number has such bits.
const NO_DEPTH: u64 = 0xffff_ffff << 32;

/// A row of the neighbour in the reference view, one entry per pixel.
#[derive(Default)]
struct Projected {
    /// Position and depth in the reference camera.
    coordinates: [Vec<f64>; 3],
    /// The cell to the upper left.
    targets: Vec<u32>,
    /// Whether the projection is to the right of that cell, and below it.
    steps: Vec<[u8; 2]>,
    /// Depth as the upper bits of a cell, the lower ones all set.
    keys: Vec<u64>,
}

impl Projected {
    fn project(&mut self, from: &Lens, to: &Lens, y: u32, depths: &[f32], size: Size) {
        let [us, vs, zs] = &mut self.coordinates;
        [&mut *us, &mut *vs, &mut *zs].into_iter().for_each(|list| list.resize(depths.len(), 0.0));
        self.targets.resize(depths.len(), 0);
        self.steps.resize(depths.len(), [0; 2]);
        self.keys.resize(depths.len(), NOTHING);
        for (x, (((u, v), z), &depth)) in
            us.iter_mut().zip(vs.iter_mut()).zip(zs.iter_mut()).zip(depths).enumerate()
        {
            let point = to.cam_point(from.world_point(x as u32, y, depth));
            [*u, *v] = to.pixel(point);
            *z = point[2];
        }
        let (width, height) = (f64::from(size.width), f64::from(size.height));
        let out = self.targets.iter_mut().zip(&mut self.steps).zip(&mut self.keys);
        let points = us.iter().zip(&*vs).zip(&*zs).zip(depths);
        for (((target, step), key), (((&u, &v), &z), &depth)) in out.zip(points) {
            let in_reference = z as f32;
            let falls =
                (depth != 0.0) & (in_reference > 0.0) & (u > -1.0) & (v > -1.0) & (u < width) & (v < height);
            let (left, top) = (floor(u), floor(v));
            let [row, column] = [top, left].map(|v| v.wrapping_add(1) as u32);
            let cell = row.wrapping_mul(size.width + 2).wrapping_add(column);
            *target = if falls { cell } else { 0 };
            *step =
                if falls { [u8::from(f64::from(left) < u), u8::from(f64::from(top) < v)] } else { [0; 2] };
            let bits = if falls { in_reference.to_bits() } else { u32::MAX };
            *key = u64::from(bits) << 32 | u64::from(u32::MAX);
        }
    }
}

/// The whole number below `value`, which is above −1 and small.
#[inline]
fn floor(value: f64) -> i32 {
    let truncated = value as i32;
    truncated.wrapping_sub(i32::from(f64::from(truncated) > value))
}

/// Whether two labels are different classes; void (0) is no class.
fn differ(a: u16, b: u16) -> bool {
    a != b && a != 0 && b != 0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::synthetic::{Plane, camera, estimate_of_depths, view_of_plane};
    use crate::scene::{DepthEstimate, Grid, LabelMap};

    #[test]
    fn whole_numbers_below_a_value() {
        for value in [-0.999, -0.5, -0.0, 0.0, 0.25, 1.0, 7.999, 4096.5] {
            assert_eq!(floor(value), f64::floor(value) as i32, "{value}");
        }
    }

    /// The rule word by word: depth and pixel at every reference pixel.
    fn by_the_rule(reference: &FilterView<'_>, neighbor: &FilterView<'_>) -> Vec<Option<Seen>> {
        let (own, other) = (reference.estimate, neighbor.estimate);
        let mut seen: Grid<Option<Seen>> = Grid::filled(own.depth.size(), None);
        for y in 0..other.depth.height() {
            for x in 0..other.depth.width() {
                let depth = other.depth[(x, y)];
                let point = other.camera.world_from_image(x as f64, y as f64, f64::from(depth));
                let point = own.camera.cam_from_world(&point);
                if depth == 0.0 || point.z <= 0.0 {
                    continue;
                }
                let (u, v) = own.camera.image_from_cam(&point);
                for (u, v) in [
                    (u.floor(), v.floor()),
                    (u.floor(), v.ceil()),
                    (u.ceil(), v.floor()),
                    (u.ceil(), v.ceil()),
                ] {
                    let inside = u >= 0.0 && v >= 0.0 && own.depth.get(u as usize, v as usize).is_some();
                    let target = (u as usize, v as usize);
                    let kept = inside
                        && reference
                            .labels
                            .zip(neighbor.labels)
                            .is_none_or(|(a, b)| !differ(a[target], b[(x, y)]));
                    if kept && seen[target].is_none_or(|now| now.depth >= point.z as f32) {
                        seen[target] = Some(Seen { depth: point.z as f32, pixel: other.depth.index(x, y) });
                    }
                }
            }
        }
        seen.into_vec()
    }

    fn warped(reference: &FilterView<'_>, neighbor: &FilterView<'_>) -> Vec<Option<Seen>> {
        let size = reference.estimate.depth.size();
        let mut warped = Warped::new(size);
        warped.fill(neighbor, reference);
        warped.fill(reference, neighbor);
        (0..size.height as usize).flat_map(|y| warped.row(y).collect::<Vec<_>>()).collect()
    }

    #[test]
    fn the_nearest_depth_wins_and_of_equal_ones_the_last() {
        let plane = Plane::slanted(6.0, 0.4, -0.3);
        let own = view_of_plane(0, camera(40, 30, [0.0, 0.0, 0.0], 0.0), plane);
        let mut other = view_of_plane(1, camera(40, 30, [0.7, 0.2, -0.4], 0.2), plane);
        for (i, depth) in other.depth.data_mut().iter_mut().enumerate() {
            match i % 11 {
                0 => *depth = 0.0,
                5 => *depth *= 0.6,
                7 => *depth *= 1.5,
                _ => {}
            }
        }
        let (a, b) = (FilterView::new(&own), FilterView::new(&other));
        assert_eq!(warped(&a, &b), by_the_rule(&a, &b));
        assert!(warped(&a, &b).iter().flatten().count() > 600);
        // Cameras that are one: every pixel falls on itself, or on all four between which rounding puts it.
        let flat = estimate_of_depths(16, 16, |_, _| 10.0);
        let flat = FilterView::new(&flat);
        assert_eq!(warped(&flat, &flat), by_the_rule(&flat, &flat));
        let size = own.depth.size();
        let stripes = |of: &DepthEstimate, n: usize| -> LabelMap {
            let width = of.depth.width();
            Grid::from_vec(size, (0..size.area()).map(|i| ((i % width) / n % 3) as u16).collect()).unwrap()
        };
        let (x, y) = (stripes(&own, 5), stripes(&other, 7));
        let (a, b) = (FilterView { labels: Some(&x), ..a }, FilterView { labels: Some(&y), ..b });
        assert_eq!(warped(&a, &b), by_the_rule(&a, &b));
    }
}
