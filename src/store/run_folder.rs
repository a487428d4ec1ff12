//! What a run has left in a folder: its scene, its cloud, its depth maps, its summary.

use super::paths::with_suffix;
use crate::error::{Error, Result};
use std::path::{Path, PathBuf};

/// The files of one run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RunFolder {
    /// The scene.
    pub scene: PathBuf,
    /// The cloud, if there is one.
    pub cloud: Option<PathBuf>,
    /// Whether there are files named like depth maps.
    pub depth_maps: bool,
    /// Files that may be the summary of a run.
    pub summaries: Vec<PathBuf>,
}

/// Extensions of clouds, in the order in which they are looked for.
const CLOUDS: [&str; 3] = ["ply", "laz", "las"];
/// The cloud of made-up points of a tower, which is not the result.
const TOWER: &str = "tower.ply";
/// Files that one message names.
const MOST_NAMED: usize = 4;

impl RunFolder {
    /// Looks through `folder`; `scene` and `cloud` are taken as given. Without `cloud` it is the one named like the scene,
    /// else the only one. `has_maps`: depth maps are elsewhere.
    ///
    /// # Errors
    /// There is no such folder; which scene or cloud is meant cannot be told; there is neither a cloud nor a depth map.
    pub fn look(folder: &Path, scene: Option<&Path>, cloud: Option<&Path>, has_maps: bool) -> Result<Self> {
        if !folder.is_dir() {
            let what =
                "no such folder; give the one that holds the cloud, the scene and the depth maps of a run";
            return Err(Error::content(folder, what));
        }
        let files = files_in(folder)?;
        let scene = match scene {
            Some(scene) => scene.to_owned(),
            None => find_scene(folder, &files)?,
        };
        let cloud = match cloud {
            Some(cloud) => Some(cloud.to_owned()),
            None => find_cloud(folder, &files, &scene)?,
        };
        let depth_maps = files.iter().any(|path| is_depth_map(path));
        if cloud.is_none() && !depth_maps && !has_maps {
            let what = "neither a cloud (.ply) nor depth maps (depthNNNN.dmap) are here; name the cloud with --cloud, the \
                        folder of the depth maps with --depth-maps";
            return Err(Error::content(folder, what));
        }
        let summaries = files.into_iter().filter(|path| has_extension(path, "json")).collect();
        Ok(RunFolder { scene, cloud, depth_maps, summaries })
    }
}

/// The depth maps in a folder, sorted by name; those of unfinished runs left out.
///
/// # Errors
/// The folder cannot be listed.
pub fn depth_maps_in(folder: &Path) -> Result<Vec<PathBuf>> {
    Ok(files_in(folder)?.into_iter().filter(|path| is_depth_map(path)).collect())
}

fn is_depth_map(path: &Path) -> bool {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    has_extension(path, "dmap") && !name.contains(".pass")
}

/// Reads a text of at most `most` bytes; `None` if it is longer or no text.
///
/// # Errors
/// The file cannot be read.
pub fn short_text(path: &Path, most: u64) -> Result<Option<String>> {
    let length = std::fs::metadata(path).map_err(|e| Error::io(path, "read", e))?.len();
    if length > most {
        return Ok(None);
    }
    let bytes = std::fs::read(path).map_err(|e| Error::io(path, "read", e))?;
    Ok(String::from_utf8(bytes).ok())
}

fn files_in(folder: &Path) -> Result<Vec<PathBuf>> {
    let failed = |e| Error::io(folder, "list", e);
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(failed)? {
        let path = entry.map_err(failed)?.path();
        if path.is_file() {
            files.push(path);
        }
    }
    files.sort();
    Ok(files)
}

fn has_extension(path: &Path, extension: &str) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case(extension))
}

fn find_scene(folder: &Path, files: &[PathBuf]) -> Result<PathBuf> {
    let scenes: Vec<&PathBuf> = files.iter().filter(|path| has_extension(path, "mvs")).collect();
    let has_cloud = |scene: &&&PathBuf| CLOUDS.iter().any(|e| scene.with_extension(e).is_file());
    let of_clouds: Vec<&PathBuf> = scenes.iter().filter(has_cloud).copied().collect();
    match (&scenes[..], &of_clouds[..]) {
        ([one], _) | (_, [one]) => Ok((*one).clone()),
        ([], _) => Err(Error::content(
            folder,
            "no scene (.mvs) is here; semvs densify writes one beside its cloud; name it with --scene",
        )),
        _ => Err(Error::content(
            folder,
            format!("several scenes: {}; choose one with --scene", named(&scenes)),
        )),
    }
}

fn find_cloud(folder: &Path, files: &[PathBuf], scene: &Path) -> Result<Option<PathBuf>> {
    let stem = scene.file_stem().unwrap_or_default();
    for extension in CLOUDS {
        let path = with_suffix(&folder.join(stem), format!(".{extension}"));
        if files.contains(&path) {
            return Ok(Some(path));
        }
    }
    // Clouds of one class and in class colours are named after the whole one.
    let is_part = |path: &Path| -> bool {
        let stem = path.file_stem().map(Path::new).unwrap_or(Path::new(""));
        let whole = stem.extension().and_then(|_| stem.file_stem());
        let is_there = |whole: &std::ffi::OsStr| {
            CLOUDS.iter().any(|e| files.contains(&with_suffix(&folder.join(whole), format!(".{e}"))))
        };
        whole.is_some_and(is_there)
    };
    let is_tower = |path: &Path| path.file_name().is_some_and(|name| name == TOWER);
    let clouds: Vec<&PathBuf> = files
        .iter()
        .filter(|path| CLOUDS.iter().any(|e| has_extension(path, e)) && !is_part(path) && !is_tower(path))
        .collect();
    match clouds[..] {
        [] => Ok(None),
        [one] => Ok(Some(one.clone())),
        _ => Err(Error::content(
            folder,
            format!("several clouds, none named like the scene: {}; choose one with --cloud", named(&clouds)),
        )),
    }
}

fn named(files: &[&PathBuf]) -> String {
    let names: Vec<_> = files
        .iter()
        .filter_map(|path| path.file_name())
        .map(|name| name.to_string_lossy().into_owned())
        .collect();
    match names.len() {
        n if n > MOST_NAMED => format!("{} and {} more", names[..MOST_NAMED].join(", "), n - MOST_NAMED),
        _ => names.join(", "),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folder(names: &[&str]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        names.iter().for_each(|name| std::fs::write(folder.path().join(name), b"").unwrap());
        folder
    }

    fn look(names: &[&str]) -> std::result::Result<(String, Option<String>), String> {
        let folder = folder(names);
        let name = |path: &Path| path.file_name().unwrap().to_string_lossy().into_owned();
        RunFolder::look(folder.path(), None, None, false)
            .map(|found| (name(&found.scene), found.cloud.as_deref().map(name)))
            .map_err(|e| e.to_string())
    }

    #[test]
    fn scene_and_cloud_are_told_apart_from_their_company() {
        let found = |scene: &str, cloud: &str| Ok((scene.to_owned(), Some(cloud.to_owned())));
        let run = ["a.ply", "a.mvs", "a.labels.ply", "a.window.ply", "tower.ply", "depth0000.dmap"];
        assert_eq!(look(&run), found("a.mvs", "a.ply"));
        assert_eq!(
            look(&["scene.mvs", "scene_dense.mvs", "scene_dense.ply"]),
            found("scene_dense.mvs", "scene_dense.ply")
        );
        assert_eq!(look(&["scene.mvs", "b.ply", "b.door.ply"]), found("scene.mvs", "b.ply"));
        assert_eq!(look(&["a.mvs", "depth0001.dmap"]), Ok(("a.mvs".to_owned(), None)));
    }

    #[test]
    fn what_is_missing_or_doubtful_is_named() {
        let said = |names: &[&str], word: &str| {
            let error = look(names).unwrap_err();
            assert!(error.contains(word), "{error}");
        };
        said(&["a.ply"], "--scene");
        said(&["a.mvs", "b.mvs", "x.ply"], "a.mvs, b.mvs");
        said(&["a.mvs", "x.ply", "y.ply"], "--cloud");
        said(&["a.mvs"], "depthNNNN.dmap");
        let missing =
            RunFolder::look(Path::new("/no/such/folder"), None, None, false).unwrap_err().to_string();
        assert!(missing.contains("no such folder"), "{missing}");
    }
}
