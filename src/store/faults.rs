//! Media that fail, for tests: every access to a file that matters asks here first. Outside tests nothing ever fails
//! here.

/// What is done to a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Access {
    /// Bytes are written.
    Write,
    /// Written bytes are brought to the medium.
    Sync,
    /// A file gets its name.
    Rename,
    /// A file is opened to be read.
    Read,
}

/// Fails where a test wants this access to `path` to fail.
#[cfg(not(test))]
#[inline]
pub(crate) fn meet(_: Access, _: &std::path::Path) -> std::io::Result<()> {
    Ok(())
}

/// How many of `length` bytes that are to be written to `path` the medium takes at once.
#[cfg(not(test))]
#[inline]
pub(crate) fn meet_write(_: &std::path::Path, length: usize) -> std::io::Result<usize> {
    Ok(length)
}

#[cfg(test)]
pub(crate) use injected::{Fault, Kind, meet, meet_write};

#[cfg(test)]
mod injected {
    use super::Access;
    use std::io::{Error, Result};
    use std::path::{Path, PathBuf};
    use std::sync::Mutex;

    /// How an access fails.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub(crate) enum Kind {
        /// No space is left.
        Full,
        /// The medium is faulty.
        Broken,
        /// A write takes half of the bytes; this is no failure.
        Short,
    }

    /// From the `nth` access of a kind to files in a folder on all fail; withdrawn when dropped.
    #[derive(Debug)]
    pub(crate) struct Fault(PathBuf);

    #[derive(Debug)]
    struct Plan {
        folder: PathBuf,
        access: Access,
        kind: Kind,
        /// Accesses that still succeed.
        left: usize,
    }

    static PLANS: Mutex<Vec<Plan>> = Mutex::new(Vec::new());

    impl Fault {
        pub(crate) fn inject(folder: &Path, access: Access, kind: Kind, nth: usize) -> Self {
            let plan = Plan { folder: folder.to_owned(), access, kind, left: nth };
            PLANS.lock().unwrap().push(plan);
            Fault(folder.to_owned())
        }

        /// Whether anything has failed.
        pub(crate) fn has_struck(&self) -> bool {
            PLANS.lock().unwrap().iter().any(|plan| plan.folder == self.0 && plan.left == 0)
        }
    }

    impl Drop for Fault {
        fn drop(&mut self) {
            PLANS.lock().unwrap().retain(|plan| plan.folder != self.0);
        }
    }

    fn kind_of(access: Access, path: &Path) -> Option<Kind> {
        let mut plans = PLANS.lock().unwrap();
        let plan = plans.iter_mut().find(|plan| plan.access == access && path.starts_with(&plan.folder))?;
        if plan.left > 0 {
            plan.left -= 1;
            return None;
        }
        Some(plan.kind)
    }

    fn error(kind: Kind) -> Result<()> {
        match kind {
            // ENOSPC and EIO.
            Kind::Full => Err(Error::from_raw_os_error(28)),
            Kind::Broken => Err(Error::from_raw_os_error(5)),
            Kind::Short => Ok(()),
        }
    }

    pub(crate) fn meet(access: Access, path: &Path) -> Result<()> {
        kind_of(access, path).map_or(Ok(()), error)
    }

    pub(crate) fn meet_write(path: &Path, length: usize) -> Result<usize> {
        match kind_of(Access::Write, path) {
            None => Ok(length),
            Some(kind) => error(kind).map(|()| length.div_ceil(2)),
        }
    }
}
