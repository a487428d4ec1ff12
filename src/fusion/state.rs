//! What fusion remembers of pixels beside the immutable maps: one or two bits each.

use super::options::Support;

/// What the pixels of a view can still do.
///
/// A *free* pixel can start a point or be claimed by one: it has a depth, no point has claimed it and none has found it
/// to be in its way. A claim is taken back only by the point that made it, before any other is looked at.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct PixelStates {
    free: Vec<u64>,
    /// Pixels with a depth that no point has found to be in its way, claimed or not; `None`: only free ones support.
    standing: Option<Vec<u64>>,
}

impl PixelStates {
    /// All pixels with a depth are free.
    pub(super) fn with_depth(depths: impl ExactSizeIterator<Item = f32>, support: Support) -> Self {
        let mut free = vec![0; depths.len().div_ceil(64)];
        for (i, depth) in depths.enumerate() {
            free[i / 64] |= u64::from(depth > 0.0) << (i % 64);
        }
        let standing = (support == Support::All).then(|| free.clone());
        PixelStates { free, standing }
    }

    /// Becomes a copy of `other` in the same memory.
    pub(super) fn copy(&mut self, other: &PixelStates) {
        self.free.clone_from(&other.free);
        self.standing.clone_from(&other.standing);
    }

    #[inline]
    pub(super) fn is_free(&self, pixel: u32) -> bool {
        has(&self.free, pixel)
    }

    /// Whether a pixel counts towards the points that it agrees with.
    #[inline]
    pub(super) fn supports(&self, pixel: u32) -> bool {
        has(self.standing.as_ref().unwrap_or(&self.free), pixel)
    }

    #[inline]
    pub(super) fn claim(&mut self, pixel: u32) {
        self.free[pixel as usize / 64] &= !(1 << (pixel % 64));
    }

    /// Takes a claim back.
    #[inline]
    pub(super) fn give_back(&mut self, pixel: u32) {
        self.free[pixel as usize / 64] |= 1 << (pixel % 64);
    }

    /// Takes a pixel out for good.
    #[inline]
    pub(super) fn invalidate(&mut self, pixel: u32) {
        self.claim(pixel);
        if let Some(standing) = &mut self.standing {
            standing[pixel as usize / 64] &= !(1 << (pixel % 64));
        }
    }

    /// The free pixels in `start..end`, ascending.
    pub(super) fn free_in_range(&self, start: usize, end: usize) -> impl Iterator<Item = usize> + '_ {
        (start / 64..end.div_ceil(64)).flat_map(move |w| {
            let mut word = self.free[w];
            if w == start / 64 {
                word &= u64::MAX << (start % 64);
            }
            if (w + 1) * 64 > end {
                word &= u64::MAX >> ((w + 1) * 64 - end);
            }
            std::iter::from_fn(move || {
                let bit = word.trailing_zeros() as usize;
                word &= word.wrapping_sub(1);
                (bit < 64).then_some(w * 64 + bit)
            })
        })
    }

    #[cfg(test)]
    pub(super) fn count(&self) -> u64 {
        self.free.iter().map(|w| u64::from(w.count_ones())).sum()
    }
}

#[inline]
fn has(words: &[u64], pixel: u32) -> bool {
    words[pixel as usize / 64] >> (pixel % 64) & 1 != 0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_are_listed_by_range_and_can_be_taken_and_given_back() {
        let depths: Vec<f32> = (0..200).map(|i| if i % 3 == 0 { 1.0 } else { 0.0 }).collect();
        let mut free = PixelStates::with_depth(depths.iter().copied(), Support::Unclaimed);
        assert_eq!(free.count(), 67);
        for (start, end) in [(0, 200), (5, 64), (64, 128), (63, 65), (100, 100), (130, 199)] {
            let listed: Vec<usize> = free.free_in_range(start, end).collect();
            let expected: Vec<usize> = (start..end).filter(|i| i % 3 == 0).collect();
            assert_eq!(listed, expected, "{start}..{end}");
        }
        free.claim(66);
        assert!(!free.is_free(66) && free.is_free(69) && !free.is_free(67));
        assert_eq!(free.count(), 66);
        free.give_back(66);
        assert!(free.is_free(66));
    }

    #[test]
    fn a_claimed_pixel_supports_others_if_asked_to_and_an_invalid_one_never() {
        for support in [Support::Unclaimed, Support::All] {
            let mut states = PixelStates::with_depth([1.0, 1.0, 0.0].into_iter(), support);
            assert!(states.supports(0) && states.supports(1) && !states.supports(2));
            states.claim(0);
            states.invalidate(1);
            assert_eq!(states.supports(0), support == Support::All);
            assert!(!states.is_free(0) && !states.is_free(1) && !states.supports(1));
        }
    }
}
