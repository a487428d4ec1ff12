//! OpenMVS's own maps and neighbour lists, for the tests of the stages that must reproduce it.

use crate::common::bytes;
use nalgebra::{Matrix3, Vector3};
use semvs::Result;
use semvs::internals::fusion::{FusionMaps, FusionView, MapInfo, MapSource};
use semvs::internals::geometry::{Camera, Size};
use semvs::internals::scene::{
    Calibration, CloudLayout, CloudPoint, DepthEstimate, Grid, ImageId, PointCloud, PointSink,
    ResolutionOptions, ViewIndex,
};
use semvs::internals::store::images::load_working_color;
use semvs_formats::dmap::DepthMapFile;
use semvs_formats::mvs::{self, Scene};
use semvs_formats::{Limits, ply};
use std::path::Path;
use std::sync::Arc;

/// The depth maps `depthNNNN.dmap.zst` of a folder, by index.
pub(crate) fn depth_maps(folder: &Path) -> Vec<DepthEstimate> {
    (0..)
        .map(|i| folder.join(format!("depth{i:04}.dmap.zst")))
        .take_while(|path| path.exists())
        .map(|path| estimate(DepthMapFile::from_bytes(&bytes(&path), &Limits::default()).unwrap()))
        .collect()
}

fn estimate(file: DepthMapFile) -> DepthEstimate {
    let size = Size::new(file.width, file.height);
    assert_eq!((file.image_width, file.image_height), (file.width, file.height));
    DepthEstimate {
        image_id: ImageId(file.ids[0]),
        image_name: String::from_utf8(file.image_name).unwrap(),
        source_ids: file.ids[1..].iter().map(|&id| ImageId(id)).collect(),
        camera: Camera::new(
            size,
            Matrix3::from_row_slice(&file.k),
            Matrix3::from_row_slice(&file.rotation),
            Vector3::from(file.center),
        ),
        depth_range: (file.depth_min, file.depth_max),
        depth: Grid::from_vec(size, file.depth).unwrap(),
        normal: Grid::from_vec(size, file.normal),
        confidence: Grid::from_vec(size, file.confidence),
    }
}

/// A scene file.
pub(crate) fn scene(path: &Path) -> Scene {
    mvs::read(path, &Limits::default()).unwrap()
}

/// The neighbour lists of a scene, best first. None of the scenes here has more than the filters and fusion retain.
pub(crate) fn neighbor_lists(scene: &Scene) -> Vec<Vec<ViewIndex>> {
    scene.images.iter().map(|image| image.view_scores.iter().map(|s| ViewIndex(s.image)).collect()).collect()
}

/// Maps of all views in memory.
pub(crate) struct MapsInMemory {
    pub(crate) maps: Vec<FusionMaps>,
    pub(crate) views: Vec<FusionView>,
}

impl MapsInMemory {
    /// The maps of `map_folder` with the images of `image_folder` and the neighbours of `scene`.
    pub(crate) fn load(
        map_folder: &Path,
        image_folder: &Path,
        scene: &Scene,
        resolution: ResolutionOptions,
    ) -> Self {
        let maps: Vec<FusionMaps> = depth_maps(map_folder)
            .into_iter()
            .map(|estimate| {
                let color =
                    load_working_color(&image_folder.join(&estimate.image_name), &resolution).unwrap();
                FusionMaps { color: Some(Arc::new(color)), ..FusionMaps::new(Arc::new(estimate)) }
            })
            .collect();
        let views = neighbor_lists(scene)
            .into_iter()
            .zip(&maps)
            .map(|(neighbors, maps)| FusionView {
                maps: Some(MapInfo::of(maps)),
                neighbor_count: neighbors.len(),
                neighbors,
            })
            .collect();
        MapsInMemory { maps, views }
    }
}

impl MapsInMemory {
    /// Where the cameras are.
    pub(crate) fn calibrations(&self) -> Vec<Option<Calibration>> {
        let of = |maps: &FusionMaps| {
            let camera = &maps.estimate.camera;
            Some(Calibration {
                normalized_k: *camera.k(),
                rotation: *camera.rotation(),
                center: *camera.center(),
                size: None,
            })
        };
        self.maps.iter().map(of).collect()
    }
}

/// The columns of a cloud that OpenMVS writes.
pub(crate) fn points(cloud: &ply::Cloud) -> PointCloud {
    let layout =
        CloudLayout { normals: true, colors: true, views: true, weights: true, ..CloudLayout::default() };
    let mut points = PointCloud::new(layout);
    for i in 0..cloud.len() {
        let views: Vec<ViewIndex> = cloud.images_of(i).iter().map(|&v| ViewIndex(v)).collect();
        let point = CloudPoint {
            position: cloud.positions[i],
            normal: cloud.normals[i],
            color: cloud.colors[i],
            views: &views,
            weights: cloud.weights_of(i),
            ..CloudPoint::default()
        };
        points.push(&point).unwrap();
    }
    points
}

impl MapSource for MapsInMemory {
    fn load(&self, view: ViewIndex) -> Result<FusionMaps> {
        Ok(self.maps[view.index()].clone())
    }
}
