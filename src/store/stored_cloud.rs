//! The points that a scene file holds, as a cloud, and the forms in which they are written again.

use super::atomic::AtomicFile;
use super::export::interface_archive;
use super::import::LoadedScene;
use crate::error::{Error, Result};
use crate::geometry::{Camera, Size};
use crate::scene::{CloudLayout, CloudPoint, PointSource, ViewIndex};
use semvs_formats::mvs;
use semvs_formats::ply::{self, Cloud, Encoding, Field, Layout, PlyWriter, TypeNames};
use std::path::Path;

/// The points of a scene file, all or some of them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct StoredCloud<'a> {
    points: &'a mvs::PointCloud,
    /// Positions in `points`; `None` = all.
    order: Option<&'a [u32]>,
    always_colored: bool,
}

impl<'a> StoredCloud<'a> {
    /// All of `points`.
    pub(crate) fn new(points: &'a mvs::PointCloud) -> Self {
        StoredCloud { points, order: None, always_colored: false }
    }

    /// Of the same points those at the positions `order`, in that order.
    pub(crate) fn only(self, order: &'a [u32]) -> Self {
        StoredCloud { order: Some(order), ..self }
    }

    /// The same with white points where they have no colours.
    pub(crate) fn always_colored(self) -> Self {
        StoredCloud { always_colored: true, ..self }
    }

    /// The same points in memory of their own.
    pub(crate) fn copied(&self) -> mvs::PointCloud {
        let mut out = mvs::PointCloud::default();
        self.each(|i| {
            out.positions.push(self.points.positions[i]);
            out.normals.extend(self.points.normals.get(i));
            out.colors.extend(self.points.colors.get(i));
            if !self.points.views.is_empty() {
                out.views.push(self.points.views.images_of(i), self.points.views.weights_of(i));
            }
            Ok(())
        })
        .unwrap_or_default();
        out
    }

    fn each(&self, mut visit: impl FnMut(usize) -> Result<()>) -> Result<()> {
        match self.order {
            Some(order) => order.iter().try_for_each(|&i| visit(i as usize)),
            None => (0..self.points.positions.len()).try_for_each(visit),
        }
    }
}

impl PointSource for StoredCloud<'_> {
    fn layout(&self) -> CloudLayout {
        CloudLayout {
            normals: !self.points.normals.is_empty(),
            colors: self.always_colored || !self.points.colors.is_empty(),
            views: !self.points.views.is_empty(),
            weights: !self.points.views.weights.is_empty(),
            ..CloudLayout::default()
        }
    }

    fn len(&self) -> u64 {
        self.order.map_or(self.points.positions.len(), <[u32]>::len) as u64
    }

    fn for_each(&self, visit: &mut dyn FnMut(&CloudPoint<'_>) -> Result<()>) -> Result<()> {
        const WHITE: [u8; 3] = [255; 3];
        let mut views = Vec::new();
        self.each(|i| {
            views.clear();
            views.extend(self.points.views.images_of(i).iter().map(|&v| ViewIndex(v)));
            visit(&CloudPoint {
                position: self.points.positions[i],
                normal: self.points.normals.get(i).copied().unwrap_or_default(),
                color: self.points.colors.get(i).copied().unwrap_or(WHITE),
                views: &views,
                weights: self.points.views.weights_of(i),
                ..CloudPoint::default()
            })
        })
    }
}

/// The camera of every view at the size that the scene was worked on: that of the stored image, else of the stored
/// camera. `None` for views without a pose or a known size.
pub(crate) fn stored_cameras(loaded: &LoadedScene) -> Vec<Option<Camera>> {
    let images = loaded.archive.images.iter();
    let views = loaded.scene.views.iter().zip(images);
    views
        .map(|(view, image)| {
            let calibration = view.calibration.as_ref()?;
            let worked = (image.width > 0 && image.height > 0).then(|| Size::new(image.width, image.height));
            Some(calibration.camera_at(worked.or(calibration.size)?))
        })
        .collect()
}

/// The scene as it was loaded, with `points` in place of its own, as OpenMVS saves a scene that it only worked on the
/// points of. `project`: for a project archive, which also keeps names, sizes and the mesh.
pub(crate) fn resaved_archive(loaded: &LoadedScene, points: mvs::PointCloud, project: bool) -> mvs::Scene {
    let mut archive = interface_archive(loaded, &vec![None; loaded.scene.views.len()], &[]);
    archive.points = points;
    if project {
        for (platform, stored) in archive.platforms.iter_mut().zip(&loaded.archive.platforms) {
            platform.name.clone_from(&stored.name);
        }
        for (image, camera) in archive.images.iter_mut().zip(stored_cameras(loaded)) {
            let size = camera.map(|camera| camera.size()).unwrap_or_default();
            (image.width, image.height) = (size.width, size.height);
        }
        archive.mesh.clone_from(&loaded.archive.mesh);
    }
    archive
}

/// Writes a cloud with the scale of every point: position, colour, normal, `confidence`, `value`; `value` is the
/// pixel size. `scales` gives size and confidence per point.
///
/// # Errors
/// The cloud cannot be read or has no normals, or the file cannot be written.
pub(crate) fn write_scaled(path: &Path, cloud: &dyn PointSource, scales: &[(f32, f32)]) -> Result<()> {
    const CHUNK: usize = 4096;
    let has = cloud.layout();
    let fields = [
        (Field::Position, true),
        (Field::Color, has.colors),
        (Field::Normal, true),
        (Field::Confidence, true),
        (Field::Value, true),
    ];
    let fields = fields.into_iter().filter(|(_, has)| *has).map(|(field, _)| field).collect();
    let layout = Layout {
        encoding: Encoding::LittleEndian,
        type_names: TypeNames::Sized,
        fields,
        comments: Vec::new(),
    };
    let failed = |error: semvs_formats::Error| Error::writing(path, error);
    let mut writer: PlyWriter<AtomicFile> =
        ply::PlyWriter::new(AtomicFile::create(path)?, &layout, cloud.len()).map_err(failed)?;
    let mut chunk = Cloud::default();
    let mut scales = scales.iter();
    cloud.for_each(&mut |point| {
        let (size, confidence) = scales.next().copied().unwrap_or_default();
        chunk.positions.push(point.position);
        if has.colors {
            chunk.colors.push(point.color);
        }
        chunk.normals.push(point.normal);
        chunk.confidence.push(confidence);
        chunk.value.push(size);
        if chunk.positions.len() == CHUNK {
            writer.write(&chunk).map_err(failed)?;
            chunk.clear();
        }
        Ok(())
    })?;
    writer.write(&chunk).map_err(failed)?;
    writer.finish().map_err(failed)?.commit()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points() -> mvs::PointCloud {
        let mut points = mvs::PointCloud {
            positions: vec![[0.0; 3], [1.0; 3], [2.0; 3]],
            normals: vec![[0.0, 0.0, 1.0]; 3],
            ..mvs::PointCloud::default()
        };
        points.views.push(&[0, 2], &[0.5, 0.25]);
        points.views.push(&[1], &[1.0]);
        points.views.push(&[0, 1, 2], &[1.0, 2.0, 3.0]);
        points
    }

    #[test]
    fn some_points_keep_their_views_and_weights() {
        let points = points();
        let cloud = StoredCloud::new(&points).only(&[2, 0]);
        let copy = cloud.copied();
        assert_eq!(copy.positions, [[2.0; 3], [0.0; 3]]);
        assert_eq!((copy.views.images_of(0), copy.views.weights_of(1)), (&[0, 1, 2][..], &[0.5, 0.25][..]));
        assert_eq!((copy.normals.len(), copy.colors.len()), (2, 0));
        assert_eq!(StoredCloud::new(&points).copied(), points);
    }

    #[test]
    fn points_without_colours_are_white_where_colours_are_wanted() {
        let points = points();
        let cloud = StoredCloud::new(&points);
        assert!(!cloud.layout().colors && cloud.layout().weights);
        let cloud = cloud.always_colored().only(&[1]);
        assert!(cloud.layout().colors && cloud.len() == 1);
        let mut seen = Vec::new();
        cloud
            .for_each(&mut |p| {
                seen.push((p.color, p.views.to_vec()));
                Ok(())
            })
            .unwrap();
        assert_eq!(seen, [([255; 3], vec![ViewIndex(1)])]);
    }
}
