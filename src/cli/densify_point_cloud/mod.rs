//! The program `DensifyPointCloud`: OpenMVS's command line before this library's pipeline.

mod actions;
pub(super) mod args;
mod config_file;
mod front;
mod help;
mod log;
mod priority;
mod refusals;
mod run;
mod tokens;

pub(crate) use args::DropInArgs;
pub use run::densify_point_cloud;
