//! Sixteen lanes of f32: what an instruction set must offer to the kernels.
//!
//! Every operation is rounded as IEEE says and none is fused, so that all implementations give the same bytes.
//! [`portable::Sixteen`] is the plain one; a row of a tile has exactly sixteen pixels.

#[cfg(target_arch = "x86_64")]
pub(super) mod avx2;
#[cfg(target_arch = "x86_64")]
pub(super) mod avx512;
pub(super) mod portable;

use crate::stereo::tile::Row;
use std::ops::{Add, Div, Mul, Sub};

/// Adding and subtracting this rounds a small f32 to the nearest integer, which then sits in its low bits.
const MAGIC: f32 = 12_582_912.0;
const MAGIC_BITS: u32 = 0x4B40_0000;
/// Steps per pixel of the vertical fraction of a sample: products with 12-bit grey levels stay exact in f32.
pub(crate) const LERP_STEPS: f32 = 4096.0;

/// Sixteen f32.
pub(crate) trait Lanes:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self>
{
    /// Sixteen 32-bit integers.
    type Bits: Copy;
    /// Sixteen truth values.
    type Mask: Copy;
    /// Tile rows whose correlation sums fit the registers at the same time: 1, 2 or 4.
    const ROWS: usize;

    fn splat(v: f32) -> Self;
    fn load(row: &Row) -> Self;
    fn store(self, row: &mut Row);
    /// The smaller; `other` if either is NaN.
    fn min(self, other: Self) -> Self;
    /// The larger; `other` if either is NaN.
    fn max(self, other: Self) -> Self;
    fn sqrt(self) -> Self;
    fn abs(self) -> Self;
    fn lt(self, other: Self) -> Self::Mask;
    fn le(self, other: Self) -> Self::Mask;
    fn both(a: Self::Mask, b: Self::Mask) -> Self::Mask;
    fn any(mask: Self::Mask) -> bool;
    fn all(mask: Self::Mask) -> bool;
    /// `yes` where the mask is set, else `no`.
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self;
    fn to_bits(self) -> Self::Bits;
    fn from_bits(bits: Self::Bits) -> Self;
    fn whole(v: u32) -> Self::Bits;
    /// Sum modulo 2³².
    fn plus(a: Self::Bits, b: Self::Bits) -> Self::Bits;
    /// Low half of the product.
    fn times(a: Self::Bits, b: Self::Bits) -> Self::Bits;
    fn shifted_left<const N: u32>(a: Self::Bits) -> Self::Bits;
    fn masked(a: Self::Bits, mask: u32) -> Self::Bits;
    /// The words at `index` and the words behind them. An index without two words gives any two; `memory` holds two.
    fn fetch(memory: &[u32], index: Self::Bits) -> (Self::Bits, Self::Bits);
    /// `low · (4096 − t) + high · t` of the two signed halves of each word, `t = round(4096 · fraction)`; exact for
    /// halves of 12 bits and fractions in 0..=1.
    fn lerp_halves(words: Self::Bits, fraction: Self) -> Self;

    /// The sum of the lanes, left to right.
    #[inline(always)]
    fn sum(self) -> f32 {
        let mut row = [0.0; 16];
        self.store(&mut row);
        row.iter().sum()
    }

    /// Splits lanes in 0.5..2²² into a whole number, in the low bits of the second result, and the fraction above it;
    /// the fraction is in 0..=1.
    #[inline(always)]
    fn fraction_and_whole(self) -> (Self, Self::Bits) {
        let shifted = (self - Self::splat(0.5)) + Self::splat(MAGIC);
        (self - (shifted - Self::splat(MAGIC)), shifted.to_bits())
    }

    /// `row · width + column` of whole numbers from [`Lanes::fraction_and_whole`].
    #[inline(always)]
    fn row_major(column: Self::Bits, row: Self::Bits, width: usize) -> Self::Bits {
        let width = width as u32;
        let excess = MAGIC_BITS.wrapping_mul(width).wrapping_add(MAGIC_BITS);
        Self::plus(
            Self::plus(Self::times(row, Self::whole(width)), column),
            Self::whole(excess.wrapping_neg()),
        )
    }

    /// A bell of unit height: close to e⁻ˣ for x ≥ 0, and 0 from x = 8 on.
    #[inline(always)]
    fn bell8(x: Self) -> Self {
        let b = (Self::splat(1.0) - x * Self::splat(1.0 / 8.0)).max(Self::splat(0.0));
        let b = b * b;
        let b = b * b;
        b * b
    }

    /// A bell of unit height: closer to e⁻ˣ for x ≥ 0, and 0 from x = 64 on.
    #[inline(always)]
    fn bell64(x: Self) -> Self {
        let b = (Self::splat(1.0) - x * Self::splat(1.0 / 64.0)).max(Self::splat(0.0));
        let b = b * b;
        let b = b * b;
        let b = b * b;
        let b = b * b;
        let b = b * b;
        b * b
    }
}

#[cfg(test)]
mod tests;
