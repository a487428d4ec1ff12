//! What label maps are called.

use super::labels::LabelRequest;
use std::path::{Path, PathBuf};

/// What the label map of the photograph `file` may be called in the folder of label maps, in the order in which it is looked for.
fn names_of(file: &Path) -> [String; 5] {
    let name = file.file_name().unwrap_or_default().to_string_lossy();
    let stem = file.file_stem().unwrap_or_default().to_string_lossy();
    [
        format!("{stem}.png"),
        format!("{name}.png"),
        format!("{stem}_l.png"),
        format!("{stem}.label.png"),
        format!("{stem}.mask.png"),
    ]
}

/// The same as words: `DSC1.png, DSC1.jpg.png, DSC1_l.png, DSC1.label.png or DSC1.mask.png`.
pub(crate) fn label_names(file: &Path) -> String {
    let [a, b, c, d, e] = names_of(file);
    format!("{a}, {b}, {c}, {d} or {e}")
}

/// The files that are looked for as the label map of `request`, in order.
pub fn candidate_files(label_path: Option<&Path>, request: &LabelRequest) -> Vec<PathBuf> {
    let in_folder = label_path.map(|folder| names_of(&request.image).map(|name| folder.join(name)));
    let mut candidates: Vec<PathBuf> = in_folder.into_iter().flatten().collect();
    candidates.extend(request.mask.clone());
    candidates.push(mask_beside(&request.image));
    candidates
}

/// The mask beside a photograph.
fn mask_beside(image: &Path) -> PathBuf {
    let stem = image.file_stem().unwrap_or_default().to_string_lossy();
    image.with_file_name(format!("{stem}.mask.png"))
}

/// What was looked for in vain, and what is there instead.
pub(super) fn looked_for(label_path: Option<&Path>, request: &LabelRequest) -> String {
    let other: Vec<String> =
        request.mask.iter().map(|mask| format!("{} (its mask)", mask.display())).collect();
    let other = [other, vec![mask_beside(&request.image).display().to_string()]].concat().join(" nor ");
    match label_path {
        Some(folder) => format!(
            "{} is not in {}{}, nor is there {other}",
            label_names(&request.image),
            folder.display(),
            what_is_there(folder)
        ),
        None => format!("there is not {other}; --label-path names a folder of label maps"),
    }
}

/// What PNG files a folder holds.
fn what_is_there(folder: &Path) -> String {
    let is_png = |name: &String| name.to_ascii_lowercase().ends_with(".png");
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let names = entries.map(|entry| entry.file_name().to_string_lossy().into_owned()).filter(is_png);
    let names: Vec<String> = names.collect();
    match names.iter().min() {
        None => " (where no PNG file is)".to_owned(),
        Some(first) => format!(" (whose {} PNG files are called like {first})", names.len()),
    }
}
