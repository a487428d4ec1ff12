//! COLMAP's folders: a workspace as a scene, its depth maps, and what its programs read.

mod maps;
mod scene;
mod workspace;

pub use maps::{ColmapMapHeader, ColmapMaps, depth_map_path, normal_map_path, write_maps};
pub use workspace::{Pass, Workspace};

use crate::error::Result;
use semvs_formats::{Limits, mvs};

impl Workspace {
    /// The workspace's sparse model as a scene whose image names are relative to [`Workspace::root`] where they can be.
    ///
    /// # Errors
    /// As [`Workspace::read_model`].
    pub fn read_scene(&self, limits: &Limits) -> Result<mvs::Scene> {
        let model = self.read_model(limits)?;
        let images = super::paths::name_relative_to(&self.images, &self.root);
        scene::scene_from_model(&model, &format!("{images}/"), &self.sparse)
    }
}
