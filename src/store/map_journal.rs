//! What the depth maps in a folder were made from: a file beside them with a line for every map that was written.
//!
//! A map whose writing was interrupted has no line, and a map that was changed since has other bytes than its line says;
//! both are taken for maps of unknown origin.

use super::atomic::write_file;
use super::digest::Digest;
use super::faults::{self, Access};
use crate::error::{Error, Result};
use crate::scene::ImageId;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, HashMap};
use std::fs::File;
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Name of the file.
pub const JOURNAL_NAME: &str = "depthmaps.semvs";
/// A longer file is none of ours.
const MAX_BYTES: u64 = 1 << 30;

/// What one depth map was made from, and what it is.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Mark {
    /// Global ID of the image.
    pub image: u32,
    /// Digest of everything that decides what the map is.
    pub key: Digest,
    /// Digest of the file.
    pub content: Digest,
    /// Digests of its ingredients by name, which tell why a map is not what is wanted.
    pub from: BTreeMap<String, Digest>,
}

/// A line of the file.
#[derive(Debug, Serialize, Deserialize)]
enum Line {
    /// A map was written.
    Map(Mark),
    /// A run begins that will replace these maps, whose origin it does not ask for.
    Given(BTreeMap<u32, Digest>),
}

/// The journal of a folder. May be used by many threads at once, but by one process only.
#[derive(Debug)]
pub struct MapJournal {
    path: PathBuf,
    state: Mutex<State>,
}

#[derive(Debug, Default)]
struct State {
    marks: HashMap<u32, Vec<Mark>>,
    given: BTreeMap<u32, Digest>,
    file: Option<File>,
    /// The file ends amid a line.
    torn: bool,
}

impl MapJournal {
    /// The journal in `folder`; lines that make no sense are passed over.
    ///
    /// # Errors
    /// It is there and cannot be read.
    pub fn open(folder: &Path) -> Result<Self> {
        let path = folder.join(JOURNAL_NAME);
        let mut state = State::default();
        let mut bytes = Vec::new();
        match File::open(&path) {
            Ok(file) => {
                file.take(MAX_BYTES).read_to_end(&mut bytes).map_err(|e| Error::io(&path, "read", e))?;
            }
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => {}
            Err(e) => return Err(Error::io(&path, "read", e)),
        }
        for line in bytes.split(|&byte| byte == b'\n') {
            match serde_json::from_slice(line) {
                Ok(Line::Map(mark)) => state.enter(mark),
                Ok(Line::Given(given)) => state.given = given,
                Err(_) => {}
            }
        }
        state.torn = bytes.last().is_some_and(|&byte| byte != b'\n');
        Ok(MapJournal { path, state: Mutex::new(state) })
    }

    /// The mark of a map of `image` that was made from exactly what `key` stands for.
    pub fn made_from(&self, image: ImageId, key: Digest) -> Option<Mark> {
        let state = self.lock();
        state.marks.get(&image.0)?.iter().rev().find(|mark| mark.key == key).cloned()
    }

    /// The mark of the map of `image` with these bytes.
    pub fn of_content(&self, image: ImageId, content: Digest) -> Option<Mark> {
        let state = self.lock();
        state.marks.get(&image.0)?.iter().rev().find(|mark| mark.content == content).cloned()
    }

    /// Enters a map.
    ///
    /// # Errors
    /// The line cannot be written.
    pub fn enter(&self, mark: Mark) -> Result<()> {
        let mut state = self.lock();
        self.append(&mut state, &Line::Map(mark.clone()))?;
        state.enter(mark);
        Ok(())
    }

    /// The bytes that a map had before a run that did not come to its end replaced it.
    pub fn given(&self, image: ImageId) -> Option<Digest> {
        self.lock().given.get(&image.0).copied()
    }

    /// A run begins that will replace maps of these bytes.
    ///
    /// # Errors
    /// The line cannot be written.
    pub fn begin(&self, given: BTreeMap<u32, Digest>) -> Result<()> {
        let mut state = self.lock();
        if state.given != given {
            self.append(&mut state, &Line::Given(given.clone()))?;
            state.given = given;
        }
        Ok(())
    }

    /// The run has come to its end: of every image one mark is kept, that of `results` or the last one, unless it is among
    /// `gone`.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn finish(&self, results: &[(ImageId, Digest)], gone: &[ImageId]) -> Result<()> {
        let mut state = self.lock();
        let before = state.marks.values().map(Vec::len).sum::<usize>();
        gone.iter().for_each(|id| drop(state.marks.remove(&id.0)));
        for (image, key) in results {
            if let Some(marks) = state.marks.get_mut(&image.0)
                && let Some(at) = marks.iter().position(|mark| mark.key == *key)
            {
                *marks = vec![marks.swap_remove(at)];
            }
        }
        state.marks.values_mut().for_each(|marks| drop(marks.drain(..marks.len() - 1)));
        if state.marks.len() == before && state.given.is_empty() && state.file.is_none() {
            return Ok(());
        }
        (state.given, state.file, state.torn) = (BTreeMap::new(), None, false);
        if state.marks.is_empty() {
            return match std::fs::remove_file(&self.path) {
                Err(e) if e.kind() != std::io::ErrorKind::NotFound => Err(Error::io(&self.path, "delete", e)),
                _ => Ok(()),
            };
        }
        let mut marks: Vec<&Mark> = state.marks.values().flatten().collect();
        marks.sort_by_key(|mark| mark.image);
        let mut bytes = Vec::new();
        for mark in marks {
            bytes.extend(self.line(&Line::Map(mark.clone()))?);
        }
        write_file(&self.path, &bytes)
    }

    fn append(&self, state: &mut State, line: &Line) -> Result<()> {
        let mut bytes = if state.torn { b"\n".to_vec() } else { Vec::new() };
        bytes.extend(self.line(line)?);
        let failed = |e| Error::io(&self.path, "write", e);
        if state.file.is_none() {
            let open = File::options().append(true).create(true).open(&self.path);
            state.file = Some(open.map_err(failed)?);
        }
        if let Some(file) = &mut state.file {
            // Until the whole line is there it counts as torn.
            state.torn = true;
            faults::meet(Access::Write, &self.path).map_err(failed)?;
            file.write_all(&bytes).map_err(failed)?;
            state.torn = false;
        }
        Ok(())
    }

    fn line(&self, line: &Line) -> Result<Vec<u8>> {
        let text = serde_json::to_vec(line);
        let mut bytes = text.map_err(|e| Error::content(&self.path, format!("no JSON: {e}")))?;
        bytes.push(b'\n');
        Ok(bytes)
    }

    /// Every change is completed before anything that could panic.
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl State {
    fn enter(&mut self, mark: Mark) {
        let marks = self.marks.entry(mark.image).or_default();
        marks.retain(|other| other.key != mark.key);
        marks.push(mark);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn digest(text: &str) -> Digest {
        Digest::of(|d| {
            d.text(text);
        })
    }

    fn mark(image: u32, key: &str) -> Mark {
        let from = BTreeMap::from([("options".to_owned(), digest("o"))]);
        Mark { image, key: digest(key), content: digest(&format!("bytes of {key}")), from }
    }

    #[test]
    fn marks_outlive_the_process_and_torn_lines_cost_only_themselves() {
        let scratch = tempfile::tempdir().unwrap();
        let path = scratch.path().join(JOURNAL_NAME);
        let journal = MapJournal::open(scratch.path()).unwrap();
        journal.begin(BTreeMap::from([(1, digest("given"))])).unwrap();
        journal.enter(mark(1, "a")).unwrap();
        journal.enter(mark(1, "b")).unwrap();
        journal.enter(mark(2, "c")).unwrap();
        let whole = std::fs::read(&path).unwrap();
        for cut in 0..whole.len() {
            std::fs::write(&path, &whole[..cut]).unwrap();
            let journal = MapJournal::open(scratch.path()).unwrap();
            journal.enter(mark(3, "d")).unwrap();
            let journal = MapJournal::open(scratch.path()).unwrap();
            assert_eq!(journal.made_from(ImageId(3), digest("d")), Some(mark(3, "d")), "cut at {cut}");
        }
        std::fs::write(&path, &whole).unwrap();
        let journal = MapJournal::open(scratch.path()).unwrap();
        assert_eq!(journal.given(ImageId(1)), Some(digest("given")));
        assert_eq!(journal.made_from(ImageId(1), digest("a")), Some(mark(1, "a")));
        assert_eq!(journal.of_content(ImageId(1), digest("bytes of b")), Some(mark(1, "b")));
        assert_eq!(journal.made_from(ImageId(2), digest("a")), None);
        assert_eq!(journal.made_from(ImageId(7), digest("a")), None);
    }

    #[test]
    fn a_finished_run_leaves_one_mark_per_map() {
        let scratch = tempfile::tempdir().unwrap();
        let journal = MapJournal::open(scratch.path()).unwrap();
        journal.begin(BTreeMap::from([(1, digest("given"))])).unwrap();
        for (image, key) in [(2, "c"), (1, "a"), (1, "b")] {
            journal.enter(mark(image, key)).unwrap();
        }
        journal.finish(&[(ImageId(2), digest("absent"))], &[]).unwrap();
        let text = std::fs::read_to_string(scratch.path().join(JOURNAL_NAME)).unwrap();
        assert_eq!(text.lines().count(), 2);
        let journal = MapJournal::open(scratch.path()).unwrap();
        assert_eq!(journal.given(ImageId(1)), None);
        assert!(journal.made_from(ImageId(1), digest("a")).is_none());
        assert!(journal.made_from(ImageId(1), digest("b")).is_some());
        journal.enter(mark(1, "e")).unwrap();
        journal.finish(&[(ImageId(1), digest("b"))], &[]).unwrap();
        assert!(journal.made_from(ImageId(1), digest("b")).is_some());
        journal.finish(&[], &[ImageId(1), ImageId(2)]).unwrap();
        assert_eq!(std::fs::read_dir(scratch.path()).unwrap().count(), 0);
    }
}
