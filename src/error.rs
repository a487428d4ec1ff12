//! The one error type of the library: what was wrong, where, and what to do.

use std::path::{Path, PathBuf};

/// Result of this library's functions.
pub type Result<T> = std::result::Result<T, Error>;

/// What went wrong. Every message is one line that names the place and, where there is one, the remedy.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A file could not be opened, read, written or renamed.
    #[error("{}: cannot {action}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// Verb phrase: "open", "write", "create folder", ...
        action: &'static str,
        /// What the system said.
        source: std::io::Error,
    },
    /// A file breaks its format.
    #[error("{}: {source}", path.display())]
    Format {
        /// The file.
        path: PathBuf,
        /// The broken rule.
        source: semvs_formats::Error,
    },
    /// A file was read but what it holds cannot be used.
    #[error("{}: {what}", path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// What is wrong with it and what to do.
        what: String,
    },
    /// More memory is needed than there is.
    #[error("out of memory: {0}")]
    OutOfMemory(String),
    /// The work was stopped by whoever asked for it.
    #[error("interrupted; what is complete is kept, the same command goes on from there")]
    Interrupted,
    /// The scene or the options cannot be used as given.
    #[error("{0}")]
    Invalid(String),
}

impl Error {
    /// An [`Error::Io`] about `path`.
    pub(crate) fn io(path: &Path, action: &'static str, source: std::io::Error) -> Self {
        Error::Io { path: path.to_owned(), action, source }
    }

    /// An [`Error::Format`] about `path`, which was read; what the medium did wrong becomes an [`Error::Io`].
    pub(crate) fn format(path: &Path, source: semvs_formats::Error) -> Self {
        Error::of_file(path, "read", source)
    }

    /// An [`Error::Format`] about `path`, which was written; what the medium did wrong becomes an [`Error::Io`].
    pub(crate) fn writing(path: &Path, source: semvs_formats::Error) -> Self {
        Error::of_file(path, "write", source)
    }

    fn of_file(path: &Path, action: &'static str, source: semvs_formats::Error) -> Self {
        match source {
            semvs_formats::Error::Io(source) => Error::io(path, action, source),
            source => Error::Format { path: path.to_owned(), source },
        }
    }

    /// An [`Error::Content`] about `path`.
    pub(crate) fn content(path: &Path, what: impl Into<String>) -> Self {
        Error::Content { path: path.to_owned(), what: what.into() }
    }

    /// An [`Error::Invalid`].
    pub(crate) fn invalid(what: impl Into<String>) -> Self {
        Error::Invalid(what.into())
    }
}
