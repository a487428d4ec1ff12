//! The bundled scene facade6 with the maps that OpenMVS made of it.

use crate::common::facade6;
use crate::openmvs_maps::{MapsInMemory, scene};
use semvs::internals::scene::{GrayImage, ResolutionOptions, ViewIndex, gray_from_color};
use semvs::internals::stereo::{ReferenceImage, StereoOptions, StereoProblem};
use std::sync::Arc;

/// Half the size of the photographs: 200 × 150 pixels.
pub(crate) const RESOLUTION: ResolutionOptions = ResolutionOptions { level: 1, min: 160, max: 2560 };

/// The maps of a step (`raw`, `post7`) with colours and neighbours.
pub(crate) fn maps(step: &str) -> MapsInMemory {
    let folder = facade6().join("openmvs-2.3.0");
    let scene = scene(&folder.join("post7/scene_dense.mvs"));
    MapsInMemory::load(&folder.join(step), &facade6(), &scene, RESOLUTION)
}

/// The problem of estimating the first view against its neighbours, without sparse points.
pub(crate) fn problem(maps: &MapsInMemory) -> StereoProblem {
    let image = |view: usize| {
        let estimate = &maps.maps[view].estimate;
        let color = maps.maps[view].color.as_ref().unwrap();
        let gray: Arc<GrayImage> = Arc::new(gray_from_color(color));
        ReferenceImage { gray, camera: estimate.camera.clone(), id: estimate.image_id }
    };
    let halvings = StereoOptions::default().levels;
    let source = |view: &ViewIndex| image(view.index()).as_source(halvings);
    StereoProblem {
        reference: image(0),
        image_name: maps.maps[0].estimate.image_name.clone(),
        sources: maps.views[0].neighbors.iter().map(source).collect(),
        depth_range: maps.maps[0].estimate.depth_range,
        sparse: Vec::new(),
        skip: None,
        labels: None,
        regions: Vec::new(),
    }
}
