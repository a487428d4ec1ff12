//! Points of a tower that the cameras climb, before neighbours are looked for.

use super::job::{TowerJob, TowerWork};
use crate::error::Result;
use crate::geometry::Camera;
use crate::progress::Progress;
use crate::scene::{
    CloudLayout, CloudPoint, NeighborOptions, PointCloud, PointSink, PointSource, Scene, TowerPoints, Tracks,
    looks_like_tower, select_neighbors, tower_points,
};
use crate::store::cloud::{CloudOptions, write_clouds};
use crate::store::import::LoadedScene;
use semvs_formats::mvs;

/// Makes points for the tower that the cameras climb, if they do, and uses them as `job` says.
///
/// # Errors
/// The cloud of the tower cannot be written.
pub(super) fn use_tower(
    loaded: &mut LoadedScene,
    job: &TowerJob,
    neighbors: &NeighborOptions,
    progress: &Progress,
) -> Result<()> {
    if !job.unchecked && !looks_like_tower(&loaded.scene, job.any_direction) {
        return Ok(());
    }
    let Some(tower) = tower_points(&loaded.scene) else {
        progress.warn(
            "the cameras climb as around a tower, but no points are made up for it: the scene is not in metres \
             (--tower-mode 0 does not look for one)",
        );
        return Ok(());
    };
    if tower.tracks.is_empty() {
        return Ok(());
    }
    progress.info(format!(
        "The cameras climb as around a tower: {} points on it are made up (--tower-mode)",
        tower.tracks.len()
    ));
    write_clouds(&cloud_of(&tower)?, &job.cloud, &CloudOptions::default(), progress)?;
    if matches!(job.work, TowerWork::Neighbors | TowerWork::NeighborsAndAppend) {
        set_neighbors(&mut loaded.scene, &tower, neighbors)?;
    }
    if job.work == TowerWork::Replace {
        loaded.scene.tracks = Tracks::default();
        loaded.archive.points = mvs::PointCloud::default();
    }
    if job.work != TowerWork::Neighbors {
        append(loaded, &tower);
    }
    Ok(())
}

fn cloud_of(tower: &TowerPoints) -> Result<PointCloud> {
    let mut cloud = PointCloud::new(CloudLayout { normals: true, views: true, ..CloudLayout::default() });
    for ((position, views), &normal) in tower.tracks.iter().zip(&tower.normals) {
        cloud.push(&CloudPoint { position, normal, views, ..CloudPoint::default() })?;
    }
    debug_assert_eq!(cloud.len() as usize, tower.normals.len());
    Ok(cloud)
}

/// Gives every view the neighbours that share points of the tower with it; one that shares none keeps what it has.
fn set_neighbors(scene: &mut Scene, tower: &TowerPoints, options: &NeighborOptions) -> Result<()> {
    let cameras: Vec<Option<Camera>> = scene
        .views
        .iter()
        .map(|view| view.calibration.as_ref().and_then(|c| Some(c.camera_at(c.size?))))
        .collect();
    let mut alone = Scene { tracks: tower.tracks.clone(), ..scene.clone() };
    alone.views.iter_mut().for_each(|view| view.neighbors.clear());
    for (view, found) in scene.views.iter_mut().zip(select_neighbors(&alone, &cameras, options)?) {
        if !found.all.is_empty() {
            (view.neighbors, view.avg_depth) = (found.all, found.avg_depth);
        }
    }
    Ok(())
}

/// Adds the points to those of the scene, with the attributes that those have.
fn append(loaded: &mut LoadedScene, tower: &TowerPoints) {
    const WHITE: [u8; 3] = [255; 3];
    let points = &mut loaded.archive.points;
    let before = points.positions.len();
    let (normals, colors) = (!points.normals.is_empty(), !points.colors.is_empty());
    let (views, weights) = (before == 0 || !points.views.is_empty(), !points.views.weights.is_empty());
    for ((position, seen), &normal) in tower.tracks.iter().zip(&tower.normals) {
        loaded.scene.tracks.push(position, seen.iter().copied());
        points.positions.push(position);
        if normals {
            points.normals.push(normal);
        }
        if colors {
            points.colors.push(WHITE);
        }
        if views {
            let images: Vec<u32> = seen.iter().map(|v| v.0).collect();
            let ones = vec![1.0; if weights { images.len() } else { 0 }];
            points.views.push(&images, &ones);
        }
    }
}
