//! Jobs other than densification, in the order in which OpenMVS looks for them: the first one asked for ends the run.

use super::front::{self, Typing};
use crate::error::Result;
use crate::pipeline::{self, CloudJob, CloudWork, DensifyJob, SceneArchive, SceneJob, SplitJob};
use crate::progress::Progress;
use crate::store::cloud::PlyLayout;
use crate::store::paths::with_suffix;
use std::path::{Path, PathBuf};

/// Does the first of the small jobs that were asked for; `false`: densify.
///
/// # Errors
/// Those of the job.
pub(crate) fn act(typing: &Typing, folder: &Path, job: &DensifyJob, progress: &Progress) -> Result<bool> {
    let actions = &typing.args.actions;
    let place = |typed: &Option<PathBuf>| typed.as_deref().map(|path| front::resolve(folder, path));
    // Points of a tower are for densification, and for the neighbours that are written as text.
    let input = SceneJob { tower: None, ..job.input.clone() };
    if let (Some(region), Some(scene)) = (place(&actions.import_roi_file), &job.outputs.scene) {
        pipeline::import_roi(&input, &region, scene, job.outputs.archive, progress)?;
        return Ok(true);
    }
    if let Some(path) = place(&actions.export_roi_file) {
        if pipeline::export_roi(&input, &path, progress)? {
            return Ok(true);
        }
        progress.warn(format!("{}: not written, the scene has no region of interest", path.display()));
    }
    if let Some(path) = place(&actions.output_view_neighbors_file) {
        pipeline::export_neighbors(&job.input, &path, progress)?;
        return Ok(true);
    }
    if actions.sub_scene_area > 0.0 {
        pipeline::split_scene(&split_job(typing, job, input), progress)?;
        return Ok(true);
    }
    let work = if actions.filter_point_cloud < 0 {
        CloudWork::FilterByVisibility(i64::from(actions.filter_point_cloud))
    } else if actions.export_number_views != 0 {
        CloudWork::WellSeen(actions.export_number_views.unsigned_abs())
    } else if actions.estimate_scale > 0.0 {
        CloudWork::Scale(actions.estimate_scale)
    } else if typing.args.strict_openmvs
        && job.outputs.archive == SceneArchive::Interface
        && pipeline::is_project(&job.input)
    {
        CloudWork::Export
    } else {
        return Ok(false);
    };
    pipeline::finished_cloud(&cloud_job(typing, job, input, work), progress)?;
    Ok(true)
}

/// The parts are named `scene_NNNN.mvs`, whatever the scene's name, in the folder of the results.
fn split_job(typing: &Typing, job: &DensifyJob, input: SceneJob) -> SplitJob {
    let folder = job.outputs.cloud.parent().filter(|p| !p.as_os_str().is_empty());
    SplitJob {
        input,
        depth_maps: job.depth_maps.clone(),
        max_area: typing.args.actions.sub_scene_area,
        folder: folder.unwrap_or(Path::new(".")).to_owned(),
        archive: job.outputs.archive,
        number_by_position: typing.args.strict_openmvs,
    }
}

/// The results are `BASE_filtered`, `BASE_Nviews`, `BASE_scale`.
fn cloud_job(typing: &Typing, job: &DensifyJob, input: SceneJob, work: CloudWork) -> CloudJob {
    let scene_too = typing.args.actions.export_number_views < 0;
    let (suffix, scene) = match work {
        CloudWork::FilterByVisibility(_) => ("_filtered".to_owned(), true),
        CloudWork::WellSeen(views) => (format!("_{views}views"), scene_too),
        CloudWork::Scale(_) => ("_scale".to_owned(), false),
        CloudWork::Export => (String::new(), true),
    };
    let base = with_suffix(&job.outputs.cloud.with_extension(""), suffix);
    let mut outputs = job.outputs.clone();
    let extension = match work {
        CloudWork::Scale(_) => "ply".into(),
        _ => job.outputs.cloud.extension().unwrap_or_default().to_owned(),
    };
    outputs.cloud = base.with_file_name(format!(
        "{}.{}",
        base.file_name().unwrap_or_default().to_string_lossy(),
        extension.to_string_lossy()
    ));
    if matches!(work, CloudWork::WellSeen(_)) && !typing.has("ply-layout") {
        outputs.layout = PlyLayout::OpenMvsProject;
    }
    outputs.scene = scene.then(|| with_suffix(&base, ".mvs"));
    CloudJob { input, work, outputs }
}
