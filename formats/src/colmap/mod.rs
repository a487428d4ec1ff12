//! COLMAP workspaces: the sparse model, the maps of the dense stage, and what its fusion reads and writes.
//!
//! Image coordinates of a sparse model have their origin at the corner of the first pixel, whose centre is
//! (0.5, 0.5); OpenMVS puts the origin at that centre.

mod config;
mod consistency;
mod matrix;
mod model;
mod sparse_binary;
mod sparse_text;
mod sparse_text_write;
#[cfg(test)]
mod tests;
mod visibility;
mod workspace;

pub use config::{
    PatchMatchEntry, PatchMatchSources, fusion_config, parse_fusion_config, parse_patch_match_config,
    patch_match_config,
};
pub use consistency::ConsistencyGraph;
pub use matrix::{Matrix, read_matrix_size};
pub use model::{
    Camera, CameraModel, Frame, FrameData, Image, Model, NO_POINT, Observation, Points, Pose, Rig, RigSensor,
    Sensor, SensorKind, TrackElement,
};
pub use visibility::{read_visibility, write_visibility};
pub use workspace::{Encoding, ModelFile};
