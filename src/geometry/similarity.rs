//! When two depths count as the same.

/// Whether `other` differs from `depth` by less than `max_ratio` relative to `depth` (strict, not symmetric;
/// nothing is similar to a depth of 0).
#[inline]
pub fn is_similar_depth(depth: f32, other: f32, max_ratio: f32) -> bool {
    (depth - other).abs() / depth < max_ratio
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_difference_is_relative_to_the_first_depth() {
        assert!(is_similar_depth(10.0, 10.09, 0.01));
        assert!(!is_similar_depth(10.0, 10.11, 0.01));
        assert!(is_similar_depth(10.2, 10.1, 0.0099));
        assert!(!is_similar_depth(10.1, 10.2, 0.0099));
        assert!(!is_similar_depth(0.0, 0.0, 1.0));
    }
}
