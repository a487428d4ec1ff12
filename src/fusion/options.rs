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
            estimate_colors: AttributeSource::DuringFusion,
            estimate_normals: AttributeSource::DuringFusion,
            map_memory: 256 << 20,
        }
    }
}

impl FusionOptions {
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
