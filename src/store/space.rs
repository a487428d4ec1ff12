//! How much room a disk has, asked before much is written and when there is none.

use crate::error::{Error, Result};
use std::path::Path;

/// Bytes that may still be written to the file system of `folder`; `None` where the system does not tell.
pub(crate) fn free(folder: &Path) -> Option<u64> {
    #[cfg(unix)]
    {
        let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
        let told = rustix::fs::statvfs(folder).ok()?;
        told.f_bavail.checked_mul(told.f_frsize)
    }
    #[cfg(not(unix))]
    {
        let _ = folder;
        None
    }
}

/// Refuses to begin `work` that writes `bytes` to `folder` if there is no room for them.
///
/// # Errors
/// [`Error::Content`] with what is needed and what is free.
pub(crate) fn require(folder: &Path, bytes: u64, work: &str) -> Result<()> {
    match free(folder) {
        Some(free) if free < bytes => Err(Error::content(
            folder,
            format!(
                "{work} need {} MiB on its disk, {} MiB are free: make room or give another folder (-w)",
                bytes.div_ceil(1 << 20),
                free >> 20
            ),
        )),
        _ => Ok(()),
    }
}

/// `error`, with the room that is left if that is what it is about.
pub(super) fn with_room(error: std::io::Error, folder: &Path, written: u64) -> std::io::Error {
    if error.kind() != std::io::ErrorKind::StorageFull {
        return error;
    }
    let free = free(folder).map_or("unknown".to_owned(), |free| format!("{} KiB", free >> 10));
    let told = format!("{error}; {} KiB of this file were written, {free} are free", written >> 10);
    std::io::Error::new(std::io::ErrorKind::StorageFull, told)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_needed_and_what_is_free_is_said() {
        let scratch = tempfile::tempdir().unwrap();
        assert!(require(scratch.path(), 1, "small things").is_ok());
        if free(scratch.path()).is_some() {
            let error = require(scratch.path(), 1 << 62, "depth maps").unwrap_err().to_string();
            assert!(
                error.contains("depth maps need 4398046511104 MiB") && error.contains("MiB are free"),
                "{error}"
            );
        }
        let full = with_room(std::io::Error::from(std::io::ErrorKind::StorageFull), scratch.path(), 5 << 10);
        assert!(full.to_string().contains("5 KiB of this file were written"), "{full}");
    }
}
