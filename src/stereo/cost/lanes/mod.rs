//! Sixteen lanes of f32: what an instruction set must offer to the kernels.
//!
//! Every operation is rounded as IEEE says and none is fused, so that all implementations give the same bytes.
//! [`portable::Sixteen`] is the plain one; a row of a tile has exactly sixteen pixels.

#[cfg(target_arch = "x86_64")]
pub(super) mod avx2;
#[cfg(target_arch = "x86_64")]
pub(super) mod avx512;
#[cfg(target_arch = "aarch64")]
pub(super) mod neon;
#[cfg(any(test, not(target_arch = "x86_64")))]
pub(super) mod portable;
#[cfg(target_arch = "x86_64")]
pub(super) mod sse2;

use crate::stereo::tile::{Row, Words};
use std::ops::{Add, Div, Mul, Sub};

/// Adding and subtracting this rounds a small f32 to the nearest integer, which then sits in its low bits.
const MAGIC: f32 = 12_582_912.0;

/// A register of pairs of signed 16-bit numbers, and of 32-bit sums of their products.
pub(crate) trait Pairs: Copy {
    /// Pairs in a register; a divisor of 16.
    const WIDTH: usize;

    fn splat(pair: u32) -> Self;
    /// The pairs from `at` on; zeros if there are not enough.
    fn load(row: &[u32], at: usize) -> Self;
    /// Stores to `at`, if there is room.
    fn store(self, row: &mut Words, at: usize);
    /// Products of halves over 2¹⁵, rounded to the nearest; `b` has at most 14 bits.
    fn scaled(self, b: Self) -> Self;
    /// Sums of halves modulo 2¹⁶.
    fn plus(self, other: Self) -> Self;
    /// Adds the products of the low halves and of the high halves.
    fn plus_dot(self, a: Self, b: Self) -> Self;
}

/// Sixteen f32.
pub(crate) trait Lanes:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self>
{
    /// Sixteen 32-bit integers.
    type Bits: Copy;
    /// Sixteen truth values.
    type Mask: Copy;
    /// One register of pairs.
    type Pairs: Pairs;

    fn splat(v: f32) -> Self;
    fn load(row: &Row) -> Self;
    fn store(self, row: &mut Row);
    /// The smaller; `other` if either is NaN.
    fn min(self, other: Self) -> Self;
    /// The larger; `other` if either is NaN.
    fn max(self, other: Self) -> Self;
    fn abs(self) -> Self;
    fn lt(self, other: Self) -> Self::Mask;
    fn le(self, other: Self) -> Self::Mask;
    fn eq(self, other: Self) -> Self::Mask;
    fn both(a: Self::Mask, b: Self::Mask) -> Self::Mask;
    fn any(mask: Self::Mask) -> bool;
    fn all(mask: Self::Mask) -> bool;
    /// `yes` where the mask is set, else `no`.
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self;
    /// The first eight lanes and the others, each lane twice.
    fn doubled(self) -> [Self; 2];
    fn to_bits(self) -> Self::Bits;
    fn from_bits(bits: Self::Bits) -> Self;
    fn whole(v: u32) -> Self::Bits;
    /// Sum modulo 2³².
    fn plus(a: Self::Bits, b: Self::Bits) -> Self::Bits;
    /// −a modulo 2³².
    #[inline(always)]
    fn negated(a: Self::Bits) -> Self::Bits {
        Self::plus(Self::inverted(a), Self::whole(1))
    }
    fn inverted(a: Self::Bits) -> Self::Bits;
    fn shifted_left<const N: u32>(a: Self::Bits) -> Self::Bits;
    fn shifted_right<const N: u32>(a: Self::Bits) -> Self::Bits;
    fn masked(a: Self::Bits, mask: u32) -> Self::Bits;
    /// The words at `index` and the words behind them. An index without two words gives any two; `memory` holds two.
    fn fetch(memory: &[u32], index: Self::Bits) -> (Self::Bits, Self::Bits);
    fn load_words(words: &Words) -> Self::Bits;
    fn store_words(words: Self::Bits, to: &mut Words);
    /// The first eight words and the others.
    fn store_halves(words: Self::Bits, first: &mut [u32; 8], second: &mut [u32; 8]);
    /// The whole part of every lane; lanes are within the range of an i32.
    fn truncated(self) -> Self::Bits;
    /// Lanes of signed integers.
    fn from_whole(bits: Self::Bits) -> Self;
    /// `row · width + column` of the whole parts of fixed-point numbers with 16 fractional bits.
    fn place(column: Self::Bits, row: Self::Bits, width: u32) -> Self::Bits;
    /// The words at `index`. An index beyond the end gives any word; `memory` is not empty.
    fn gather(memory: &[u32], index: Self::Bits) -> Self::Bits;
    /// Whether [`Lanes::lookup`] is there, and faster than [`Lanes::gather`].
    const LOOKUP: bool = false;
    /// The bytes at the whole parts of fixed-point columns and rows, at the next column, and at both in the next row:
    /// as packed in words for [`Lanes::bilinear`]. All lie in a table of `ROWS` (4 or 8) rows of sixteen bytes, `stride`
    /// apart in `memory`, from byte `first` on, where `column + 16·row` is `-origin`; memory holds all of it.
    #[inline(always)]
    fn lookup<const ROWS: usize>(
        _memory: &[u8],
        (_first, _origin): (usize, u32),
        _stride: usize,
        column: Self::Bits,
        _row: Self::Bits,
    ) -> Self::Bits {
        column
    }
    /// Bilinear samples of four signed bytes (left, right, left below, right below, from the low byte up) at the
    /// fractions of fixed-point numbers with 16 fractional bits, of which eight are used: 255² times the bytes, and `base`
    /// more; all of it 32 times, modulo 2³².
    fn bilinear(quad: Self::Bits, column: Self::Bits, row: Self::Bits, base: Self::Bits) -> Self::Bits;
    /// The high halves of two words as one: `low`'s in the low half.
    fn paired(low: Self::Bits, high: Self::Bits) -> Self::Bits;
    /// The sum of the lanes, left to right.
    #[inline(always)]
    fn sum(self) -> f32 {
        let mut row = [0.0; 16];
        self.store(&mut row);
        row.iter().sum()
    }

    /// The nearest whole numbers of lanes in 0..2²², in the low bits of the second result, and what lanes are above them:
    /// −0.5..=0.5.
    #[inline(always)]
    fn nearest(self) -> (Self, Self::Bits) {
        let shifted = self + Self::splat(MAGIC);
        (self - (shifted - Self::splat(MAGIC)), shifted.to_bits())
    }

    /// `row · width + column` of whole numbers below 2¹⁵ from [`Lanes::nearest`].
    #[inline(always)]
    fn row_major(column: Self::Bits, row: Self::Bits, width: usize) -> Self::Bits {
        Self::place(Self::shifted_left::<16>(column), Self::shifted_left::<16>(row), width as u32)
    }

    /// One over the square root of positive normal lanes, within 2.1e-5 of it: a guess from the bits (Lomont 2003), and the
    /// parabola in `x · guess²` that makes up best for it, cheaper than steps of Newton's method. Finite for zero.
    #[inline(always)]
    fn inverse_sqrt(self) -> Self {
        let guess =
            Self::plus(Self::whole(0x5f11_1000), Self::negated(Self::shifted_right::<1>(self.to_bits())));
        let y = Self::from_bits(guess);
        let square = self * y * y;
        y * (Self::splat(2.282_519_3) - square * (Self::splat(2.253_306_2) - square))
    }

    /// A bell of unit height: close to e⁻ˣ for x ≥ 0, and 0 from x = 64 on.
    #[inline(always)]
    fn bell64(x: Self) -> Self {
        Self::bell64_of(Self::splat(1.0) - x * Self::splat(1.0 / 64.0))
    }

    /// The same of `1 - x/64`.
    #[inline(always)]
    fn bell64_of(b: Self) -> Self {
        let b = b.max(Self::splat(0.0));
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
