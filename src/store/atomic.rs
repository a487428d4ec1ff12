//! Outputs that appear whole or not at all.

use super::faults::{self, Access};
use super::space::with_room;
use crate::error::{Error, Result};
use std::fs::File;
use std::io::{BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// Bytes gathered before they go to the file.
const BUFFER: usize = 1 << 20;
/// How names of temporary files end.
pub(crate) const TEMPORARY: &str = ".semvs-tmp";

/// A file that is written under a temporary name in its folder and takes its name when it is complete.
///
/// Dropped without [`AtomicFile::commit`], it leaves nothing behind and what was there before stays. A target that
/// is neither file nor folder (a pipe, `/dev/stdout`) is written directly.
#[derive(Debug)]
pub(crate) struct AtomicFile {
    writer: BufWriter<Medium>,
    temporary: Option<tempfile::TempPath>,
    path: PathBuf,
}

impl AtomicFile {
    /// Starts to write `path`; missing folders are created.
    ///
    /// # Errors
    /// [`Error`] if the folder cannot be created or written, or `path` is a folder.
    pub(crate) fn create(path: &Path) -> Result<Self> {
        if let Ok(metadata) = std::fs::metadata(path) {
            if metadata.is_dir() {
                return Err(Error::content(path, "cannot write: a folder has this name; give a file name"));
            }
            if !metadata.is_file() {
                let file = File::options().write(true).open(path).map_err(|e| Error::io(path, "write", e))?;
                let writer =
                    BufWriter::with_capacity(BUFFER, Medium { file, path: path.to_owned(), written: 0 });
                return Ok(AtomicFile { writer, temporary: None, path: path.to_owned() });
            }
        }
        let folder = folder_of(path);
        create_folder(folder)?;
        let named = temporary_beside(path, folder)
            .map_err(|e| locked(path, folder, e, "write (its folder refuses)"))?;
        let (file, temporary) = named.into_parts();
        // Tells those who sweep that it is in use; where there are no locks nobody sweeps.
        let _ = file.try_lock();
        let writer = BufWriter::with_capacity(BUFFER, Medium { file, path: path.to_owned(), written: 0 });
        Ok(AtomicFile { writer, temporary: Some(temporary), path: path.to_owned() })
    }

    /// Completes the file: brings it to the medium and gives it its name, replacing what had it.
    ///
    /// # Errors
    /// [`Error::Io`] if the medium fails; then nothing has changed.
    pub(crate) fn commit(self) -> Result<()> {
        self.complete(true)
    }

    /// The same for a file that can be made again: after a power failure it may be damaged under its name.
    ///
    /// # Errors
    /// As [`AtomicFile::commit`].
    pub(crate) fn commit_passing(self) -> Result<()> {
        self.complete(false)
    }

    fn complete(self, lasting: bool) -> Result<()> {
        let AtomicFile { mut writer, temporary, path } = self;
        writer.flush().map_err(|e| Error::io(&path, "write", e))?;
        let Some(temporary) = temporary else { return Ok(()) };
        if lasting {
            writer.get_ref().sync().map_err(|e| Error::io(&path, "write", e))?;
        }
        drop(writer);
        faults::meet(Access::Rename, &path).map_err(|e| Error::io(&path, "replace", e))?;
        temporary.persist(&path).map_err(|e| Error::io(&path, "replace", e.error))?;
        if lasting {
            sync_folder(folder_of(&path));
        }
        Ok(())
    }
}

/// The file itself.
#[derive(Debug)]
struct Medium {
    file: File,
    path: PathBuf,
    written: u64,
}

impl Medium {
    fn sync(&self) -> std::io::Result<()> {
        faults::meet(Access::Sync, &self.path)?;
        self.file.sync_all()
    }
}

impl Write for Medium {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        let length = faults::meet_write(&self.path, bytes.len());
        match length.and_then(|length| self.file.write(&bytes[..length])) {
            Ok(length) => {
                self.written += length as u64;
                Ok(length)
            }
            Err(e) => Err(with_room(e, folder_of(&self.path), self.written)),
        }
    }
    fn flush(&mut self) -> std::io::Result<()> {
        self.file.flush()
    }
}

impl Seek for Medium {
    fn seek(&mut self, to: SeekFrom) -> std::io::Result<u64> {
        self.file.seek(to)
    }
}

impl Write for AtomicFile {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.writer.write(bytes)
    }
    fn write_all(&mut self, bytes: &[u8]) -> std::io::Result<()> {
        self.writer.write_all(bytes)
    }
    fn flush(&mut self) -> std::io::Result<()> {
        self.writer.flush()
    }
}

impl Seek for AtomicFile {
    fn seek(&mut self, to: SeekFrom) -> std::io::Result<u64> {
        self.writer.seek(to)
    }
}

/// Writes `bytes` to `path`, whole or not at all.
///
/// # Errors
/// As [`AtomicFile::create`] and [`AtomicFile::commit`].
pub(crate) fn write_file(path: &Path, bytes: &[u8]) -> Result<()> {
    let mut file = AtomicFile::create(path)?;
    file.write_all(bytes).map_err(|e| Error::io(path, "write", e))?;
    file.commit()
}

/// Checks that `path` can be written, creating missing folders and nothing else; to be called before long work.
///
/// # Errors
/// As [`AtomicFile::create`].
pub(crate) fn check_writable(path: &Path) -> Result<()> {
    AtomicFile::create(path).map(drop)
}

/// Creates `folder` and the folders above it where they are missing.
///
/// # Errors
/// [`Error`] if a file is in the way or the system refuses.
pub(crate) fn create_folder(folder: &Path) -> Result<()> {
    if folder.is_dir() {
        return Ok(());
    }
    if let Some(file) = folder.ancestors().find(|a| a.exists() && !a.is_dir()) {
        let what = format!("cannot create the folder {}: a file is in the way; move it", folder.display());
        return Err(Error::content(file, what));
    }
    let above = folder.ancestors().skip(1).find(|a| a.is_dir()).unwrap_or(Path::new("."));
    std::fs::create_dir_all(folder).map_err(|e| locked(folder, above, e, "create folder"))
}

/// What to do when `folder` may not be written in, which `path` needs; else what the system says.
fn locked(path: &Path, folder: &Path, error: std::io::Error, action: &'static str) -> Error {
    use std::io::ErrorKind::{PermissionDenied, ReadOnlyFilesystem};
    match error.kind() {
        PermissionDenied | ReadOnlyFilesystem => Error::content(
            path,
            format!(
                "cannot {}: {} may not be written in; choose another place (-o, -w), or change its permissions",
                action.split(" (").next().unwrap_or_default(),
                std::path::absolute(folder).as_deref().unwrap_or(folder).display()
            ),
        ),
        _ => Error::io(path, action, error),
    }
}

/// Brings the names in `folder` to the medium, where the system can.
pub(crate) fn sync_folder(folder: &Path) {
    #[cfg(unix)]
    if let Ok(folder) = File::open(folder) {
        // The file itself is safe; a file system that cannot do this has its own ways.
        let _ = folder.sync_all();
    }
    #[cfg(not(unix))]
    let _ = folder;
}

/// The folder that holds `path`.
fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

/// A new hidden file in `folder`, with the permissions that a plain new file gets.
fn temporary_beside(path: &Path, folder: &Path) -> std::io::Result<tempfile::NamedTempFile> {
    let mut prefix = std::ffi::OsString::from(".");
    prefix.push(path.file_name().unwrap_or_default());
    prefix.push(".");
    let mut builder = tempfile::Builder::new();
    builder.prefix(&prefix).suffix(TEMPORARY);
    #[cfg(unix)]
    let plain = std::os::unix::fs::PermissionsExt::from_mode(0o666);
    #[cfg(unix)]
    builder.permissions(plain);
    builder.tempfile_in(folder)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let entries = std::fs::read_dir(folder).unwrap();
        let mut names: Vec<_> = entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    #[test]
    fn commits_whole_files_into_new_folders() {
        let scratch = tempfile::tempdir().unwrap();
        let path = scratch.path().join("a/b/c.bin");
        write_file(&path, b"first").unwrap();
        write_file(&path, b"second").unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"second");
        assert_eq!(names(path.parent().unwrap()), ["c.bin"]);
    }

    #[test]
    fn an_abandoned_file_changes_nothing() {
        let scratch = tempfile::tempdir().unwrap();
        let path = scratch.path().join("cloud.ply");
        write_file(&path, b"before").unwrap();
        let mut file = AtomicFile::create(&path).unwrap();
        file.write_all(b"half of the ne").unwrap();
        drop(file);
        check_writable(&path).unwrap();
        check_writable(&scratch.path().join("other.ply")).unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"before");
        assert_eq!(names(scratch.path()), ["cloud.ply"]);
    }

    #[test]
    fn what_is_in_the_way_is_named() {
        let scratch = tempfile::tempdir().unwrap();
        let file = scratch.path().join("file");
        write_file(&file, b"").unwrap();
        let error = check_writable(&file.join("x/y.ply")).unwrap_err().to_string();
        assert!(error.contains("a file is in the way") && error.contains("file"), "{error}");
        let error = check_writable(scratch.path()).unwrap_err().to_string();
        assert!(error.contains("a folder has this name"), "{error}");
    }

    #[cfg(unix)]
    #[test]
    fn new_files_get_ordinary_permissions() {
        use std::os::unix::fs::PermissionsExt;
        let scratch = tempfile::tempdir().unwrap();
        let plain = scratch.path().join("plain");
        std::fs::write(&plain, b"").unwrap();
        let ours = scratch.path().join("ours");
        write_file(&ours, b"").unwrap();
        let mode = |path: &Path| std::fs::metadata(path).unwrap().permissions().mode();
        assert_eq!(mode(&ours), mode(&plain));
    }
}
