//! What a job reads, and what of it can be checked before any work.

use super::job::{LabelJob, MaskJob, SceneJob};
use crate::error::{Error, Result};
use crate::semantics::{ClassPolicy, ClassTable};
use semvs_formats::Limits;
use std::fs::File;
use std::path::{Path, PathBuf};

/// The classes of a run; those of the table `ids` are known only when the label maps are read.
#[derive(Debug)]
pub(super) struct Classes {
    table: ClassTable,
    policy: ClassPolicy,
}

impl Classes {
    /// Both parts.
    pub(super) fn parts(&self) -> (&ClassTable, &ClassPolicy) {
        (&self.table, &self.policy)
    }

    /// Reads the class table and looks up the classes that are named.
    ///
    /// # Errors
    /// No such folder of label maps, an unusable table, a class that it lacks.
    pub(super) fn of(job: &LabelJob) -> Result<Self> {
        let table = job.sources.table(Limits::default())?;
        let policy = ClassPolicy::new(&table, &job.rules)?;
        Ok(Classes { table, policy })
    }
}

/// Checks that the files and folders that `job` names are there, and looks up its classes.
///
/// # Errors
/// The first that cannot be used.
pub(super) fn check_inputs(job: &SceneJob) -> Result<Option<Classes>> {
    // A folder is a workspace, which is looked into when it is read.
    let scene = Some(&job.scene).filter(|scene| !scene.is_dir());
    let files = [scene, job.pointcloud_file.as_ref(), job.view_neighbors_file.as_ref()];
    files.into_iter().flatten().try_for_each(|path| check_file(path))?;
    job.masks.as_ref().map_or(Ok(()), check_mask_folder)?;
    job.labels.as_ref().map(Classes::of).transpose()
}

/// Checks that the folder of masks is there, if one is named.
///
/// # Errors
/// It is not.
pub(super) fn check_mask_folder(job: &MaskJob) -> Result<()> {
    match job.folder.as_deref().filter(|folder| !folder.is_dir()) {
        Some(folder) => Err(Error::content(folder, "no such folder of masks (--mask-path)")),
        None => Ok(()),
    }
}

fn check_file(path: &Path) -> Result<()> {
    if path.is_dir() {
        return Err(Error::content(path, "this is a folder; give a file"));
    }
    File::open(path).map(drop).map_err(|e| Error::io(path, "open", e))
}

/// The files that a job names, none of which an output may replace.
pub(super) fn named_files(job: &SceneJob) -> Vec<PathBuf> {
    let mut files = vec![job.scene.clone()];
    files.extend([&job.pointcloud_file, &job.view_neighbors_file].into_iter().flatten().cloned());
    if let Some(LabelJob { sources, .. }) = &job.labels {
        files.extend(sources.class_table.as_ref().map(PathBuf::from));
        files.extend(sources.label_path.as_ref().map(|folder| folder.join("labels.json")));
    }
    files
}
