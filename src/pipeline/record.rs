//! What a run did, for its report.

use super::prepare::Prepared;
use crate::error::{Error, Result};
use crate::report::{RunReport, StageTime, ViewReport};
use crate::scene::ViewIndex;
use crate::store::depth_store::DepthStore;
use crate::store::memory;
use rayon::prelude::*;
use std::collections::BTreeSet;
use std::time::Instant;

/// Measures the stages of a run.
pub(super) struct Clock {
    start: Instant,
    stage: Instant,
    cpu_start: Option<f64>,
    cpu_stage: Option<f64>,
    stages: Vec<StageTime>,
}

impl Clock {
    /// Starts now.
    pub(super) fn start() -> Self {
        let now = Instant::now();
        let cpu = cpu_seconds();
        Clock { start: now, stage: now, cpu_start: cpu, cpu_stage: cpu, stages: Vec::new() }
    }

    /// The stage that ends now.
    pub(super) fn stage(&mut self, name: &str) {
        let now = Instant::now();
        let seconds = (now - self.stage).as_secs_f64();
        let cpu = cpu_seconds();
        let spent = difference(cpu, self.cpu_stage);
        self.stages.push(StageTime {
            stage: name.to_owned(),
            seconds,
            cpu_seconds: spent,
            peak_memory_bytes: memory::peak(),
        });
        (self.stage, self.cpu_stage) = (now, cpu);
    }

    /// Time since the start.
    pub(super) fn elapsed(&self) -> std::time::Duration {
        self.start.elapsed()
    }

    /// Puts the times into a report.
    pub(super) fn finish(self, report: &mut RunReport) {
        report.seconds = self.start.elapsed().as_secs_f64();
        report.cpu_seconds = difference(cpu_seconds(), self.cpu_start);
        report.stages = self.stages;
        report.peak_memory_bytes = memory::peak();
    }
}

/// Time that all threads of this process have worked so far, seconds; `None` where the system does not tell.
fn cpu_seconds() -> Option<f64> {
    #[cfg(unix)]
    {
        let time = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
        Some(time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9)
    }
    #[cfg(not(unix))]
    None
}

fn difference(later: Option<f64>, earlier: Option<f64>) -> Option<f64> {
    Some(later? - earlier?)
}

/// One row per view of the scene; `mapped` ones have depth maps, of which `reused` were there before.
///
/// # Errors
/// A depth map cannot be read.
pub(super) fn view_rows(
    prepared: &Prepared,
    store: &DepthStore,
    mapped: &[ViewIndex],
    reused: &BTreeSet<ViewIndex>,
) -> Result<Vec<ViewReport>> {
    let views = &prepared.loaded.scene.views;
    (0..views.len())
        .into_par_iter()
        .map(|i| {
            let view = ViewIndex(i as u32);
            let mut row = ViewReport {
                index: view.0,
                id: views[i].id.0,
                image: views[i].name.clone(),
                sources: prepared.neighbors[i].matching().iter().map(|n| prepared.id(n.view).0).collect(),
                reused: reused.contains(&view),
                labels: prepared
                    .labels
                    .as_ref()
                    .and_then(|labels| labels.file(view))
                    .map(|path| path.display().to_string()),
                dropped: prepared.dropped[i].clone(),
                ..ViewReport::default()
            };
            if mapped.binary_search(&view).is_ok() {
                let map = store.summary(views[i].id)?;
                (row.width, row.height) = (map.size.width, map.size.height);
                row.depth_range = [map.depth_range.0, map.depth_range.1];
                row.valid_depths = map.valid_depths;
                row.coverage = map.valid_depths as f64 / map.size.area().max(1) as f64;
                row.mean_confidence = map.mean_confidence;
            }
            Ok(row)
        })
        .collect()
}

/// More threads than this only cost time: no stage has more work at once on a machine of today.
const MOST_THREADS: usize = 1024;

/// Runs `work` on a pool of `threads` threads; 0 = as many as the machine has.
///
/// # Errors
/// Those of `work`; the threads cannot be started.
pub(super) fn with_threads<T: Send>(threads: usize, work: impl FnOnce() -> Result<T> + Send) -> Result<T> {
    if threads > MOST_THREADS {
        return Err(Error::invalid(format!("--max-threads {threads}: at most {MOST_THREADS} are of use")));
    }
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .map_err(|e| Error::invalid(format!("--max-threads {threads}: cannot start the threads: {e}")))?;
    pool.install(work)
}
