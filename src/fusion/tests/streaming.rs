use super::*;
use crate::error::Error;
use crate::scene::{CloudPoint, ColorImage, PointSink};
use std::sync::Mutex;
use std::sync::Weak;

/// Hands out fresh copies of maps and keeps count of those alive.
struct CountingSource {
    scene: TestScene,
    alive: Mutex<(Vec<Weak<ColorImage>>, usize, usize)>,
}

impl CountingSource {
    /// Fuses a line of `count` views, each knowing two on either side; returns the cloud, the largest number of
    /// maps alive at any time, and the number of loads.
    fn fuse_line(count: u32, options: FusionOptions) -> (PointCloud, usize, usize) {
        let source = CountingSource { scene: TestScene::wall(count), alive: Mutex::default() };
        let views: Vec<FusionView> = (0..count as i64)
            .map(|i| FusionView {
                maps: Some(MapInfo::of(&source.scene.maps[i as usize])),
                neighbors: [1, -1, 2, -2]
                    .iter()
                    .map(|k| i + k)
                    .filter(|v| (0..i64::from(count)).contains(v))
                    .map(|v| ViewIndex(v as u32))
                    .collect(),
                neighbor_count: 4,
            })
            .collect();
        let input = FusionInput { views: &views, source: &source, policy: None };
        let mut points = PointCloud::new(input.layout(&options));
        fuse(&input, &options, &Progress::silent(), &mut points).unwrap();
        let (_, most, loads) = *source.alive.lock().unwrap();
        (points, most, loads)
    }
}

impl MapSource for CountingSource {
    fn load(&self, view: ViewIndex) -> Result<FusionMaps> {
        let maps = &self.scene.maps[view.index()];
        let color = Arc::new(ColorImage::clone(maps.color.as_ref().unwrap()));
        let copy = FusionMaps { color: Some(Arc::clone(&color)), ..maps.clone() };
        let (alive, most, loads) = &mut *self.alive.lock().unwrap();
        alive.retain(|w| w.strong_count() > 0);
        alive.push(Arc::downgrade(&color));
        *most = (*most).max(alive.len());
        *loads += 1;
        Ok(copy)
    }
}

fn unlimited() -> FusionOptions {
    FusionOptions { map_memory: u64::MAX, ..with_min_views(3) }
}

#[test]
fn maps_leave_memory_after_their_last_use() {
    let (cloud, most, loads) = CountingSource::fuse_line(12, unlimited());
    assert_eq!(loads, 12, "every map is read once");
    assert!(most <= 6, "{most} maps in memory");
    let (long, most_long, _) = CountingSource::fuse_line(16, unlimited());
    assert_eq!(most_long, most, "the length of the line does not matter");
    assert!(cloud.iter().count() < long.iter().count());
}

#[test]
fn a_small_budget_gives_the_same_cloud() {
    // More than sixteen views: ties in the order of views are mixed, so maps are needed again after long pauses.
    for options in [FusionOptions::default(), FusionOptions::supporting()] {
        let within = |map_memory| CountingSource::fuse_line(40, FusionOptions { map_memory, ..options });
        let (unlimited, most, loads) = within(u64::MAX);
        let (limited, most_limited, loads_limited) = within(0);
        assert!(most > 10 && loads == 40, "{most} maps, {loads} loads");
        assert!(most_limited <= 5, "a view and its four neighbours: {most_limited}");
        assert!(loads_limited > 40);
        assert_eq!(unlimited, limited);
    }
}

#[test]
fn the_cloud_does_not_depend_on_the_number_of_threads() {
    let scene = TestScene::of(row_of_views(5, 160, 120, 0.2, wall()));
    for options in [FusionOptions::default(), FusionOptions::supporting()] {
        let fuse_with = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| scene.fuse(&options))
        };
        let one = fuse_with(1);
        assert_eq!(one, fuse_with(2));
        assert_eq!(one, fuse_with(5));
    }
}

/// Fails at the third point.
struct FullDisk(u32);

impl PointSink for FullDisk {
    fn push(&mut self, _: &CloudPoint<'_>) -> Result<()> {
        self.0 += 1;
        if self.0 == 3 { Err(Error::invalid("full")) } else { Ok(()) }
    }
}

#[test]
fn an_error_of_the_sink_ends_fusion() {
    let scene = TestScene::wall(3);
    let views = scene.views();
    let input = FusionInput { views: &views, source: &scene, policy: None };
    let mut sink = FullDisk(0);
    let error = fuse(&input, &with_min_views(3), &Progress::silent(), &mut sink).unwrap_err();
    assert_eq!((error.to_string().as_str(), sink.0), ("full", 3));
}
