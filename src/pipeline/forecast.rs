//! What a run will take, known before it begins: a model fitted to measured runs (`docs/benchmarks.md`), good to a factor of two.

use super::job::DensifyJob;
use super::memory_plan::MemoryPlan;
use super::prepare::Prepared;
use super::resume::Plan;
use crate::error::Result;
use crate::geometry::Size;
use crate::progress::{Forecast, Stage};
use crate::stereo::{CpuLevel, StereoOptions};
use std::time::Duration;

/// Processor seconds per pixel and pass over it, at normal quality with the AVX-512 kernels.
const PASS: f64 = 0.33e-6;
/// Share of that without any source view, and what each source view adds to it; five make the whole.
const BY_SOURCES: (f64, f64) = (0.42, 0.116);
/// Passes as long as a geometric one is: it compares one view more.
const GEOMETRIC_PASS: f64 = 4.0 / 3.0;
/// Processor seconds per pixel of the filter across views, and of fusion and the writing of the cloud.
const FILTER: f64 = 0.15e-6;
const FUSION: f64 = 0.2e-6;
/// What every thread beyond the first adds of its own.
const SPEEDUP: f64 = 0.85;

/// Time with other kernels than those of AVX-512; NEON is not measured.
fn slowness(cpu: CpuLevel) -> f64 {
    match cpu {
        CpuLevel::Avx512 => 1.0,
        CpuLevel::Avx2 => 1.3,
        CpuLevel::Neon | CpuLevel::Scalar => 2.3,
    }
}

/// Time of a quality relative to the normal one: draft 0.7, high 1.5.
fn effort(options: &StereoOptions) -> f64 {
    let compared = (options.candidates + options.refinements) * options.compared_views;
    0.59 + 0.0091 * f64::from(compared)
}

/// Passes over all pixels that the photometric stage is as long as: coarser levels have fewer pixels.
fn photometric_passes(options: &StereoOptions) -> f64 {
    let spared = u32::from(options.levels > 0);
    let own = f64::from(options.iterations.saturating_sub(spared).max(1));
    let coarser: f64 = (1..=options.levels.min(8)).map(|level| 0.25_f64.powi(level as i32)).sum();
    own + f64::from(options.iterations) * coarser
}

/// Depth maps that a stage makes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Maps {
    count: usize,
    /// Sum over the maps.
    pixels: f64,
    /// Sum over the maps of the pixels times the source views.
    matched: f64,
}

impl Maps {
    /// Processor seconds of one pass over them.
    fn pass(self, options: &StereoOptions, cpu: CpuLevel) -> f64 {
        let (alone, each) = BY_SOURCES;
        PASS * slowness(cpu) * effort(options) * (alone * self.pixels + each * self.matched)
    }
}

/// Wall time of `seconds` of processor time on work that `workers` can share.
fn wall(seconds: f64, workers: usize) -> f64 {
    seconds / (1.0 + SPEEDUP * (workers.max(1) - 1) as f64)
}

/// What is left to do in a run over `prepared`; `None` if no depth map is to be made.
///
/// # Errors
/// A view that is to get a map takes no part.
pub(super) fn forecast(
    job: &DensifyJob,
    prepared: &Prepared,
    plan: &Plan,
    memory: &MemoryPlan,
    cpu: CpuLevel,
) -> Result<Option<Forecast>> {
    let passes = job.stereo.geometric_iterations;
    let sum = |stage: u32| -> Result<Maps> {
        let mut maps = Maps::default();
        for &view in plan.todo(stage).iter().filter(|view| stage > 0 || !plan.given.contains(view)) {
            let pixels = prepared.camera(view)?.size().area() as f64;
            let sources = prepared.neighbors[view.index()].matching().len();
            maps.count += 1;
            maps.pixels += pixels;
            maps.matched += pixels * sources as f64;
        }
        Ok(maps)
    };
    let todo = (0..=passes).map(sum).collect::<Result<Vec<Maps>>>()?;
    let Some(most) = todo.iter().copied().max_by_key(|maps| maps.count).filter(|maps| maps.count > 0) else {
        return Ok(None);
    };
    let threads = rayon::current_num_threads();
    let mut stages = Vec::new();
    for (stage, maps) in todo.iter().enumerate() {
        let seconds = match stage {
            0 => maps.pass(&job.stereo, cpu) * photometric_passes(&job.stereo),
            _ => maps.pass(&job.stereo, cpu) * GEOMETRIC_PASS,
        };
        let stage = match stage {
            0 => Stage::Estimate,
            pass => Stage::Geometric { pass: pass - 1, passes: passes as usize },
        };
        stages.push((stage, wall(seconds, memory.views_at_once.min(maps.count))));
    }
    let all: f64 = plan
        .views
        .iter()
        .map(|&view| Ok(prepared.camera(view)?.size().area() as f64))
        .sum::<Result<f64>>()?;
    if job.filter.across.is_some() {
        stages.push((Stage::Filter, wall(FILTER * all, memory.views_at_once)));
    }
    if !job.depth_maps_only {
        stages.push((Stage::Fuse, wall(FUSION * all, threads)));
    }
    let sizes =
        plan.views.iter().map(|&view| Ok(prepared.camera(view)?.size())).collect::<Result<Vec<Size>>>()?;
    let largest = sizes.iter().copied().max_by_key(|size| size.area()).unwrap_or_default();
    Ok(Some(Forecast {
        maps: most.count,
        size: (largest.width, largest.height),
        is_one_size: sizes.iter().all(|&size| size == largest),
        sources: (most.matched / most.pixels.max(1.0)).round() as usize,
        threads,
        stages: stages
            .into_iter()
            .map(|(stage, seconds)| (stage, Duration::from_secs_f64(seconds)))
            .collect(),
        memory: memory.most(all as u64),
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stereo::Quality;

    fn seconds(count: usize, side: f64, sources: usize, options: &StereoOptions, cpu: CpuLevel) -> f64 {
        let pixels = count as f64 * side * side;
        let maps = Maps { count, pixels, matched: pixels * sources as f64 };
        let passes = photometric_passes(options) + f64::from(options.geometric_iterations) * GEOMETRIC_PASS;
        maps.pass(options, cpu) * passes
    }

    #[test]
    fn more_work_takes_longer() {
        let normal = StereoOptions::default();
        let least = seconds(4, 100.0, 3, &normal, CpuLevel::Avx512);
        let of = StereoOptions::of;
        let longer = StereoOptions { iterations: 4, ..normal.clone() };
        let more_passes = StereoOptions { geometric_iterations: 3, ..normal.clone() };
        let more_levels = StereoOptions { levels: 3, ..normal.clone() };
        for (what, more) in [
            ("maps", seconds(5, 100.0, 3, &normal, CpuLevel::Avx512)),
            ("pixels", seconds(4, 101.0, 3, &normal, CpuLevel::Avx512)),
            ("sources", seconds(4, 100.0, 4, &normal, CpuLevel::Avx512)),
            ("quality", seconds(4, 100.0, 3, &of(Quality::High), CpuLevel::Avx512)),
            ("iterations", seconds(4, 100.0, 3, &longer, CpuLevel::Avx512)),
            ("passes", seconds(4, 100.0, 3, &more_passes, CpuLevel::Avx512)),
            ("levels", seconds(4, 100.0, 3, &more_levels, CpuLevel::Avx512)),
            ("AVX2", seconds(4, 100.0, 3, &normal, CpuLevel::Avx2)),
            ("scalar", seconds(4, 100.0, 3, &normal, CpuLevel::Scalar)),
        ] {
            assert!(more > least, "{what}: {more} s, {least} s with less");
        }
        assert!(seconds(4, 100.0, 3, &of(Quality::Draft), CpuLevel::Avx512) < 0.7 * least);
        assert!(
            wall(8.0, 1) == 8.0 && wall(8.0, 2) < 5.0 && wall(8.0, 2) > 4.0 && wall(8.0, 4) < wall(8.0, 2)
        );
    }

    /// Processor seconds of whole runs in `docs/benchmarks.md`: the model is within a quarter on the machine it is fitted to.
    #[test]
    fn measured_runs_are_met() {
        for (measured, maps, pixels, sources, cpu) in [
            (9.3, 16, 600.0 * 450.0, 5, CpuLevel::Avx512),
            (11.6, 16, 600.0 * 450.0, 5, CpuLevel::Avx2),
            (19.4, 16, 600.0 * 450.0, 5, CpuLevel::Scalar),
            (9.1, 11, 768.0 * 512.0, 5, CpuLevel::Avx512),
            (38.6, 11, 1536.0 * 1024.0, 5, CpuLevel::Avx512),
            (1.47, 6, 400.0 * 300.0, 5, CpuLevel::Avx512),
            (0.33, 6, 200.0 * 150.0, 2, CpuLevel::Avx512),
            (18.95, 258, 200.0 * 150.0, 5, CpuLevel::Avx512),
        ] {
            let side = f64::sqrt(pixels);
            let rest = f64::from(maps) * pixels * (FILTER + FUSION);
            let said = seconds(maps as usize, side, sources, &StereoOptions::default(), cpu) + rest;
            let ratio = said / measured;
            println!("{measured} s measured, {said:.2} s said");
            assert!((0.8..1.25).contains(&ratio), "{measured} s measured, {said:.2} s said");
        }
    }
}
