//! A cloud that exists to other formats.

use super::job::Outputs;
use super::outputs::{check_places, cloud_rows, clouds};
use crate::error::{Error, Result};
use crate::geometry::Placement;
use crate::progress::Progress;
use crate::report::RunReport;
use crate::scene::PointSource;
use crate::semantics::{ClassPolicy, ClassRules, ClassTable};
use crate::store::labels::LabelSources;
use crate::store::paths::is_same_file;
use crate::store::ply_source::PlySource;
use semvs_formats::Limits;
use std::path::PathBuf;

/// `convert` of a cloud.
#[derive(Clone, Debug)]
pub struct ConvertCloudJob {
    /// The cloud, a PLY file.
    pub cloud: PathBuf,
    /// Built-in class table or file. `None`: the classes that the header lists, else those met, by number.
    pub class_table: Option<String>,
    /// What to keep.
    pub rules: ClassRules,
    /// What to write.
    pub outputs: Outputs,
}

/// Runs `job`: the points as they are, those of unwanted classes left out.
///
/// # Errors
/// An unreadable file, a class that is not known, an output that cannot be written or is the input.
pub fn convert_cloud(job: &ConvertCloudJob, progress: &Progress) -> Result<RunReport> {
    let limits = Limits::default();
    let source = PlySource::open(&job.cloud, limits)?;
    job.outputs.check(source.layout().labels)?;
    if is_same_file(&job.cloud, &job.outputs.cloud) {
        return Err(Error::content(&job.outputs.cloud, "--output: this is the input; choose another name"));
    }
    if !source.layout().labels && (job.class_table.is_some() || job.rules != ClassRules::default()) {
        return Err(Error::content(
            &job.cloud,
            "its points have no labels, which the options about classes need",
        ));
    }
    let classes = source.layout().labels.then(|| classes(job, &source, limits)).transpose()?;
    check_places(&job.outputs, classes.as_ref().map(|(table, policy)| (table, policy)))?;
    let source = match &classes {
        Some((_, policy)) => source.keeping(policy.clone())?,
        None => source,
    };
    if source.is_empty() {
        return Err(Error::content(&job.cloud, "no point of it is wanted; nothing is written"));
    }
    if source.origin() != [0.0; 3] && !job.outputs.are_precise() {
        let cloud = job.outputs.cloud.display();
        progress
            .warn(format!("{cloud}: coordinates are rounded to 32 bits; --ply-doubles keeps their digits"));
    }
    let placement = Placement::shift(job.outputs.offset.unwrap_or_default()).after_shift(source.origin());
    let table = classes.as_ref().map(|(table, _)| table);
    let written = clouds(&job.outputs, &source, table, placement, progress)?;
    let outputs = cloud_rows(&written, table);
    Ok(RunReport { points: source.len(), outputs, ..RunReport::default() })
}

/// The classes of the labels, and what to do with each.
fn classes(job: &ConvertCloudJob, source: &PlySource, limits: Limits) -> Result<(ClassTable, ClassPolicy)> {
    let listed = match &job.class_table {
        Some(_) => {
            let class_table = job.class_table.clone();
            Some(LabelSources { class_table, ..LabelSources::default() }.table(limits)?)
        }
        None => source.listed_classes()?,
    };
    let table = listed.unwrap_or_else(ClassTable::ids);
    let met = source.labels()?;
    if let Some(stranger) = met.iter().find(|&&id| !table.contains(id)) {
        let what = format!(
            "label {stranger} is not in class table {}; give the table of these labels",
            table.name()
        );
        return Err(Error::content(&job.cloud, what));
    }
    let table = table.with_ids(met);
    let policy = ClassPolicy::new(&table, &job.rules)?;
    Ok((table, policy))
}
