//! Names as scenes store them, and the files they mean.

use std::ffi::OsStr;
use std::path::{Component, Path, PathBuf};

/// Where relative names of a scene are looked for: the working folder first, then the folder of the scene file.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SearchPath {
    /// Base of relative names; empty = the current folder.
    pub working_folder: PathBuf,
    /// The folder that holds the scene file.
    pub scene_folder: PathBuf,
}

impl SearchPath {
    /// The search path of the scene file at `scene` (as given, not relative to the working folder).
    pub fn new(working_folder: &Path, scene: &Path) -> Self {
        let scene_folder = scene.parent().unwrap_or(Path::new("")).to_owned();
        SearchPath { working_folder: working_folder.to_owned(), scene_folder }
    }

    /// The file that `name` means: as it is if absolute, else in the working folder, else beside the scene. Where
    /// neither exists, the name in the working folder.
    pub fn find(&self, name: &str) -> PathBuf {
        let [first, second] = self.places(name);
        if !first.exists() && second.exists() { second } else { first }
    }

    /// The places where the file that `name` means is looked for, in order; equal for an absolute name.
    pub fn places(&self, name: &str) -> [PathBuf; 2] {
        let name = clean_name(name);
        [&self.working_folder, &self.scene_folder].map(|folder| folder.join(&name))
    }
}

/// Whether two paths name one file.
pub fn is_same_file(a: &Path, b: &Path) -> bool {
    a == b || matches!((a.canonicalize(), b.canonicalize()), (Ok(a), Ok(b)) if a == b)
}

/// `name` with `/` separators, without `./`, and with `folder/..` collapsed.
pub fn clean_name(name: &str) -> String {
    let name = name.replace('\\', "/");
    let rooted = name.starts_with('/');
    let mut parts: Vec<&str> = Vec::new();
    for part in name.split('/') {
        match part {
            "" | "." => {}
            ".." if parts.last().is_some_and(|&last| last != "..") => {
                parts.pop();
            }
            ".." if rooted => {}
            part => parts.push(part),
        }
    }
    let joined = parts.join("/");
    if rooted { format!("/{joined}") } else { joined }
}

/// `path` as a name relative to `folder`, with `/` separators and `../` where needed; absolute where the two share
/// no root.
pub fn name_relative_to(path: &Path, folder: &Path) -> String {
    let absolute = |p: &Path| std::path::absolute(if p.as_os_str().is_empty() { Path::new(".") } else { p });
    let (Ok(path), Ok(folder)) = (absolute(path), absolute(folder)) else {
        return clean_name(&path.to_string_lossy());
    };
    let parts = |p: &Path| clean_name(&p.to_string_lossy()).split('/').map(str::to_owned).collect::<Vec<_>>();
    let (to, from) = (parts(&path), parts(&folder));
    let shared = to.iter().zip(&from).take_while(|(a, b)| a == b).count();
    let same_root = path.components().next() == folder.components().next()
        || !matches!(path.components().next(), Some(Component::Prefix(_)));
    if !same_root {
        return to.join("/");
    }
    let up = from[shared..].iter().filter(|part| !part.is_empty()).map(|_| "..");
    let down = to[shared..].iter().map(String::as_str);
    up.chain(down).collect::<Vec<_>>().join("/")
}

/// `path` followed by `suffix` in its last component.
pub fn with_suffix(path: &Path, suffix: impl AsRef<OsStr>) -> PathBuf {
    let mut text = path.as_os_str().to_owned();
    text.push(suffix);
    PathBuf::from(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_cleaned() {
        let cases = [
            ("images\\a.jpg", "images/a.jpg"),
            ("./images/./a.jpg", "images/a.jpg"),
            ("x/../images//a.jpg", "images/a.jpg"),
            ("../images/a.jpg", "../images/a.jpg"),
            ("../../a/../b.jpg", "../../b.jpg"),
            ("/data/../a.jpg", "/a.jpg"),
            ("C:\\photos\\a.jpg", "C:/photos/a.jpg"),
        ];
        for (name, clean) in cases {
            assert_eq!(clean_name(name), clean, "{name}");
        }
    }

    #[test]
    fn the_working_folder_comes_before_the_scene_folder() {
        let scratch = tempfile::tempdir().unwrap();
        let (work, scene) = (scratch.path().join("work"), scratch.path().join("scene"));
        for folder in [&work, &scene] {
            std::fs::create_dir_all(folder.join("images")).unwrap();
        }
        let paths = SearchPath::new(&work, &scene.join("scene.mvs"));
        assert_eq!(paths.find("images/a.jpg"), work.join("images/a.jpg"));
        std::fs::write(scene.join("images/a.jpg"), b"").unwrap();
        assert_eq!(paths.find("images\\a.jpg"), scene.join("images/a.jpg"));
        std::fs::write(work.join("images/a.jpg"), b"").unwrap();
        assert_eq!(paths.find("images/a.jpg"), work.join("images/a.jpg"));
        let absolute = scene.join("images/a.jpg");
        assert_eq!(paths.find(absolute.to_str().unwrap()), absolute);
    }

    #[test]
    fn relative_names_climb_where_needed() {
        let name = |path: &str, folder: &str| name_relative_to(Path::new(path), Path::new(folder));
        assert_eq!(name("/p/images/a.jpg", "/p"), "images/a.jpg");
        assert_eq!(name("/p/images/a.jpg", "/p/mvs"), "../images/a.jpg");
        assert_eq!(name("/a.jpg", "/p/mvs"), "../../a.jpg");
        assert_eq!(name("images/a.jpg", ""), "images/a.jpg");
        assert_eq!(name("/q/a.jpg", "/"), "q/a.jpg");
    }
}
