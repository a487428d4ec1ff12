//! Finding and reading the label maps of a scene's views.

use super::byte_cache::ByteCache;
pub use super::label_names::candidate_files;
use super::label_names::{label_names, looked_for};
use super::label_png::LabelReader;
pub use super::label_png::{UnknownLabel, grey_ids};
use super::paths::is_same_file;
use crate::error::{Error, Result};
use crate::geometry::Size;
use crate::progress::{Progress, Stage};
use crate::scene::{Grid, LabelMap, ViewIndex};
use crate::semantics::{ClassId, ClassTable, nearest_labels};
use rayon::prelude::*;
use semvs_formats::Limits;
use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// What to do with a view that has no label map.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum MissingLabels {
    /// Stop before any work.
    #[default]
    Refuse,
    /// All its pixels are void; a warning says so.
    Void,
}

/// Where label maps come from, as the user asked. Labels take part only if one of the first two is given.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LabelSources {
    /// Folder of label maps. Default: none, then the scene's mask entries and the images' folders are searched.
    pub label_path: Option<PathBuf>,
    /// Built-in table or file (TOML, or JSON like `labels.json`). Default: `labels.json` in `label_path`, else `ids`.
    pub class_table: Option<String>,
    /// What an id or colour means that the class table lacks. Default: an error.
    pub unknown: UnknownLabel,
    /// What a view without label map means. Default: an error.
    pub missing: MissingLabels,
}

impl LabelSources {
    /// The class table, as far as it is known without label maps.
    ///
    /// # Errors
    /// The folder of label maps is not there, the table cannot be used.
    pub fn table(&self, limits: Limits) -> Result<ClassTable> {
        self.check_folder()?;
        Ok(class_table(self, limits)?.0)
    }

    fn check_folder(&self) -> Result<()> {
        match self.label_path.as_deref().filter(|folder| !folder.is_dir()) {
            Some(file) if file.exists() => {
                Err(Error::content(file, "this is a file; --label-path takes the folder of the label maps"))
            }
            Some(folder) => Err(Error::content(
                folder,
                format!(
                    "no such folder of label maps (--label-path); for DSC1.jpg it holds {}",
                    label_names(Path::new("DSC1.jpg"))
                ),
            )),
            None => Ok(()),
        }
    }
}

/// A view whose label map is wanted.
#[derive(Clone, Debug, PartialEq)]
pub struct LabelRequest {
    /// The view.
    pub view: ViewIndex,
    /// Its photograph.
    pub image: PathBuf,
    /// The mask that the scene names for it.
    pub mask: Option<PathBuf>,
    /// Size of the photograph, if known: the label map must have its aspect ratio.
    pub size: Option<Size>,
}

/// The label maps of a scene's views, found and checked.
#[derive(Debug)]
pub struct LabelStore {
    reader: LabelReader,
    files: HashMap<ViewIndex, PathBuf>,
    counts: BTreeMap<ViewIndex, BTreeMap<ClassId, u64>>,
    cache: ByteCache<(ViewIndex, Size), LabelMap>,
}

/// Bytes of label maps that a [`LabelStore`] keeps for the next use.
const CACHE_BYTES: usize = 256 << 20;

/// Most files that one message names.
const MOST_NAMED: usize = 3;

impl LabelStore {
    /// Finds the label map of every view and reads each once, in parallel, so that whatever is wrong with any of them
    /// shows before long work starts.
    ///
    /// # Errors
    /// The class table cannot be used; a view has no label map (the message lists the names tried) or none has; a map
    /// is unreadable, of another aspect ratio than its image, or holds an id or colour that the table lacks. With
    /// several faulty maps the message is about the first and names others.
    pub fn open(
        sources: &LabelSources,
        views: &[LabelRequest],
        limits: Limits,
        progress: &Progress,
    ) -> Result<Self> {
        sources.check_folder()?;
        let (table, table_is_assumed) = class_table(sources, limits)?;
        let colors = table.colors();
        let reader = LabelReader { table, colors, table_is_assumed, unknown: sources.unknown, limits };
        let files = find_all(sources, views, progress)?;
        let steps = progress.start(Stage::CheckLabels, files.len());
        let scanned: Vec<Result<_>> = views
            .par_iter()
            .filter_map(|request| files.get(&request.view).map(|path| (request, path)))
            .map(|(request, path)| {
                let labels = reader.read(path, |size| check_aspect(path, size, request))?;
                steps.step();
                Ok((request.view, count_classes(&labels)))
            })
            .collect();
        let counts: BTreeMap<ViewIndex, BTreeMap<ClassId, u64>> =
            first_error_of_all(scanned)?.into_iter().collect();
        let met = counts.values().flat_map(|counts| counts.keys().copied());
        let table = reader.table.with_ids(met);
        let reader = LabelReader { table, ..reader };
        Ok(LabelStore { reader, files, counts, cache: ByteCache::new(CACHE_BYTES) })
    }

    /// The classes; for table `ids` those that were met.
    pub fn table(&self) -> &ClassTable {
        &self.reader.table
    }

    /// The file of a view's label map; `None`: the view is all void.
    pub fn file(&self, view: ViewIndex) -> Option<&Path> {
        self.files.get(&view).map(PathBuf::as_path)
    }

    /// Pixels of each class in a view's label map, at the map's own size.
    pub fn pixel_counts(&self, view: ViewIndex) -> Option<&BTreeMap<ClassId, u64>> {
        self.counts.get(&view)
    }

    /// The labels of a view's pixels at `size`, by the nearest pixel; all void for a view without map.
    ///
    /// # Errors
    /// The file has changed for the worse since [`LabelStore::open`].
    pub fn load(&self, view: ViewIndex, size: Size) -> Result<Arc<LabelMap>> {
        let Some(path) = self.files.get(&view) else {
            return Ok(Arc::new(Grid::filled(size, ClassId::VOID.0)));
        };
        self.cache.get_or_load((view, size), || {
            let labels = nearest_labels(&self.reader.read(path, |_| Ok(()))?, size);
            let bytes = std::mem::size_of_val(labels.data());
            Ok((labels, bytes))
        })
    }
}

/// What is there in the way of a label map for a view.
#[derive(Debug)]
pub struct LabelFinding {
    /// The view.
    pub view: ViewIndex,
    /// The label map, if there is a file.
    pub file: Option<PathBuf>,
    /// Pixels of each class, or what is wrong with the map; empty without file.
    pub counts: Result<BTreeMap<ClassId, u64>>,
}

/// Looks for the label maps of all views and reads each, whatever may be wrong with the others. The table holds, for
/// `ids`, what was met.
///
/// # Errors
/// The class table cannot be used; the folder of label maps is not there.
pub fn survey_labels(
    sources: &LabelSources,
    views: &[LabelRequest],
    limits: Limits,
) -> Result<(ClassTable, Vec<LabelFinding>)> {
    sources.check_folder()?;
    let (table, table_is_assumed) = class_table(sources, limits)?;
    let reader =
        LabelReader { colors: table.colors(), table, table_is_assumed, unknown: sources.unknown, limits };
    let find = |request: &LabelRequest| LabelFinding {
        view: request.view,
        file: found_file(sources, request),
        counts: match found_file(sources, request) {
            Some(path) => {
                reader.read(&path, |size| check_aspect(&path, size, request)).map(|map| count_classes(&map))
            }
            None => Ok(BTreeMap::new()),
        },
    };
    let findings: Vec<LabelFinding> = views.par_iter().map(find).collect();
    let met =
        findings.iter().filter_map(|f| f.counts.as_ref().ok()).flat_map(|counts| counts.keys().copied());
    Ok((reader.table.with_ids(met), findings))
}

/// The label map at `path`, of the classes of `table`.
///
/// # Errors
/// [`Error`] about `path`: unreadable, not a PNG, an id or colour that the table lacks.
pub(crate) fn read_label_map(path: &Path, table: &ClassTable, limits: Limits) -> Result<LabelMap> {
    let (colors, table, unknown) = (table.colors(), table.clone(), UnknownLabel::Refuse);
    LabelReader { table, colors, table_is_assumed: false, unknown, limits }.read(path, |_| Ok(()))
}

/// Pixels of each class.
pub fn count_classes(labels: &LabelMap) -> BTreeMap<ClassId, u64> {
    let mut counts: BTreeMap<ClassId, u64> = BTreeMap::new();
    for run in labels.data().chunk_by(|a, b| a == b) {
        *counts.entry(ClassId(run[0])).or_default() += run.len() as u64;
    }
    counts
}

/// The class table that the sources name, and whether it is only assumed.
fn class_table(sources: &LabelSources, limits: Limits) -> Result<(ClassTable, bool)> {
    let Some(name) = &sources.class_table else {
        let json = sources.label_path.as_ref().map(|folder| folder.join("labels.json"));
        return match json.filter(|path| path.is_file()) {
            Some(path) => Ok((ClassTable::from_labels_json(&read_text(&path, limits)?, &path)?, false)),
            None => Ok((ClassTable::ids(), true)),
        };
    };
    let path = Path::new(name);
    if ClassTable::builtin_names().any(|builtin| builtin == name) || !path.is_file() {
        return Ok((ClassTable::builtin(name)?, false));
    }
    let text = read_text(path, limits)?;
    let is_json = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("json"));
    let table = match is_json {
        true => ClassTable::from_labels_json(&text, path)?,
        false => ClassTable::from_toml(&text, path)?,
    };
    Ok((table, false))
}

/// A class table of 65535 classes is smaller.
const MAX_TABLE_BYTES: u64 = 64 << 20;

fn read_text(path: &Path, limits: Limits) -> Result<String> {
    let bytes = std::fs::metadata(path).map_err(|e| Error::io(path, "open", e))?.len();
    let most = limits.max_bytes.min(MAX_TABLE_BYTES);
    if bytes > most {
        return Err(Error::content(path, format!("{bytes} bytes are too many for a class table")));
    }
    let bytes = std::fs::read(path).map_err(|e| Error::io(path, "read", e))?;
    String::from_utf8(bytes)
        .map_err(|e| Error::content(path, format!("a class table is UTF-8 text: {}", e.utf8_error())))
}

/// The first candidate that is there; a photograph in the folder of label maps is no label map.
fn found_file(sources: &LabelSources, request: &LabelRequest) -> Option<PathBuf> {
    let candidates = candidate_files(sources.label_path.as_deref(), request);
    candidates.into_iter().find(|path| path.is_file() && !is_same_file(path, &request.image))
}

/// The label map of every view that has one.
fn find_all(
    sources: &LabelSources,
    views: &[LabelRequest],
    progress: &Progress,
) -> Result<HashMap<ViewIndex, PathBuf>> {
    let mut files = HashMap::new();
    let mut without = Vec::new();
    for request in views {
        match found_file(sources, request) {
            Some(path) => drop(files.insert(request.view, path)),
            None => without.push(request),
        }
    }
    warn_of_shared(views, &files, progress);
    let Some(first) = without.first() else { return Ok(files) };
    if sources.missing == MissingLabels::Refuse || files.is_empty() {
        let which = match without.len() {
            n if n == views.len() && n > 1 => "no image has a label map".to_owned(),
            1 => format!("no label map for {}", first.image.display()),
            n => {
                format!("no label map for {} of {} images, such as {}", n, views.len(), first.image.display())
            }
        };
        let remedy =
            if files.is_empty() { "" } else { "; --missing-labels void takes such images as unlabelled" };
        return Err(Error::invalid(format!(
            "{which}: {}{remedy}",
            looked_for(sources.label_path.as_deref(), first)
        )));
    }
    for request in without {
        progress.warn(format!("{}: no label map, all its pixels are void", request.image.display()));
    }
    Ok(files)
}

/// Two images of one name in different folders may find one label map, which can hardly be right for both.
fn warn_of_shared(views: &[LabelRequest], files: &HashMap<ViewIndex, PathBuf>, progress: &Progress) {
    let mut users: HashMap<&Path, &LabelRequest> = HashMap::new();
    for request in views {
        let Some(path) = files.get(&request.view) else { continue };
        if let Some(other) = users.insert(path, request) {
            let (a, b) = (other.image.display(), request.image.display());
            progress.warn(format!("{}: label map of both {a} and {b}", path.display()));
        }
    }
}

/// Whether two rasters show the same, pixel for pixel or scaled: the larger of the two, scaled to the smaller one's width
/// or height, must fit it to a pixel.
pub(crate) fn have_one_shape(a: Size, b: Size) -> bool {
    let (small, large) = if a.area() <= b.area() { (a, b) } else { (b, a) };
    let [sw, sh, lw, lh] = [small.width, small.height, large.width, large.height].map(f64::from);
    (sh - lh * sw / lw).abs() <= 1.0 || (sw - lw * sh / lh).abs() <= 1.0
}

/// Refuses a label map of `size` that has not its image's shape.
fn check_aspect(path: &Path, size: Size, request: &LabelRequest) -> Result<()> {
    let Some(image) = request.size else { return Ok(()) };
    if have_one_shape(size, image) {
        return Ok(());
    }
    let what = format!(
        "the label map has {size} pixels, its image {} has {image}: they must have the same shape, pixel for pixel or scaled",
        request.image.display()
    );
    Err(Error::content(path, what))
}

/// All values, or the first error with the number of the others.
fn first_error_of_all<T>(results: Vec<Result<T>>) -> Result<Vec<T>> {
    let mut values = Vec::new();
    let mut errors = Vec::new();
    for result in results {
        match result {
            Ok(value) => values.push(value),
            Err(error) => errors.push(error),
        }
    }
    let others: Vec<String> = errors.iter().skip(1).map(place).collect();
    let named = others.iter().take(MOST_NAMED).map(String::as_str).collect::<Vec<_>>().join(", ");
    let more = match others.len().saturating_sub(MOST_NAMED) {
        0 => String::new(),
        n => format!(" and {n} more"),
    };
    match errors.into_iter().next() {
        None => Ok(values),
        Some(error) if others.is_empty() => Err(error),
        Some(error) => Err(Error::invalid(format!("{error} (faulty as well: {named}{more})"))),
    }
}

/// The file that an error is about.
fn place(error: &Error) -> String {
    match error {
        Error::Io { path, .. } | Error::Format { path, .. } | Error::Content { path, .. } => {
            path.display().to_string()
        }
        error => error.to_string(),
    }
}

#[cfg(test)]
#[path = "labels_tests.rs"]
mod tests;
