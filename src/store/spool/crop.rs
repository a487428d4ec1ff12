//! The order in which OpenMVS's crop leaves the points.

/// Whether each point is inside the region of interest, one bit each.
#[derive(Clone, Debug, Default)]
pub(super) struct InsideBits {
    words: Vec<u64>,
    len: u64,
}

impl InsideBits {
    pub(super) fn push(&mut self, inside: bool) {
        let bit = self.len % 64;
        if bit == 0 {
            self.words.push(0);
        }
        if let Some(word) = self.words.last_mut() {
            *word |= u64::from(inside) << bit;
        }
        self.len += 1;
    }

    fn get(&self, i: u64) -> bool {
        self.words[(i / 64) as usize] >> (i % 64) & 1 != 0
    }
}

/// Which point comes at which place.
///
/// Removal goes from the last point to the first, and each removed point's place is taken by the point that is last
/// at that moment. So a point inside stays where it is unless it is moved into a hole before it; only the holes need
/// to be stored.
#[derive(Clone, Debug)]
pub(super) struct CropOrder {
    inside: InsideBits,
    /// Points that remain.
    remaining: u64,
    /// For every hole below `remaining`, ascending, the point that fills it.
    fillers: Vec<u64>,
}

impl CropOrder {
    /// Nothing is removed.
    pub(super) fn all(count: u64) -> Self {
        CropOrder {
            inside: InsideBits { words: Vec::new(), len: count },
            remaining: count,
            fillers: Vec::new(),
        }
    }

    pub(super) fn new(inside: InsideBits) -> Self {
        // Holes and what fills them, by descending place.
        let mut holes: Vec<(u64, u64)> = Vec::new();
        let mut remaining = inside.len;
        for i in (0..inside.len).rev().filter(|&i| !inside.get(i)) {
            remaining -= 1;
            if remaining == i {
                continue;
            }
            let filler = if inside.get(remaining) {
                remaining
            } else {
                let hole = holes.partition_point(|&(place, _)| place > remaining);
                holes[hole].1
            };
            holes.push((i, filler));
        }
        let fillers = holes.iter().rev().filter(|(place, _)| *place < remaining).map(|&(_, f)| f).collect();
        CropOrder { inside, remaining, fillers }
    }

    pub(super) fn len(&self) -> u64 {
        self.remaining
    }

    /// Numbers of the remaining points in their final order.
    pub(super) fn iter(&self) -> impl Iterator<Item = u64> + '_ {
        let mut fillers = self.fillers.iter();
        let everything = self.remaining == self.inside.len;
        (0..self.remaining).map(move |place| {
            if everything || self.inside.get(place) {
                place
            } else {
                fillers.next().copied().unwrap_or(place)
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The rule word by word.
    fn swap_removed(inside: &[bool]) -> Vec<u64> {
        let mut points: Vec<u64> = (0..inside.len() as u64).collect();
        for i in (0..inside.len()).rev() {
            if !inside[points[i] as usize] {
                points.swap_remove(i);
            }
        }
        points
    }

    fn cropped(inside: &[bool]) -> Vec<u64> {
        let mut bits = InsideBits::default();
        inside.iter().for_each(|&b| bits.push(b));
        CropOrder::new(bits).iter().collect()
    }

    #[test]
    fn the_last_point_moves_into_each_hole() {
        assert_eq!(cropped(&[true, false, true, false, true, true]), [0, 4, 2, 5]);
        assert_eq!(cropped(&[false, true, true]), [2, 1]);
        assert_eq!(cropped(&[true, true, false]), [0, 1]);
        assert_eq!(cropped(&[false, false]), [0; 0]);
        assert_eq!(cropped(&[]), [0; 0]);
        assert_eq!(CropOrder::all(3).iter().collect::<Vec<_>>(), [0, 1, 2]);
    }

    #[test]
    fn every_pattern_of_twelve_and_long_ones_follow_the_rule() {
        for pattern in 0..1_u32 << 12 {
            let inside: Vec<bool> = (0..12).map(|i| pattern >> i & 1 != 0).collect();
            assert_eq!(cropped(&inside), swap_removed(&inside), "{inside:?}");
        }
        for keep in [1, 5, 50, 95, 99] {
            let mut state = 12345_u32;
            let inside: Vec<bool> = (0..5000)
                .map(|_| {
                    state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                    (state >> 16) % 100 < keep
                })
                .collect();
            assert_eq!(cropped(&inside), swap_removed(&inside), "{keep} % kept");
        }
    }
}
