//! Oriented photographs to dense, semantically labelled 3D point clouds.
//!
//! The layout and the flow of data are described in `docs/ARCHITECTURE.md`.
#![deny(unsafe_code)]

pub mod cli;
pub mod cloud_filter;
pub mod depth_filter;
mod error;
pub mod evaluate;
pub mod fusion;
pub mod geometry;
pub mod pipeline;
pub mod progress;
pub mod report;
pub mod scene;
pub mod semantics;
pub mod stereo;
pub mod store;
pub mod sub_scenes;

pub use error::{Error, Result};
