//! What is done to finished depth maps.

use crate::busy::time;
use crate::openmvs_maps::MapsInMemory;
use crate::scene::maps;
use criterion::{Criterion, Throughput};
use semvs::internals::depth_filter::{
    DepthFilterOptions, FilterView, UnbiasedFilterOptions, fill_gaps, filter_consistency, filter_unbiased,
    remove_speckles,
};
use semvs::internals::fusion::{FusionInput, FusionOptions, fuse as fuse_maps};
use semvs::internals::progress::Progress;
use semvs::internals::scene::{CloudPoint, DepthEstimate, PointSink};

fn views<'a>(maps: &'a MapsInMemory, view: usize) -> Vec<FilterView<'a>> {
    maps.views[view].neighbors.iter().map(|v| FilterView::new(&maps.maps[v.index()].estimate)).collect()
}

pub(crate) fn filter(c: &mut Criterion) {
    let raw = maps("raw");
    let reference = FilterView::new(&raw.maps[0].estimate);
    let neighbors = views(&raw, 0);
    let pixels = reference.estimate.depth.data().len() as u64;
    let options = DepthFilterOptions::default();
    let mut group = c.benchmark_group("filter");
    group.throughput(Throughput::Elements(pixels * neighbors.len() as u64));
    group.bench_function("unbiased", |b| {
        let options = UnbiasedFilterOptions::default();
        b.iter_custom(|n| time(n, || filter_unbiased(&reference, &neighbors, &options)));
    });
    group.bench_function("adjust", |b| {
        b.iter_custom(|n| time(n, || filter_consistency(&reference, &neighbors, raw.maps.len(), &options)));
    });
    group.throughput(Throughput::Elements(pixels));
    group.bench_function("speckles and gaps", |b| {
        b.iter_custom(|n| {
            time(n, || {
                let mut estimate = DepthEstimate::clone(reference.estimate);
                (remove_speckles(&mut estimate, &options), fill_gaps(&mut estimate, &options), estimate)
            })
        });
    });
    group.finish();
}

/// Takes points and does nothing.
struct Nowhere;

impl PointSink for Nowhere {
    fn push(&mut self, point: &CloudPoint<'_>) -> semvs::Result<()> {
        std::hint::black_box(point);
        Ok(())
    }
}

pub(crate) fn fuse(c: &mut Criterion) {
    let filtered = maps("post7");
    let input = FusionInput { views: &filtered.views, source: &filtered, policy: None };
    let options = FusionOptions::default();
    let work = || fuse_maps(&input, &options, &Progress::silent(), &mut Nowhere).unwrap();
    let mut group = c.benchmark_group("fuse");
    group.throughput(Throughput::Elements(work().depths));
    group.bench_function("six views", |b| b.iter_custom(|n| time(n, work)));
    group.finish();
}
