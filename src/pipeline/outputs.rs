//! What a run writes at its end, and whether it can, asked at its start.

use super::job::{Outputs, SceneArchive};
use super::prepare::Prepared;
use super::skip::Labels;
use crate::error::{Error, Result};
use crate::fusion::FusionSummary;
use crate::geometry::{Camera, Placement};
use crate::progress::{Event, Progress, SceneSummary};
use crate::report::{ClassRow, OutputReport, fill_shares};
use crate::scene::PointSource;
use crate::semantics::{ClassId, ClassPolicy, ClassTable};
use crate::store::atomic::check_writable;
use crate::store::cloud::{CloudOptions, WrittenClouds, check_cloud_paths, write_clouds};
use crate::store::depth_store::depth_map_name;
use crate::store::export::{
    interface_archive, project_archive, relocate_names, write_interface, write_project, write_project_header,
};
use crate::store::import::LoadedScene;
use crate::store::memory;
use crate::store::paths::is_same_file;
use semvs_formats::mvs;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Bytes of a point of a project archive in memory, at least: position, normal, colour, two views with weights.
const POINT_BYTES: u64 = 12 + 12 + 3 + 8 + 2 * 8;

/// Checks that everything can be written, creating missing folders.
///
/// # Errors
/// The first place that cannot; options about labels without classes.
pub(super) fn check_places(outputs: &Outputs, classes: Option<(&ClassTable, &ClassPolicy)>) -> Result<()> {
    let options = cloud_options(outputs, classes.map(|(table, _)| table));
    check_cloud_paths(&outputs.cloud, &options, classes.map(|(_, policy)| policy))?;
    [&outputs.scene, &outputs.report, &outputs.report_html]
        .into_iter()
        .flatten()
        .try_for_each(|path| check_writable(path))
}

/// Refuses reports in the place of an input or another output, or of a file that is no report: a mistyped name must
/// not cost a photograph.
///
/// # Errors
/// [`Error::Content`] about the report.
pub(super) fn check_report(outputs: &Outputs, inputs: &[PathBuf]) -> Result<()> {
    let others = [Some(&outputs.cloud), outputs.scene.as_ref()];
    let (json, html) = (outputs.report.as_deref(), outputs.report_html.as_deref());
    if let Some(path) = json.filter(|_| json == html) {
        return Err(Error::content(path, "--report and --report-html name one file; choose another name"));
    }
    for (option, path, first_byte) in [("--report", json, b'{'), ("--report-html", html, b'<')] {
        let Some(path) = path else { continue };
        let refused = |what: &str| Err(Error::content(path, format!("{option}: {what}")));
        if inputs.iter().any(|input| is_same_file(input, path)) {
            return refused("this run reads that file; choose another name");
        }
        if others.iter().flatten().any(|other| *other == path) {
            return refused("this run writes another file there; choose another name");
        }
        let mut first = [0u8; 1];
        let begun = File::open(path).and_then(|mut file| file.read(&mut first));
        if matches!(begun, Ok(1)) && first[0] != first_byte {
            return refused("the file there is no report; choose another name or remove it");
        }
    }
    Ok(())
}

/// Checks that depth maps of the views with a camera can be written to `folder`, creating it.
///
/// # Errors
/// They cannot.
pub(super) fn check_depth_maps(
    loaded: &LoadedScene,
    cameras: &[Option<Camera>],
    folder: &Path,
) -> Result<()> {
    let views = loaded.scene.views.iter().zip(cameras).filter(|(_, camera)| camera.is_some());
    views.map(|(view, _)| folder.join(depth_map_name(view.id))).try_for_each(|path| check_writable(&path))
}

fn cloud_options<'a>(outputs: &Outputs, table: Option<&'a ClassTable>) -> CloudOptions<'a> {
    CloudOptions {
        layout: outputs.layout,
        table,
        split_by_class: outputs.split_by_class,
        color_by_label: outputs.color_by_label,
        doubles: outputs.ply_doubles,
        las_without_normals: !outputs.las_normals,
        placement: Placement::default(),
    }
}

/// Where the points of a scene go: by the offset that was given, else by its transform, if the cloud's coordinates have the
/// digits for either.
pub(super) fn placement(outputs: &Outputs, archive: &mvs::Scene, progress: &Progress) -> Placement {
    if !outputs.are_precise() {
        return Placement::default();
    }
    if let Some(offset) = outputs.offset {
        return Placement::shift(offset);
    }
    let Some(placement) = Placement::undoing(&archive.transform) else {
        progress
            .warn("the scene's transform is no similarity and is left alone; --offset says where clouds go");
        return Placement::default();
    };
    if !placement.is_identity() {
        let [x, y, z] = placement.offset();
        let how = if placement.turns() { "turned, scaled and moved" } else { "moved" };
        progress.info(format!(
            "the cloud is {how} by the scene's transform, its origin to ({x}, {y}, {z}); --offset 0,0,0 leaves it in place"
        ));
    }
    placement
}

/// Writes the cloud in all its forms, its points where `placement` says.
///
/// # Errors
/// A file cannot be written.
pub(super) fn write_cloud(
    outputs: &Outputs,
    cloud: &dyn PointSource,
    labels: Option<&Labels>,
    placement: Placement,
    progress: &Progress,
) -> Result<WrittenClouds> {
    clouds(outputs, cloud, labels.map(Labels::table), placement, progress)
}

/// The same for labels that are classes of `table`.
///
/// # Errors
/// A file cannot be written.
pub(super) fn clouds(
    outputs: &Outputs,
    cloud: &dyn PointSource,
    table: Option<&ClassTable>,
    placement: Placement,
    progress: &Progress,
) -> Result<WrittenClouds> {
    let start = Instant::now();
    let options = CloudOptions { placement, ..cloud_options(outputs, table) };
    let written = write_clouds(cloud, &outputs.cloud, &options, progress)?;
    for file in &written.files {
        progress.event(Event::CloudSaved {
            path: file.path.clone(),
            points: file.points,
            elapsed: start.elapsed(),
        });
    }
    Ok(written)
}

/// Writes the scene with its neighbours; a project archive holds the points of `cloud`.
///
/// # Errors
/// The file cannot be written.
pub(super) fn write_scene(
    outputs: &Outputs,
    prepared: &Prepared,
    cloud: &dyn PointSource,
    progress: &Progress,
) -> Result<()> {
    let Some(path) = &outputs.scene else { return Ok(()) };
    let start = Instant::now();
    let Prepared { loaded, cameras, neighbors, .. } = prepared;
    let mut archive = match outputs.archive {
        SceneArchive::Interface | SceneArchive::Header(_) => interface_archive(loaded, cameras, neighbors),
        SceneArchive::Project(_) => {
            memory::require(
                cloud.len() * POINT_BYTES,
                "a project archive with the dense cloud (--archive-type)",
            )?;
            project_archive(loaded, cameras, neighbors, cloud)?
        }
    };
    if let Some(masks) = &prepared.masks {
        masks.enter(&mut archive, &loaded.search.working_folder);
    }
    if outputs.names_from_scene {
        let folder = path.parent().unwrap_or(Path::new(""));
        relocate_names(&mut archive, &loaded.search.working_folder, folder);
    }
    write_archive(path, &archive, outputs.archive)?;
    let scene = summary(&archive, outputs.archive == SceneArchive::Interface);
    progress.event(Event::SceneSaved { path: path.clone(), scene, elapsed: start.elapsed() });
    Ok(())
}

/// Writes `archive` in the form that `kind` says.
///
/// # Errors
/// The file cannot be written.
pub(super) fn write_archive(path: &Path, archive: &mvs::Scene, kind: SceneArchive) -> Result<()> {
    match kind {
        SceneArchive::Interface => write_interface(path, archive),
        SceneArchive::Project(kind) => write_project(path, archive, kind),
        SceneArchive::Header(kind) => write_project_header(path, kind),
    }
}

/// What a written scene holds.
pub(super) fn summary(archive: &mvs::Scene, interface: bool) -> SceneSummary {
    SceneSummary {
        interface,
        images: archive.images.len(),
        calibrated: archive.images.iter().filter(|image| image.pose != mvs::NO_ID).count(),
        points: archive.points.positions.len(),
    }
}

/// The rows of a report about written clouds, whose classes are those of `table`.
pub(super) fn cloud_rows(written: &WrittenClouds, table: Option<&ClassTable>) -> Vec<OutputReport> {
    let content = |class: Option<ClassId>, label_colors: bool| match (class, table) {
        (Some(id), Some(table)) => format!("dense cloud of class {}", table.class_name(id)),
        _ if label_colors => "dense cloud in class colours".to_owned(),
        _ => "dense cloud".to_owned(),
    };
    let clouds = written.files.iter().map(|file| OutputReport {
        path: file.path.display().to_string(),
        content: content(file.class, file.label_colors),
        points: Some(file.points),
    });
    let legend = written.legend.iter().map(|path| OutputReport {
        path: path.display().to_string(),
        content: "legend of the classes".to_owned(),
        points: None,
    });
    clouds.chain(legend).collect()
}

/// What became of every class: pixels as fusion saw them, points as written.
pub(super) fn class_rows(summary: &FusionSummary, written: &WrittenClouds, labels: &Labels) -> Vec<ClassRow> {
    let table = labels.table();
    let mut ids: Vec<ClassId> = table.classes().iter().map(|c| c.id).collect();
    ids.extend(summary.classes.iter().map(|c| ClassId(c.id)));
    ids.push(ClassId::VOID);
    ids.sort_unstable();
    ids.dedup();
    let mut rows: Vec<ClassRow> = ids
        .into_iter()
        .map(|id| {
            let counts = summary.classes.iter().find(|c| c.id == id.0).copied().unwrap_or_default();
            let points = written.classes.get(&id).copied().unwrap_or_default();
            ClassRow {
                id: id.0,
                name: table.class_name(id).into_owned(),
                color: table.color(id),
                kept: labels.policy().is_kept(id),
                pixels: counts.pixels,
                depths: counts.depths,
                points: points.points,
                share: 0.0,
                mean_confidence: (points.points > 0).then(|| points.confidence_sum / points.points as f64),
                rejected: counts.rejected_by_consistency,
                excluded: counts.rejected_by_class,
            }
        })
        .collect();
    fill_shares(&mut rows);
    rows
}
