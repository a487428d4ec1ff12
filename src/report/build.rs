//! Which build of the programs this is.

/// The version of the programs.
pub const VERSION: &str = env!("CARGO_PKG_VERSION");

/// The commit that they are built from, twelve digits; `None` where the build could not tell, as those that are not for
/// release.
pub fn commit() -> Option<&'static str> {
    Some(env!("SEMVS_COMMIT")).filter(|commit| !commit.is_empty())
}

/// `0.1.0 (2078195a0b1c)`, or the version alone.
pub fn with_commit(version: &str, commit: Option<&str>) -> String {
    match commit {
        Some(commit) => format!("{version} ({commit})"),
        None => version.to_owned(),
    }
}

/// The version of this build with its commit.
pub fn build() -> String {
    with_commit(VERSION, commit())
}
