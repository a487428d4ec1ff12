//! The programs as their users run them: what is typed, what is written, what is said, how it ends.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout, reason = "tests may")]

#[path = "../common/mod.rs"]
mod common;

mod actions;
mod bad_input;
mod cloud_files;
mod colmap;
mod command_line;
mod compare;
mod corners;
mod docs;
mod exact_runs;
mod exchange;
mod first_run;
mod install;
mod json_outputs;
mod label_estimation;
mod labels;
mod library;
mod line;
mod masks;
mod odd_inputs;
mod pages;
mod pipelines;
mod resume;
mod runs;
mod similarity;
mod strict_openmvs;
