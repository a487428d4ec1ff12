//! Pixels drawn towards the planes of their region: where the photographs show nothing that contradicts it.
//!
//! Windows mirror the surroundings or show nothing at all, so that matching finds depths behind them or none. Frames and
//! curtains are matched well and lie in few planes; fitted to these, the planes are offered to all pixels of the region
//! (after Stathopoulou et al. 2021, and the planar priors of Xu and Tao 2020), and matched there like any hypothesis.

use super::confidence::sharpened;
use super::cost::Kernels;
use super::level::Level;
use super::plane::InversePlane;
use super::plane_fit::{RegionPlane, fit};
use super::problem::StereoProblem;
use super::rng::Rng;
use super::state::State;
use super::tile::{TILE_H, TILE_W, Tile};
use crate::scene::DepthEstimate;
use crate::semantics::PlanarRegion;

/// Pass number that keys the random numbers.
const PASS: u32 = u32::MAX - 1;
/// How much costlier than a pixel's own hypothesis a plane may be where there is no texture; nothing where there is.
const MARGIN: f32 = 0.5;
/// Cost of a pixel's own hypothesis from which the lack of texture counts in full; below, it matches too well for that.
const POOR: f32 = 0.5;
/// What a plane that all of the region lies in is cheaper by where there is no texture, against the other planes.
const SHARE_BONUS: f32 = 0.2;
/// Confidence of a pixel without texture in a plane that all of the region lies in.
const CONFIDENCE: f32 = 0.1;
/// A pixel nearer to its plane than this, in pixels of shift in the most distant source, keeps its own depth.
const NEAR: f32 = 0.5;
/// Cost of a pixel without depth, at least.
const NOTHING: f32 = 1.0;

/// Draws the pixels of the problem's regions towards planes fitted to `estimate`, which `state` led to.
pub(crate) fn draw_to_planes(
    problem: &StereoProblem,
    kernels: Kernels,
    level: &Level,
    state: &State,
    seed: u64,
    estimate: &mut DepthEstimate,
) {
    if problem.regions.is_empty() {
        return;
    }
    let mut drawer = Drawer {
        kernels,
        level,
        state,
        depth_range: problem.depth_range,
        tile: Tile::boxed(level.sources.len()),
    };
    for (i, region) in problem.regions.iter().enumerate() {
        let mut rng = Rng::keyed(seed, problem.reference.id.0, PASS, i as u32);
        let planes = fit(region, level, estimate, &mut rng);
        if !planes.is_empty() {
            drawer.draw(region, &planes, estimate);
        }
    }
}

/// What a pixel is offered.
#[derive(Clone, Copy)]
struct Offer {
    plane: InversePlane,
    cost: f32,
    /// Cost with the bonus, by which planes compete.
    rank: f32,
    /// 1 without texture, 0 with much of it.
    blank: f32,
    share: f32,
}

type Offers = [[Option<Offer>; TILE_W]; TILE_H];

struct Drawer<'a> {
    kernels: Kernels,
    level: &'a Level,
    state: &'a State,
    depth_range: (f32, f32),
    tile: Box<Tile>,
}

impl Drawer<'_> {
    fn draw(&mut self, region: &PlanarRegion, planes: &[RegionPlane], estimate: &mut DepthEstimate) {
        let width = self.level.size.width as usize;
        let place = |at: u32| (at as usize % width, at as usize / width);
        let tile_of = |(x, y): (usize, usize)| (y / TILE_H, x / TILE_W);
        let mut pixels: Vec<(usize, usize)> = region.pixels.iter().map(|&at| place(at)).collect();
        pixels.sort_unstable_by_key(|&(x, y)| (tile_of((x, y)), y, x));
        for pixels in pixels.chunk_by(|&a, &b| tile_of(a) == tile_of(b)) {
            let (row, column) = tile_of(pixels[0]);
            let offers = self.offers(planes, column * TILE_W, row * TILE_H);
            for &(x, y) in pixels {
                if let Some(offer) = offers[y % TILE_H][x % TILE_W] {
                    self.decide(x, y, offer, estimate);
                }
            }
        }
    }

    /// The best plane for every pixel of the tile at `(x0, y0)`.
    fn offers(&mut self, planes: &[RegionPlane], x0: usize, y0: usize) -> Offers {
        let mut best: Offers = [[None; TILE_W]; TILE_H];
        for region_plane in planes {
            let tile = &mut *self.tile;
            tile.load(self.level, self.state, x0 as i32, y0 as i32);
            for y in 0..TILE_H {
                for x in 0..TILE_W {
                    let plane = region_plane.plane.moved((x0 + x) as f32, (y0 + y) as f32);
                    let w = plane.w.max(f32::MIN_POSITIVE);
                    let b = &mut tile.belief;
                    (b.w[y][x], b.wx[y][x], b.wy[y][x], b.prior_z[y][x]) = (w, plane.wx, plane.wy, 1.0 / w);
                }
            }
            (self.kernels.prepare)(tile, self.level);
            (self.kernels.score_own)(tile, self.level);
            for (y, row) in best.iter_mut().enumerate() {
                for (x, best) in row.iter_mut().enumerate() {
                    let (cost, blank) = (tile.belief.data[y][x], tile.belief.prior_k[y][x]);
                    let rank = cost - blank * SHARE_BONUS * region_plane.share;
                    if best.is_none_or(|other: Offer| rank < other.rank) {
                        let plane = tile.pixel_plane(x, y);
                        *best = Some(Offer { plane, cost, rank, blank, share: region_plane.share });
                    }
                }
            }
        }
        best
    }

    /// Takes an offer unless the pixel's own hypothesis is near, or matches better than the lack of texture excuses.
    fn decide(&self, x: usize, y: usize, offer: Offer, estimate: &mut DepthEstimate) {
        let at = self.state.at(x as i32, y as i32);
        let depth = 1.0 / offer.plane.w;
        let (low, high) = self.depth_range;
        if self.state.active[at] < 0.5 || !(depth >= low && depth < high) {
            return;
        }
        let has_depth = estimate.depth[(x, y)] > 0.0;
        let apart = (self.state.w[at] - offer.plane.w).abs() * self.level.pixels_per_w;
        let own = self.state.cost[at].max(if has_depth { 0.0 } else { NOTHING });
        let excused = MARGIN * offer.blank * (own / POOR).min(1.0);
        if (has_depth && apart < NEAR) || offer.rank > own + excused {
            return;
        }
        estimate.depth[(x, y)] = depth;
        if let Some(normal) = &mut estimate.normal {
            normal[(x, y)] = self.level.pinhole.normal(offer.plane, x as f32, y as f32);
        }
        if let Some(confidence) = &mut estimate.confidence {
            confidence[(x, y)] = sharpened(offer.cost).max(CONFIDENCE * offer.blank * offer.share);
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::geometry::Camera;
    use crate::scene::{DepthEstimate, Grid};
    use crate::semantics::{PlanarRegion, PlanePrior};
    use crate::stereo::tests::{SEEDS, Surface, images, problem, problem_of, slanted, sphere_before_wall};
    use crate::stereo::{CpuLevel, ReferenceImage, StereoOptions, StereoProblem, estimate};
    use nalgebra::Vector3;

    /// Columns and rows of the reference that make up the region.
    const COLUMNS: std::ops::Range<usize> = 24..88;
    const ROWS: std::ops::Range<usize> = 16..64;
    /// Relative error of a depth that counts as right.
    const RIGHT: f32 = 0.014;

    fn inside() -> impl Iterator<Item = (usize, usize)> {
        ROWS.flat_map(|y| COLUMNS.map(move |x| (x, y)))
    }

    fn with_region(mut problem: StereoProblem) -> StereoProblem {
        let width = problem.reference.gray.width();
        let pixels = inside().map(|(x, y)| (y * width + x) as u32).collect();
        problem.regions = vec![PlanarRegion { pixels, prior: PlanePrior::default() }];
        problem
    }

    fn run(problem: &StereoProblem) -> DepthEstimate {
        run_seeded(problem, 0)
    }

    fn run_seeded(problem: &StereoProblem, seed: u64) -> DepthEstimate {
        let options = StereoOptions { geometric_iterations: 0, seed, ..StereoOptions::default() };
        estimate(problem, &options, CpuLevel::detect()).unwrap()
    }

    /// Paints over what lies in a box in space.
    fn blank(image: &mut ReferenceImage, surface: Surface, half: f64) {
        let camera: &Camera = &image.camera;
        let mut gray = (*image.gray).clone();
        for y in 0..gray.height() {
            for x in 0..gray.width() {
                let dir = camera.cam_from_image(x as f64, y as f64, 1.0);
                let point: Vector3<f64> = camera.center() + dir * surface(*camera.center(), dir);
                if point.x.abs() < half && point.y.abs() < half {
                    gray[(x, y)] = 0.5;
                }
            }
        }
        image.gray = std::sync::Arc::new(gray);
    }

    fn right(made: &DepthEstimate, truth: &Grid<f32>) -> f64 {
        let near = |&(x, y): &(usize, usize)| {
            let (d, t) = (made.depth[(x, y)], truth[(x, y)]);
            d > 0.0 && (d - t).abs() < RIGHT * t
        };
        inside().filter(near).count() as f64 / inside().count() as f64
    }

    #[test]
    fn a_pane_without_texture_takes_the_plane_of_its_frame() {
        let mut images = images(slanted);
        images.iter_mut().for_each(|(image, _)| blank(image, slanted, 0.7));
        let (problem, truth) = problem_of(images, 0);
        let without = run(&problem);
        let with = run(&with_region(problem));
        let (before, after) = (right(&without, &truth), right(&with, &truth));
        assert!(before < 0.8 && after > 0.97, "{before} {after}");
        let outside = |e: &DepthEstimate| e.depth.row(2).to_vec();
        assert_eq!(outside(&with), outside(&without));
    }

    #[test]
    fn what_matches_well_elsewhere_is_left_where_it_is() {
        let (problem, truth) = problem(sphere_before_wall, 0);
        let mean = |problem: &StereoProblem| {
            let shares = SEEDS.map(|seed| right(&run_seeded(problem, seed), &truth));
            shares.iter().sum::<f64>() / shares.len() as f64
        };
        let before = mean(&problem);
        let after = mean(&with_region(problem));
        assert!(after > before - 0.0125, "{before} {after}");
    }
}
