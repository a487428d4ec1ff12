//! Lanes as an array: readable, safe, and vectorised by the compiler as far as it can.

use super::{LERP_STEPS, Lanes, MAGIC};
use crate::stereo::tile::Row;
use std::array::from_fn;
use std::ops::{Add, Div, Mul, Sub};

/// Sixteen lanes as an array.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sixteen(Row);

macro_rules! operator {
    ($trait:ident, $name:ident, $op:tt) => {
        impl $trait for Sixteen {
            type Output = Self;

            #[inline(always)]
            fn $name(self, other: Self) -> Self {
                Sixteen(from_fn(|i| self.0[i] $op other.0[i]))
            }
        }
    };
}

operator!(Add, add, +);
operator!(Sub, sub, -);
operator!(Mul, mul, *);
operator!(Div, div, /);

impl Sixteen {
    #[inline(always)]
    fn map(self, f: impl Fn(f32) -> f32) -> Self {
        Sixteen(self.0.map(f))
    }
}

impl Lanes for Sixteen {
    type Bits = [u32; 16];
    type Mask = [u32; 16];
    const ROWS: usize = 1;

    #[inline(always)]
    fn splat(v: f32) -> Self {
        Sixteen([v; 16])
    }

    #[inline(always)]
    fn load(row: &Row) -> Self {
        Sixteen(*row)
    }

    #[inline(always)]
    fn store(self, row: &mut Row) {
        *row = self.0;
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Sixteen(from_fn(|i| if self.0[i] < other.0[i] { self.0[i] } else { other.0[i] }))
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Sixteen(from_fn(|i| if self.0[i] > other.0[i] { self.0[i] } else { other.0[i] }))
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        self.map(f32::sqrt)
    }

    #[inline(always)]
    fn abs(self) -> Self {
        self.map(f32::abs)
    }

    #[inline(always)]
    fn lt(self, other: Self) -> [u32; 16] {
        from_fn(|i| u32::from(self.0[i] < other.0[i]).wrapping_neg())
    }

    #[inline(always)]
    fn le(self, other: Self) -> [u32; 16] {
        from_fn(|i| u32::from(self.0[i] <= other.0[i]).wrapping_neg())
    }

    #[inline(always)]
    fn both(a: [u32; 16], b: [u32; 16]) -> [u32; 16] {
        from_fn(|i| a[i] & b[i])
    }

    #[inline(always)]
    fn any(mask: [u32; 16]) -> bool {
        mask.iter().fold(0, |a, b| a | b) != 0
    }

    #[inline(always)]
    fn all(mask: [u32; 16]) -> bool {
        mask.iter().fold(!0, |a, b| a & b) == !0
    }

    #[inline(always)]
    fn select(mask: [u32; 16], yes: Self, no: Self) -> Self {
        Sixteen(from_fn(|i| f32::from_bits(yes.0[i].to_bits() & mask[i] | no.0[i].to_bits() & !mask[i])))
    }

    #[inline(always)]
    fn to_bits(self) -> [u32; 16] {
        self.0.map(f32::to_bits)
    }

    #[inline(always)]
    fn from_bits(bits: [u32; 16]) -> Self {
        Sixteen(bits.map(f32::from_bits))
    }

    #[inline(always)]
    fn whole(v: u32) -> [u32; 16] {
        [v; 16]
    }

    #[inline(always)]
    fn plus(a: [u32; 16], b: [u32; 16]) -> [u32; 16] {
        from_fn(|i| a[i].wrapping_add(b[i]))
    }

    #[inline(always)]
    fn times(a: [u32; 16], b: [u32; 16]) -> [u32; 16] {
        from_fn(|i| a[i].wrapping_mul(b[i]))
    }

    #[inline(always)]
    fn shifted_left<const N: u32>(a: [u32; 16]) -> [u32; 16] {
        a.map(|v| v << N)
    }

    #[inline(always)]
    fn masked(a: [u32; 16], mask: u32) -> [u32; 16] {
        a.map(|v| v & mask)
    }

    #[inline(always)]
    fn fetch(memory: &[u32], index: [u32; 16]) -> ([u32; 16], [u32; 16]) {
        let both =
            index.map(|i| memory.get(i as usize..).and_then(|m| m.first_chunk()).copied().unwrap_or([0; 2]));
        (both.map(|p| p[0]), both.map(|p| p[1]))
    }

    #[inline(always)]
    fn lerp_halves(words: [u32; 16], fraction: Self) -> Self {
        Sixteen(from_fn(|i| {
            let t = (fraction.0[i] * LERP_STEPS + MAGIC) - MAGIC;
            let low = ((words[i] << 16) as i32 >> 16) as f32;
            let high = (words[i] as i32 >> 16) as f32;
            low * (LERP_STEPS - t) + high * t
        }))
    }
}
