//! Durations and times as text.

use std::time::{Duration, SystemTime, UNIX_EPOCH};

/// `1h2m3s45ms`, units that are zero left out, never empty.
pub(crate) fn text(duration: Duration) -> String {
    let ms = duration.as_millis();
    let parts = [(ms / 3_600_000, "h"), (ms / 60_000 % 60, "m"), (ms / 1000 % 60, "s"), (ms % 1000, "ms")];
    let text: String = parts.iter().filter(|(n, _)| *n > 0).map(|(n, unit)| format!("{n}{unit}")).collect();
    if text.is_empty() { "0ms".to_owned() } else { text }
}

/// A moment of the civil calendar, in UTC.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Moment {
    pub(crate) year: i64,
    pub(crate) month: u32,
    pub(crate) day: u32,
    pub(crate) hour: u32,
    pub(crate) minute: u32,
    pub(crate) second: u32,
}

impl Moment {
    /// The present.
    pub(crate) fn now() -> Self {
        let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        Moment::from_unix(since.as_secs())
    }

    /// `seconds` after 1970-01-01T00:00:00Z.
    #[allow(clippy::cast_possible_truncation, clippy::cast_possible_wrap)]
    pub(crate) fn from_unix(seconds: u64) -> Self {
        let of_day = (seconds % 86_400) as u32;
        let (year, month, day) = civil_from_days((seconds / 86_400) as i64);
        Moment { year, month, day, hour: of_day / 3600, minute: of_day / 60 % 60, second: of_day % 60 }
    }

    /// `HH:MM:SS`.
    pub(crate) fn clock(self) -> String {
        format!("{:02}:{:02}:{:02}", self.hour, self.minute, self.second)
    }

    /// `yymmddHHMMSS`.
    pub(crate) fn stamp(self) -> String {
        format!(
            "{:02}{:02}{:02}{:02}{:02}{:02}",
            self.year.rem_euclid(100),
            self.month,
            self.day,
            self.hour,
            self.minute,
            self.second
        )
    }
}

/// Proleptic Gregorian date of a day counted from 1970-01-01 (Hinnant 2013, "chrono-compatible low-level
/// date algorithms").
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
fn civil_from_days(days: i64) -> (i64, u32, u32) {
    let z = days + 719_468;
    let era = z.div_euclid(146_097);
    let doe = z.rem_euclid(146_097);
    let yoe = (doe - doe / 1460 + doe / 36_524 - doe / 146_096) / 365;
    let doy = doe - (365 * yoe + yoe / 4 - yoe / 100);
    let mp = (5 * doy + 2) / 153;
    let day = (doy - (153 * mp + 2) / 5 + 1) as u32;
    let month = if mp < 10 { mp + 3 } else { mp - 9 } as u32;
    (yoe + era * 400 + i64::from(month <= 2), month, day)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_leave_out_zero_units() {
        for (ms, expected) in
            [(0, "0ms"), (45, "45ms"), (3_723_045, "1h2m3s45ms"), (3_600_000, "1h"), (60_001, "1m1ms")]
        {
            assert_eq!(text(Duration::from_millis(ms)), expected);
        }
    }

    #[test]
    fn moments_of_the_calendar() {
        assert_eq!(Moment::from_unix(951_782_400 + 3661).stamp(), "000229010101");
        assert_eq!(Moment::from_unix(1_735_689_599).stamp(), "241231235959");
        assert_eq!(Moment::from_unix(0).clock(), "00:00:00");
    }
}
