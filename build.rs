//! Tells the programs which commit they are built from: `SEMVS_COMMIT`, empty where that is not known.
//!
//! It is taken from the environment (a container image is built without the repository), else from the file that
//! `cargo package` adds, else from git. Nothing here can fail: a build without any of them is as good.
#![allow(clippy::print_stdout, reason = "this is how Cargo is told")]

use std::path::{Path, PathBuf};
use std::process::Command;

/// Digits of a commit that are shown.
const DIGITS: usize = 12;

fn main() {
    let root = PathBuf::from(std::env::var_os("CARGO_MANIFEST_DIR").unwrap_or_default());
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-env-changed=SEMVS_COMMIT");
    let given = std::env::var("SEMVS_COMMIT").ok().filter(|commit| is_commit(commit));
    let commit = given.or_else(|| packaged(&root)).or_else(|| checked_out(&root)).unwrap_or_default();
    println!("cargo::rustc-env=SEMVS_COMMIT={}", commit.get(..DIGITS).unwrap_or(&commit));
}

fn is_commit(text: &str) -> bool {
    text.len() >= 7 && text.bytes().all(|byte| byte.is_ascii_hexdigit())
}

/// From `.cargo_vcs_info.json` of a published package.
fn packaged(root: &Path) -> Option<String> {
    let text = std::fs::read_to_string(root.join(".cargo_vcs_info.json")).ok()?;
    let (_, rest) = text.split_once("\"sha1\"")?;
    rest.split('"').nth(1).filter(|word| is_commit(word)).map(str::to_owned)
}

/// From git, if `root` is the top of a working tree and not only somewhere within one. Only for release builds: with others
/// every commit would mean to compile everything anew.
fn checked_out(root: &Path) -> Option<String> {
    if std::env::var("PROFILE").is_ok_and(|profile| profile != "release") {
        return None;
    }
    let top = PathBuf::from(git(root, &["rev-parse", "--show-toplevel"])?);
    if top.canonicalize().ok()? != root.canonicalize().ok()? {
        return None;
    }
    // These change with the commit: HEAD with the branch, its log with everything that moves it. A path that does not exist
    // would make every build run this again.
    for name in ["HEAD", "logs/HEAD"] {
        let path = root.join(git(root, &["rev-parse", "--git-path", name])?);
        if path.is_file() {
            println!("cargo::rerun-if-changed={}", path.display());
        }
    }
    git(root, &["rev-parse", "HEAD"]).filter(|word| is_commit(word))
}

/// What git answers, if it is there and does.
fn git(root: &Path, words: &[&str]) -> Option<String> {
    let mut command = Command::new("git");
    // Variables that point to another repository are set where git itself starts a build, in its hooks.
    command.args(words).current_dir(root).env_remove("GIT_DIR").env_remove("GIT_WORK_TREE");
    let output = command.output().ok().filter(|output| output.status.success())?;
    let text = String::from_utf8(output.stdout).ok()?;
    Some(text.trim().to_owned()).filter(|text| !text.is_empty())
}
