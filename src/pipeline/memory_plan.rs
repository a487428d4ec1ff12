//! How the memory that a run may take is shared out, decided before any long work.

use super::job::SceneJob;
use crate::depth_filter::MAX_NEIGHBORS;
use crate::error::{Error, Result};
use crate::geometry::Camera;
use crate::store::memory;
use crate::store::spool::DEFAULT_SPOOL_MEMORY;

/// What the program takes without any image.
const BASE: u64 = 48 << 20;
/// Bytes per pixel of a map in memory.
pub(super) const MAP_BYTES: u64 = 20;
/// Bytes per pixel of a view while it is estimated: reference, state of two levels, the map twice, one of a source.
const VIEW_BYTES: u64 = 100;
/// Bytes per pixel and source view: its texels, the planes of its map, its classes.
const SOURCE_BYTES: u64 = 20;
/// Bytes per pixel of a photograph.
const COLOR_BYTES: u64 = 3;
/// Bytes per pixel of a source's texels at all resolutions.
const TEXEL_BYTES: u64 = 7;
/// Bytes per pixel of the planes of a source's map.
const PLANE_BYTES: u64 = 8;
/// Bytes per pixel of a view's maps while they are fused.
const FUSED_BYTES: u64 = 27;
/// Bytes per pixel of all maps that the points of a cloud take in memory, at most.
const POINT_BYTES: u64 = 16;
/// Bytes per pixel of a photograph while it is decoded and scaled.
const DECODED_BYTES: u64 = 4;

/// What each part of a run may take, bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct MemoryPlan {
    /// Views that are worked on at a time.
    pub(super) views_at_once: usize,
    /// Depth maps kept between their uses in estimation.
    pub(super) maps: usize,
    /// The same after it, when texels and planes are gone.
    pub(super) filtered: usize,
    /// Colours kept.
    pub(super) colors: usize,
    /// Texels of sources kept.
    pub(super) texels: usize,
    /// Planes of sources' depth maps kept.
    pub(super) planes: usize,
    /// Maps kept between their uses by fusion.
    pub(super) fusion: u64,
    /// Points kept until the cloud is written; the rest waits in a file.
    pub(super) points: u64,
    /// What a view takes while it is estimated.
    view: u64,
    /// What photographs take while they are decoded.
    decoded: u64,
    /// What may be used in all.
    limit: u64,
}

/// Least and most memory for depth maps between the passes, where there is enough.
const MAPS: (u64, u64) = (64 << 20, 4 << 30);
/// Share of all maps that estimation keeps: a pass needs each of them twice at most.
const MAPS_KEPT: (u64, u64) = (1, 4);
/// The same for colours, texels and planes.
const OTHERS: (u64, u64) = (32 << 20, 4 << 30);
/// Memory for colours where nothing is estimated: each is needed once to see whether it can be read, once for the points.
const COLORS: u64 = 4 << 20;
/// Least memory for the maps that fusion works on, where there is enough; else half as much again as those of a turn.
const FUSION: u64 = 12 << 20;

impl MemoryPlan {
    /// Shares out what `job` may take for views with these cameras; `estimates`: depth maps are made.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`] if a single view at a time is too much.
    pub(super) fn of(job: &SceneJob, cameras: &[Option<Camera>], estimates: bool) -> Result<Self> {
        let limit = memory::allowed(job.max_memory);
        let threads = rayon::current_num_threads();
        let sources = most_sources(job) as u64;
        let area = cameras.iter().flatten().map(|c| c.size().area() as u64).max().unwrap_or(0);
        let in_hand = pixels_in_hand(job, cameras);
        let decoded = area * DECODED_BYTES * threads as u64;
        let one = area * (VIEW_BYTES + SOURCE_BYTES * sources);
        let group = area * FUSED_BYTES * (1 + (job.neighbors.max_views as u64).max(sources));
        let least = BASE + decoded + if estimates { one.max(group) } else { group };
        if least > limit {
            let (least, limit) = (least.div_ceil(1 << 20), limit >> 20);
            return Err(Error::OutOfMemory(format!(
                "a view and its neighbours need {least} MiB, {limit} MiB may be used: give --max-memory {least}M if there is as \
                 much, else a lower --max-resolution, fewer --number-views, or split the scene with --sub-scene-area"
            )));
        }
        let free = limit - BASE - decoded;
        let views_at_once = (free * 3 / 4 / one.max(1)).clamp(1, threads as u64);
        let cached = if estimates { free - (views_at_once * one).min(free) } else { free / 2 };
        let share = |part: u64, wanted: u64, (least, most): (u64, u64)| {
            wanted.clamp(least, most).min(cached / part) as usize
        };
        let points = DEFAULT_SPOOL_MEMORY.min(free / 8);
        Ok(MemoryPlan {
            views_at_once: views_at_once as usize,
            maps: share(4, in_hand * MAP_BYTES * MAPS_KEPT.0 / MAPS_KEPT.1, MAPS),
            filtered: share(1, in_hand * MAP_BYTES, MAPS).min((cached - cached / 4) as usize),
            colors: if estimates {
                share(4, in_hand * COLOR_BYTES, OTHERS)
            } else {
                share(4, COLORS, (COLORS, COLORS))
            },
            texels: share(4, in_hand * TEXEL_BYTES, OTHERS),
            planes: share(4, in_hand * PLANE_BYTES, OTHERS),
            fusion: (group * 3 / 2).max(FUSION).min(free * 5 / 8).max(group.min(free)),
            points,
            view: if estimates { one } else { 0 },
            decoded,
            limit,
        })
    }

    /// The most that a run will take by this plan, if all its maps together have `pixels`.
    pub(super) fn most(&self, pixels: u64) -> u64 {
        let kept = |budget: usize, bytes: u64| (budget as u64).min(pixels * bytes);
        let colors = kept(self.colors, COLOR_BYTES);
        // Maps of two passes are side by side.
        let sources =
            kept(self.maps, 2 * MAP_BYTES) + kept(self.texels, TEXEL_BYTES) + kept(self.planes, PLANE_BYTES);
        let estimation = self.views_at_once as u64 * self.view + sources;
        let fusion = self.fusion.min(pixels * FUSED_BYTES) + self.points.min(pixels * POINT_BYTES);
        (BASE + self.decoded + colors + estimation.max(fusion)).min(self.limit)
    }
}

/// Pixels of the views that all threads work on at a time: each on a view and its neighbours.
fn pixels_in_hand(job: &SceneJob, cameras: &[Option<Camera>]) -> u64 {
    let pixels = || cameras.iter().flatten().map(|c| c.size().area() as u64);
    let views = rayon::current_num_threads() * (1 + most_sources(job).max(MAX_NEIGHBORS));
    (views as u64 * pixels().max().unwrap_or(0)).min(pixels().sum())
}

/// Largest number of views that one is matched with.
fn most_sources(job: &SceneJob) -> usize {
    match job.neighbors.number_views {
        0 => job.neighbors.max_views,
        typed => typed.min(MAX_NEIGHBORS.max(job.neighbors.max_views)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_pixels_take_more_memory_up_to_the_limit() {
        let plan = MemoryPlan {
            views_at_once: 2,
            maps: 176 << 20,
            filtered: 176 << 20,
            colors: 64 << 20,
            texels: 64 << 20,
            planes: 64 << 20,
            fusion: 256 << 20,
            points: 64 << 20,
            view: 75 << 20,
            decoded: 2 << 20,
            limit: 1 << 30,
        };
        let most: Vec<u64> = (0..32).map(|i| plan.most(1 << i)).collect();
        assert!(most.is_sorted(), "{most:?}");
        assert!(most[0] > 200 << 20 && most[31] <= plan.limit, "{most:?}");
        let tight = MemoryPlan { limit: 300 << 20, ..plan };
        assert_eq!(tight.most(1 << 31), 300 << 20);
        let fuses = MemoryPlan { view: 0, maps: 0, texels: 0, planes: 0, ..plan };
        assert!(fuses.most(1 << 20) < plan.most(1 << 20));
    }
}
