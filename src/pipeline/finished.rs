//! Work on the cloud that a scene already has: filter it by visibility, take its well-seen points, tell their scale.

use super::job::{Outputs, SceneArchive, SceneJob};
use super::outputs::{check_places, cloud_rows, placement, summary, write_archive, write_cloud};
use super::prepare::load;
use super::record::with_threads;
use crate::cloud_filter::{PointViews, point_scales, point_visibility, swap_removed};
use crate::error::{Error, Result};
use crate::fusion::WithNormals;
use crate::progress::{Event, Progress};
use crate::report::{OutputReport, RunReport};
use crate::scene::{PointSource, View};
use crate::store::atomic::check_writable;
use crate::store::import::LoadedScene;
use crate::store::stored_cloud::{StoredCloud, resaved_archive, stored_cameras, write_scaled};
use nalgebra::Vector3;
use semvs_formats::mvs;
use std::path::Path;
use std::time::Instant;

/// What to do with the cloud of a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CloudWork {
    /// Remove the points whose visibility is at most this, see [`point_visibility`].
    FilterByVisibility(i64),
    /// Keep the points that at least this many views see.
    WellSeen(u32),
    /// Tell the size of a pixel at every point, times this factor.
    Scale(f32),
    /// Write the cloud as it is, and a scene without points.
    Export,
}

/// Work on the cloud that a scene already has.
#[derive(Clone, Debug)]
pub struct CloudJob {
    /// The scene, whose points are the cloud.
    pub input: SceneJob,
    /// What to do.
    pub work: CloudWork,
    /// The cloud to write and, if wanted, the scene with it.
    pub outputs: Outputs,
}

/// Runs `job`.
///
/// # Errors
/// The scene has no points or they do not know their views; nothing remains; a file cannot be read or written.
pub fn finished_cloud(job: &CloudJob, progress: &Progress) -> Result<RunReport> {
    with_threads(job.input.max_threads, || run(job, progress))
}

fn run(job: &CloudJob, progress: &Progress) -> Result<RunReport> {
    let start = Instant::now();
    let outputs = job.outputs.without_labels();
    outputs.check(false)?;
    check_places(&outputs, None)?;
    let loaded = load(&job.input, progress)?;
    let points = &loaded.archive.points;
    if job.work != CloudWork::Export && (points.positions.is_empty() || points.views.is_empty()) {
        return Err(Error::content(
            &loaded.path,
            "a cloud whose points know the views that see them is needed: densify with --archive-type 0 to 3, or give \
             the cloud with --pointcloud-file",
        ));
    }
    let mut report = RunReport { scene: job.input.scene.display().to_string(), ..RunReport::default() };
    match job.work {
        CloudWork::Scale(factor) => scale(job, &loaded, factor, progress, &mut report)?,
        CloudWork::Export => {
            let all: Vec<u32> = (0..points.positions.len() as u32).collect();
            keep(job, &loaded, &all, progress, &mut report)?;
        }
        CloudWork::FilterByVisibility(limit) => {
            let visibility = point_visibility(point_views(&loaded), &stored_cameras(&loaded));
            keep(job, &loaded, &swap_removed(&visibility, limit), progress, &mut report)?;
        }
        CloudWork::WellSeen(least) => {
            let count = |i: usize| points.views.images_of(i).len() as i64;
            let counts: Vec<i64> = (0..points.positions.len()).map(count).collect();
            let well_seen = |&i: &u32| counts[i as usize] >= i64::from(least);
            let order: Vec<u32> = (0..counts.len() as u32).filter(well_seen).collect();
            keep(job, &loaded, &order, progress, &mut report)?;
        }
    }
    report.seconds = start.elapsed().as_secs_f64();
    Ok(report)
}

fn point_views(loaded: &LoadedScene) -> PointViews<'_> {
    let points = &loaded.archive.points;
    PointViews { positions: &points.positions, offsets: &points.views.offsets, views: &points.views.images }
}

/// Writes the points of `order` and, if wanted, the scene with them alone.
fn keep(
    job: &CloudJob,
    loaded: &LoadedScene,
    order: &[u32],
    progress: &Progress,
    report: &mut RunReport,
) -> Result<()> {
    let all = loaded.archive.points.positions.len();
    if order.is_empty() && job.work != CloudWork::Export {
        return Err(Error::content(
            &loaded.path,
            format!("none of its {all} points remains; nothing is written"),
        ));
    }
    progress.info(format!("Points kept: {} of {all}, {} removed", order.len(), all - order.len()));
    let mut cloud = StoredCloud::new(&loaded.archive.points).only(order);
    if matches!(job.work, CloudWork::WellSeen(_)) {
        cloud = cloud.always_colored();
    }
    let outputs = job.outputs.without_labels();
    let place = placement(&outputs, &loaded.archive, progress);
    let written = write_cloud(&outputs, &cloud, None, place, progress)?;
    report.points = cloud.len();
    report.outputs.extend(cloud_rows(&written, None));
    if let Some(path) = &job.outputs.scene {
        let points = if job.work == CloudWork::Export { mvs::PointCloud::default() } else { cloud.copied() };
        write_points(path, loaded, points, job.outputs.archive, progress)?;
        report.outputs.extend(job.outputs.scene_row());
    }
    Ok(())
}

fn write_points(
    path: &Path,
    loaded: &LoadedScene,
    points: mvs::PointCloud,
    archive: SceneArchive,
    progress: &Progress,
) -> Result<()> {
    let start = Instant::now();
    let resaved = resaved_archive(loaded, points, matches!(archive, SceneArchive::Project(_)));
    write_archive(path, &resaved, archive)?;
    let scene = summary(&resaved, archive == SceneArchive::Interface);
    progress.event(Event::SceneSaved { path: path.to_owned(), scene, elapsed: start.elapsed() });
    Ok(())
}

fn scale(
    job: &CloudJob,
    loaded: &LoadedScene,
    factor: f32,
    progress: &Progress,
    report: &mut RunReport,
) -> Result<()> {
    let start = Instant::now();
    let path = &job.outputs.cloud;
    check_writable(path)?;
    let points = &loaded.archive.points;
    let scales = point_scales(point_views(loaded), &points.views.weights, &stored_cameras(loaded));
    let scales: Vec<(f32, f32)> = scales.iter().map(|s| (s.size * factor, s.confidence)).collect();
    let cloud = StoredCloud::new(points);
    let centers: Vec<Vector3<f64>> = loaded.scene.views.iter().map(center).collect();
    if cloud.layout().normals {
        write_scaled(path, &cloud, &scales)?;
    } else {
        write_scaled(path, &WithNormals::estimate(&cloud, &centers)?, &scales)?;
    }
    report.points = cloud.len();
    report.outputs.push(OutputReport {
        path: path.display().to_string(),
        content: "cloud with scales".to_owned(),
        points: Some(cloud.len()),
    });
    progress.event(Event::CloudSaved { path: path.clone(), points: cloud.len(), elapsed: start.elapsed() });
    Ok(())
}

fn center(view: &View) -> Vector3<f64> {
    view.calibration.as_ref().map_or_else(Vector3::zeros, |calibration| calibration.center)
}
