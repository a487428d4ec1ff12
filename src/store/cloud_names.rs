//! Names of the clouds that one run writes.

use crate::semantics::{ClassId, ClassTable};
use std::collections::HashSet;
use std::ffi::OsString;
use std::path::{Path, PathBuf};

/// What kind of file a cloud is written as; the extension of its name says it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CloudFormat {
    /// `.ply`
    Ply,
    /// `.las`
    Las,
    /// `.laz`, compressed LAS
    Laz,
}

impl CloudFormat {
    /// The format of the file at `path` by its extension, in any case; `None` for another extension or none.
    pub fn named(path: &Path) -> Option<Self> {
        let extension = path.extension()?.to_str()?.to_ascii_lowercase();
        match extension.as_str() {
            "ply" => Some(CloudFormat::Ply),
            "las" => Some(CloudFormat::Las),
            "laz" => Some(CloudFormat::Laz),
            _ => None,
        }
    }

    /// The format of the file at `path`; PLY whatever else its name says.
    pub fn of(path: &Path) -> Self {
        CloudFormat::named(path).unwrap_or(CloudFormat::Ply)
    }

    /// Whether coordinates have more digits than single precision holds.
    pub fn is_precise(self) -> bool {
        self != CloudFormat::Ply
    }
}

/// `dir/x.legend.png` for the picture that says what the class colours of `dir/x.ply` mean.
pub(super) fn legend_path(cloud: &Path) -> PathBuf {
    let mut name = stem(cloud);
    name.push(".legend.png");
    cloud.with_file_name(name)
}

/// `dir/x.ply` for the cloud in the colours of its classes: `dir/x.labels.ply`.
pub(super) fn label_colors_path(cloud: &Path) -> PathBuf {
    with_part(cloud, LABELS)
}

/// For every class of `ids` the file that holds its part of `cloud`: `dir/x.building.ply` for `dir/x.ply`.
///
/// What is not a letter, a digit, `-` or `_` becomes `_`; where that makes two names equal (or equal but for case,
/// or `labels`, which is taken) the id is appended.
pub(super) fn class_paths(cloud: &Path, table: &ClassTable, ids: &[ClassId]) -> Vec<PathBuf> {
    let mut taken: HashSet<String> = [LABELS.to_owned()].into();
    let mut part = |id: ClassId| {
        let mut part = file_part(&table.class_name(id));
        if !taken.insert(part.to_lowercase()) {
            part = format!("{part}-{id}");
            taken.insert(part.to_lowercase());
        }
        part
    };
    ids.iter().map(|&id| with_part(cloud, &part(id))).collect()
}

/// What stands for the class in the name of the cloud with label colours.
const LABELS: &str = "labels";

/// Longest part of a file name that is made from a class name, in characters.
const MAX_PART: usize = 64;

fn file_part(class_name: &str) -> String {
    let safe = |c: char| if c.is_alphanumeric() || c == '-' || c == '_' { c } else { '_' };
    class_name.chars().map(safe).take(MAX_PART).collect()
}

/// `x.ply` with `.part` before its extension.
fn with_part(cloud: &Path, part: &str) -> PathBuf {
    let extension = match CloudFormat::named(cloud) {
        Some(_) => cloud.extension().map(|e| e.to_string_lossy().into_owned()).unwrap_or_default(),
        None => "ply".to_owned(),
    };
    // Capitals are not carried on.
    let extension = extension.to_ascii_lowercase();
    let mut name = stem(cloud);
    name.push(format!(".{part}.{extension}"));
    cloud.with_file_name(name)
}

/// The file name of a cloud without its extension, if it has one of a cloud.
pub(super) fn stem(cloud: &Path) -> OsString {
    let stem = match CloudFormat::named(cloud) {
        Some(_) => cloud.file_stem(),
        None => cloud.file_name(),
    };
    stem.unwrap_or_default().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_come_before_the_extension() {
        let labels = |path: &str| label_colors_path(Path::new(path));
        assert_eq!(labels("out/x.ply"), Path::new("out/x.labels.ply"));
        assert_eq!(labels("x.v2.PLY"), Path::new("x.v2.labels.ply"));
        assert_eq!(labels("out/x.v2"), Path::new("out/x.v2.labels.ply"));
        assert_eq!(labels("out/x.LAZ"), Path::new("out/x.labels.laz"));
        assert_eq!(legend_path(Path::new("out/x.las")), Path::new("out/x.legend.png"));
    }

    #[test]
    fn class_names_become_safe_and_distinct() {
        let text = "class = [\n{ id = 1, name = \"traffic light\" }, { id = 2, name = \"a/b\" }, { id = 3, name = \"a.b\" },\n\
                    { id = 4, name = \"labels\" }, { id = 5, name = \"façade\" }, { id = 6, name = \"../x\" } ]";
        let table = ClassTable::from_toml(text, Path::new("t.toml")).unwrap();
        let ids: Vec<ClassId> = (0..=6).map(ClassId).collect();
        let names: Vec<String> = class_paths(Path::new("o/x.ply"), &table, &ids)
            .iter()
            .map(|path| path.strip_prefix("o").unwrap().to_str().unwrap().to_owned())
            .collect();
        let expected = [
            "x.void.ply",
            "x.traffic_light.ply",
            "x.a_b.ply",
            "x.a_b-3.ply",
            "x.labels-4.ply",
            "x.façade.ply",
            "x.___x.ply",
        ];
        assert_eq!(names, expected);
    }
}
