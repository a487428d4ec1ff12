//! OpenMVS scene files (`.mvs`): the MVSI interface archive and the native project archive.

mod scene;

pub use scene::{Camera, Image, Line, NO_ID, Obb, Platform, PointCloud, Pose, Scene, ViewScore, Visibility};
