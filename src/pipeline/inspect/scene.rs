//! What is in a scene file.

use super::bytes_of;
use super::values::{Bounds, Range, RangeOf};
use crate::error::{Error, Result};
use semvs_formats::Limits;
use semvs_formats::mvs::{ArchiveKind, Container, NO_ID, Scene, SceneFile};
use serde::Serialize;
use std::path::Path;

/// A `.mvs` file.
#[derive(Clone, Debug, Serialize)]
pub struct SceneFacts {
    /// The file.
    pub file: String,
    /// Its size in bytes.
    pub bytes: u64,
    /// `interface archive` or `project archive`.
    pub archive: String,
    /// Version of an interface archive.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub version: Option<u32>,
    /// How a project archive is stored: `text`, `binary`, `zlib`, `zstd`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub storage: Option<&'static str>,
    /// Platforms.
    pub platforms: usize,
    /// Cameras on them.
    pub cameras: Vec<CameraFacts>,
    /// Images.
    pub images: Vec<ImageFacts>,
    /// Images with a pose.
    pub calibrated: usize,
    /// Sparse or dense points.
    pub points: PointFacts,
    /// Box around the camera centres.
    pub camera_bounds: Option<Bounds>,
    /// Whether there is a region of interest.
    pub region_of_interest: Option<RoiFacts>,
    /// What would keep the scene from being used.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub problem: Option<String>,
}

/// A camera.
#[derive(Clone, Debug, Serialize)]
pub struct CameraFacts {
    /// Image width that the intrinsics refer to; 0 = they are normalised.
    pub width: u32,
    /// Image height.
    pub height: u32,
    /// Focal lengths.
    pub focal: [f64; 2],
    /// Principal point.
    pub principal_point: [f64; 2],
}

/// An image.
#[derive(Clone, Debug, Serialize)]
pub struct ImageFacts {
    /// Position in the scene.
    pub index: usize,
    /// Global ID.
    pub id: u32,
    /// Path as stored.
    pub name: String,
    /// Mask path as stored.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mask: Option<String>,
    /// Whether it has a pose.
    pub calibrated: bool,
    /// Scored neighbours stored with it.
    pub neighbors: usize,
}

/// The points.
#[derive(Clone, Debug, Serialize)]
pub struct PointFacts {
    /// Points.
    pub count: usize,
    /// Views per point.
    pub views: Option<Range>,
    /// Whether there are colours.
    pub colors: bool,
    /// Whether there are normals.
    pub normals: bool,
    /// Box around them.
    pub bounds: Option<Bounds>,
}

/// The region of interest.
#[derive(Clone, Debug, Serialize)]
pub struct RoiFacts {
    /// Centre.
    pub center: [f64; 3],
    /// Half sizes.
    pub half_extent: [f64; 3],
}

pub(super) fn inspect(path: &Path) -> Result<SceneFacts> {
    let file = SceneFile::read(path, &Limits::default()).map_err(|e| Error::format(path, e))?;
    let scene = &file.scene;
    let (archive, version, storage) = match file.container {
        Container::Interface { version } => ("interface archive", Some(version), None),
        Container::Project { kind } => ("project archive", None, Some(storage_name(kind))),
    };
    let centers = scene.platforms.iter().flat_map(|p| p.poses.iter().map(|pose| pose.center));
    Ok(SceneFacts {
        file: path.display().to_string(),
        bytes: bytes_of(path)?,
        archive: archive.to_owned(),
        version,
        storage,
        platforms: scene.platforms.len(),
        cameras: scene.platforms.iter().flat_map(|p| &p.cameras).map(camera).collect(),
        images: (0..scene.images.len()).map(|i| image(scene, i)).collect(),
        calibrated: scene.images.iter().filter(|i| i.pose != NO_ID).count(),
        points: points(scene),
        camera_bounds: Bounds::of(centers),
        region_of_interest: scene
            .obb
            .map(|obb| RoiFacts { center: obb.center, half_extent: obb.half_extent }),
        problem: scene.check().err().map(|e| e.to_string()),
    })
}

fn storage_name(kind: ArchiveKind) -> &'static str {
    match kind {
        ArchiveKind::Text => "text",
        ArchiveKind::Binary => "binary",
        ArchiveKind::Zlib => "zlib",
        ArchiveKind::Zstd => "zstd",
    }
}

fn camera(camera: &semvs_formats::mvs::Camera) -> CameraFacts {
    let k = &camera.k;
    CameraFacts {
        width: camera.width,
        height: camera.height,
        focal: [k[0], k[4]],
        principal_point: [k[2], k[5]],
    }
}

fn image(scene: &Scene, index: usize) -> ImageFacts {
    let image = &scene.images[index];
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    ImageFacts {
        index,
        id: if image.id == NO_ID { index as u32 } else { image.id },
        name: text(&image.name),
        mask: (!image.mask_name.is_empty()).then(|| text(&image.mask_name)),
        calibrated: image.pose != NO_ID,
        neighbors: image.view_scores.len(),
    }
}

fn points(scene: &Scene) -> PointFacts {
    let points = &scene.points;
    let mut views = RangeOf::new();
    for i in 0..points.views.len() {
        views.add(points.views.images_of(i).len() as f64);
    }
    PointFacts {
        count: points.positions.len(),
        views: views.range(),
        colors: !points.colors.is_empty(),
        normals: !points.normals.is_empty(),
        bounds: Bounds::of(points.positions.iter().map(|p| p.map(f64::from))),
    }
}
