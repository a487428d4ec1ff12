//! `semvs report`.

use crate::cli::page_args::ReportArgs;
use crate::cli::resolve;
use crate::error::{Error, Result};
use crate::pipeline::{self, ReportPageJob, WrittenPage};
use crate::progress::Progress;
use crate::report::grouped;
use crate::store::labels::LabelSources;
use std::path::Path;

/// Runs the command.
pub(crate) fn report(args: &ReportArgs, progress: &Progress) -> Result<()> {
    let (scene, cloud, maps) = (args.scene.as_deref(), args.cloud.as_deref(), args.depth_maps.as_deref());
    let mut job = ReportPageJob::of_folder(&args.folder, scene, cloud, maps)?;
    if let Some(path) = &args.output {
        check_page(path)?;
        job.output.clone_from(path);
    }
    if args.label_path.is_some() || args.class_table.is_some() {
        let class_table = args.class_table.as_deref().map(|name| resolve::table(name, &Path::to_path_buf));
        job.labels = Some(LabelSources {
            label_path: args.label_path.clone(),
            class_table,
            ..LabelSources::default()
        });
    }
    job.working_folder = args.working_folder.clone().unwrap_or_default();
    job.points = args.points;
    job.max_threads = args.max_threads as usize;
    print(&pipeline::report_page(&job, progress)?);
    Ok(())
}

/// Refuses a page in the place of another kind of file: a mistyped name must not cost a cloud.
///
/// # Errors
/// [`Error::Content`].
pub(super) fn check_page(path: &Path) -> Result<()> {
    let is_page =
        path.extension().is_some_and(|e| e.eq_ignore_ascii_case("html") || e.eq_ignore_ascii_case("htm"));
    match is_page {
        true => Ok(()),
        false => Err(Error::content(path, "a page is written; end the name in .html")),
    }
}

/// Says what was written.
pub(super) fn print(page: &WrittenPage) {
    crate::cli::print(&format!(
        "{}: {} views, {} points, {:.1} MB\n",
        page.path.display(),
        page.views,
        grouped(page.points as u64),
        page.bytes as f64 / 1e6
    ));
}
