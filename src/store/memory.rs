//! How much memory there is, asked before much of it is taken.

use crate::error::{Error, Result};
use std::path::{Path, PathBuf};

/// Share of the memory of the machine, or of what its control group allows, that a run takes at most unless more is asked
/// for.
const SHARE: f64 = 0.7;

/// What counts as without bound: more than any machine has, and small enough to be reckoned with.
const UNBOUNDED: u64 = u64::MAX >> 4;

/// Bytes that a run may take in all: `typed`, else 70 % of what the machine has or the control group allows; without
/// bound where nothing is known.
pub(crate) fn allowed(typed: Option<u64>) -> u64 {
    let machine = read("/proc/meminfo").and_then(|text| field(&text, "MemTotal:")).map(|kib| kib << 10);
    let there = [machine, group(|folder| number_in(folder, "memory.max"))].into_iter().flatten().min();
    let share = there.map(|bytes| (bytes as f64 * SHARE) as u64);
    let stated = std::env::var(LIMIT_VARIABLE).ok().and_then(|v| v.trim().parse::<u64>().ok());
    let default = [share, stated.map(|mib| mib << 20)].into_iter().flatten().min();
    typed.or(default).unwrap_or(UNBOUNDED).min(UNBOUNDED)
}

/// Largest resident size of this process so far, bytes.
pub(crate) fn peak() -> Option<u64> {
    read("/proc/self/status").and_then(|text| field(&text, "VmHWM:")).map(|kib| kib << 10)
}

/// Environment variable that says how many MiB may be used, less than there are.
pub(crate) const LIMIT_VARIABLE: &str = "SEMVS_MEMORY_MIB";

/// Refuses to begin `work` that needs at least `bytes` if there are fewer. Where nothing is known there is enough.
///
/// # Errors
/// [`Error::OutOfMemory`] that says what to do.
pub(crate) fn require(bytes: u64, work: &str) -> Result<()> {
    match available() {
        Some(there) if there < bytes => Err(Error::OutOfMemory(format!(
            "{work} needs at least {} MiB, {} MiB are free: give fewer --max-threads, a lower --max-resolution, or \
             split the scene with --sub-scene-area",
            bytes >> 20,
            there >> 20
        ))),
        _ => Ok(()),
    }
}

/// Bytes that this process can still take: what the machine has free, or its control group allows, or
/// [`LIMIT_VARIABLE`] says, whichever is least.
fn available() -> Option<u64> {
    let typed = std::env::var(LIMIT_VARIABLE).ok().and_then(|v| v.trim().parse::<u64>().ok());
    let machine = read("/proc/meminfo").and_then(|text| field(&text, "MemAvailable:")).map(|kib| kib << 10);
    [typed.map(|mib| mib << 20), machine, group(left_in)].into_iter().flatten().min()
}

/// The least that `of` says of the control groups of this process and those above them.
fn group(of: impl Fn(&Path) -> Option<u64>) -> Option<u64> {
    let text = read("/proc/self/cgroup")?;
    let own = text.lines().find_map(|line| line.strip_prefix("0::"))?.trim_start_matches('/').to_owned();
    let root = Path::new("/sys/fs/cgroup");
    let mut folder = root.join(own);
    let mut least = None;
    loop {
        least = [least, of(&folder)].into_iter().flatten().min();
        if folder == root || !folder.pop() || !folder.starts_with(root) {
            return least;
        }
    }
}

/// What one control group leaves; files that are only cached can be given up.
fn left_in(folder: &Path) -> Option<u64> {
    let number = |name: &str| number_in(folder, name);
    let limit = number("memory.max")?;
    let cached = read(folder.join("memory.stat")).and_then(|text| field(&text, "inactive_file")).unwrap_or(0);
    Some(limit.saturating_sub(number("memory.current")?.saturating_sub(cached)))
}

/// The number in a file of a control group.
fn number_in(folder: &Path, name: &str) -> Option<u64> {
    read(folder.join(name))?.trim().parse().ok()
}

/// The number after `name` in a table of names and numbers.
fn field(text: &str, name: &str) -> Option<u64> {
    let line = text.lines().find_map(|line| line.strip_prefix(name))?;
    line.split_whitespace().next()?.parse().ok()
}

fn read(path: impl Into<PathBuf>) -> Option<String> {
    std::fs::read_to_string(path.into()).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_of_the_system_are_read() {
        let text = "MemTotal:  100 kB\nMemAvailable:   42 kB\ninactive_file 7\n";
        assert_eq!(field(text, "MemAvailable:"), Some(42));
        assert_eq!(field(text, "inactive_file"), Some(7));
        assert_eq!(field(text, "SwapFree:"), None);
    }

    #[test]
    fn groups_leave_what_they_allow_less_what_is_used() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
        assert_eq!(left_in(folder.path()), None);
        write("memory.current", "700\n");
        write("memory.max", "max\n");
        assert_eq!(left_in(folder.path()), None, "no limit");
        write("memory.max", "1000\n");
        assert_eq!(left_in(folder.path()), Some(300));
        write("memory.stat", "anon 1\ninactive_file 200\n");
        assert_eq!(left_in(folder.path()), Some(500));
    }

    #[test]
    fn any_bound_can_be_reckoned_with() {
        assert_eq!(allowed(Some(5 << 20)), 5 << 20);
        assert!(allowed(Some(u64::MAX)).checked_mul(8).is_some());
        assert!(allowed(None).checked_mul(8).is_some());
    }

    #[test]
    fn only_what_is_not_there_is_refused() {
        assert!(require(1 << 20, "a little").is_ok());
        if cfg!(target_os = "linux") {
            let error = require(1 << 60, "too much").unwrap_err();
            assert!(matches!(error, Error::OutOfMemory(_)) && error.to_string().contains("--max-threads"));
        }
    }
}
