//! What the estimator may be told.

use crate::{Error, Result};

/// How much is tried for every depth.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Quality {
    /// For a look: about two thirds of the normal time.
    Draft,
    /// What matches OpenMVS's depth maps.
    #[default]
    Normal,
    /// For the last details: about 1.5 times the normal time.
    High,
}

impl Quality {
    /// Name as given on the command line and in reports.
    pub fn name(self) -> &'static str {
        match self {
            Quality::Draft => "draft",
            Quality::Normal => "normal",
            Quality::High => "high",
        }
    }
}

/// Options of depth estimation. Angles are in degrees, costs on the 0 (best) .. 2 (worst) scale.
#[derive(Clone, Debug, PartialEq)]
pub struct StereoOptions {
    /// Coarser levels estimated before the full resolution, each half the size of the next. 0..=8. Default: 2.
    pub levels: u32,
    /// Iterations over all tiles on every level; the full resolution, which starts from a coarser one, takes one less.
    /// 1..=100. Default: 3.
    pub iterations: u32,
    /// Passes that also compare a hypothesis with the neighbours' depth maps. 0..=100. Default: 2.
    pub geometric_iterations: u32,
    /// Planes from within a tile, and as many from beside it, that its pixels try at a visit; two fifths of that in
    /// passes with the neighbours' depth maps, which propose planes themselves. 1..=64. Default: 10.
    pub candidates: u32,
    /// Small changes of a tile's planes, and as many planes fitted to its pixels, tried at a visit; four fifths of that in
    /// passes with the neighbours' depth maps. 0..=64. Default: 5.
    pub refinements: u32,
    /// Source views, the best of each tile, that hypotheses are compared with; passes with the neighbours' depth maps
    /// take one more. 1..=64. Default: 3.
    pub compared_views: u32,
    /// A pixel whose final matching cost is not below this has no depth. (0, 2]. Default: 1.
    pub keep_cost: f32,
    /// Weight of the geometric term: cost added per pixel of disagreement, at most four. >= 0. Default: 0.1.
    pub geometric_weight: f32,
    /// Seed of every random number. Default: 0.
    pub seed: u64,
}

impl Default for StereoOptions {
    fn default() -> Self {
        StereoOptions {
            levels: 2,
            iterations: 3,
            geometric_iterations: 2,
            candidates: 12,
            refinements: 5,
            compared_views: 3,
            keep_cost: 1.0,
            geometric_weight: 0.1,
            seed: 0,
        }
    }
}

impl StereoOptions {
    /// The options of a quality.
    pub fn of(quality: Quality) -> Self {
        let (candidates, refinements, compared_views) = match quality {
            Quality::Draft => (3, 2, 2),
            Quality::Normal => (12, 5, 3),
            Quality::High => (16, 10, 4),
        };
        StereoOptions { candidates, refinements, compared_views, ..StereoOptions::default() }
    }

    /// Checks the ranges stated at the fields.
    ///
    /// # Errors
    /// [`Error::Invalid`] names the option, its value and the allowed range.
    pub fn check(&self) -> Result<()> {
        let whole = [
            ("--sub-resolution-levels", self.levels, 0, 8),
            ("--iters", self.iterations, 1, 100),
            ("--geometric-iters", self.geometric_iterations, 0, 100),
            ("candidates", self.candidates, 1, 64),
            ("refinements", self.refinements, 0, 64),
            ("compared views", self.compared_views, 1, 64),
        ];
        for (name, value, low, high) in whole {
            if !(low..=high).contains(&value) {
                return Err(Error::invalid(format!("{name} {value}: give {low} to {high}")));
            }
        }
        if !(self.keep_cost > 0.0 && self.keep_cost <= 2.0) {
            return Err(Error::invalid(format!(
                "keep cost is {}; it must be above 0, at most 2",
                self.keep_cost
            )));
        }
        if !(self.geometric_weight >= 0.0 && self.geometric_weight.is_finite()) {
            return Err(Error::invalid(format!(
                "geometric weight is {}; it must be 0 or more",
                self.geometric_weight
            )));
        }
        Ok(())
    }
}
