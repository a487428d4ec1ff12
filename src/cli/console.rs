//! What `semvs` says on stderr while it works: lines, and bars on a terminal.

use super::duration;
use super::forecast::{self, Remaining};
use super::one_line::printable;
use crate::progress::{Event, Listener, Stage};
use indicatif::{MultiProgress, ProgressBar, ProgressStyle};
use std::io::{IsTerminal, Write};
use std::sync::Mutex;
use std::time::{Duration, Instant};

/// How much is said.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Level {
    /// Errors alone, which the program itself prints.
    Errors,
    /// And warnings.
    Warnings,
    /// And what happens.
    Info,
    /// And what happens to every view.
    Detail,
    /// Everything.
    All,
}

impl Level {
    /// Level for `-v` given `verbose` times and `-q` given `quiet` times.
    pub(crate) fn of(verbose: u8, quiet: u8) -> Level {
        match (verbose, quiet) {
            (_, 2..) => Level::Errors,
            (_, 1) => Level::Warnings,
            (0, 0) => Level::Info,
            (1, 0) => Level::Detail,
            _ => Level::All,
        }
    }
}

/// Turns what work reports into log lines and bars.
pub(crate) struct Console {
    level: Level,
    bars: MultiProgress,
    /// Bars are drawn; otherwise every tenth of a stage gets a line.
    draw: bool,
    current: Mutex<Option<(Stage, ProgressBar)>>,
    /// How long the run still takes, if that was forecast.
    remaining: Mutex<Option<Remaining>>,
    /// When the last line about steps was printed.
    last_line: Mutex<Option<Instant>>,
}

/// Least time between two lines about the steps of a stage.
const LINE_INTERVAL: Duration = Duration::from_secs(2);

impl Console {
    /// Says what `level` asks for; bars are for terminals.
    pub(crate) fn new(level: Level) -> Self {
        let draw = std::io::stderr().is_terminal() && level >= Level::Info;
        Console {
            level,
            bars: MultiProgress::new(),
            draw,
            current: Mutex::default(),
            remaining: Mutex::default(),
            last_line: Mutex::default(),
        }
    }

    fn say(&self, level: Level, text: &str) {
        if level <= self.level {
            // A closed pipe must not stop the work.
            self.bars.suspend(|| {
                let _ = writeln!(std::io::stderr(), "{text}");
            });
        }
    }

    /// Whether it is time for another line; the first one of a stage waits too.
    fn is_due(&self) -> bool {
        let mut last = self.last_line.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        let now = Instant::now();
        let due = now.duration_since(*last.get_or_insert(now)) >= LINE_INTERVAL;
        if due {
            *last = Some(now);
        }
        due
    }

    /// What is left of the run, `, about 2 min left`; empty where that is not known.
    fn left(&self, stage: Stage, done: usize, total: usize) -> String {
        let remaining = self.remaining.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        let left = remaining.as_ref().and_then(|remaining| remaining.at(stage, done, total));
        left.map_or_else(String::new, |left| format!(", {} left", forecast::about(left)))
    }

    fn draw_steps(&self, stage: Stage, done: usize, total: usize) {
        let mut current = self.current.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        if current.as_ref().is_none_or(|(shown, _)| *shown != stage) {
            let bar = self.bars.add(ProgressBar::new(total as u64));
            if let Ok(style) =
                ProgressStyle::with_template("{msg:28} {wide_bar} {pos}/{len} {elapsed}{prefix}")
            {
                bar.set_style(style);
            }
            bar.set_message(stage.to_string());
            *current = Some((stage, bar));
        }
        if let Some((_, bar)) = current.as_ref() {
            // Threads may report out of order.
            bar.set_position(bar.position().max(done as u64));
            bar.set_prefix(match self.left(stage, done, total) {
                left if left.is_empty() && done > 0 => format!(", {} left", forecast::about(bar.eta())),
                left => left,
            });
            if done == total {
                bar.finish_and_clear();
                self.bars.remove(bar);
            }
        }
        if done == total {
            *current = None;
        }
    }
}

/// Whether step `done` of `total` is the first of a new tenth.
fn begins_a_tenth(done: usize, total: usize) -> bool {
    done > 0 && total > 0 && done * 10 / total > (done - 1) * 10 / total
}

impl Listener for Console {
    fn event(&self, event: &Event) {
        match event {
            Event::Warning(text) => self.say(Level::Warnings, &format!("warning: {}", printable(text))),
            Event::Detail(_) | Event::DepthEstimated { .. } | Event::DepthFiltered { .. } => {
                self.say(Level::Detail, &line(event));
            }
            Event::Paired { .. } => self.say(Level::All, &line(event)),
            Event::Planned(forecast) => {
                *self.remaining.lock().unwrap_or_else(std::sync::PoisonError::into_inner) =
                    Some(Remaining::of(forecast));
                self.say(Level::Info, &line(event));
            }
            _ => self.say(Level::Info, &line(event)),
        }
    }

    fn steps(&self, stage: Stage, done: usize, total: usize) {
        if self.draw {
            self.draw_steps(stage, done, total);
        } else if begins_a_tenth(done, total) && (done == total || self.is_due()) {
            self.say(Level::Info, &format!("{stage}: {done} of {total}{}", self.left(stage, done, total)));
        }
    }
}

fn line(event: &Event) -> String {
    let time = |elapsed: &Duration| duration::text(*elapsed);
    match event {
        Event::Warning(text) | Event::Info(text) | Event::Detail(text) => printable(text),
        Event::SceneLoaded { scene, elapsed } => format!(
            "Scene read: {} images ({} with a pose), {} points ({})",
            scene.images,
            scene.calibrated,
            scene.points,
            time(elapsed)
        ),
        Event::ImagesPrepared { images, elapsed } => format!("Images ready: {images} ({})", time(elapsed)),
        Event::ViewsSelected { images, .. } => format!("Images with neighbours: {images}"),
        Event::Planned(forecast) => forecast::line(forecast),
        Event::Paired { reference, sources } => {
            let sources: Vec<String> = sources.iter().map(ToString::to_string).collect();
            format!("Image {reference} is matched with {}", sources.join(" "))
        }
        Event::DepthEstimated { reference, sources, size, elapsed } => format!(
            "Depth map {reference}: {}×{} from {sources} neighbours ({})",
            size.0,
            size.1,
            time(elapsed)
        ),
        Event::DepthFiltered { reference, sources, discarded, processed, elapsed } => format!(
            "Depth map {reference} held against {sources} others: {discarded} of {processed} depths removed ({})",
            time(elapsed)
        ),
        Event::Fused { maps, depths, points, elapsed } => {
            format!("Fused {maps} depth maps: {depths} depths, {points} points ({})", time(elapsed))
        }
        Event::DepthMapsCompleted { maps, elapsed, .. } => {
            format!("Depth maps done: {maps} ({})", time(elapsed))
        }
        Event::Densified { points, elapsed } => format!("Dense cloud: {points} points ({})", time(elapsed)),
        Event::CloudSaved { path, points, .. } => format!("Wrote {}: {points} points", path.display()),
        Event::SceneSaved { path, .. } => format!("Wrote {}", path.display()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plain_output_has_ten_lines_per_stage_at_most() {
        for total in [1, 7, 10, 11, 1000] {
            let lines = (0..=total).filter(|&done| begins_a_tenth(done, total)).count();
            assert!(lines == total.min(10), "{total}: {lines}");
            assert!(begins_a_tenth(total, total));
        }
    }

    #[test]
    fn verbosity_levels() {
        assert_eq!(Level::of(0, 0), Level::Info);
        assert_eq!(Level::of(1, 0), Level::Detail);
        assert_eq!(Level::of(3, 0), Level::All);
        assert_eq!(Level::of(0, 1), Level::Warnings);
        assert_eq!(Level::of(0, 2), Level::Errors);
    }
}
