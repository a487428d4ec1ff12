//! A labelled cloud as label maps: which class does a camera see where.

use super::ClassId;
use crate::geometry::{Camera, Lens, NearestIndex};
use crate::scene::{Grid, LabelMap};
use rayon::prelude::*;

/// Points with labels, all slices parallel.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LabelledSurface {
    /// World positions.
    pub positions: Vec<[f64; 3]>,
    /// World normals, facing outwards; empty = unknown.
    pub normals: Vec<[f32; 3]>,
    /// Class ids.
    pub labels: Vec<u16>,
    /// Radius of the disc that stands for each point, scene units; see [`point_radii`].
    pub radii: Vec<f32>,
}

/// Surfaces whose depths differ by less, relatively, are one.
const SAME_SURFACE: f32 = 0.02;
/// Largest disc in pixels: a point that comes close to the camera must not paint the picture.
const MAX_PIXELS: f32 = 24.0;
/// Points around a point that tell how far points are apart.
const SPACING_NEIGHBORS: usize = 6;
/// Radius of a disc in units of the distance to the last of those: discs close the gaps of an even surface.
const RADIUS_FACTOR: f32 = 1.0;
/// A point that stands alone stands for a disc of at most so many times the median radius.
const MAX_RADIUS: f32 = 3.0;

/// Radii at which the discs of a cloud close its surfaces.
pub fn point_radii(positions: &[[f64; 3]]) -> Vec<f32> {
    let index = NearestIndex::new(positions);
    let last = |p: &[f64; 3]| {
        let around = index.nearest_n(p, SPACING_NEIGHBORS + 1);
        around.last().map_or(0.0, |n| n.squared.sqrt() as f32 * RADIUS_FACTOR)
    };
    let mut radii: Vec<f32> = positions.par_iter().map(last).collect();
    let mut sorted = radii.clone();
    sorted.sort_by(f32::total_cmp);
    let most = sorted.get(sorted.len() / 2).map_or(0.0, |median| median * MAX_RADIUS);
    radii.iter_mut().for_each(|r| *r = r.min(most));
    radii
}

/// The class of the nearest surface at every pixel of `camera`; void where there is none. Where discs of one surface
/// overlap, the pixel takes the class of the point whose centre is nearest. Points whose normal looks away from the
/// camera are not seen, but for edges.
pub fn render_labels(surface: &LabelledSurface, camera: &Camera) -> LabelMap {
    let size = camera.size();
    let mut nearest = Grid::filled(size, f32::INFINITY);
    let discs = discs(surface, camera);
    for disc in &discs {
        disc.for_each_pixel(size.width, size.height, |i, _| {
            let depth = &mut nearest.data_mut()[i];
            *depth = depth.min(disc.depth);
        });
    }
    let mut best = vec![f32::INFINITY; size.area()];
    let mut labels = LabelMap::filled(size, ClassId::VOID.0);
    for disc in &discs {
        disc.for_each_pixel(size.width, size.height, |i, squared| {
            if disc.depth <= nearest.data()[i] * (1.0 + SAME_SURFACE) && squared < best[i] {
                best[i] = squared;
                labels.data_mut()[i] = disc.label;
            }
        });
    }
    labels
}

/// A point as the camera sees it.
struct Disc {
    center: [f32; 2],
    radius: f32,
    depth: f32,
    label: u16,
}

/// Cosine between ray and normal from which a point counts as seen from behind.
const FROM_BEHIND: f64 = 0.1;

fn discs(surface: &LabelledSurface, camera: &Camera) -> Vec<Disc> {
    let lens = Lens::new(camera);
    let focal = camera.intrinsics().0;
    let (width, height) = (camera.size().width as f64, camera.size().height as f64);
    let center: [f64; 3] = (*camera.center()).into();
    let mut discs = Vec::new();
    for (i, position) in surface.positions.iter().enumerate() {
        let cam = lens.cam_point(*position);
        if cam[2] <= 0.0 {
            continue;
        }
        let [u, v] = lens.pixel(cam);
        let radius = (focal * f64::from(surface.radii[i]) / cam[2]).min(f64::from(MAX_PIXELS)).max(0.5);
        let inside = u > -radius && v > -radius && u < width + radius && v < height + radius;
        let ray: [f64; 3] = std::array::from_fn(|k| position[k] - center[k]);
        let away = surface.normals.get(i).is_some_and(|n| {
            let length = ray.iter().map(|v| v * v).sum::<f64>().sqrt();
            (0..3).map(|k| ray[k] * f64::from(n[k])).sum::<f64>() > FROM_BEHIND * length
        });
        if inside && !away {
            let (depth, label) = (cam[2] as f32, surface.labels[i]);
            discs.push(Disc { center: [u as f32, v as f32], radius: radius as f32, depth, label });
        }
    }
    discs
}

impl Disc {
    /// Calls `visit` with the index of every pixel that the disc covers and the squared distance from its centre.
    fn for_each_pixel(&self, width: u32, height: u32, mut visit: impl FnMut(usize, f32)) {
        let [u, v] = self.center;
        let r = self.radius;
        let range = |c: f32, end: u32| {
            let first = (c - r).ceil().max(0.0) as u32;
            first..((c + r).floor().max(-1.0) + 1.0).min(end as f32) as u32
        };
        for y in range(v, height) {
            for x in range(u, width) {
                let squared = (x as f32 - u).powi(2) + (y as f32 - v).powi(2);
                if squared <= r * r {
                    visit((y * width + x) as usize, squared);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::synthetic::camera;

    /// A square of points at depth `z`, `half` wide each way from the axis.
    fn square(z: f64, half: f64, step: f64, label: impl Fn(f64, f64) -> u16) -> LabelledSurface {
        let mut surface = LabelledSurface::default();
        let n = (half / step) as i32;
        for j in -n..=n {
            for i in -n..=n {
                let (x, y) = (f64::from(i) * step, f64::from(j) * step);
                surface.positions.push([x, y, z]);
                surface.normals.push([0.0, 0.0, -1.0]);
                surface.labels.push(label(x, y));
            }
        }
        surface.radii = point_radii(&surface.positions);
        surface
    }

    fn joined(mut a: LabelledSurface, b: LabelledSurface) -> LabelledSurface {
        a.positions.extend(b.positions);
        a.normals.extend(b.normals);
        a.labels.extend(b.labels);
        a.radii.extend(b.radii);
        a
    }

    #[test]
    fn a_wall_fills_the_picture_and_classes_meet_where_they_do() {
        let camera = camera(64, 48, [0.0; 3], 0.0);
        let wall = square(8.0, 8.0, 0.2, |x, _| if x < 0.0 { 1 } else { 4 });
        let labels = render_labels(&wall, &camera);
        let principal = camera.intrinsics().2;
        for (i, &label) in labels.data().iter().enumerate() {
            let x = (i % 64) as f64 - principal;
            assert!(label != 0, "a hole at {i}");
            if x.abs() > 2.0 {
                assert_eq!(label, if x < 0.0 { 1 } else { 4 }, "pixel {i}");
            }
        }
    }

    #[test]
    fn what_is_nearer_hides_what_is_behind() {
        let camera = camera(64, 48, [0.0; 3], 0.0);
        let sign = square(4.0, 0.5, 0.05, |_, _| 7);
        let both = joined(square(8.0, 8.0, 0.2, |_, _| 1), sign.clone());
        let labels = render_labels(&both, &camera);
        assert_eq!((labels[(32, 24)], labels[(2, 2)]), (7, 1));
        // The order of the points does not matter.
        let swapped = joined(sign, square(8.0, 8.0, 0.2, |_, _| 1));
        assert_eq!(render_labels(&swapped, &camera), labels);
    }

    #[test]
    fn nothing_is_void_and_so_is_the_back_of_a_surface() {
        let camera = camera(64, 48, [0.0; 3], 0.0);
        let patch = square(8.0, 1.0, 0.1, |_, _| 1);
        let labels = render_labels(&patch, &camera);
        assert_eq!((labels[(32, 24)], labels[(0, 0)]), (1, 0));
        let mut turned = patch.clone();
        turned.normals.iter_mut().for_each(|n| n[2] = 1.0);
        assert!(render_labels(&turned, &camera).data().iter().all(|l| *l == 0));
        let mut behind = patch;
        behind.positions.iter_mut().for_each(|p| p[2] = -8.0);
        assert!(render_labels(&behind, &camera).data().iter().all(|l| *l == 0));
        assert!(render_labels(&LabelledSurface::default(), &camera).data().iter().all(|l| *l == 0));
    }
}
