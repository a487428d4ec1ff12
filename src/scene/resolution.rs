//! At which size a photograph is processed.

use crate::error::{Error, Result};
use crate::geometry::Size;

/// How far photographs are reduced before they are matched.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ResolutionOptions {
    /// How many times the longer side is halved. 0 = not at all, and then `min` is ignored. Default 1.
    pub level: u32,
    /// The longer side is never halved below this many pixels; a photograph that is smaller keeps its size.
    /// Default 640.
    pub min: u32,
    /// The longer side is never larger than this many pixels, whatever the level; at least 1. Default 2560.
    pub max: u32,
}

impl Default for ResolutionOptions {
    fn default() -> Self {
        ResolutionOptions { level: 1, min: 640, max: 2560 }
    }
}

impl ResolutionOptions {
    /// Checks the ranges.
    ///
    /// # Errors
    /// [`Error::Invalid`] if `max` is 0.
    pub fn check(&self) -> Result<()> {
        if self.max == 0 {
            return Err(Error::invalid(
                "max-resolution is 0: give the longest image side to work at, in pixels",
            ));
        }
        Ok(())
    }

    /// The longer side, in pixels, at which a photograph whose longer side is `longest` is processed.
    pub fn target(&self, longest: u32) -> u32 {
        let halved = |k: u32| longest.checked_shr(k).unwrap_or(0);
        let mut target = halved(self.level);
        if self.level > 0 && target < self.min {
            let mut k = 0;
            while k < self.level && halved(k + 1) >= self.min {
                k += 1;
            }
            target = halved(k);
        }
        target.min(self.max).max(1)
    }

    /// The factor that takes a photograph of `size` to its working size; exactly 1.0 if it is used as it is.
    pub fn factor(&self, size: Size) -> f64 {
        let longest = size.longest();
        let target = self.target(longest);
        if longest > target { f64::from(target) / f64::from(longest) } else { 1.0 }
    }

    /// The size at which a photograph of `size` is processed.
    pub fn working_size(&self, size: Size) -> Size {
        scaled_size(size, self.factor(size))
    }
}

/// `size` times `factor`, each side rounded half to even and at least 1.
pub fn scaled_size(size: Size, factor: f64) -> Size {
    let side = |n: u32| ((f64::from(n) * factor).round_ties_even() as u32).max(1);
    Size::new(side(size.width), side(size.height))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn options(level: u32, min: u32, max: u32) -> ResolutionOptions {
        ResolutionOptions { level, min, max }
    }

    #[test]
    fn halves_the_longer_side_per_level() {
        let size = Size::new(6000, 4000);
        assert_eq!(options(0, 640, 9000).working_size(size), size);
        assert_eq!(options(1, 640, 9000).working_size(size), Size::new(3000, 2000));
        assert_eq!(options(2, 640, 9000).working_size(size), Size::new(1500, 1000));
    }

    #[test]
    fn never_halves_below_the_minimum() {
        // 1200 >> 1 = 600 is below 640: no halving; 1280 >> 1 = 640 is not.
        assert_eq!(options(1, 640, 2560).target(1200), 1200);
        assert_eq!(options(1, 640, 2560).target(1280), 640);
        // Two levels wanted, one possible.
        assert_eq!(options(2, 640, 2560).target(2000), 1000);
        // Smaller than the minimum from the start: full size, whatever the level.
        assert_eq!(options(5, 640, 2560).target(500), 500);
        assert_eq!(options(1, 320, 2560).working_size(Size::new(1200, 900)), Size::new(600, 450));
    }

    #[test]
    fn level_zero_ignores_the_minimum_and_the_maximum_always_holds() {
        assert_eq!(options(0, 4000, 2560).target(3000), 2560);
        assert_eq!(options(1, 4000, 2560).target(6001), 2560);
        assert_eq!(options(1, 640, 1000).working_size(Size::new(3000, 6000)), Size::new(500, 1000));
    }

    #[test]
    fn sides_round_half_to_even() {
        assert_eq!(scaled_size(Size::new(640, 479), 0.5), Size::new(320, 240));
        assert_eq!(scaled_size(Size::new(640, 477), 0.5), Size::new(320, 238));
        assert_eq!(scaled_size(Size::new(3, 1), 0.25), Size::new(1, 1));
    }

    #[test]
    fn extreme_options_neither_overflow_nor_reach_zero() {
        assert_eq!(options(400, 0, 2560).target(6000), 1);
        assert_eq!(options(u32::MAX, 1, u32::MAX).target(u32::MAX), 1);
        assert!(options(1, 640, 0).check().is_err());
        assert!(ResolutionOptions::default().check().is_ok());
    }
}
