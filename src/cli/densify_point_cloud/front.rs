//! From the words after `DensifyPointCloud` to checked options: command line over config file over defaults.

use super::args::{self, DropInArgs};
use super::config_file;
use super::tokens::{self, Typed};
use crate::cli::commands::effective::options_in_effect;
use crate::cli::label_options::ConsistencyMode;
use crate::cli::one_line::one_line;
use crate::cli::values::{openmvs_path, under};
use clap::{CommandFactory, FromArgMatches};
use serde_json::{Map, Value};
use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};

/// Options and which of them somebody typed.
#[derive(Clone, Debug)]
pub(crate) struct Typing {
    /// All options with their values.
    pub(crate) args: DropInArgs,
    /// Long names found on the command line or in the config file.
    given: Vec<String>,
    /// Every option in effect under its long name.
    pub(crate) options: Map<String, Value>,
}

impl Typing {
    /// Whether the command line or the config file has `--long`.
    pub(crate) fn has(&self, long: &str) -> bool {
        self.given.iter().any(|given| given == long)
    }
}

/// Reads the command line and the config file that it names.
///
/// # Errors
/// One line that names the option.
pub(crate) fn read(words: &[OsString]) -> Result<Typing, String> {
    let known = args::known();
    let mut typed = tokens::split(words, &known, "input-file")?;
    let value = |name: &str| typed.iter().find(|(n, _)| n == name).and_then(|(_, v)| v.as_deref());
    let folder = value("working-folder").map(|v| openmvs_path(Path::new(v))).unwrap_or_default();
    if folder.exists() && !folder.is_dir() {
        return Err(format!("{}: the working folder (-w) is a file here; give a folder", folder.display()));
    }
    let config = value("config-file").unwrap_or(OsStr::new("DensifyPointCloud.cfg"));
    let config = under(&folder, &openmvs_path(Path::new(config)));
    for (name, value) in config_file::read(&config, &known)? {
        if typed.iter().all(|(earlier, _)| *earlier != name) {
            typed.push((name, value));
        }
    }
    let matches = DropInArgs::command().try_get_matches_from(canonical(&typed));
    let matches = matches.map_err(|error| one_line(&error))?;
    let mut args = DropInArgs::from_arg_matches(&matches).map_err(|error| one_line(&error))?;
    map_segmentation(&mut args);
    let options = options_in_effect::<DropInArgs>(&matches);
    Ok(Typing { args, given: typed.into_iter().map(|(name, _)| name).collect(), options })
}

/// OpenMVS 2.4's `--estimate-segmentation` in terms of labels: the label maps are those of the mask folder, else the masks
/// that the scene names or that lie beside the images; points are labelled, fusion is not changed. Options about labels
/// that are given go first.
fn map_segmentation(args: &mut DropInArgs) {
    /// The classes that OpenMVS 2.4 knows.
    const CLASSES: &str = "openmvs-aerial";
    if args.estimate_segmentation <= 0 {
        return;
    }
    let labels = &mut args.shared.labels.input;
    if labels.label_path.is_none() {
        labels.label_path = args.shared.images.mask_path.as_deref().map(openmvs_path);
    }
    let has_classes = labels.label_path.as_ref().is_some_and(|folder| folder.join("labels.json").is_file());
    if labels.class_table.is_none() && !has_classes {
        labels.class_table = Some(CLASSES.to_owned());
    }
    labels.label_consistency.get_or_insert(ConsistencyMode::Off);
}

/// `--name=value` words for the typed parser.
fn canonical(typed: &[Typed]) -> Vec<OsString> {
    typed
        .iter()
        .map(|(name, value)| {
            let mut word = OsString::from(format!("--{name}"));
            if let Some(value) = value {
                word.push("=");
                word.push(value);
            }
            word
        })
        .collect()
}

/// A path option as OpenMVS resolves it: cleaned, and relative to the working folder.
pub(crate) fn resolve(folder: &Path, path: &Path) -> PathBuf {
    under(folder, &openmvs_path(path))
}

/// The same for something to be read that may also be meant relative to the current folder: the working folder goes
/// first.
pub(crate) fn resolve_existing(folder: &Path, path: &Path) -> PathBuf {
    let first = resolve(folder, path);
    let second = openmvs_path(path);
    if !first.exists() && second.exists() { second } else { first }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read_in(folder: &Path, words: &[&str]) -> Result<Typing, String> {
        let mut all = vec![OsString::from("-w"), folder.as_os_str().to_owned()];
        all.extend(words.iter().map(OsString::from));
        read(&all)
    }

    #[test]
    fn command_line_beats_config_file_beats_default() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("DensifyPointCloud.cfg"), "iters = 7\nmin-resolution = 99\n")
            .unwrap();
        let typing = read_in(folder.path(), &["s.mvs", "--iters", "5"]).unwrap();
        let args = &typing.args;
        assert_eq!(args.shared.estimation.iters, 5);
        assert_eq!(args.shared.images.min_resolution, 99);
        assert_eq!(args.shared.images.max_resolution, 2560);
        assert_eq!(args.input_file.as_deref(), Some(Path::new("s.mvs")));
        assert!(typing.has("min-resolution") && !typing.has("max-resolution"));
    }

    #[test]
    fn a_generic_option_in_the_config_file_is_an_error() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("my.cfg"), "max-threads = 7\n").unwrap();
        let error = read_in(folder.path(), &["s.mvs", "-c", "my.cfg"]).unwrap_err();
        assert!(error.ends_with("my.cfg: line 1: unrecognised option 'max-threads'"), "{error}");
    }

    #[test]
    fn values_are_checked_by_type_and_named() {
        let folder = tempfile::tempdir().unwrap();
        for (words, name) in [
            (&["--iters", "x"][..], "--iters"),
            (&["--iters", "-1"], "--iters"),
            (&["--crop-to-roi", "maybe"], "--crop-to-roi"),
            (&["--fusion-mode", "1.5"], "--fusion-mode"),
            (&["--label-consistency", "no"], "--label-consistency"),
        ] {
            let error = read_in(folder.path(), words).unwrap_err();
            assert!(error.contains(name) && !error.contains('\n'), "{error}");
        }
    }

    #[test]
    fn every_option_takes_a_value_of_its_kind() {
        let folder = tempfile::tempdir().unwrap();
        for known in args::known() {
            let long = format!("--{}", known.long);
            let mut words = vec![long.clone()];
            if known.takes_value {
                words.push(match known.long.as_str() {
                    "working-folder" => continue,
                    "label-consistency" => "strict".into(),
                    "missing-labels" | "unknown-label" => "void".into(),
                    "ply-layout" => "plain".into(),
                    "filter" => "unbiased".into(),
                    "support" => "all".into(),
                    "quality" => "draft".into(),
                    "label-votes" => "merged".into(),
                    "label-filter" => "on".into(),
                    "max-memory" => "4G".into(),
                    "label-estimation" => "aware".into(),
                    "offset" => "1,-2,3".into(),
                    _ => "1".into(),
                });
            }
            let words: Vec<&str> = words.iter().map(String::as_str).collect();
            let typing = read_in(folder.path(), &words).unwrap_or_else(|e| panic!("{long}: {e}"));
            assert!(typing.has(&known.long));
        }
    }
}
