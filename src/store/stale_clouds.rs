//! Clouds of an earlier run beside those of this one.

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

/// Bytes at the start of a cloud in which its classes are listed.
const HEADER_BYTES: u64 = 64 << 10;

/// The clouds beside `cloud` that hold one of its classes or show their colours and are not among `written`, sorted:
/// files `x.PART.ply` for `x.ply` whose header lists classes.
pub(super) fn stale_clouds(cloud: &Path, written: &[&Path]) -> Vec<PathBuf> {
    let folder = cloud.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let Some(stem) = cloud.file_stem().map(|stem| stem.to_string_lossy().into_owned()) else {
        return Vec::new();
    };
    let Ok(entries) = std::fs::read_dir(folder) else { return Vec::new() };
    let is_part = |name: &str| {
        let part = name.strip_prefix(&stem).and_then(|rest| rest.strip_prefix('.'));
        part.and_then(|part| part.strip_suffix(".ply"))
            .is_some_and(|part| !part.is_empty() && !part.contains('.'))
    };
    let mut stale: Vec<PathBuf> = entries
        .filter_map(Result::ok)
        .filter(|entry| is_part(&entry.file_name().to_string_lossy()))
        .map(|entry| cloud.with_file_name(entry.file_name()))
        .filter(|path| path.is_file() && !written.contains(&path.as_path()) && lists_classes(path))
        .collect();
    stale.sort();
    stale
}

fn lists_classes(path: &Path) -> bool {
    const LINE: &[u8] = b"\ncomment class ";
    let mut head = Vec::new();
    let read = File::open(path).and_then(|file| file.take(HEADER_BYTES).read_to_end(&mut head));
    let end = head.windows(11).position(|w| w == b"\nend_header").unwrap_or(head.len());
    read.is_ok() && head.starts_with(b"ply") && head[..end].windows(LINE.len()).any(|w| w == LINE)
}
