//! The kernels against a direct evaluation of their definition in double precision.

use super::{CpuLevel, Kernels};
use crate::geometry::Size;
use crate::scene::Grid;
use crate::stereo::ReferenceImage;
use crate::stereo::level::Level;
use crate::stereo::plane::InversePlane;
use crate::stereo::state::State;
use crate::stereo::tests::{images, problem_of, slanted};
use crate::stereo::tile::{CENTRE, TILE_H, TILE_W, Tile};

/// Source images have whole grey levels, samples 1/256 of a pixel and 1/32 of a grey level.
const TOLERANCE: f64 = 1e-2;

fn bilinear(gray: &crate::scene::GrayImage, u: f64, v: f64) -> f64 {
    let (x, y) = (u.floor() as usize, v.floor() as usize);
    let (fx, fy) = (u - x as f64, v - y as f64);
    let p = |x, y| f64::from(gray[(x, y)]) * 255.0;
    (p(x, y) * (1.0 - fx) + p(x + 1, y) * fx) * (1.0 - fy)
        + (p(x, y + 1) * (1.0 - fx) + p(x + 1, y + 1) * fx) * fy
}

/// Cost of the plane (anchored at the tile's centre) at pixel (x, y), straight from the definition.
fn direct_cost(
    images: &[(ReferenceImage, Grid<f32>)],
    level: &Level,
    plane: InversePlane,
    tile: (i32, i32),
    x: i32,
    y: i32,
) -> f64 {
    let gray = &images[0].0.gray;
    let level_at = |x: i32, y: i32| f64::from(gray[(x as usize, y as usize)]) * 255.0;
    let centre = level_at(x, y);
    let mut costs = Vec::new();
    for (source, image) in level.sources.iter().zip(images[1..].iter().map(|(image, _)| image)) {
        let mut texels = Vec::new();
        for dy in [-4, -2, 0, 2, 4] {
            for dx in [-4, -2, 0, 2, 4] {
                let (px, py) = (f64::from(x + dx), f64::from(y + dy));
                let w = f64::from(plane.w)
                    + f64::from(plane.wx) * (px - f64::from(tile.0) - f64::from(CENTRE.0))
                    + f64::from(plane.wy) * (py - f64::from(tile.1) - f64::from(CENTRE.1));
                let q: [f64; 3] = std::array::from_fn(|i| {
                    let a = source.a[i].map(f64::from);
                    a[0] * px + a[1] * py + a[2] + f64::from(source.b[i]) * w
                });
                let t = level_at(x + dx, y + dy);
                let away = f64::from(level.weighting.grey) * (t - centre).powi(2)
                    + f64::from(level.weighting.space) * f64::from(dx * dx + dy * dy);
                let weight = (1.0 - away / 64.0).max(0.0).powi(64);
                texels.push((weight, t, bilinear(&image.gray, q[0] / q[2], q[1] / q[2])));
            }
        }
        let sum: f64 = texels.iter().map(|t| t.0).sum();
        let mean = |f: &dyn Fn(&(f64, f64, f64)) -> f64| texels.iter().map(|t| t.0 * f(t)).sum::<f64>() / sum;
        let (m0, m1) = (mean(&|t| t.1), mean(&|t| t.2));
        let covariance = mean(&|t| (t.1 - m0) * (t.2 - m1));
        let variances = mean(&|t| (t.1 - m0).powi(2)) * mean(&|t| (t.2 - m1).powi(2));
        costs.push(1.0 - covariance / variances.sqrt());
    }
    costs.sort_by(f64::total_cmp);
    0.5 * (costs[0] + costs[1])
}

#[test]
fn kernels_agree_with_the_definition() {
    let images = images(slanted);
    let (problem, _) = problem_of(images.clone(), 0);
    let level = Level::new(&problem, 0);
    let state = State::random(&level, &problem, 0, 0);
    let at = (48, 32);
    let plane = InversePlane { w: 0.26, wx: 0.0009, wy: -0.0006 };
    for cpu in [CpuLevel::Scalar, CpuLevel::Avx2, CpuLevel::Avx512].into_iter().filter(|c| c.is_supported()) {
        let kernels = Kernels::of(cpu);
        let mut tile = Tile::boxed(level.sources.len());
        tile.load(&level, &state, at.0, at.1);
        tile.belief.total = [[9.0; TILE_W]; TILE_H];
        (kernels.prepare)(&mut tile, &level);
        assert!((kernels.try_plane)(&mut tile, &level, plane));
        for (x, y) in [(0, 0), (7, 3), (15, 7), (3, 6)] {
            let want = direct_cost(&images, &level, plane, at, at.0 + x, at.1 + y);
            let got = f64::from(tile.belief.data[y as usize][x as usize]);
            assert!((got - want).abs() < TOLERANCE, "{} ({x}, {y}): {got} {want}", cpu.name());
        }
        (kernels.score_own)(&mut tile, &level);
        for (x, y) in [(0, 0), (15, 7)] {
            let want = direct_cost(&images, &level, plane, at, at.0 + x, at.1 + y);
            let got = f64::from(tile.belief.data[y as usize][x as usize]);
            assert!((got - want).abs() < TOLERANCE, "own, {} ({x}, {y}): {got} {want}", cpu.name());
        }
    }
    assert_eq!(level.size, Size::new(112, 80));
}
