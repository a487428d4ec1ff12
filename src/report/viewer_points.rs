//! The points of a report's viewer: 16 bytes each.

use rayon::prelude::*;

/// A point of the viewer.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ViewerPoint {
    /// World position, scene units.
    pub position: [f64; 3],
    /// Red, green, blue.
    pub color: [u8; 3],
    /// Unit normal in the world frame; zeros = unknown.
    pub normal: [f32; 3],
    /// Position of its class in the page's list.
    pub class: u8,
    /// Confidence of its depths, 0..1.
    pub confidence: f32,
    /// Confidence of its label, 0..1.
    pub label_confidence: f32,
    /// Views that see it.
    pub views: u32,
}

/// Bytes of a point.
const BYTES: usize = 16;

/// The points as the viewer takes them: x, y, z as 16-bit shares (little endian) of `extent` from `min` on, class, label
/// confidence, red, green, blue, confidence, the normal as three signed bytes, and the number of views, at most 127.
pub fn packed(points: &[ViewerPoint], min: [f64; 3], extent: [f64; 3]) -> Vec<u8> {
    let mut bytes = vec![0; points.len() * BYTES];
    bytes.par_chunks_exact_mut(BYTES).zip(points).for_each(|(out, point)| {
        for axis in 0..3 {
            let share = (point.position[axis] - min[axis]) / extent[axis].max(f64::MIN_POSITIVE);
            let place = (share.clamp(0.0, 1.0) * f64::from(u16::MAX)).round() as u16;
            out[2 * axis..2 * axis + 2].copy_from_slice(&place.to_le_bytes());
            out[8 + axis] = point.color[axis];
            out[12 + axis] = ((point.normal[axis].clamp(-1.0, 1.0) * 127.0).round() as i8) as u8;
        }
        out[6] = point.class;
        out[7] = eight_bits(point.label_confidence);
        out[11] = eight_bits(point.confidence);
        out[15] = point.views.min(127) as u8;
    });
    bytes
}

fn eight_bits(share: f32) -> u8 {
    (share.clamp(0.0, 1.0) * 255.0).round() as u8
}

/// Where the `count`-th part of `len` points that stands for all is: point `i` of the part is point `chosen(i, ..)` of all.
/// Every stretch of equal length gives one point, at a place in it that looks random but never changes.
pub fn chosen(i: u64, count: u64, len: u64) -> u64 {
    if count >= len {
        return i;
    }
    let start = |i: u64| (u128::from(i) * u128::from(len) / u128::from(count)) as u64;
    let (from, to) = (start(i), start(i + 1));
    from + scattered(i) % (to - from).max(1)
}

/// The numbers below `count` in an order that looks random but never changes: any first part of points in this order is
/// spread over all of them.
pub fn shuffled(count: usize) -> Vec<u32> {
    let mut order: Vec<u32> = (0..count as u32).collect();
    order.par_sort_unstable_by_key(|&i| (scattered(i.into()), i));
    order
}

/// A number that depends on every bit of `i` (splitmix64, Steele, Lea and Flood 2014).
fn scattered(i: u64) -> u64 {
    let mut z = i.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_point_is_16_bytes_in_the_order_of_the_viewer() {
        let point = ViewerPoint {
            position: [1.0, 2.5, 4.0],
            color: [1, 2, 3],
            normal: [1.0, 0.0, -1.0],
            class: 4,
            confidence: 1.0,
            label_confidence: 0.2,
            views: 500,
        };
        let bytes = packed(&[point], [1.0, 2.0, 3.0], [2.0, 1.0, 0.5]);
        assert_eq!(bytes, [0, 0, 0, 128, 255, 255, 4, 51, 1, 2, 3, 255, 127, 0, 129, 127]);
        assert_eq!(packed(&[ViewerPoint::default()], [0.0; 3], [0.0; 3]), [0; BYTES]);
    }

    #[test]
    fn a_part_is_spread_over_all_and_always_the_same() {
        let part: Vec<u64> = (0..1000).map(|i| chosen(i, 1000, 12_345)).collect();
        assert!(part.windows(2).all(|w| w[0] < w[1]) && part[999] < 12_345);
        assert_eq!(part, (0..1000).map(|i| chosen(i, 1000, 12_345)).collect::<Vec<_>>());
        let steps: std::collections::BTreeSet<u64> = part.windows(2).map(|w| w[1] - w[0]).collect();
        assert!(steps.len() > 10, "no stripes: {steps:?}");
        let order = shuffled(1000);
        assert!(order[..100].iter().filter(|i| **i < 500).count().abs_diff(50) < 15);
        assert_eq!(order.iter().collect::<std::collections::BTreeSet<_>>().len(), 1000);
        assert_eq!((0..5).map(|i| chosen(i, 9, 5)).collect::<Vec<_>>(), [0, 1, 2, 3, 4]);
    }
}
