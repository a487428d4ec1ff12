//! Which filters run on depth maps.

use crate::depth_filter::{DepthFilterOptions, UnbiasedFilterOptions};
use crate::error::{Error, Result};

/// "Depth Diff Threshold" that holds together what is no scrap.
const SCRAP_DEPTH_DIFF: f32 = 0.004;

/// Matching cost from which agreement says little. On the rendered façade 0.7 leaves a fifth of the gross errors, mostly of clouds in the
/// sky, and 0.64 an eighth; on photographs the one costs 3 % of the points, the other 4 %.
const COUNTED_COST: f32 = 0.7;

/// Which filters run on the depth maps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FilterJob {
    /// Remove small regions.
    pub speckles: bool,
    /// Fill small gaps.
    pub gaps: bool,
    /// Filter across views, if any.
    pub across: Option<AcrossViews>,
    /// Thresholds.
    pub options: DepthFilterOptions,
}

/// Filters across views.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AcrossViews {
    /// OpenMVS's, which moves depths towards those of the neighbours.
    OpenMvs,
    /// The one that keeps or drops depths as they are.
    Unbiased(UnbiasedFilterOptions),
}

impl FilterJob {
    /// What the unbiased filter goes with: itself alone, as it leaves few speckles and small regions that other views
    /// confirm are worth keeping.
    pub fn unbiased() -> Self {
        FilterJob {
            speckles: false,
            gaps: false,
            across: Some(AcrossViews::Unbiased(UnbiasedFilterOptions::default())),
            options: DepthFilterOptions::default(),
        }
    }

    /// How scraps are removed where labels or masks leave pixels out: before the unbiased filter, as beside what is cut
    /// out they have but each other for a witness. Scraps hang on to what they lie beside less than speckles may.
    pub(super) fn scraps(&self) -> Option<DepthFilterOptions> {
        let unbiased = matches!(self.across, Some(AcrossViews::Unbiased(_)));
        let depth_diff_threshold = SCRAP_DEPTH_DIFF.min(self.options.depth_diff_threshold);
        unbiased.then_some(DepthFilterOptions { depth_diff_threshold, ..self.options })
    }

    /// What OpenMVS does: everything.
    pub fn openmvs() -> Self {
        FilterJob {
            speckles: true,
            gaps: true,
            across: Some(AcrossViews::OpenMvs),
            options: DepthFilterOptions::default(),
        }
    }

    /// Matching cost from which a depth is not kept for the filter, if estimation keeps those below `own`: OpenMVS's filter
    /// counts views that agree however badly they match, as clouds in the sky do, and the unbiased one weighs how well.
    pub fn keep_cost(&self, own: f32) -> f32 {
        match self.across {
            Some(AcrossViews::OpenMvs) => own.min(COUNTED_COST),
            Some(AcrossViews::Unbiased(_)) | None => own,
        }
    }

    /// The filters of OpenMVS's `--postprocess-dmaps`, of which bit 2 stands for `across`.
    ///
    /// # Errors
    /// Bits that mean nothing.
    pub fn from_bits(bits: u32, across: AcrossViews, options: DepthFilterOptions) -> Result<Self> {
        if bits > 7 {
            let what =
                format!("--postprocess-dmaps {bits}: give a sum of 1 (speckles), 2 (gaps), 4 (adjust)");
            return Err(Error::invalid(what));
        }
        Ok(FilterJob {
            speckles: bits & 1 != 0,
            gaps: bits & 2 != 0,
            across: (bits & 4 != 0).then_some(across),
            options,
        })
    }

    /// The bits of [`FilterJob::from_bits`].
    pub fn bits(&self) -> u32 {
        let bits = [self.speckles, self.gaps, self.across.is_some()];
        bits.iter().enumerate().map(|(i, &on)| u32::from(on) << i).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_filter_that_counts_is_spared_what_hardly_matches() {
        assert!(FilterJob::openmvs().keep_cost(1.0) < FilterJob::unbiased().keep_cost(1.0));
        assert_eq!(FilterJob::openmvs().keep_cost(0.1), 0.1);
        let cleaned = FilterJob { across: None, ..FilterJob::openmvs() };
        assert_eq!(cleaned.keep_cost(1.0), 1.0);
    }

    #[test]
    fn bits_stand_for_filters() {
        for bits in 0..8 {
            let own = FilterJob::unbiased();
            let job = FilterJob::from_bits(bits, AcrossViews::OpenMvs, own.options).unwrap();
            assert_eq!(job.bits(), bits);
            assert!(job.scraps().is_none(), "OpenMVS's filter is as it is there");
        }
        assert_eq!((FilterJob::unbiased().bits(), FilterJob::openmvs().bits()), (4, 7));
        let scraps = FilterJob::unbiased().scraps().unwrap();
        assert!(scraps.depth_diff_threshold < FilterJob::unbiased().options.depth_diff_threshold);
    }
}
