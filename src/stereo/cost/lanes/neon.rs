//! Lanes of NEON, which every 64-bit ARM processor has: four registers.
//!
//! # Safety
//! Every intrinsic here needs NEON, which is part of the architecture. Loads and stores go through references.
#![allow(unsafe_code, unused_unsafe)]

use super::{Lanes, Pairs};
use crate::stereo::tile::{Row, Words};
use std::arch::aarch64::*;
use std::ops::{Add, Div, Mul, Sub};

/// Sixteen lanes in four registers.
#[derive(Clone, Copy)]
pub(crate) struct Four([float32x4_t; 4]);

/// Sixteen integers in four registers.
type Bits = [uint32x4_t; 4];

/// The same expression for each of the four registers.
macro_rules! each {
    ($i:ident => $e:expr) => {{
        unsafe {
            [
                { const $i: usize = 0; $e },
                { const $i: usize = 1; $e },
                { const $i: usize = 2; $e },
                { const $i: usize = 3; $e },
            ]
        }
    }};
}

macro_rules! operator {
    ($trait:ident, $name:ident, $intrinsic:ident) => {
        impl $trait for Four {
            type Output = Self;

            #[inline(always)]
            fn $name(self, other: Self) -> Self {
                Four(each!(I => $intrinsic(self.0[I], other.0[I])))
            }
        }
    };
}

operator!(Add, add, vaddq_f32);
operator!(Sub, sub, vsubq_f32);
operator!(Mul, mul, vmulq_f32);
operator!(Div, div, vdivq_f32);

impl Lanes for Four {
    type Bits = Bits;
    type Mask = Bits;
    type Pairs = FourPairs;

    #[inline(always)]
    fn splat(v: f32) -> Self {
        Four([unsafe { vdupq_n_f32(v) }; 4])
    }

    #[inline(always)]
    fn load(row: &Row) -> Self {
        // SAFETY: a row has sixteen values.
        Four(each!(I => vld1q_f32(row.as_ptr().add(4 * I))))
    }

    #[inline(always)]
    fn store(self, row: &mut Row) {
        // SAFETY: a row has sixteen values.
        each!(I => vst1q_f32(row.as_mut_ptr().add(4 * I), self.0[I]));
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Four(each!(I => vbslq_f32(vcltq_f32(self.0[I], other.0[I]), self.0[I], other.0[I])))
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Four(each!(I => vbslq_f32(vcgtq_f32(self.0[I], other.0[I]), self.0[I], other.0[I])))
    }

    #[inline(always)]
    fn abs(self) -> Self {
        Four(each!(I => vabsq_f32(self.0[I])))
    }

    #[inline(always)]
    fn lt(self, other: Self) -> Bits {
        each!(I => vcltq_f32(self.0[I], other.0[I]))
    }

    #[inline(always)]
    fn le(self, other: Self) -> Bits {
        each!(I => vcleq_f32(self.0[I], other.0[I]))
    }

    #[inline(always)]
    fn eq(self, other: Self) -> Bits {
        each!(I => vceqq_f32(self.0[I], other.0[I]))
    }

    #[inline(always)]
    fn both(a: Bits, b: Bits) -> Bits {
        each!(I => vandq_u32(a[I], b[I]))
    }

    #[inline(always)]
    fn any(m: Bits) -> bool {
        unsafe { vmaxvq_u32(vorrq_u32(vorrq_u32(m[0], m[1]), vorrq_u32(m[2], m[3]))) != 0 }
    }

    #[inline(always)]
    fn all(m: Bits) -> bool {
        unsafe { vminvq_u32(vandq_u32(vandq_u32(m[0], m[1]), vandq_u32(m[2], m[3]))) != 0 }
    }

    #[inline(always)]
    fn select(mask: Bits, yes: Self, no: Self) -> Self {
        Four(each!(I => vbslq_f32(mask[I], yes.0[I], no.0[I])))
    }

    #[inline(always)]
    fn doubled(self) -> [Self; 2] {
        let [a, b, c, d] = self.0;
        unsafe {
            let twice = |a, b| Four([vzip1q_f32(a, a), vzip2q_f32(a, a), vzip1q_f32(b, b), vzip2q_f32(b, b)]);
            [twice(a, b), twice(c, d)]
        }
    }

    #[inline(always)]
    fn to_bits(self) -> Bits {
        each!(I => vreinterpretq_u32_f32(self.0[I]))
    }

    #[inline(always)]
    fn from_bits(bits: Bits) -> Self {
        Four(each!(I => vreinterpretq_f32_u32(bits[I])))
    }

    #[inline(always)]
    fn whole(v: u32) -> Bits {
        [unsafe { vdupq_n_u32(v) }; 4]
    }

    #[inline(always)]
    fn plus(a: Bits, b: Bits) -> Bits {
        each!(I => vaddq_u32(a[I], b[I]))
    }

    #[inline(always)]
    fn inverted(a: Bits) -> Bits {
        each!(I => vmvnq_u32(a[I]))
    }

    #[inline(always)]
    fn shifted_left<const N: u32>(a: Bits) -> Bits {
        each!(I => vshlq_u32(a[I], vdupq_n_s32(N as i32)))
    }

    #[inline(always)]
    fn shifted_right<const N: u32>(a: Bits) -> Bits {
        each!(I => vshlq_u32(a[I], vdupq_n_s32(-(N as i32))))
    }

    #[inline(always)]
    fn masked(a: Bits, mask: u32) -> Bits {
        each!(I => vandq_u32(a[I], vdupq_n_u32(mask)))
    }

    #[inline(always)]
    fn fetch(memory: &[u32], index: Bits) -> (Bits, Bits) {
        let next = Self::plus(index, Self::whole(1));
        (Self::gather(memory, index), Self::gather(memory, next))
    }

    #[inline(always)]
    fn load_words(words: &Words) -> Bits {
        // SAFETY: there are sixteen words.
        each!(I => vld1q_u32(words.as_ptr().add(4 * I)))
    }

    #[inline(always)]
    fn store_words(words: Bits, to: &mut Words) {
        // SAFETY: there are sixteen words.
        each!(I => vst1q_u32(to.as_mut_ptr().add(4 * I), words[I]));
    }

    #[inline(always)]
    fn store_halves(words: Bits, first: &mut [u32; 8], second: &mut [u32; 8]) {
        // SAFETY: each half has eight words.
        unsafe {
            vst1q_u32(first.as_mut_ptr(), words[0]);
            vst1q_u32(first.as_mut_ptr().add(4), words[1]);
            vst1q_u32(second.as_mut_ptr(), words[2]);
            vst1q_u32(second.as_mut_ptr().add(4), words[3]);
        }
    }

    #[inline(always)]
    fn truncated(self) -> Bits {
        each!(I => vreinterpretq_u32_s32(vcvtq_s32_f32(self.0[I])))
    }

    #[inline(always)]
    fn from_whole(bits: Bits) -> Self {
        Four(each!(I => vcvtq_f32_s32(vreinterpretq_s32_u32(bits[I]))))
    }

    #[inline(always)]
    fn place(column: Bits, row: Bits, width: u32) -> Bits {
        each!(I => {
            let column = vshrq_n_s32::<16>(vreinterpretq_s32_u32(column[I]));
            let row = vshrq_n_s32::<16>(vreinterpretq_s32_u32(row[I]));
            vreinterpretq_u32_s32(vmlaq_s32(column, row, vdupq_n_s32(width as i32)))
        })
    }

    #[inline(always)]
    fn gather(memory: &[u32], index: Bits) -> Bits {
        each!(I => gather4(memory, index[I]))
    }

    #[inline(always)]
    fn bilinear(quad: Bits, column: Bits, row: Bits, base: Bits) -> Bits {
        each!(I => bilinear4(quad[I], column[I], row[I], base[I]))
    }

    #[inline(always)]
    fn paired(low: Bits, high: Bits) -> Bits {
        each!(I => vorrq_u32(vshrq_n_u32::<16>(low[I]), vandq_u32(high[I], vdupq_n_u32(0xffff_0000))))
    }
}

/// [`Lanes::gather`] of one register.
#[inline(always)]
fn gather4(memory: &[u32], index: uint32x4_t) -> uint32x4_t {
    let mut at = [0u32; 4];
    // SAFETY: the array has four words.
    unsafe { vst1q_u32(at.as_mut_ptr(), index) };
    let words = at.map(|i| memory.get(i as usize).copied().unwrap_or(0));
    // SAFETY: as above.
    unsafe { vld1q_u32(words.as_ptr()) }
}

/// [`Lanes::bilinear`] of one register.
#[inline(always)]
fn bilinear4(quad: uint32x4_t, column: uint32x4_t, row: uint32x4_t, base: uint32x4_t) -> uint32x4_t {
    unsafe {
        let byte = vdupq_n_u32(0xff);
        let f = vandq_u32(vshrq_n_u32::<8>(column), byte);
        let f = vreinterpretq_s16_u32(vorrq_u32(f, vshlq_n_u32::<16>(f)));
        let g = vandq_u32(vshrq_n_u32::<8>(row), byte);
        let down = vreinterpretq_s16_u32(veorq_u32(vorrq_u32(g, vshlq_n_u32::<16>(g)), byte));
        let quad = vreinterpretq_s16_u32(quad);
        let left = vshrq_n_s16::<8>(vshlq_n_s16::<8>(quad));
        let right = vshrq_n_s16::<8>(quad);
        // left · (255 − f) + right · f, modulo 2¹⁶
        let across = vmulq_s16(vsubq_s16(right, left), f);
        let across = vaddq_s16(across, vsubq_s16(vshlq_n_s16::<8>(left), left));
        vshlq_n_u32::<5>(vaddq_u32(vreinterpretq_u32_s32(dot(across, down)), base))
    }
}

/// Sums of the products of the low and of the high halves of words.
#[inline(always)]
fn dot(a: int16x8_t, b: int16x8_t) -> int32x4_t {
    unsafe { vpaddq_s32(vmull_s16(vget_low_s16(a), vget_low_s16(b)), vmull_high_s16(a, b)) }
}

/// Four pairs in one register.
#[derive(Clone, Copy)]
pub(crate) struct FourPairs(int16x8_t);

impl Pairs for FourPairs {
    const WIDTH: usize = 4;

    #[inline(always)]
    fn splat(pair: u32) -> Self {
        FourPairs(unsafe { vreinterpretq_s16_u32(vdupq_n_u32(pair)) })
    }

    #[inline(always)]
    fn load(row: &[u32], at: usize) -> Self {
        let row: &[u32; 4] = row.get(at..).and_then(|r| r.first_chunk()).unwrap_or(&[0; 4]);
        // SAFETY: the reference is to four words.
        FourPairs(unsafe { vreinterpretq_s16_u32(vld1q_u32(row.as_ptr())) })
    }

    #[inline(always)]
    fn store(self, row: &mut Words, at: usize) {
        if let Some(to) = row.get_mut(at..).and_then(|r| r.first_chunk_mut::<4>()) {
            // SAFETY: the reference is to four words.
            unsafe { vst1q_u32(to.as_mut_ptr(), vreinterpretq_u32_s16(self.0)) }
        }
    }

    #[inline(always)]
    fn scaled(self, b: Self) -> Self {
        FourPairs(unsafe { vqrdmulhq_s16(self.0, b.0) })
    }

    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        FourPairs(unsafe { vaddq_s16(self.0, other.0) })
    }

    #[inline(always)]
    fn plus_dot(self, a: Self, b: Self) -> Self {
        unsafe {
            let sum = vaddq_s32(vreinterpretq_s32_s16(self.0), dot(a.0, b.0));
            FourPairs(vreinterpretq_s16_s32(sum))
        }
    }
}
