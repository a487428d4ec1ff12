//! Elementary functions in plain arithmetic, so that every instruction-set level gives the same bits.

/// Adding and subtracting this rounds a small f32 to the nearest integer, which then sits in its low bits.
const MAGIC: f32 = 12_582_912.0;
const MAGIC_BITS: u32 = 0x4B40_0000;

/// `e^x` for x ≤ 0 to a relative error below 6e-6; below −80 the value at −80.
#[inline(always)]
pub(super) fn exp(x: f32) -> f32 {
    let y = x.max(-80.0) * std::f32::consts::LOG2_E;
    let shifted = y + MAGIC;
    let f = y - (shifted - MAGIC);
    let mut p = 0.001_333_355_8f32;
    p = p * f + 0.009_618_129;
    p = p * f + 0.055_504_11;
    p = p * f + 0.240_226_5;
    p = p * f + std::f32::consts::LN_2;
    p = p * f + 1.0;
    let n = shifted.to_bits().wrapping_sub(MAGIC_BITS);
    p * f32::from_bits(n.wrapping_add(127) << 23)
}

/// Splits `x` in 0.5..2²² into an index and the fraction above it; the fraction is in 0..=1.
#[inline(always)]
pub(super) fn fraction_and_index(x: f32) -> (f32, u32) {
    let shifted = (x - 0.5) + MAGIC;
    (x - (shifted - MAGIC), shifted.to_bits().wrapping_sub(MAGIC_BITS))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The polynomial's own error; callers weigh costs with it, where 1e-5 is invisible.
    const EXP_TOLERANCE: f32 = 6e-6;

    #[test]
    fn exp_is_close_over_its_range() {
        for i in 0..8000 {
            let x = -f32::from(i as u16) * 0.01;
            let want = x.exp();
            assert!((exp(x) - want).abs() <= EXP_TOLERANCE * want, "{x}: {} {want}", exp(x));
        }
        assert!(exp(-1e9) > 0.0 && exp(-1e9) < 1e-30);
        assert_eq!(exp(0.0), 1.0);
    }

    #[test]
    fn index_and_fraction_add_up() {
        for i in 8..40_000u16 {
            let x = f32::from(i) / 16.0;
            let (f, n) = fraction_and_index(x);
            assert_eq!(n as f32 + f, x);
            assert!((0.0..=1.0).contains(&f), "{x} {f}");
        }
    }
}
