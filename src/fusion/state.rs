//! What fusion remembers of pixels beside the immutable maps: one bit each.

/// The pixels of a view that can still start or join a point: they have a depth, no point has claimed them and
/// none has found them to be in its way.
///
/// A claim and an invalidation need not be told apart: both take the pixel out for good, and a claim is taken
/// back only by the point that made it, before any other is looked at.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct FreePixels {
    words: Vec<u64>,
}

impl FreePixels {
    /// All pixels with a depth.
    pub(super) fn with_depth(depths: impl ExactSizeIterator<Item = f32>) -> Self {
        let mut words = vec![0; depths.len().div_ceil(64)];
        for (i, depth) in depths.enumerate() {
            words[i / 64] |= u64::from(depth > 0.0) << (i % 64);
        }
        FreePixels { words }
    }

    /// Becomes a copy of `other` in the same memory.
    pub(super) fn copy(&mut self, other: &FreePixels) {
        self.words.clone_from(&other.words);
    }

    #[inline]
    pub(super) fn contains(&self, pixel: u32) -> bool {
        self.words[pixel as usize / 64] >> (pixel % 64) & 1 != 0
    }

    #[inline]
    pub(super) fn take(&mut self, pixel: u32) {
        self.words[pixel as usize / 64] &= !(1 << (pixel % 64));
    }

    #[inline]
    pub(super) fn give_back(&mut self, pixel: u32) {
        self.words[pixel as usize / 64] |= 1 << (pixel % 64);
    }

    /// The free pixels in `start..end`, ascending.
    pub(super) fn in_range(&self, start: usize, end: usize) -> impl Iterator<Item = usize> + '_ {
        (start / 64..end.div_ceil(64)).flat_map(move |w| {
            let mut word = self.words[w];
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
        self.words.iter().map(|w| u64::from(w.count_ones())).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_are_listed_by_range_and_can_be_taken_and_given_back() {
        let depths: Vec<f32> = (0..200).map(|i| if i % 3 == 0 { 1.0 } else { 0.0 }).collect();
        let mut free = FreePixels::with_depth(depths.iter().copied());
        assert_eq!(free.count(), 67);
        for (start, end) in [(0, 200), (5, 64), (64, 128), (63, 65), (100, 100), (130, 199)] {
            let listed: Vec<usize> = free.in_range(start, end).collect();
            let expected: Vec<usize> = (start..end).filter(|i| i % 3 == 0).collect();
            assert_eq!(listed, expected, "{start}..{end}");
        }
        free.take(66);
        assert!(!free.contains(66) && free.contains(69) && !free.contains(67));
        assert_eq!(free.count(), 66);
        free.give_back(66);
        assert!(free.contains(66));
    }
}
