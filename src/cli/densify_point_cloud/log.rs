//! What `DensifyPointCloud` says: OpenMVS's lines, on stdout and in a log file.

use crate::cli::duration;
use crate::cli::one_line::printable;
use crate::cli::print;
use crate::error::{Error, Result};
use crate::progress::{Event, Listener, SceneSummary, Stage};
use std::fs::File;
use std::io::{IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Writes `HH:MM:SS [App     ] text` lines to stdout and to the log file. While a stage counts its steps,
/// lines other than warnings go to the file only, as with OpenMVS.
pub(crate) struct Log {
    verbosity: i32,
    terminal: bool,
    state: Mutex<State>,
}

struct State {
    file: Option<File>,
    stage: Option<(Stage, Instant)>,
}

impl Log {
    /// A log that also goes into a new file in `folder`.
    ///
    /// # Errors
    /// The file cannot be created.
    pub(crate) fn create(folder: &Path, verbosity: i32) -> Result<Self> {
        let path = folder.join(file_name());
        let file = File::create(&path).map_err(|e| Error::io(&path, "create", e))?;
        Ok(Log {
            verbosity,
            terminal: std::io::stdout().is_terminal(),
            state: Mutex::new(State { file: Some(file), stage: None }),
        })
    }

    /// A line for which verbosity `level` is needed.
    pub(crate) fn line(&self, level: i32, text: &str) {
        if level <= self.verbosity {
            let mut state = self.lock();
            let paused = state.stage.is_some();
            state.write(text, !paused);
        }
    }

    /// The largest and the present size of the process, where the system tells.
    pub(crate) fn memory(&self) {
        let Ok(status) = std::fs::read_to_string("/proc/self/status") else { return };
        self.line(0, "MEMORYINFO: {");
        let sizes = status.lines().filter(|l| l.starts_with("VmPeak:") || l.starts_with("VmSize:"));
        sizes.for_each(|line| self.line(0, &format!("\t{line}")));
        self.line(0, "} ENDINFO");
    }

    /// What ended the run.
    pub(crate) fn error(&self, text: &str) {
        self.important(&format!("error: {}", printable(text)));
    }

    fn important(&self, text: &str) {
        let mut state = self.lock();
        if self.terminal && state.stage.is_some() {
            print("\n");
        }
        state.write(text, true);
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl State {
    fn write(&mut self, text: &str, console: bool) {
        let line = format!("{} [App     ] {text}\n", duration::clock());
        if console {
            print(&line);
        }
        // A log that cannot be written must not stop the work.
        if let Some(file) = &mut self.file
            && file.write_all(line.as_bytes()).is_err()
        {
            self.file = None;
        }
    }
}

/// `DensifyPointCloud-<yymmddHHMMSS><6 hex digits>.log`; the digits differ between processes.
fn file_name() -> PathBuf {
    let nanos = std::time::SystemTime::now()
        .duration_since(std::time::UNIX_EPOCH)
        .map_or(0, |since| since.subsec_nanos());
    let unique = (std::process::id() ^ nanos) & 0xff_ffff;
    PathBuf::from(format!("DensifyPointCloud-{}{unique:06X}.log", duration::stamp()))
}

fn stage_name(stage: Stage) -> Option<&'static str> {
    match stage {
        Stage::PrepareImages | Stage::CheckLabels | Stage::RenderLabels | Stage::DrawViews => None,
        Stage::Estimate => Some("Estimated depth-maps"),
        Stage::Geometric { .. } => Some("Geometric-consistent estimated depth-maps"),
        Stage::Filter => Some("Filtered depth-maps"),
        Stage::Fuse => Some("Fused depth-maps"),
        Stage::Merge => Some("Merged depth-maps"),
    }
}

impl Listener for Log {
    fn event(&self, event: &Event) {
        match event {
            Event::Warning(text) => self.important(&format!("warning: {}", printable(text))),
            _ => {
                if let Some((level, text)) = message(event) {
                    self.line(level, &text);
                }
            }
        }
    }

    fn steps(&self, stage: Stage, done: usize, total: usize) {
        let Some(name) = stage_name(stage) else { return };
        let mut state = self.lock();
        let start = match state.stage {
            Some((current, start)) if current == stage => start,
            _ => {
                let now = Instant::now();
                state.stage = Some((stage, now));
                now
            }
        };
        let elapsed = start.elapsed();
        if done == total {
            state.stage = None;
            let blank = if self.terminal { format!("\r{:79}\r", "") } else { String::new() };
            print(&format!("{blank}{name} {total} (100%, {})\n", duration::text(elapsed)));
        } else if self.terminal && done > 0 {
            print(&format!("\r{}   ", running(name, done, total, elapsed)));
        }
    }
}

fn running(name: &str, done: usize, total: usize, elapsed: Duration) -> String {
    let share = done as f64 / total as f64;
    let left = elapsed.mul_f64((1.0 - share) / share);
    let [elapsed, left] = [elapsed, left].map(duration::text);
    format!("{name} {done} ({:.2}%, {elapsed}, ETA {left})...", share * 100.0)
}

/// OpenMVS's line for `event` and the verbosity it needs.
fn message(event: &Event) -> Option<(i32, String)> {
    let time = |elapsed: &Duration| duration::text(*elapsed);
    Some(match event {
        Event::Warning(text) | Event::Info(text) => (0, printable(text)),
        Event::Detail(text) => (2, printable(text)),
        // OpenMVS says nothing of the kind.
        Event::Planned(_) => return None,
        Event::SceneLoaded { scene, elapsed } => (0, scene_lines("loaded", "from", scene, elapsed)),
        Event::ImagesPrepared { images, elapsed } => (
            0,
            format!(
                "Preparing images for dense reconstruction completed: {images} images ({})",
                time(elapsed)
            ),
        ),
        Event::ViewsSelected { images, elapsed } => (
            0,
            format!(
                "Selecting images for dense reconstruction completed: {images} images ({})",
                time(elapsed)
            ),
        ),
        Event::Paired { reference, sources } => {
            (2, format!("Reference image {:3} paired with {} views", reference.0, sources.len()))
        }
        Event::DepthEstimated { reference, sources, size, elapsed } => (
            1,
            format!(
                "Depth-map for image {:3} estimated using {sources:2} images: {}x{} ({})",
                reference.0,
                size.0,
                size.1,
                time(elapsed)
            ),
        ),
        Event::DepthFiltered { reference, sources, discarded, processed, elapsed } => (
            1,
            format!(
                "Depth map {:3} filtered using {sources} other images: {discarded}/{processed} depths discarded ({})",
                reference.0,
                time(elapsed)
            ),
        ),
        Event::Fused { maps, depths, points, elapsed } => (
            0,
            format!(
                "Depth-maps fused and filtered: {maps} depth-maps, {depths} depths, {points} points ({}%%) ({})",
                (points * 100).checked_div(*depths).unwrap_or(0),
                time(elapsed)
            ),
        ),
        Event::DepthMapsCompleted { sparse_points, elapsed, .. } => {
            (0, format!("Densifying point-cloud completed: {sparse_points} points ({})", time(elapsed)))
        }
        Event::Densified { points, elapsed } => {
            (0, format!("Densifying point-cloud completed: {points} points ({})", time(elapsed)))
        }
        Event::CloudSaved { path, points, elapsed } => {
            (0, format!("Point-cloud '{}' saved: {points} points ({})", path.display(), time(elapsed)))
        }
        Event::SceneSaved { scene, elapsed, .. } => (0, scene_lines("saved", "to", scene, elapsed)),
    })
}

/// The lines about a scene that was read or written; project archives go without the name of a format.
fn scene_lines(done: &str, to: &str, scene: &SceneSummary, elapsed: &Duration) -> String {
    let format = if scene.interface { format!(" {to} interface format") } else { String::new() };
    let SceneSummary { images, calibrated, points, .. } = scene;
    format!(
        "Scene {done}{format} ({}):\n\t{images} images ({calibrated} calibrated)\n\t{points} points, 0 vertices, \
         0 faces",
        duration::text(*elapsed)
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::ImageId;

    #[test]
    fn completion_lines_are_openmvs_own() {
        let ms = Duration::from_millis(57);
        for (event, expected) in [
            (
                Event::Fused { maps: 6, depths: 132_021, points: 24_171, elapsed: ms },
                "Depth-maps fused and filtered: 6 depth-maps, 132021 depths, 24171 points (18%%) (57ms)",
            ),
            (
                Event::Densified { points: 24_171, elapsed: ms },
                "Densifying point-cloud completed: 24171 points (57ms)",
            ),
            (
                Event::DepthEstimated { reference: ImageId(3), sources: 5, size: (200, 150), elapsed: ms },
                "Depth-map for image   3 estimated using  5 images: 200x150 (57ms)",
            ),
            (
                Event::ImagesPrepared { images: 6, elapsed: ms },
                "Preparing images for dense reconstruction completed: 6 images (57ms)",
            ),
            (
                Event::CloudSaved { path: "scene_dense.ply".into(), points: 7, elapsed: ms },
                "Point-cloud 'scene_dense.ply' saved: 7 points (57ms)",
            ),
        ] {
            assert_eq!(message(&event).unwrap().1, expected);
        }
    }

    #[test]
    fn scenes_are_summed_up_after_a_colon() {
        let scene = SceneSummary { interface: true, images: 6, calibrated: 6, points: 6344 };
        let event = Event::SceneSaved { path: "a.mvs".into(), scene, elapsed: Duration::from_millis(1) };
        assert_eq!(
            message(&event).unwrap().1,
            "Scene saved to interface format (1ms):\n\t6 images (6 calibrated)\n\t6344 points, 0 vertices, 0 faces"
        );
    }

    #[test]
    fn log_files_are_named_by_time() {
        let name = file_name().into_os_string().into_string().unwrap();
        let stem = name.strip_prefix("DensifyPointCloud-").unwrap().strip_suffix(".log").unwrap();
        assert_eq!(stem.len(), 18, "{name}");
    }
}
