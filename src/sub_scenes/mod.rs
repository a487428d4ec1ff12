//! Splits a scene that is too large to be fused at once: samples of its depth maps are divided among boxes, and each
//! box gets the views that see it.

mod boxes;
mod chunks;
mod views;

pub use chunks::{Chunk, Sample, split};
