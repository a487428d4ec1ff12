//! Estimation of one view, by instruction set.

use crate::busy::time;
use crate::scene::{maps, problem};
use criterion::{Criterion, Throughput};
use semvs::internals::scene::ViewIndex;
use semvs::internals::stereo::{
    CpuLevel, SourcePlanes, StereoOptions, estimate as estimate_view, refine_geometric,
};
use std::sync::Arc;

pub(crate) fn estimate(c: &mut Criterion) {
    let raw = maps("raw");
    let problem = problem(&raw);
    let pixels = problem.reference.gray.size().area() as u64;
    let previous = &raw.maps[0].estimate;
    let planes = |v: &ViewIndex| Some(Arc::new(SourcePlanes::new(&raw.maps[v.index()].estimate)));
    let sources: Vec<Option<Arc<SourcePlanes>>> = raw.views[0].neighbors.iter().map(planes).collect();
    let options = StereoOptions::default();
    // Little but kernels: no coarser levels, nothing relaxed.
    let one_pass = StereoOptions { levels: 0, iterations: 1, geometric_iterations: 0, ..options.clone() };
    let mut group = c.benchmark_group("estimate");
    group.sample_size(10);
    // Pixels times the views that each is matched with.
    group.throughput(Throughput::Elements(pixels * problem.sources.len() as u64));
    let levels = [CpuLevel::Avx512, CpuLevel::Avx2, CpuLevel::Scalar];
    for cpu in levels.into_iter().filter(|level| level.is_supported()) {
        let name = cpu.name();
        group.bench_function(format!("one pass, {name}"), |b| {
            b.iter_custom(|n| time(n, || estimate_view(&problem, &one_pass, cpu).unwrap()));
        });
        group.bench_function(format!("photometric, {name}"), |b| {
            b.iter_custom(|n| time(n, || estimate_view(&problem, &options, cpu).unwrap()));
        });
        group.bench_function(format!("geometric, {name}"), |b| {
            b.iter_custom(|n| {
                time(n, || refine_geometric(&problem, previous, &sources, 0, &options, cpu).unwrap())
            });
        });
    }
    group.finish();
}
