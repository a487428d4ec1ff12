//! Files, as far as they are of this scene; large ones are in the benchmarks of `semvs-formats`.

use crate::busy::time;
use crate::common::{bytes, facade6};
use crate::openmvs_maps::points;
use criterion::{Criterion, Throughput};
use semvs::internals::progress::Progress;
use semvs::internals::scene::{PointSource, ResolutionOptions};
use semvs::internals::store::cloud::{CloudOptions, write_clouds};
use semvs::internals::store::images::load_working_color;
use semvs_formats::Limits;
use semvs_formats::dmap::DepthMapFile;

pub(crate) fn codecs(c: &mut Criterion) {
    let results = facade6().join("openmvs-2.3.0/post7");
    let map = bytes(&results.join("depth0000.dmap.zst"));
    let limits = Limits::default();
    let decoded = DepthMapFile::from_bytes(&map, &limits).unwrap();
    let mut group = c.benchmark_group("codecs");
    group.throughput(Throughput::Bytes(map.len() as u64));
    group.bench_function("read a depth map", |b| {
        b.iter_custom(|n| time(n, || DepthMapFile::from_bytes(&map, &limits).unwrap()));
    });
    group.bench_function("write a depth map", |b| {
        b.iter_custom(|n| {
            time(n, || {
                let mut out = Vec::with_capacity(map.len());
                decoded.write(&mut out).unwrap();
                out
            })
        });
    });

    let photograph = facade6().join("images/0003.jpg");
    let full = ResolutionOptions { level: 0, ..ResolutionOptions::default() };
    let pixels = load_working_color(&photograph, &full).unwrap().data().len();
    group.throughput(Throughput::Elements(pixels as u64));
    for (name, resolution) in
        [("decode a photograph", full), ("decode and halve it", crate::scene::RESOLUTION)]
    {
        group.bench_function(name, |b| {
            b.iter_custom(|n| time(n, || load_working_color(&photograph, &resolution).unwrap()));
        });
    }

    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cloud.ply");
    let cloud = points(&crate::common::cloud(&results.join("scene_dense.ply.zst")));
    group.throughput(Throughput::Elements(cloud.len()));
    group.bench_function("write a cloud", |b| {
        b.iter_custom(|n| {
            time(n, || write_clouds(&cloud, &path, &CloudOptions::default(), &Progress::silent()).unwrap())
        });
    });
    group.finish();
}
