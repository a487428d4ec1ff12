//! Clouds of an earlier run beside those of this one.

use super::cloud_names::{CloudFormat, stem};
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

/// Bytes at the start of a cloud in which its classes are listed.
const HEADER_BYTES: u64 = 64 << 10;

/// The clouds beside `cloud` that hold one of its classes or show their colours and are not among `written`, sorted:
/// files `x.PART.ply` for `x.ply` whose header lists classes, and so for LAS and LAZ.
pub(super) fn stale_clouds(cloud: &Path, written: &[&Path]) -> Vec<PathBuf> {
    let folder = cloud.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let stem = stem(cloud).to_string_lossy().into_owned();
    let extension = match CloudFormat::of(cloud) {
        CloudFormat::Ply => ".ply",
        CloudFormat::Las => ".las",
        CloudFormat::Laz => ".laz",
    };
    let Ok(entries) = std::fs::read_dir(folder) else { return Vec::new() };
    let is_part = |name: &str| {
        let part = name.strip_prefix(&stem).and_then(|rest| rest.strip_prefix('.'));
        part.and_then(|part| part.strip_suffix(extension))
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
    let mut head = Vec::new();
    let read = File::open(path).and_then(|file| file.take(HEADER_BYTES).read_to_end(&mut head));
    let holds = |head: &[u8], text: &[u8]| head.windows(text.len()).any(|w| w == text);
    let lists = if head.starts_with(b"LASF") {
        // The dimension that only this program writes.
        holds(&head, b"label_confidence")
    } else {
        let end = head.windows(11).position(|w| w == b"\nend_header").unwrap_or(head.len());
        head.starts_with(b"ply") && holds(&head[..end], b"\ncomment class ")
    };
    read.is_ok() && lists
}
