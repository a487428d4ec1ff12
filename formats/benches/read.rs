//! Reading of a dense scene of a million points, by kind of archive; throughput in uncompressed bytes.

#![allow(clippy::unwrap_used, missing_docs)]

use std::path::Path;

use criterion::{BatchSize, Criterion, Throughput, criterion_group, criterion_main};
use semvs_formats::mvs::{self, ArchiveKind, PointCloud, Scene, SceneFile, Visibility};
use semvs_formats::{Limits, ply};

const POINTS: usize = 1_000_000;
const IMAGES: u32 = 60;

/// Pseudo-random numbers (Steele et al. 2014, SplitMix64).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// A float in 0..1.
    fn unit(&mut self) -> f32 {
        (self.next() >> 40) as f32 / (1u64 << 24) as f32
    }
}

/// Points of a rough wall, each seen by 3 to 8 of the images.
fn cloud() -> PointCloud {
    let mut random = Random(1);
    let mut cloud = PointCloud::default();
    let (mut images, mut weights) = (Vec::new(), Vec::new());
    for i in 0..POINTS {
        let [x, y, z] = [0; 3].map(|_| random.unit());
        cloud.positions.push([
            (i % 1000) as f32 * 0.01 + x * 0.01,
            (i / 1000) as f32 * 0.01 + y * 0.01,
            z * 0.05,
        ]);
        cloud.normals.push([x * 0.1, y * 0.1, -0.99]);
        cloud.colors.push([0; 3].map(|_| 96 + (random.unit() * 64.0) as u8));
        let first = (i / 20_000) as u32;
        images.clear();
        images.extend((0..3 + (random.next() % 6) as u32).map(|k| (first + k) % IMAGES));
        weights.clear();
        weights.extend(images.iter().map(|_| 0.1 + random.unit()));
        cloud.views.push(&images, &weights);
    }
    cloud
}

/// Writes every kind of archive; returns name, path and the bytes that count.
fn archives(folder: &Path) -> Vec<(&'static str, std::path::PathBuf, u64)> {
    let points = cloud();
    let Visibility { offsets, images, weights } = points.views.clone();
    let dense = ply::Cloud {
        positions: points.positions.clone(),
        colors: points.colors.clone(),
        normals: points.normals.clone(),
        views: Visibility { offsets, images, weights },
        ..ply::Cloud::default()
    };
    let image =
        |id: u32| mvs::Image { name: format!("{id:04}.jpg").into_bytes(), id, ..mvs::Image::default() };
    let scene = Scene { images: (0..IMAGES).map(image).collect(), points, ..Scene::default() };
    let mut out = Vec::new();
    let mut add = |name, file: &str, bytes: &[u8]| {
        let path = folder.join(file);
        std::fs::write(&path, bytes).unwrap();
        out.push((name, path, bytes.len() as u64));
    };
    let write = |write: &dyn Fn(&mut Vec<u8>)| {
        let mut bytes = Vec::new();
        write(&mut bytes);
        bytes
    };
    add(
        "mvs interface",
        "i.mvs",
        &write(&|out| mvs::write_interface(out, &scene, mvs::NEWEST_VERSION).unwrap()),
    );
    for (name, file, kind) in [
        ("mvs binary", "b.mvs", ArchiveKind::Binary),
        ("mvs text", "t.mvs", ArchiveKind::Text),
        ("mvs zlib", "z.mvs", ArchiveKind::Zlib),
        ("mvs zstd", "s.mvs", ArchiveKind::Zstd),
    ] {
        add(name, file, &write(&|out| mvs::write_project(out, &scene, kind).unwrap()));
    }
    let layouts = [
        ("ply openmvs", "o.ply", ply::Layout::openmvs(true, true, true)),
        ("ply plain", "p.ply", ply::Layout::plain(true, true)),
    ];
    for (name, file, layout) in layouts {
        add(name, file, &write(&|out| ply::write_cloud(out, &layout, &dense).unwrap()));
    }
    for (name, _, bytes) in &out {
        eprintln!("{name}: {bytes} bytes on disk");
    }
    let binary = out[1].2;
    out.iter_mut().filter(|(name, ..)| matches!(*name, "mvs zlib" | "mvs zstd")).for_each(|a| a.2 = binary);
    out
}

fn read(c: &mut Criterion) {
    let folder = tempfile::tempdir().unwrap();
    let limits = Limits::default();
    let mut group = c.benchmark_group("read a million points");
    group.sample_size(10);
    for (name, path, bytes) in archives(folder.path()) {
        group.throughput(Throughput::Bytes(bytes));
        group.bench_function(name, |b| {
            // What was read is dropped outside of the measurement.
            if name.starts_with("ply") {
                let open = || std::fs::File::open(&path).unwrap();
                b.iter_batched(open, |file| ply::read_cloud(file, &limits).unwrap(), BatchSize::PerIteration);
            } else {
                b.iter_batched(|| (), |()| SceneFile::read(&path, &limits).unwrap(), BatchSize::PerIteration);
            }
        });
    }
    group.finish();
}

criterion_group!(benches, read);
criterion_main!(benches);
