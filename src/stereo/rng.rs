//! Random numbers that depend on their key alone, not on threads or on the order of work.

/// SplitMix64 (Steele et al. 2014) started from a hash of its key.
#[derive(Clone, Debug)]
pub(crate) struct Rng(u64);

const GOLDEN: u64 = 0x9E37_79B9_7F4A_7C15;

impl Rng {
    /// The sequence of one tile: keyed on (seed, view, pass, tile).
    pub(crate) fn keyed(seed: u64, view: u32, pass: u32, tile: u32) -> Self {
        let a = mix(seed ^ GOLDEN);
        let b = mix(a ^ (u64::from(view) << 32 | u64::from(pass)));
        Rng(mix(b ^ u64::from(tile).wrapping_mul(GOLDEN)))
    }

    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(GOLDEN);
        mix(self.0)
    }

    /// Uniform in [0, 1).
    pub(crate) fn unit(&mut self) -> f32 {
        (self.next() >> 40) as f32 / (1u64 << 24) as f32
    }

    /// Uniform in [-1, 1).
    pub(crate) fn signed(&mut self) -> f32 {
        self.unit() * 2.0 - 1.0
    }

    /// Uniform in 0..n; 0 for n = 0.
    pub(crate) fn below(&mut self, n: usize) -> usize {
        (((self.next() >> 32) * n as u64) >> 32) as usize
    }
}

fn mix(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn same_key_same_sequence_and_other_key_another() {
        let take = |mut r: Rng| -> Vec<f32> { (0..8).map(|_| r.unit()).collect() };
        assert_eq!(take(Rng::keyed(1, 2, 3, 4)), take(Rng::keyed(1, 2, 3, 4)));
        for other in
            [Rng::keyed(0, 2, 3, 4), Rng::keyed(1, 3, 3, 4), Rng::keyed(1, 2, 4, 4), Rng::keyed(1, 2, 3, 5)]
        {
            assert_ne!(take(Rng::keyed(1, 2, 3, 4)), take(other));
        }
    }

    #[test]
    fn numbers_are_uniform_in_their_range() {
        let mut r = Rng::keyed(7, 0, 0, 0);
        let mut bins = [0u32; 10];
        for _ in 0..10_000 {
            let u = r.unit();
            assert!((0.0..1.0).contains(&u));
            bins[(u * 10.0) as usize] += 1;
            assert!(r.below(7) < 7);
        }
        assert!(bins.iter().all(|&b| (850..1150).contains(&b)), "{bins:?}");
    }
}
