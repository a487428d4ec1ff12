//! What a neighbour measures where the points of a reference row fall in it, in single precision.
//!
//! A row goes through three passes, of which the first and the last are plain arithmetic on lists: where the points fall,
//! what is there, how that compares.

use super::FilterView;
use crate::geometry::Camera;
use nalgebra::{Matrix3, Vector3};

/// Most that the plane through a pixel may change the depth within that pixel, as a ratio; beyond, the normal is not
/// believed.
const MAX_PLANE_CORRECTION: f32 = 1.05;

/// A neighbour with what is needed to look up points of the reference in it.
pub(super) struct Witness<'a> {
    view: FilterView<'a>,
    /// Homogeneous neighbour pixel per reference pixel, at depth 1: `K' R' Rᵀ K⁻¹`, by columns.
    columns: [[f32; 3]; 3],
    /// Homogeneous neighbour pixel of the reference's centre.
    offset: [f32; 3],
    /// From pixels to rays: factor and summand along x, then along y.
    ray: [[f32; 2]; 2],
}

impl<'a> Witness<'a> {
    pub(super) fn new(reference: &Camera, view: FilterView<'a>) -> Self {
        let camera = &view.estimate.camera;
        let (fx, fy, cx, cy) = reference.intrinsics();
        let ray_from_pixel = Matrix3::new(1.0 / fx, 0.0, -cx / fx, 0.0, 1.0 / fy, -cy / fy, 0.0, 0.0, 1.0);
        let (nfx, nfy, ncx, ncy) = camera.intrinsics();
        let k = Matrix3::new(nfx, 0.0, ncx, 0.0, nfy, ncy, 0.0, 0.0, 1.0);
        let map = k * camera.rotation() * reference.rotation().transpose() * ray_from_pixel;
        let offset: Vector3<f64> = k * camera.cam_from_world(reference.center());
        Witness {
            view,
            columns: std::array::from_fn(|c| std::array::from_fn(|r| map[(r, c)] as f32)),
            offset: std::array::from_fn(|r| offset[r] as f32),
            ray: [[1.0 / nfx, -ncx / nfx], [1.0 / nfy, -ncy / nfy]].map(|axis| axis.map(|v| v as f32)),
        }
    }
}

/// Nothing there.
const OUTSIDE: u32 = u32::MAX;

/// The passes over one row, one entry per pixel; reused from row to row.
#[derive(Default)]
pub(super) struct RowScratch {
    /// Where the point falls, [`OUTSIDE`] if it is not seen there.
    pixels: Vec<u32>,
    /// Its depth in the neighbour.
    depths: Vec<f32>,
    /// Its ray in the neighbour, at depth 1: x, y.
    rays: [Vec<f32>; 2],
    /// The ray of the neighbour's pixel.
    centers: [Vec<f32>; 2],
    /// Depth of the neighbour's pixel; NaN if it has nothing to say.
    seen: Vec<f32>,
    /// Normal of the neighbour's pixel.
    normals: [Vec<f32>; 3],
    /// Confidence of the neighbour's pixel; 0 if it has none.
    confidences: Vec<f32>,
    /// The result.
    differences: Vec<f32>,
}

/// What a neighbour says about a row of points.
pub(super) struct Testimony<'a> {
    /// How much farther its surface is than the points, relative to their depths in it; NaN where it has nothing to say.
    pub(super) differences: &'a [f32],
    /// How sure it is of that, 0..1.
    pub(super) confidences: &'a [f32],
}

impl RowScratch {
    /// What the neighbour says about the points of row `y` of the reference with these `depths`.
    pub(super) fn compare(
        &mut self,
        witness: &Witness<'_>,
        y: usize,
        depths: &[f32],
        labels: Option<&[u16]>,
    ) -> Testimony<'_> {
        self.project(witness, y as f32, depths);
        match labels.zip(witness.view.labels) {
            Some((own, other)) => {
                let other = other.data();
                self.look(witness, |x, pixel| {
                    let (a, b) = (own[x], other[pixel]);
                    a != b && a != 0 && b != 0
                });
            }
            None => self.look(witness, |_, _| false),
        }
        self.judge(witness.view.estimate.normal.is_some());
        Testimony { differences: &self.differences, confidences: &self.confidences }
    }

    /// Where the points fall.
    fn project(&mut self, witness: &Witness<'_>, y: f32, depths: &[f32]) {
        let size = witness.view.estimate.depth.size();
        let (width, height) = (size.width as f32, size.height as f32);
        let [c0, c1, c2] = &witness.columns;
        let start: [f32; 3] = std::array::from_fn(|r| c1[r] * y + c2[r]);
        let [[ray_x, ray_x0], [ray_y, ray_y0]] = witness.ray;
        let count = depths.len();
        self.pixels.resize(count, OUTSIDE);
        self.depths.resize(count, 0.0);
        self.rays.iter_mut().chain(&mut self.centers).for_each(|list| list.resize(count, 0.0));
        let ([rays_x, rays_y], [centers_x, centers_y]) = (&mut self.rays, &mut self.centers);
        let rays = rays_x.iter_mut().zip(rays_y).zip(centers_x.iter_mut().zip(centers_y));
        let out = self.pixels.iter_mut().zip(&mut self.depths).zip(rays);
        for (x, (((out_pixel, out_depth), ((out_x, out_y), (center_x, center_y))), &depth)) in
            out.zip(depths).enumerate()
        {
            let x = x as i32 as f32;
            let [qx, qy, z] = [0, 1, 2].map(|r| (start[r] + c0[r] * x) * depth + witness.offset[r]);
            let inverse = 1.0 / z;
            let (u, v) = (qx * inverse, qy * inverse);
            let (left, top) = (u + 0.5, v + 0.5);
            let inside =
                (depth > 0.0) & (z > 0.0) & (left >= 0.0) & (top >= 0.0) & (left < width) & (top < height);
            let (column, row) = (left as i32, top as i32);
            let pixel = (row as u32).wrapping_mul(size.width).wrapping_add(column as u32);
            *out_pixel = if inside { pixel } else { OUTSIDE };
            *out_depth = z;
            *out_x = u * ray_x + ray_x0;
            *out_y = v * ray_y + ray_y0;
            *center_x = column as f32 * ray_x + ray_x0;
            *center_y = row as f32 * ray_y + ray_y0;
        }
    }

    /// What the neighbour has there; `differs` tells pixels of other classes, which have nothing to say.
    fn look(&mut self, witness: &Witness<'_>, differs: impl Fn(usize, usize) -> bool) {
        let estimate = witness.view.estimate;
        let depths = estimate.depth.data();
        let normals = estimate.normal.as_ref().map(|map| map.data());
        let Some(last) = depths.len().checked_sub(1) else { return self.seen.clear() };
        let count = self.pixels.len();
        self.seen.resize(count, 0.0);
        self.normals.iter_mut().for_each(|list| list.resize(count, 0.0));
        self.confidences.resize(count, 0.0);
        let confidences = estimate.confidence.as_ref().map(|map| map.data());
        let [nx, ny, nz] = &mut self.normals;
        let seen = self.seen.iter_mut().zip(&mut self.confidences);
        let all = self.pixels.iter().zip(seen).zip(nx.iter_mut().zip(ny).zip(nz));
        for (x, ((&pixel, (seen, confidence)), ((nx, ny), nz))) in all.enumerate() {
            // A pixel is looked at even if there is none, so that nothing has to be guessed ahead.
            let there = (pixel as usize).min(last);
            let depth = depths[there];
            let speaks = (pixel != OUTSIDE) & (depth > 0.0) & !differs(x, there);
            *seen = if speaks { depth } else { f32::NAN };
            *confidence = confidences.map_or(0.0, |map| map[there]);
            if let Some(normals) = normals {
                [*nx, *ny, *nz] = normals[there];
            }
        }
    }

    /// How that compares: with the plane through the neighbour's pixel if there are normals, else with its depth.
    fn judge(&mut self, has_normals: bool) {
        self.differences.resize(self.seen.len(), 0.0);
        let points = self.seen.iter().zip(&self.depths);
        if !has_normals {
            for (difference, (&seen, &z)) in self.differences.iter_mut().zip(points) {
                *difference = (seen - z) / z;
            }
            return;
        }
        let [nx, ny, nz] = &self.normals;
        let normals = nx.iter().zip(ny).zip(nz);
        let rays = self.rays[0].iter().zip(&self.rays[1]);
        let centers = self.centers[0].iter().zip(&self.centers[1]);
        let all = points.zip(normals).zip(rays.zip(centers));
        for (difference, (((&seen, &z), ((nx, ny), nz)), ((x, y), (center_x, center_y)))) in
            self.differences.iter_mut().zip(all)
        {
            let along = |x: f32, y: f32| nx * x + ny * y + nz;
            let ratio = along(*center_x, *center_y) / along(*x, *y);
            let believed = (1.0 / MAX_PLANE_CORRECTION..MAX_PLANE_CORRECTION).contains(&ratio);
            let ratio = if believed { ratio } else { 1.0 };
            *difference = (seen * ratio - z) / z;
        }
    }
}
