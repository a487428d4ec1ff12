//! The scene that comes with the program.

use super::atomic::{create_folder, write_file};
use crate::error::{Error, Result};
use std::path::Path;

/// Name and bytes of a file of the bundled scene.
macro_rules! file {
    ($name:literal) => {
        ($name, include_bytes!(concat!("../../compat-fixtures/facade6/", $name)))
    };
}

/// The scene first: a folder with it is known again.
const FILES: [(&str, &[u8]); 13] = [
    file!("scene.mvs"),
    file!("images/0003.jpg"),
    file!("images/0004.jpg"),
    file!("images/0005.jpg"),
    file!("images/0006.jpg"),
    file!("images/0012.jpg"),
    file!("images/0013.jpg"),
    file!("labels/0003_l.png"),
    file!("labels/0004_l.png"),
    file!("labels/0005_l.png"),
    file!("labels/0006_l.png"),
    file!("labels/0012_l.png"),
    file!("labels/0013_l.png"),
];

/// Writes the scene (`scene.mvs`, `images/`, `labels/`) to `scene`, a folder in `folder`, which must be new, empty, or have the
/// scene already. Nothing that is there is replaced.
///
/// # Errors
/// `folder` holds other things, a file of the scene was changed, or a file cannot be read or written.
pub(crate) fn unpack(folder: &Path, scene: &Path) -> Result<()> {
    let is_known = scene.join(FILES[0].0).is_file();
    create_folder(folder)?;
    if !is_known && !is_empty(folder)? {
        let what = "this folder holds other files; give a new or an empty one (-o)";
        return Err(Error::content(folder, what));
    }
    let mut missing = Vec::new();
    for (name, bytes) in FILES {
        let path = scene.join(name);
        match std::fs::read(&path) {
            Ok(found) if found == bytes => {}
            Ok(_) => {
                let what = "this is not the demo's file of this name; move it, or give another folder (-o)";
                return Err(Error::content(&path, what));
            }
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => missing.push((path, bytes)),
            Err(e) => return Err(Error::io(&path, "read", e)),
        }
    }
    missing.into_iter().try_for_each(|(path, bytes)| write_file(&path, bytes))
}

fn is_empty(folder: &Path) -> Result<bool> {
    let mut entries = std::fs::read_dir(folder).map_err(|e| Error::io(folder, "list", e))?;
    Ok(entries.next().is_none())
}
