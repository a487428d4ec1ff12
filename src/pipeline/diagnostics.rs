//! What verbose runs leave beside their results.

use super::filter::valid_depths;
use super::prepare::Prepared;
use super::resume::Plan;
use super::schedule::for_each_view;
use crate::error::Result;
use crate::fusion::{FusionMaps, project_maps};
use crate::geometry::Camera;
use crate::progress::Progress;
use crate::scene::CloudLayout;
use crate::store::depth_store::DepthStore;
use crate::store::diagnostics::{ViewCloud, write_meshlab, write_picture};
use std::path::Path;

/// Beside the depth map of every view, as it is after the stage `after`: `depthNNNN<stage>.png`, its points as `depthNNNN<stage>.ply` and, for the
/// empty stage, its confidences as `depthNNNN.conf.png`.
///
/// # Errors
/// A depth map or image cannot be read; the folder cannot be written.
pub(super) fn leave_pictures(
    prepared: &Prepared,
    store: &DepthStore,
    plan: &Plan,
    after: u32,
    stage: &str,
) -> Result<()> {
    for_each_view(&plan.views, 1, &Progress::silent(), |view| {
        let id = prepared.id(view);
        let estimate = plan.read(store, view, after)?;
        let beside = |extension: &str| store.path(id).with_extension(extension);
        write_picture(&beside(&format!("{stage}.png")[1..]), &estimate.depth, true)?;
        if let Some(confidence) = estimate.confidence.as_ref().filter(|_| stage.is_empty()) {
            write_picture(&beside("conf.png"), confidence, false)?;
        }
        let points = valid_depths(&estimate.depth) as u64;
        if points == 0 {
            return Ok(());
        }
        let color = prepared.images.color(view, estimate.depth.size())?;
        let maps = FusionMaps { color: Some(color), ..FusionMaps::new(estimate) };
        let layout = CloudLayout { normals: true, colors: true, ..CloudLayout::default() };
        let path = beside(&format!("{stage}.ply")[1..]);
        let mut cloud = ViewCloud::create(&path, points)?;
        project_maps(view, &maps, None, layout, &mut cloud)?;
        cloud.finish()
    })
}

/// The MeshLab project of the cloud at `cloud`, beside it.
///
/// # Errors
/// It cannot be written.
pub(super) fn leave_project(prepared: &Prepared, cloud: &Path) -> Result<()> {
    let photographs: Vec<(&Path, &Camera)> = prepared
        .views()
        .filter_map(|view| {
            Some((prepared.images.path(view).as_path(), prepared.cameras[view.index()].as_ref()?))
        })
        .collect();
    write_meshlab(&cloud.with_extension("mlp"), cloud, &photographs)
}
