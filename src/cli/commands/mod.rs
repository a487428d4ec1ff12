//! The commands of `semvs`: from typed options to a job, and from its outcome to text.

mod compare;
mod completions;
mod convert;
mod demo;
mod densify;
pub(crate) mod effective;
mod evaluate;
mod export;
mod fuse;
mod import;
mod inspect;
mod labels;
mod man;
mod preview;
mod report;

pub(crate) use compare::{INCOMPARABLE, compare};
pub(crate) use completions::completions;
pub(crate) use convert::convert;
pub(crate) use demo::demo;
pub(crate) use densify::densify;
pub(crate) use evaluate::evaluate;
pub(crate) use export::export;
pub(crate) use fuse::fuse;
pub(crate) use import::import;
pub(crate) use inspect::inspect;
pub(crate) use labels::labels;
pub(crate) use man::man;
pub(crate) use preview::preview;
pub(crate) use report::report;

use super::exchange_args::ArchiveArgs;
use super::label_options::LabelOutput;
use super::listen::Recorder;
use super::options::SharedOptions;
use super::page_args::PageOption;
use super::resolve::{self, Resolver};
use crate::error::{Error, Result};
use crate::pipeline::{self, DEFAULT_POINTS, DEPTH_MAP, DepthMapsJob, Outputs, ReportPageJob, SceneJob};
use crate::progress::Progress;
use crate::report::{OutputReport, RunReport};
use crate::store::atomic::write_file;
use crate::store::cloud::{CloudFormat, PlyLayout};
use crate::store::colmap::Workspace;
use crate::store::paths::with_suffix;
use clap::ArgMatches;
use clap::parser::ValueSource;
use semvs_formats::mvs::{ArchiveKind, Container, NEWEST_VERSION};
use serde_json::{Map, Value};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The cloud that `-o` names: `.ply` is added to a name without extension.
///
/// # Errors
/// It can only be a folder, is a device, or has the extension of another kind of file.
fn cloud_path(typed: &Path) -> Result<PathBuf> {
    let ends_in_separator = typed.as_os_str().to_string_lossy().ends_with(std::path::is_separator);
    match typed.extension() {
        _ if typed.file_name().is_none() => Err(Error::content(typed, "--output: give a file name")),
        _ if ends_in_separator || typed.is_dir() => {
            Err(Error::content(typed, "--output: this is a folder; give the name of a file in it"))
        }
        _ if typed.exists() && !typed.is_file() => {
            Err(Error::content(typed, "--output: this is a device or a pipe; give the name of a file"))
        }
        None => Ok(typed.with_extension("ply")),
        Some(_) if CloudFormat::named(typed).is_some() => Ok(typed.to_owned()),
        Some(_) => {
            Err(Error::content(typed, "--output: clouds are written as .ply, .las or .laz; end the name so"))
        }
    }
}

/// The cloud of a scene when `-o` is not given: `SCENE_dense.ply` beside it; for a COLMAP workspace
/// `semvs/dense.ply` in it.
fn default_cloud(scene: &Path) -> PathBuf {
    if scene.is_dir() {
        return own_folder(scene).join("dense.ply");
    }
    with_suffix(&scene.with_extension(""), "_dense.ply")
}

/// The folder in a COLMAP workspace that holds what this program makes.
fn own_folder(workspace: &Path) -> PathBuf {
    workspace.join("semvs")
}

/// Refuses outputs in the place of COLMAP's own files, if the scene is a COLMAP workspace.
fn spare_workspace(scene: &Path, outputs: &Outputs) -> Result<()> {
    if !scene.is_dir() {
        return Ok(());
    }
    let workspace = Workspace::at(scene, None)?;
    let reports = [outputs.report.as_ref(), outputs.report_html.as_ref()];
    let paths = [Some(&outputs.cloud), outputs.scene.as_ref()].into_iter().chain(reports);
    match paths.flatten().find(|path| workspace.owns(path)) {
        Some(path) => {
            Err(Error::content(path, "this is a file of COLMAP; choose another name for the output"))
        }
        None => Ok(()),
    }
}

/// The kind of archive that is asked for, if one is.
fn archive_kind(typed: ArchiveArgs) -> Option<Container> {
    let newest = Container::Interface { version: NEWEST_VERSION };
    let project = |kind| Container::Project { kind };
    match (typed.mvs_version, typed.archive_type) {
        (Some(version), _) => Some(Container::Interface { version }),
        (None, Some(0)) => Some(project(ArchiveKind::Text)),
        (None, Some(1)) => Some(project(ArchiveKind::Binary)),
        (None, Some(2)) => Some(project(ArchiveKind::Zlib)),
        (None, Some(3)) => Some(project(ArchiveKind::Zstd)),
        (None, Some(_)) => Some(newest),
        (None, None) => None,
    }
}

/// Whether an option was typed, by its long name.
fn is_typed(matches: &ArgMatches, long: &str) -> bool {
    matches.value_source(&long.replace('-', "_")) == Some(ValueSource::CommandLine)
}

/// Options whose paths are relative to the current folder, with remarks about the dense config file as warnings.
fn resolver<'a>(options: &'a SharedOptions, recorder: &Arc<Recorder>) -> Result<Resolver<'a>> {
    let resolver = Resolver::new(options, &Path::to_path_buf)?;
    let progress = recorder.progress();
    resolver.remarks.iter().for_each(|remark| progress.warn(remark.as_str()));
    Ok(resolver)
}

/// What to write for the options about labelled outputs.
///
/// # Errors
/// A page that is not named like one.
fn outputs(
    typed: &LabelOutput,
    page: &PageOption,
    cloud: PathBuf,
    scene: Option<PathBuf>,
) -> Result<Outputs> {
    page.report_html.as_deref().map_or(Ok(()), report::check_page)?;
    Ok(Outputs {
        scene,
        report: typed.report.clone(),
        report_html: page.report_html.clone(),
        ..resolve::outputs(&typed.clouds, cloud, PlyLayout::Plain)
    })
}

/// Fewest images of a point where they must agree on its class, too; `None`: as typed.
fn agreeing_on_class(typed: &ArgMatches) -> Option<u32> {
    const FEWEST: u32 = 2;
    (!is_typed(typed, "number-views-fuse")).then_some(FEWEST)
}

/// Completes the report of `program`, prints its summary, and writes it as `outputs` says.
fn conclude(
    mut report: RunReport,
    program: &str,
    options: Map<String, Value>,
    recorder: &Recorder,
    outputs: &Outputs,
) -> Result<RunReport> {
    report.of_this_build(program);
    report.options = options;
    report.warnings = recorder.warnings();
    if let Some(path) = &outputs.report_html {
        let (path, content) = (path.display().to_string(), "page about the run".to_owned());
        report.outputs.push(OutputReport { path, content, points: None });
    }
    if let Some(path) = &outputs.report {
        write_report(&report, path)?;
    }
    crate::cli::print(&with_maps_in_one_row(&report).summary());
    Ok(report)
}

/// Writes the page about a run, if one is asked for.
///
/// # Errors
/// What the run wrote cannot be read again, or the place cannot be written.
fn write_page(
    run: RunReport,
    input: &SceneJob,
    outputs: &Outputs,
    depth_maps: Option<DepthMapsJob>,
    progress: &Progress,
) -> Result<()> {
    let Some(output) = outputs.report_html.clone() else { return Ok(()) };
    let own_scene = outputs.scene.clone().map(|scene| {
        let folder = scene.parent().unwrap_or(Path::new("")).to_owned();
        (scene, folder)
    });
    let (scene, working_folder) =
        own_scene.unwrap_or_else(|| (input.scene.clone(), input.working_folder.clone()));
    let written = |output: &OutputReport| Path::new(&output.path) == outputs.cloud;
    let page = pipeline::report_page(
        &ReportPageJob {
            output,
            scene,
            working_folder,
            cloud: run.outputs.iter().any(written).then(|| outputs.cloud.clone()),
            depth_maps,
            labels: input.labels.as_ref().map(|labels| labels.sources.clone()),
            run: Some(run),
            points: DEFAULT_POINTS,
            max_threads: input.max_threads,
        },
        progress,
    )?;
    report::print(&page);
    Ok(())
}

/// Writes a report as JSON.
///
/// # Errors
/// The file cannot be written.
pub(crate) fn write_report(report: &RunReport, path: &Path) -> Result<()> {
    let text = report.to_json().map_err(|e| Error::content(path, format!("no JSON: {e}")))?;
    write_file(path, text.as_bytes())
}

/// The report with one row for all depth maps.
fn with_maps_in_one_row(report: &RunReport) -> RunReport {
    let mut short = report.clone();
    let maps: Vec<&OutputReport> = report.outputs.iter().filter(|o| o.content == DEPTH_MAP).collect();
    short.outputs.retain(|o| o.content != DEPTH_MAP);
    if let Some(folder) = maps.first().and_then(|map| Path::new(&map.path).parent()) {
        short.outputs.push(OutputReport {
            path: folder.join("depth*.dmap").display().to_string(),
            content: format!("{} depth maps", maps.len()),
            points: None,
        });
    }
    short
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clouds_end_in_ply_las_or_laz() {
        assert_eq!(cloud_path(Path::new("a/b")).unwrap(), Path::new("a/b.ply"));
        assert_eq!(cloud_path(Path::new("b.PLY")).unwrap(), Path::new("b.PLY"));
        assert_eq!(cloud_path(Path::new("b.las")).unwrap(), Path::new("b.las"));
        assert!(cloud_path(Path::new("b.xyz")).unwrap_err().to_string().contains(".ply, .las or .laz"));
        assert_eq!(default_cloud(Path::new("x/scene.mvs")), Path::new("x/scene_dense.ply"));
    }
}
