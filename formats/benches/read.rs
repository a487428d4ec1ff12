//! Reading of a dense scene of a million points, by kind of archive; throughput in uncompressed
//! bytes per second of one core.

#![allow(clippy::unwrap_used, missing_docs)]

use std::path::Path;
use std::sync::LazyLock;
use std::time::{Duration, Instant};

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
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
    let binary = out[1].2;
    out.iter_mut().filter(|(name, ..)| matches!(*name, "mvs zlib" | "mvs zstd")).for_each(|a| a.2 = binary);
    out
}

/// What was read.
#[expect(dead_code, reason = "kept only to be dropped after the clock was read")]
enum Read {
    Ply(Box<ply::Cloud>),
    Mvs(Box<SceneFile>),
}

/// Time that this thread spent on a processor, so that a shared machine does not spoil the figures; where the system
/// does not tell, the time that passed.
fn busy() -> Duration {
    static START: LazyLock<Instant> = LazyLock::new(Instant::now);
    let told = std::fs::read_to_string("/proc/thread-self/schedstat").ok();
    let nanoseconds = told.and_then(|text| text.split(' ').next()?.parse().ok());
    nanoseconds.map_or_else(|| START.elapsed(), Duration::from_nanos)
}

fn read(c: &mut Criterion) {
    let folder = tempfile::tempdir().unwrap();
    let limits = Limits::default();
    let mut group = c.benchmark_group("read a million points");
    group.sample_size(10);
    for (name, path, bytes) in archives(folder.path()) {
        group.throughput(Throughput::Bytes(bytes));
        group.bench_function(name, |b| {
            b.iter_custom(|iterations| {
                let read = || match name.starts_with("ply") {
                    true => Read::Ply(Box::new(
                        ply::read_cloud(std::fs::File::open(&path).unwrap(), &limits).unwrap(),
                    )),
                    false => Read::Mvs(Box::new(SceneFile::read(&path, &limits).unwrap())),
                };
                let timed = || {
                    let before = busy();
                    let value = std::hint::black_box(read());
                    let time = busy() - before;
                    drop(value); // not measured
                    time
                };
                (0..iterations).map(|_| timed()).sum()
            });
        });
    }
    group.finish();
}

criterion_group!(benches, read);
criterion_main!(benches);
