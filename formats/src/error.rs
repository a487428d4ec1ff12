//! What can be wrong with a file, and the budget a reader may spend on it.

use std::io;

/// Result of reading or writing a file of this crate.
pub type Result<T> = std::result::Result<T, Error>;

/// What went wrong, by who is at fault: the medium, the file, the budget, or this crate's coverage.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The medium failed; trying again may help.
    #[error("{0}")]
    Io(#[from] io::Error),
    /// The file breaks a rule of its format.
    #[error("{what} in {field} at byte {offset}")]
    Format {
        /// Byte offset in the (decompressed) file at which the rule was found broken.
        offset: u64,
        /// Dotted path of the field, such as `images[3].name`.
        field: String,
        /// The broken rule with the offending values.
        what: String,
    },
    /// Reading on would exceed the [`Limits`].
    #[error("{field} needs {needed} bytes, the limit is {limit}")]
    Limits {
        /// What was about to be allocated.
        field: String,
        /// Bytes it would take.
        needed: u64,
        /// Bytes allowed.
        limit: u64,
    },
    /// A value that was read, or is about to be written, cannot be right.
    #[error("{field}: {what}")]
    Invalid {
        /// Dotted path of the value, such as `images[3].camera`.
        field: String,
        /// The broken rule with the offending values.
        what: String,
    },
    /// A valid file of a kind or version that this crate does not handle.
    #[error("unsupported: {0}")]
    Unsupported(String),
}

/// The budget of a reader.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Most bytes one reader may allocate for the values it returns. Default: 64 GiB.
    pub max_bytes: u64,
    /// Longest string, in bytes. Default: 64 KiB.
    pub max_string: u64,
}

impl Default for Limits {
    fn default() -> Self {
        Limits { max_bytes: 64 << 30, max_string: 64 << 10 }
    }
}
