//! Options of fusion; names and defaults are those of OpenMVS.

use crate::error::{Error, Result};

/// When an attribute of the points is computed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum AttributeSource {
    /// Never: the cloud has no such attribute.
    None,
    /// From the finished cloud: colours from the nearest view, normals from neighbouring points.
    AfterFusion,
    /// Mean of the merged pixels.
    #[default]
    DuringFusion,
}

impl AttributeSource {
    /// The meaning of OpenMVS's 0, 1, 2; `None` for any other number.
    pub fn from_level(level: u32) -> Option<Self> {
        [AttributeSource::None, AttributeSource::AfterFusion, AttributeSource::DuringFusion]
            .get(level as usize)
            .copied()
    }
}

/// Which depths of other views count towards a point's views.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Support {
    /// Only those that no other point has claimed, as in OpenMVS: every depth is part of one point at most.
    #[default]
    Unclaimed,
    /// Claimed ones, too: a depth starts one point or is claimed by one, and supports all others that agree with it.
    /// A point that needs claimed depths needs one view more. Views rarely sample a surface alike, so that claims
    /// alone leave every other depth without enough views.
    All,
}

/// How depth maps become one cloud.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FusionOptions {
    /// `--number-views-fuse`: views that must agree on a point, the one that starts it included; lowered to the
    /// number of views of the scene. Below 2, all pixels of all maps become points without any test. Default 3.
    pub number_views_fuse: u32,
    /// "Depth Diff Threshold": relative difference, > 0, below which two depths are the same. Default 0.01.
    pub depth_diff_threshold: f32,
    /// "Normal Diff Threshold": largest angle between the normals of merged pixels, degrees, 0..180. Default 25.
    pub normal_diff_threshold_deg: f32,
    /// `--support`. Default: unclaimed depths.
    pub support: Support,
    /// `--estimate-colors`. Default: during fusion.
    pub estimate_colors: AttributeSource,
    /// `--estimate-normals`. Default: during fusion.
    pub estimate_normals: AttributeSource,
    /// Bytes of maps kept in memory between their uses; the maps of one view and its neighbours are held in any
    /// case. Default 256 MiB.
    pub map_memory: u64,
}

impl Default for FusionOptions {
    fn default() -> Self {
        FusionOptions {
            number_views_fuse: 3,
            depth_diff_threshold: 0.01,
            normal_diff_threshold_deg: 25.0,
            support: Support::Unclaimed,
            estimate_colors: AttributeSource::DuringFusion,
            estimate_normals: AttributeSource::DuringFusion,
            map_memory: 256 << 20,
        }
    }
}

impl FusionOptions {
    /// Options for [`Support::All`]: depths are the same within 0.007, and normals only have to face the same side. A
    /// depth that is left over finds support anyway, so that pairs can be held to a closer match; normals of weakly
    /// textured surfaces scatter more than their depths, and the two sides of a thin wall differ by more than 90°.
    pub fn supporting() -> Self {
        FusionOptions {
            support: Support::All,
            depth_diff_threshold: 0.007,
            normal_diff_threshold_deg: 90.0,
            ..FusionOptions::default()
        }
    }

    /// Refuses thresholds that no pair of pixels could meet.
    ///
    /// # Errors
    /// [`Error::Invalid`] naming the option.
    pub fn check(&self) -> Result<()> {
        if !(self.depth_diff_threshold > 0.0 && self.depth_diff_threshold < 1.0) {
            return Err(Error::invalid(format!(
                "\"Depth Diff Threshold\" is {}: give a relative difference between 0 and 1, such as 0.01",
                self.depth_diff_threshold
            )));
        }
        if !(self.normal_diff_threshold_deg > 0.0 && self.normal_diff_threshold_deg <= 180.0) {
            return Err(Error::invalid(format!(
                "\"Normal Diff Threshold\" is {}: give an angle between 0 and 180 degrees, such as 25",
                self.normal_diff_threshold_deg
            )));
        }
        Ok(())
    }

    /// Cosine of [`FusionOptions::normal_diff_threshold_deg`].
    pub(super) fn min_cos_normal(&self) -> f32 {
        self.normal_diff_threshold_deg.to_radians().cos()
    }
}
