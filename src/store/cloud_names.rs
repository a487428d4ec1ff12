//! Names of the clouds that one run writes.

use crate::semantics::{ClassId, ClassTable};
use std::collections::HashSet;
use std::ffi::OsString;
use std::path::{Path, PathBuf};

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
    let is_ply = cloud.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("ply"));
    let stem = if is_ply { cloud.file_stem() } else { cloud.file_name() };
    let mut name = OsString::from(stem.unwrap_or_default());
    name.push(format!(".{part}.ply"));
    cloud.with_file_name(name)
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
