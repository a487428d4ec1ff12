//! Analytic scenes with exact depth: a slanted plane, a sphere before a wall, a step edge.

use super::*;
use crate::geometry::{Camera, Size};
use crate::scene::{Grid, ImageId};
use nalgebra::{Matrix3, Vector3};

const SIZE: Size = Size::new(112, 80);
const FOCAL: f64 = 110.0;
/// Relative depth error that counts as right: a quarter of a pixel of disparity at these baselines (f·B/z = 18 pixels).
const RIGHT: f32 = 0.014;

/// Depth along z of the first surface hit by the ray from `origin` in direction `dir`, as distance along `dir`.
pub(in crate::stereo) type Surface = fn(origin: Vector3<f64>, dir: Vector3<f64>) -> f64;

fn plane_hit(o: Vector3<f64>, d: Vector3<f64>, n: Vector3<f64>, offset: f64) -> f64 {
    let t = (offset - n.dot(&o)) / n.dot(&d);
    if t > 0.0 { t } else { f64::INFINITY }
}

pub(in crate::stereo) fn slanted(o: Vector3<f64>, d: Vector3<f64>) -> f64 {
    plane_hit(o, d, Vector3::new(0.45, -0.3, 1.0), 4.0)
}

pub(in crate::stereo) fn sphere_before_wall(o: Vector3<f64>, d: Vector3<f64>) -> f64 {
    let wall = plane_hit(o, d, Vector3::z(), 5.0);
    let (c, r) = (Vector3::new(0.1, 0.0, 4.4), 1.0);
    let oc = o - c;
    let (a, b, k) = (d.dot(&d), oc.dot(&d), oc.dot(&oc) - r * r);
    let disc = b * b - a * k;
    if disc < 0.0 { wall } else { wall.min((-b - disc.sqrt()) / a) }
}

fn step(o: Vector3<f64>, d: Vector3<f64>) -> f64 {
    let near = plane_hit(o, d, Vector3::z(), 4.0);
    let hit = o + d * near;
    if hit.x < 0.2 { near } else { plane_hit(o, d, Vector3::z(), 5.0) }
}

/// Value noise in 0..1 that depends on the point in space alone: details of about two and five pixels.
fn texture(p: Vector3<f64>) -> f32 {
    (0.55 * noise(p * 11.0) + 0.45 * noise(p * 4.7 + Vector3::repeat(40.0))) as f32
}

/// Random values at the corners of a unit lattice, blended smoothly between them.
fn noise(p: Vector3<f64>) -> f64 {
    let cell = p.map(f64::floor);
    let t = (p - cell).map(|t| t * t * (3.0 - 2.0 * t));
    let corner = |dx: i64, dy: i64, dz: i64| {
        let key = (cell.x as i64 + dx) as u32
            ^ ((cell.y as i64 + dy) as u32) << 10
            ^ ((cell.z as i64 + dz) as u32) << 20;
        f64::from(rng::Rng::keyed(3, key, 0, 0).unit())
    };
    let along_x = |dy, dz| corner(0, dy, dz) * (1.0 - t.x) + corner(1, dy, dz) * t.x;
    let along_y = |dz| along_x(0, dz) * (1.0 - t.y) + along_x(1, dz) * t.y;
    along_y(0) * (1.0 - t.z) + along_y(1) * t.z
}

fn camera(center: Vector3<f64>) -> Camera {
    let k = Matrix3::new(FOCAL, 0.0, 55.5, 0.0, FOCAL, 39.5, 0.0, 0.0, 1.0);
    Camera::new(SIZE, k, Matrix3::identity(), center)
}

fn render(surface: Surface, center: Vector3<f64>, id: u32) -> (ReferenceImage, Grid<f32>) {
    let camera = camera(center);
    let (mut gray, mut depth) = (Grid::filled(SIZE, 0.0f32), Grid::filled(SIZE, 0.0f32));
    for y in 0..SIZE.height as usize {
        for x in 0..SIZE.width as usize {
            let dir = camera.cam_from_image(x as f64, y as f64, 1.0);
            let t = surface(center, dir);
            gray[(x, y)] = texture(center + dir * t);
            depth[(x, y)] = t as f32;
        }
    }
    (ReferenceImage { gray: std::sync::Arc::new(gray), camera, id: ImageId(id) }, depth)
}

const CENTERS: [[f64; 3]; 5] =
    [[0.0, 0.0, 0.0], [0.8, 0.0, 0.0], [-0.8, 0.1, 0.0], [0.1, 0.8, 0.0], [0.0, -0.8, 0.1]];

/// The images of all views, with their depths.
pub(in crate::stereo) fn images(surface: Surface) -> Vec<(ReferenceImage, Grid<f32>)> {
    (0..5).map(|i| render(surface, Vector3::from(CENTERS[i]), i as u32)).collect()
}

pub(in crate::stereo) fn problem(surface: Surface, reference: usize) -> (StereoProblem, Grid<f32>) {
    problem_of(images(surface), reference)
}

/// The problem of estimating one of the images by the others, and its depths.
pub(in crate::stereo) fn problem_of(
    mut images: Vec<(ReferenceImage, Grid<f32>)>,
    reference: usize,
) -> (StereoProblem, Grid<f32>) {
    let (image, depth) = images.remove(reference);
    let problem = StereoProblem {
        reference: image,
        image_name: format!("{reference}.png"),
        sources: images.iter().map(|(i, _)| i.as_source(2)).collect(),
        depth_range: (2.0, 9.0),
        sparse: Vec::new(),
        skip: None,
        labels: None,
        regions: Vec::new(),
    };
    (problem, depth)
}

/// One seed moves the share of the sphere that is right by up to a percent, as half of what is wrong is its rim: the mean
/// of three is asked for.
pub(in crate::stereo) const SEEDS: [u64; 3] = [0, 1, 2];

/// Share of the pixels whose depth is right.
fn share_right(estimate: &DepthEstimate, truth: &Grid<f32>) -> f64 {
    let near = |(d, t): (&f32, &f32)| *d > 0.0 && (d - t).abs() < RIGHT * t;
    estimate.depth.data().iter().zip(truth.data()).filter(|&p| near(p)).count() as f64 / SIZE.area() as f64
}

fn run(surface: Surface) -> (DepthEstimate, Grid<f32>) {
    let (problem, truth) = problem(surface, 0);
    let options = StereoOptions { geometric_iterations: 0, ..StereoOptions::default() };
    (estimate(&problem, &options, CpuLevel::detect()).unwrap(), truth)
}

#[test]
fn a_slanted_plane_is_found_with_its_normal() {
    let (e, truth) = run(slanted);
    assert!(share_right(&e, &truth) > 0.97, "{}", share_right(&e, &truth));
    let n = -Vector3::new(0.45, -0.3, 1.0).normalize();
    let close = e.normal.as_ref().unwrap().data().iter().filter(|m| {
        f64::from(m[0]) * n.x + f64::from(m[1]) * n.y + f64::from(m[2]) * n.z > 10f64.to_radians().cos()
    });
    assert!(close.count() as f64 > 0.8 * SIZE.area() as f64);
}

#[test]
fn a_sphere_before_a_wall_is_found() {
    let (problem, truth) = problem(sphere_before_wall, 0);
    let share = |seed| {
        let options = StereoOptions { geometric_iterations: 0, seed, ..StereoOptions::default() };
        share_right(&estimate(&problem, &options, CpuLevel::detect()).unwrap(), &truth)
    };
    let shares = SEEDS.map(share);
    let mean = shares.iter().sum::<f64>() / shares.len() as f64;
    assert!(mean > 0.89, "{shares:?}");
}

#[test]
fn a_step_edge_stays_sharp() {
    let (e, truth) = run(step);
    assert!(share_right(&e, &truth) > 0.93, "{}", share_right(&e, &truth));
    let between = e.depth.data().iter().filter(|d| **d > 4.15 && **d < 4.85).count();
    assert!(between < SIZE.area() / 50, "{between} pixels float between the two planes");
}

#[test]
fn every_cpu_level_and_every_run_gives_the_same_bytes() {
    let (problem, _) = problem(sphere_before_wall, 0);
    let options = StereoOptions::default();
    let first = estimate(&problem, &options, CpuLevel::Scalar).unwrap();
    for cpu in [CpuLevel::Scalar, CpuLevel::Neon, CpuLevel::Avx2, CpuLevel::Avx512] {
        if !cpu.is_supported() {
            println!("{}: not on this processor, not compared", cpu.name());
            continue;
        }
        let e = estimate(&problem, &options, cpu).unwrap();
        assert_eq!(e, first, "{}", cpu.name());
        let g = refine_geometric(&problem, &first, &[None, None, None, None], 0, &options, cpu).unwrap();
        let h = refine_geometric(&problem, &first, &[None, None, None, None], 0, &options, CpuLevel::Scalar)
            .unwrap();
        assert_eq!(g, h, "{}", cpu.name());
    }
    let other = StereoOptions { seed: 1, ..options };
    assert_ne!(estimate(&problem, &other, CpuLevel::Scalar).unwrap().depth, first.depth);
}

/// The first view of the sphere, its depths, what matching finds there, and the planes of what it finds in the others.
fn matched(
    options: &StereoOptions,
) -> (StereoProblem, Grid<f32>, DepthEstimate, Vec<Option<Arc<SourcePlanes>>>) {
    let find = |p: &StereoProblem| estimate(p, options, CpuLevel::detect()).unwrap();
    let (first, truth) = problem(sphere_before_wall, 0);
    let others = (1..5).map(|i| find(&problem(sphere_before_wall, i).0));
    let sources = others.map(|map| Some(Arc::new(SourcePlanes::new(&map)))).collect();
    let map = find(&first);
    (first, truth, map, sources)
}

#[test]
fn geometric_passes_do_not_lose_what_matching_found() {
    let options = StereoOptions::default();
    let (p, truth, map, sources) = &matched(&options);
    let refined = refine_geometric(p, map, sources, 0, &options, CpuLevel::detect()).unwrap();
    let right = |e: &DepthEstimate| {
        let valid = e.depth.data().iter().filter(|d| **d > 0.0).count() as f64;
        share_right(e, truth) * SIZE.area() as f64 / valid
    };
    assert!(right(&refined) >= right(map), "{} {}", right(&refined), right(map));
    assert!(share_right(&refined, truth) > 0.9);
}

#[test]
fn what_a_view_has_missed_is_proposed_by_the_others() {
    let options = StereoOptions::default();
    let (p, truth, map, sources) = &matched(&options);
    // The first view has seen the wall alone.
    let mut blind = map.clone();
    blind.depth.data_mut().fill(5.0);
    blind.normal.as_mut().unwrap().data_mut().fill([0.0, 0.0, -1.0]);
    let on_sphere = |e: &DepthEstimate| {
        let sphere = e.depth.data().iter().zip(truth.data()).filter(|(_, t)| **t < 4.5);
        let (found, all) = sphere
            .fold((0, 0), |(found, all), (d, t)| (found + u32::from((d - t).abs() < RIGHT * t), all + 1));
        f64::from(found) / f64::from(all)
    };
    let refine = |maps: &[Option<Arc<SourcePlanes>>], cpu| {
        refine_geometric(p, &blind, maps, 0, &options, cpu).unwrap()
    };
    let alone = on_sphere(&refine(&[None, None, None, None], CpuLevel::Scalar));
    let helped = refine(sources, CpuLevel::Scalar);
    assert!(on_sphere(&helped) > 0.8 && alone < 0.5, "{} {alone}", on_sphere(&helped));
    for cpu in [CpuLevel::Neon, CpuLevel::Avx2, CpuLevel::Avx512].into_iter().filter(|l| l.is_supported()) {
        assert_eq!(refine(sources, cpu), helped, "{}", cpu.name());
    }
}

#[test]
fn skipped_pixels_get_no_depth_and_others_do() {
    let (mut problem, _) = problem(slanted, 0);
    let mut skip = Grid::filled(SIZE, false);
    for y in 0..SIZE.height as usize {
        for x in 0..40 {
            skip[(x, y)] = true;
        }
    }
    problem.skip = Some(skip.clone());
    let e = estimate(&problem, &StereoOptions::default(), CpuLevel::detect()).unwrap();
    let valid =
        |want: bool| e.depth.data().iter().zip(skip.data()).filter(|&(d, s)| *s == want && *d > 0.0).count();
    assert_eq!(valid(true), 0);
    assert!(valid(false) as f64 > 0.9 * 72.0 * 80.0);
}

#[test]
fn unusable_problems_are_named() {
    let (good, _) = problem(slanted, 0);
    let options = StereoOptions::default();
    let message = |p: StereoProblem| estimate(&p, &options, CpuLevel::Scalar).unwrap_err().to_string();
    assert!(
        message(StereoProblem { sources: Vec::new(), ..good.clone() }).contains("0.png: no view to match")
    );
    assert!(
        message(StereoProblem { depth_range: (0.0, 1.0), ..good.clone() }).contains("depth range 0 to 1")
    );
    let mut wrong = good;
    wrong.sources[1].camera = wrong.sources[1].camera.scaled_per_axis(Size::new(56, 40));
    assert!(message(wrong).contains("image 0002 is 112×80, its camera is for 56×40"));
    let bad = StereoOptions { iterations: 0, ..options };
    assert!(bad.check().unwrap_err().to_string().contains("--iters 0"));
}
