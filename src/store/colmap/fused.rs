//! The cloud of COLMAP's fusion.

use super::Workspace;
use crate::error::{Error, Result};
use semvs_formats::colmap::{Model, SensorKind, read_visibility};
use semvs_formats::mvs::Visibility;
use semvs_formats::{Limits, ply};
use std::collections::HashMap;
use std::fs::File;

impl Workspace {
    /// `fused.ply` with the views of `fused.ply.vis`, as positions of images in the scene that
    /// [`Workspace::read_scene`] gives.
    ///
    /// # Errors
    /// A file is missing or damaged, they differ in their numbers of points, or a view is not in the model.
    pub fn read_fused(&self, limits: &Limits) -> Result<ply::Cloud> {
        let path = self.root.join("fused.ply");
        let file = File::open(&path).map_err(|e| Error::io(&path, "open", e))?;
        let mut cloud = ply::read_cloud(file, limits).map_err(|e| Error::format(&path, e))?;
        let path = self.root.join("fused.ply.vis");
        let file = File::open(&path).map_err(|e| Error::io(&path, "open", e))?;
        let length = file.metadata().map_err(|e| Error::io(&path, "read", e))?.len();
        let lists = read_visibility(file, Some(length), limits).map_err(|e| Error::format(&path, e))?;
        if lists.len() != cloud.len() {
            let what = format!("lists of {} points, the cloud beside it has {}", lists.len(), cloud.len());
            return Err(Error::content(&path, what));
        }
        let order = registered_order(&self.read_model(limits)?);
        let mut views = Visibility::default();
        for i in 0..lists.len() {
            let place = |&index: &u32| {
                order.get(index as usize).copied().ok_or_else(|| {
                    let what = format!("a point is seen by image {index}, the model has {}", order.len());
                    Error::content(&path, what)
                })
            };
            let mut list = lists.images_of(i).iter().map(place).collect::<Result<Vec<u32>>>()?;
            list.sort_unstable();
            list.dedup();
            views.push(&list, &[]);
        }
        cloud.views = views;
        Ok(cloud)
    }
}

/// Positions in the model's images in the order in which COLMAP counts them: that of the file; with frames that of the
/// frames, within one by sensor and image id.
fn registered_order(model: &Model) -> Vec<u32> {
    if model.frames.is_empty() {
        return (0..model.images.len() as u32).collect();
    }
    let place_of: HashMap<u64, u32> = model.images.iter().map(|image| u64::from(image.id)).zip(0..).collect();
    let mut order = Vec::with_capacity(model.images.len());
    for frame in &model.frames {
        let cameras = frame.data.iter().filter(|data| data.sensor.kind == SensorKind::Camera);
        let mut images: Vec<(u32, u64)> = cameras.map(|data| (data.sensor.id, data.data_id)).collect();
        images.sort_unstable();
        order.extend(images.iter().filter_map(|(_, id)| place_of.get(id)));
    }
    order
}

#[cfg(test)]
mod tests {
    use super::*;
    use semvs_formats::colmap::{Frame, FrameData, Image, Pose, Sensor};

    #[test]
    fn frames_decide_the_order_of_images() {
        let pose = Pose { rotation: [1.0, 0.0, 0.0, 0.0], translation: [0.0; 3] };
        let image = |id| Image { id, pose, camera_id: 1, name: Vec::new(), observations: Vec::new() };
        let mut model = Model { images: [7, 3, 9, 4].map(image).to_vec(), ..Model::default() };
        assert_eq!(registered_order(&model), [0, 1, 2, 3]);
        let data =
            |sensor, id| FrameData { sensor: Sensor { kind: SensorKind::Camera, id: sensor }, data_id: id };
        let frame = |id, data: &[FrameData]| Frame { id, rig_id: 1, pose, data: data.to_vec() };
        model.frames =
            vec![frame(2, &[data(2, 3), data(1, 9)]), frame(1, &[data(1, 7), data(2, 4), data(2, 99)])];
        assert_eq!(registered_order(&model), [2, 1, 0, 3]);
    }
}
