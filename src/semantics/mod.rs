//! What the pixels of an image depict, and what that means for the points made from them.
//!
//! Method: Stathopoulou and Remondino, "Multi-view stereo with semantic priors", 2019, Section 4. Nothing here opens
//! a file: [`crate::store`] reads class tables and label maps.

mod class_file;
mod classes;
mod consensus;
mod label_map;
mod names;
mod policy;
mod regions;
mod render;
mod smooth;
mod vote;

pub use classes::{Class, ClassId, ClassTable};
pub use consensus::{Consensus, ConsensusOptions, Witness, border_distance, label_consensus};
pub use label_map::{nearest_labels, void_borders};
pub(crate) use names::nearest;
pub use policy::{Agreement, ClassPolicy, ClassRules, Consistency, LabelEstimation, Voters};
pub use regions::{PlanarRegion, PlanePrior, planar_regions};
pub use render::{LabelledSurface, point_radii, render_labels};
pub use smooth::smooth_labels;
pub use vote::{LabelVote, Vote};
