//! From files to what is compared.

use crate::error::{Error, Result};
use crate::evaluate::{ComparedImage, ComparedScene};
use crate::scene::{
    Calibration, CloudLayout, CloudPoint, ImageId, Neighbor, PointCloud, PointSink, ViewIndex,
};
use crate::store::import::{import_calibration, import_roi};
use crate::store::packed;
use semvs_formats::mvs::{self, NO_ID, Visibility};
use semvs_formats::{Limits, ply};
use std::path::Path;

/// Reads a scene of any kind.
pub(super) fn scene(path: &Path) -> Result<ComparedScene> {
    let archive = packed::read_scene(path, &Limits::default())?;
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    let image = |(i, image): (usize, &mvs::Image)| {
        let calibration = import_calibration(&archive, image);
        if calibration.is_none() && image.pose != NO_ID {
            return Err(Error::content(path, format!("image {i} names a camera that is not there")));
        }
        Ok(ComparedImage {
            name: text(&image.name),
            mask: text(&image.mask_name),
            id: ImageId(image.id_at(i)),
            calibration,
            depths: [image.min_depth, image.avg_depth, image.max_depth],
            neighbors: image.view_scores.iter().map(neighbor).collect(),
        })
    };
    Ok(ComparedScene {
        platforms: archive.platforms.len(),
        images: archive.images.iter().enumerate().map(image).collect::<Result<_>>()?,
        points: sparse_points(&archive.points)?,
        roi: archive.obb.as_ref().map(import_roi),
        transform: archive.transform,
    })
}

/// Poses of a scene's images.
pub(super) fn calibrations(path: &Path) -> Result<Vec<Option<Calibration>>> {
    Ok(scene(path)?.images.into_iter().map(|image| image.calibration).collect())
}

fn neighbor(stored: &mvs::ViewScore) -> Neighbor {
    let mvs::ViewScore { image, points, scale, angle, area, score } = *stored;
    Neighbor { view: ViewIndex(image), points, scale, angle, area, score }
}

fn sparse_points(points: &mvs::PointCloud) -> Result<PointCloud> {
    let cloud = ply::Cloud {
        positions: points.positions.clone(),
        normals: points.normals.clone(),
        colors: points.colors.clone(),
        views: points.views.clone(),
        ..ply::Cloud::default()
    };
    columns(&cloud)
}

/// Reads a cloud.
pub(super) fn cloud(path: &Path) -> Result<PointCloud> {
    columns(&packed::read_cloud(path, &Limits::default())?)
}

/// The points of a cloud, their views in ascending order.
fn columns(cloud: &ply::Cloud) -> Result<PointCloud> {
    let layout = CloudLayout {
        normals: !cloud.normals.is_empty(),
        colors: !cloud.colors.is_empty(),
        views: cloud.has_views(),
        weights: !cloud.views.weights.is_empty(),
        confidence: !cloud.confidence.is_empty(),
        labels: !cloud.labels.is_empty(),
    };
    let mut points = PointCloud::new(layout);
    let (mut views, mut weights) = (Vec::new(), Vec::new());
    for (i, &position) in cloud.positions.iter().enumerate() {
        sorted_views(&cloud.views, i, &mut views, &mut weights);
        points.push(&CloudPoint {
            position,
            normal: cloud.normals.get(i).copied().unwrap_or_default(),
            color: cloud.colors.get(i).copied().unwrap_or_default(),
            views: &views,
            weights: if layout.weights { &weights } else { &[] },
            confidence: cloud.confidence.get(i).copied().unwrap_or_default(),
            label: cloud.labels.get(i).copied().unwrap_or_default(),
            label_confidence: cloud.label_confidence.get(i).copied().unwrap_or_default(),
        })?;
    }
    Ok(points)
}

fn sorted_views(lists: &Visibility, i: usize, views: &mut Vec<ViewIndex>, weights: &mut Vec<f32>) {
    let stored = lists.weights_of(i);
    let mut entries: Vec<(ViewIndex, f32)> = Vec::new();
    for (k, &image) in lists.images_of(i).iter().enumerate() {
        entries.push((ViewIndex(image), stored.get(k).copied().unwrap_or_default()));
    }
    entries.sort_by_key(|(view, _)| *view);
    views.clear();
    weights.clear();
    views.extend(entries.iter().map(|(view, _)| *view));
    weights.extend(entries.iter().map(|(_, weight)| *weight));
}
