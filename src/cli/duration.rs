//! Durations and times as text.

use chrono::Local;
use std::time::Duration;

/// `1h2m3s45ms`, units that are zero left out, never empty.
pub(crate) fn text(duration: Duration) -> String {
    let ms = duration.as_millis();
    let parts = [(ms / 3_600_000, "h"), (ms / 60_000 % 60, "m"), (ms / 1000 % 60, "s"), (ms % 1000, "ms")];
    let text: String = parts.iter().filter(|(n, _)| *n > 0).map(|(n, unit)| format!("{n}{unit}")).collect();
    if text.is_empty() { "0ms".to_owned() } else { text }
}

/// The present in local time, `HH:MM:SS`.
pub(crate) fn clock() -> String {
    Local::now().format("%H:%M:%S").to_string()
}

/// The present in local time, `yymmddHHMMSS`.
pub(crate) fn stamp() -> String {
    Local::now().format("%y%m%d%H%M%S").to_string()
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
}
