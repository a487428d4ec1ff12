//! A folder that one run at a time works in, and what a run that was killed has left there.

use super::atomic::TEMPORARY;
use crate::error::{Error, Result};
use std::fs::{File, TryLockError};
use std::io::{Read, Write};
use std::path::{Path, PathBuf};

/// Name of the file that is locked while a run works in its folder.
pub(crate) const LOCK_NAME: &str = ".semvs.lock";

/// The right to change the depth maps in a folder; given up when dropped, or when the process ends in any way.
#[derive(Debug)]
pub(crate) struct FolderLock {
    path: PathBuf,
    /// `None`: the file system has no locks.
    file: Option<File>,
}

impl FolderLock {
    /// Takes `folder`, which exists.
    ///
    /// # Errors
    /// Another run has it, or the lock file cannot be created.
    pub(crate) fn take(folder: &Path) -> Result<Self> {
        let path = folder.join(LOCK_NAME);
        loop {
            let mut options = File::options();
            let open = options.read(true).write(true).create(true).truncate(false).open(&path);
            let mut file = open.map_err(|e| Error::io(&path, "create", e))?;
            match file.try_lock() {
                Ok(()) => {}
                Err(TryLockError::WouldBlock) => return Err(taken(folder, file)),
                Err(TryLockError::Error(_)) => return Ok(FolderLock { path, file: None }),
            }
            // Whoever had the lock deletes the file at the end; then this is another one than the next run will find.
            if !is_at(&file, &path) {
                continue;
            }
            // What it says is for people.
            let _ = file.set_len(0).and_then(|()| file.write_all(std::process::id().to_string().as_bytes()));
            return Ok(FolderLock { path, file: Some(file) });
        }
    }

    /// Refuses to read from `folder` while a run changes it.
    ///
    /// # Errors
    /// Such a run is under way.
    pub(crate) fn check_free(folder: &Path) -> Result<()> {
        let Ok(file) = File::open(folder.join(LOCK_NAME)) else { return Ok(()) };
        match file.try_lock_shared() {
            Err(TryLockError::WouldBlock) => Err(taken(folder, file)),
            _ => Ok(()),
        }
    }
}

impl Drop for FolderLock {
    fn drop(&mut self) {
        if self.file.is_some() {
            // Left behind it does no harm: it is not locked any more.
            let _ = std::fs::remove_file(&self.path);
        }
    }
}

fn taken(folder: &Path, file: File) -> Error {
    let mut process = String::new();
    let _ = file.take(20).read_to_string(&mut process);
    let who = if process.is_empty() { String::new() } else { format!(" (process {process})") };
    Error::content(
        folder,
        format!("another run{who} is working in this folder; wait for its end or give another one (-w)"),
    )
}

/// Whether `path` still names `file`.
fn is_at(file: &File, path: &Path) -> bool {
    #[cfg(unix)]
    {
        use std::os::unix::fs::MetadataExt;
        let place = |metadata: &std::fs::Metadata| (metadata.dev(), metadata.ino());
        matches!((file.metadata(), std::fs::metadata(path)), (Ok(a), Ok(b)) if place(&a) == place(&b))
    }
    #[cfg(not(unix))]
    {
        let _ = file;
        path.exists()
    }
}

/// Deletes the temporary files in `folder` whose run is no more; returns how many there were.
pub(crate) fn sweep(folder: &Path) -> usize {
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let Ok(entries) = std::fs::read_dir(folder) else { return 0 };
    let is_ours = |name: &[u8]| name.starts_with(b".") && name.ends_with(TEMPORARY.as_bytes());
    let stale = entries.flatten().filter(|entry| is_ours(entry.file_name().as_encoded_bytes()));
    let delete = |path: PathBuf| {
        // Who still writes it holds a lock.
        let file = File::options().write(true).open(&path).ok()?;
        file.try_lock().ok()?;
        std::fs::remove_file(&path).ok()
    };
    stale.filter_map(|entry| delete(entry.path())).count()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::atomic::AtomicFile;

    #[test]
    fn a_folder_has_one_run_at_a_time() {
        let scratch = tempfile::tempdir().unwrap();
        FolderLock::check_free(scratch.path()).unwrap();
        let lock = FolderLock::take(scratch.path()).unwrap();
        let error = FolderLock::take(scratch.path()).unwrap_err().to_string();
        assert!(error.contains("another run") && error.contains("-w"), "{error}");
        assert!(error.contains(&std::process::id().to_string()), "{error}");
        assert!(FolderLock::check_free(scratch.path()).is_err());
        drop(lock);
        assert_eq!(std::fs::read_dir(scratch.path()).unwrap().count(), 0);
        FolderLock::check_free(scratch.path()).unwrap();
        // A process that was killed leaves the file, but no lock.
        std::fs::write(scratch.path().join(LOCK_NAME), "1").unwrap();
        FolderLock::take(scratch.path()).unwrap();
    }

    #[test]
    fn only_files_without_a_writer_are_swept() {
        let scratch = tempfile::tempdir().unwrap();
        let mut writing = AtomicFile::create(&scratch.path().join("a.ply")).unwrap();
        let stale = scratch.path().join(format!(".b.ply.Xx1234{TEMPORARY}"));
        std::fs::write(&stale, "half").unwrap();
        std::fs::write(scratch.path().join(".other.tmp"), "").unwrap();
        assert_eq!(sweep(scratch.path()), 1);
        assert!(!stale.exists());
        writing.write_all(b"whole").unwrap();
        writing.commit().unwrap();
        assert_eq!(std::fs::read(scratch.path().join("a.ply")).unwrap(), b"whole");
        assert_eq!(std::fs::read_dir(scratch.path()).unwrap().count(), 2);
    }
}
