//! What a run will take, in words, and how much of it is left.

use crate::progress::{Forecast, Stage};
use std::time::{Duration, Instant};

/// The line before the work begins.
pub(super) fn line(forecast: &Forecast) -> String {
    let Forecast { maps, size: (width, height), is_one_size, sources, threads, .. } = forecast;
    let maps = match maps {
        1 => "1 depth map".to_owned(),
        maps => format!("{maps} depth maps"),
    };
    let size = if *is_one_size { "" } else { "at most " };
    let neighbors = if *sources == 1 { "1 neighbour" } else { &format!("{sources} neighbours") };
    let threads = if *threads == 1 { "1 thread" } else { &format!("{threads} threads") };
    format!(
        "To make: {maps} of {size}{width}×{height} with about {neighbors} each: {} on {threads}, at most {} of memory",
        about(whole(forecast)),
        gigabytes(forecast.memory)
    )
}

/// The time of all stages.
fn whole(forecast: &Forecast) -> Duration {
    forecast.stages.iter().map(|(_, time)| *time).sum()
}

/// A time that is not known better than by a fifth.
pub(super) fn about(time: Duration) -> String {
    let seconds = time.as_secs_f64();
    let minutes = seconds / 60.0;
    match seconds {
        s if s < 1.5 => "about 1 s".to_owned(),
        s if s < 9.5 => format!("about {s:.0} s"),
        s if s < 57.5 => format!("about {:.0} s", (s / 5.0).round() * 5.0),
        _ if minutes < 9.5 => format!("about {minutes:.0} min"),
        _ if minutes < 57.5 => format!("about {:.0} min", (minutes / 5.0).round() * 5.0),
        _ if minutes < 9.5 * 60.0 => format!("about {:.1} h", minutes / 60.0),
        _ => format!("about {:.0} h", minutes / 60.0),
    }
}

/// Bytes as GB of 10⁹ bytes, rounded up.
fn gigabytes(bytes: u64) -> String {
    let tenths = bytes.div_ceil(100_000_000).max(1);
    format!("{}.{} GB", tenths / 10, tenths % 10)
}

/// How long a run that was forecast still takes, by the time that it has taken so far.
#[derive(Debug)]
pub(super) struct Remaining {
    forecast: Forecast,
    start: Instant,
}

impl Remaining {
    /// Of a run that begins now.
    pub(super) fn of(forecast: &Forecast) -> Self {
        Remaining { forecast: forecast.clone(), start: Instant::now() }
    }

    /// What is left when `done` of `total` steps of `stage` are done.
    pub(super) fn at(&self, stage: Stage, done: usize, total: usize) -> Option<Duration> {
        left(&self.forecast, self.start.elapsed(), stage, done, total)
    }
}

/// What is left of a run after `elapsed`: what was forecast for the rest, as much slower or faster as the work so far was.
/// `None` before the first step, and for stages that were not forecast.
fn left(forecast: &Forecast, elapsed: Duration, stage: Stage, done: usize, total: usize) -> Option<Duration> {
    let at = forecast.stages.iter().position(|(known, _)| *known == stage)?;
    let before: Duration = forecast.stages[..at].iter().map(|(_, time)| *time).sum();
    let share = done as f64 / total.max(1) as f64;
    let so_far = before.as_secs_f64() + share * forecast.stages[at].1.as_secs_f64();
    let rest = whole(forecast).as_secs_f64() - so_far;
    (so_far > 0.0).then(|| Duration::from_secs_f64((elapsed.as_secs_f64() * rest / so_far).max(0.0)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn forecast(seconds: [u64; 3]) -> Forecast {
        let stages = [Stage::Estimate, Stage::Geometric { pass: 0, passes: 1 }, Stage::Fuse];
        Forecast {
            maps: 16,
            size: (600, 450),
            is_one_size: true,
            sources: 6,
            threads: 2,
            stages: stages.into_iter().zip(seconds.map(Duration::from_secs)).collect(),
            memory: 290_000_000,
        }
    }

    #[test]
    fn the_line_says_how_much_how_long_and_how_large() {
        let mut forecast = forecast([6, 3, 1]);
        assert_eq!(
            line(&forecast),
            "To make: 16 depth maps of 600×450 with about 6 neighbours each: about 10 s on 2 threads, at most 0.3 GB of memory"
        );
        (forecast.maps, forecast.sources, forecast.threads, forecast.is_one_size) = (1, 1, 1, false);
        assert_eq!(
            line(&forecast),
            "To make: 1 depth map of at most 600×450 with about 1 neighbour each: about 10 s on 1 thread, at most 0.3 GB of memory"
        );
    }

    #[test]
    fn times_are_round_and_grow() {
        let said = |seconds: f64| about(Duration::from_secs_f64(seconds));
        for (seconds, expected) in [
            (0.0, "about 1 s"),
            (1.6, "about 2 s"),
            (9.4, "about 9 s"),
            (12.4, "about 10 s"),
            (57.4, "about 55 s"),
            (57.6, "about 1 min"),
            (130.0, "about 2 min"),
            (800.0, "about 15 min"),
            (3500.0, "about 1.0 h"),
            (9000.0, "about 2.5 h"),
            (90_000.0, "about 25 h"),
        ] {
            assert_eq!(said(seconds), expected, "{seconds}");
        }
        let value = |text: &str| -> f64 {
            let words: Vec<&str> = text.split(' ').collect();
            let unit =
                [("s", 1.0), ("min", 60.0), ("h", 3600.0)].iter().find(|(u, _)| *u == words[2]).unwrap().1;
            words[1].parse::<f64>().unwrap() * unit
        };
        let times: Vec<f64> = (0..400).map(|i| 1.04_f64.powi(i)).collect();
        for pair in times.windows(2) {
            let (a, b) = (value(&said(pair[0])), value(&said(pair[1])));
            assert!(a <= b, "{pair:?}: {a} {b}");
            assert!((a / pair[0] - 1.0).abs() < 0.5, "{pair:?}: {a}");
        }
    }

    #[test]
    fn memory_is_rounded_up() {
        assert_eq!(gigabytes(0), "0.1 GB");
        assert_eq!(gigabytes(300_000_000), "0.3 GB");
        assert_eq!(gigabytes(300_000_001), "0.4 GB");
        assert_eq!(gigabytes(12_340_000_000), "12.4 GB");
    }

    #[test]
    fn what_is_left_follows_the_speed_so_far() {
        let forecast = forecast([6, 3, 1]);
        let at = |elapsed, stage, done| left(&forecast, Duration::from_secs(elapsed), stage, done, 4);
        assert_eq!(at(0, Stage::Estimate, 0), None);
        assert_eq!(at(3, Stage::Estimate, 2), Some(Duration::from_secs(7)), "as forecast");
        assert_eq!(at(6, Stage::Estimate, 2), Some(Duration::from_secs(14)), "half as fast");
        assert_eq!(at(18, Stage::Fuse, 0), Some(Duration::from_secs(2)));
        assert_eq!(at(20, Stage::Fuse, 4), Some(Duration::ZERO));
        assert_eq!(at(20, Stage::Filter, 1), None, "not forecast");
    }
}
