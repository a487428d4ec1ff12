//! COLMAP's folders: a workspace as a scene, its depth maps, and what its programs read.

mod fused;
mod maps;
mod scene;
mod workspace;
mod write;

pub use maps::{ColmapMapHeader, ColmapMaps, depth_map_path, normal_map_path, write_maps};
pub use workspace::{Pass, Workspace};
pub use write::{has_maps, model_from_scene, write_configs, write_fused, write_model};

use crate::error::Result;
use semvs_formats::{Limits, mvs};
use std::path::Path;

impl Workspace {
    /// The workspace's sparse model as a scene whose image names are relative to [`Workspace::root`] where they can be.
    ///
    /// # Errors
    /// As [`Workspace::read_model`].
    pub fn read_scene(&self, limits: &Limits) -> Result<mvs::Scene> {
        self.read_scene_for(&self.root, limits)
    }

    /// [`Workspace::read_scene`] with image names that are relative to `folder`.
    ///
    /// # Errors
    /// As [`Workspace::read_model`].
    pub fn read_scene_for(&self, folder: &Path, limits: &Limits) -> Result<mvs::Scene> {
        let model = self.read_model(limits)?;
        scene::scene_from_model(&model, &self.image_prefix(folder), &self.sparse)
    }

    /// What the names of the model's images have before them in a scene whose names are relative to `folder`.
    pub fn image_prefix(&self, folder: &Path) -> String {
        match super::paths::name_relative_to(&self.images, folder) {
            here if here.is_empty() => here,
            images => format!("{images}/"),
        }
    }
}
