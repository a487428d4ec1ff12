//! Lanes as an array: readable, safe, and vectorised by the compiler as far as it can.

use super::{Lanes, Pairs};
use crate::stereo::tile::{Row, Words};
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
    type Pairs = FourPairs;

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
    fn eq(self, other: Self) -> [u32; 16] {
        from_fn(|i| u32::from(self.0[i] == other.0[i]).wrapping_neg())
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
    fn doubled(self) -> [Self; 2] {
        [0, 8].map(|first| Sixteen(from_fn(|i| self.0[first + i / 2])))
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
    fn inverted(a: [u32; 16]) -> [u32; 16] {
        a.map(|v| !v)
    }

    #[inline(always)]
    fn shifted_left<const N: u32>(a: [u32; 16]) -> [u32; 16] {
        a.map(|v| v << N)
    }

    #[inline(always)]
    fn shifted_right<const N: u32>(a: [u32; 16]) -> [u32; 16] {
        a.map(|v| v >> N)
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
    fn load_words(words: &Words) -> [u32; 16] {
        *words
    }

    #[inline(always)]
    fn store_words(words: [u32; 16], to: &mut Words) {
        *to = words;
    }

    #[inline(always)]
    fn store_halves(words: [u32; 16], first: &mut [u32; 8], second: &mut [u32; 8]) {
        first.copy_from_slice(&words[..8]);
        second.copy_from_slice(&words[8..]);
    }

    #[inline(always)]
    fn truncated(self) -> [u32; 16] {
        self.0.map(|v| v as i32 as u32)
    }

    #[inline(always)]
    fn from_whole(bits: [u32; 16]) -> Self {
        Sixteen(bits.map(|v| v as i32 as f32))
    }

    #[inline(always)]
    fn place(column: [u32; 16], row: [u32; 16], width: u32) -> [u32; 16] {
        from_fn(|i| (row[i] >> 16).wrapping_mul(width).wrapping_add(column[i] >> 16))
    }

    #[inline(always)]
    fn gather(memory: &[u32], index: [u32; 16]) -> [u32; 16] {
        index.map(|i| memory.get(i as usize).copied().unwrap_or(0))
    }

    #[inline(always)]
    fn bilinear(quad: [u32; 16], column: [u32; 16], row: [u32; 16], base: [u32; 16]) -> [u32; 16] {
        from_fn(|i| {
            let [a, b, c, d] = quad[i].to_le_bytes().map(|v| i32::from(v as i8));
            let (f, g) = ((column[i] >> 8 & 255) as i32, (row[i] >> 8 & 255) as i32);
            let (top, bottom) = (a * (255 - f) + b * f, c * (255 - f) + d * f);
            ((top * (255 - g) + bottom * g) as u32).wrapping_add(base[i]) << 5
        })
    }

    #[inline(always)]
    fn paired(low: [u32; 16], high: [u32; 16]) -> [u32; 16] {
        from_fn(|i| low[i] >> 16 | high[i] & 0xffff_0000)
    }
}

/// Four pairs: low halves, high halves.
#[derive(Clone, Copy)]
pub(crate) struct FourPairs(pub(super) [u32; 4]);

impl Pairs for FourPairs {
    const WIDTH: usize = 4;

    #[inline(always)]
    fn splat(pair: u32) -> Self {
        FourPairs([pair; 4])
    }

    #[inline(always)]
    fn load(row: &[u32], at: usize) -> Self {
        FourPairs(row.get(at..).and_then(|r| r.first_chunk()).copied().unwrap_or_default())
    }

    #[inline(always)]
    fn store(self, row: &mut Words, at: usize) {
        if let Some(to) = row.get_mut(at..).and_then(|r| r.first_chunk_mut()) {
            *to = self.0;
        }
    }

    #[inline(always)]
    fn scaled(self, b: Self) -> Self {
        FourPairs(from_fn(|i| {
            let low = (low_half(self.0[i]) * low_half(b.0[i]) + 0x4000) >> 15;
            let high = (high_half(self.0[i]) * high_half(b.0[i]) + 0x4000) >> 15;
            low as u32 & 0xffff | (high as u32) << 16
        }))
    }

    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        FourPairs(from_fn(|i| {
            let low = low_half(self.0[i]) + low_half(other.0[i]);
            let high = high_half(self.0[i]) + high_half(other.0[i]);
            low as u32 & 0xffff | (high as u32) << 16
        }))
    }

    #[inline(always)]
    fn plus_dot(self, a: Self, b: Self) -> Self {
        FourPairs(from_fn(|i| {
            let both = low_half(a.0[i]) * low_half(b.0[i]) + high_half(a.0[i]) * high_half(b.0[i]);
            self.0[i].wrapping_add(both as u32)
        }))
    }
}

#[inline(always)]
fn low_half(v: u32) -> i32 {
    i32::from(v as i16)
}

#[inline(always)]
fn high_half(v: u32) -> i32 {
    v as i32 >> 16
}
