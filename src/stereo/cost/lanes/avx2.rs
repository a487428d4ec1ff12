//! Lanes of AVX2: two registers.
//!
//! # Safety
//! Every intrinsic here needs AVX or AVX2. The type is only used by kernels that
//! [`Kernels::of`](super::super::Kernels::of) hands out after AVX2 was detected, and that are compiled with it enabled.
//! Loads and stores go through references; a gather's indices are held below the length of its slice.
#![allow(unsafe_code)]

use super::{LERP_STEPS, Lanes, MAGIC, MAGIC_BITS};
use crate::stereo::tile::Row;
use std::arch::x86_64::*;
use std::ops::{Add, Div, Mul, Sub};

/// Sixteen lanes in two registers.
#[derive(Clone, Copy)]
pub(crate) struct Two(__m256, __m256);

/// Sixteen integers in two registers.
type Bits = (__m256i, __m256i);

macro_rules! operator {
    ($trait:ident, $name:ident, $intrinsic:ident) => {
        impl $trait for Two {
            type Output = Self;

            #[inline(always)]
            fn $name(self, other: Self) -> Self {
                unsafe { Two($intrinsic(self.0, other.0), $intrinsic(self.1, other.1)) }
            }
        }
    };
}

operator!(Add, add, _mm256_add_ps);
operator!(Sub, sub, _mm256_sub_ps);
operator!(Mul, mul, _mm256_mul_ps);
operator!(Div, div, _mm256_div_ps);

impl Lanes for Two {
    type Bits = Bits;
    type Mask = (__m256, __m256);
    const ROWS: usize = 2;

    #[inline(always)]
    fn splat(v: f32) -> Self {
        let v = unsafe { _mm256_set1_ps(v) };
        Two(v, v)
    }

    #[inline(always)]
    fn load(row: &Row) -> Self {
        // SAFETY: a row has sixteen values.
        unsafe { Two(_mm256_loadu_ps(row.as_ptr()), _mm256_loadu_ps(row.as_ptr().add(8))) }
    }

    #[inline(always)]
    fn store(self, row: &mut Row) {
        // SAFETY: a row has sixteen values.
        unsafe {
            _mm256_storeu_ps(row.as_mut_ptr(), self.0);
            _mm256_storeu_ps(row.as_mut_ptr().add(8), self.1);
        }
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        unsafe { Two(_mm256_min_ps(self.0, other.0), _mm256_min_ps(self.1, other.1)) }
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        unsafe { Two(_mm256_max_ps(self.0, other.0), _mm256_max_ps(self.1, other.1)) }
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        unsafe { Two(_mm256_sqrt_ps(self.0), _mm256_sqrt_ps(self.1)) }
    }

    #[inline(always)]
    fn abs(self) -> Self {
        unsafe {
            let sign = _mm256_set1_ps(-0.0);
            Two(_mm256_andnot_ps(sign, self.0), _mm256_andnot_ps(sign, self.1))
        }
    }

    #[inline(always)]
    fn lt(self, other: Self) -> (__m256, __m256) {
        unsafe {
            (_mm256_cmp_ps::<_CMP_LT_OQ>(self.0, other.0), _mm256_cmp_ps::<_CMP_LT_OQ>(self.1, other.1))
        }
    }

    #[inline(always)]
    fn le(self, other: Self) -> (__m256, __m256) {
        unsafe {
            (_mm256_cmp_ps::<_CMP_LE_OQ>(self.0, other.0), _mm256_cmp_ps::<_CMP_LE_OQ>(self.1, other.1))
        }
    }

    #[inline(always)]
    fn both(a: (__m256, __m256), b: (__m256, __m256)) -> (__m256, __m256) {
        unsafe { (_mm256_and_ps(a.0, b.0), _mm256_and_ps(a.1, b.1)) }
    }

    #[inline(always)]
    fn any(mask: (__m256, __m256)) -> bool {
        unsafe { _mm256_movemask_ps(_mm256_or_ps(mask.0, mask.1)) != 0 }
    }

    #[inline(always)]
    fn all(mask: (__m256, __m256)) -> bool {
        unsafe { _mm256_movemask_ps(_mm256_and_ps(mask.0, mask.1)) == 0xff }
    }

    #[inline(always)]
    fn select(mask: (__m256, __m256), yes: Self, no: Self) -> Self {
        unsafe { Two(_mm256_blendv_ps(no.0, yes.0, mask.0), _mm256_blendv_ps(no.1, yes.1, mask.1)) }
    }

    #[inline(always)]
    fn to_bits(self) -> Bits {
        unsafe { (_mm256_castps_si256(self.0), _mm256_castps_si256(self.1)) }
    }

    #[inline(always)]
    fn from_bits(bits: Bits) -> Self {
        unsafe { Two(_mm256_castsi256_ps(bits.0), _mm256_castsi256_ps(bits.1)) }
    }

    #[inline(always)]
    fn whole(v: u32) -> Bits {
        let v = unsafe { _mm256_set1_epi32(v as i32) };
        (v, v)
    }

    #[inline(always)]
    fn plus(a: Bits, b: Bits) -> Bits {
        unsafe { (_mm256_add_epi32(a.0, b.0), _mm256_add_epi32(a.1, b.1)) }
    }

    #[inline(always)]
    fn times(a: Bits, b: Bits) -> Bits {
        unsafe { (_mm256_mullo_epi32(a.0, b.0), _mm256_mullo_epi32(a.1, b.1)) }
    }

    #[inline(always)]
    fn shifted_left<const N: u32>(a: Bits) -> Bits {
        unsafe {
            let n = _mm_cvtsi32_si128(N as i32);
            (_mm256_sll_epi32(a.0, n), _mm256_sll_epi32(a.1, n))
        }
    }

    #[inline(always)]
    fn masked(a: Bits, mask: u32) -> Bits {
        let m = Self::whole(mask);
        unsafe { (_mm256_and_si256(a.0, m.0), _mm256_and_si256(a.1, m.1)) }
    }

    #[inline(always)]
    fn fetch(memory: &[u32], index: Bits) -> (Bits, Bits) {
        if memory.len() < 2 {
            return (Self::whole(0), Self::whole(0));
        }
        let (a, b) = fetch8(memory, index.0);
        let (c, d) = fetch8(memory, index.1);
        ((a, c), (b, d))
    }

    #[inline(always)]
    fn lerp_halves(words: Bits, fraction: Self) -> Self {
        unsafe {
            let t = (fraction * Self::splat(LERP_STEPS) + Self::splat(MAGIC)).to_bits();
            let t = Self::plus(t, Self::whole(MAGIC_BITS.wrapping_neg()));
            let steps = Self::whole(LERP_STEPS as u32);
            let down = (_mm256_sub_epi32(steps.0, t.0), _mm256_sub_epi32(steps.1, t.1));
            let weights = Self::plus(Self::shifted_left::<16>(t), down);
            Two(
                _mm256_cvtepi32_ps(_mm256_madd_epi16(words.0, weights.0)),
                _mm256_cvtepi32_ps(_mm256_madd_epi16(words.1, weights.1)),
            )
        }
    }
}

/// The words at eight indices and the words behind them; `memory` holds two words at least.
#[inline(always)]
fn fetch8(memory: &[u32], index: __m256i) -> (__m256i, __m256i) {
    let last = memory.len().saturating_sub(2).min(i32::MAX as usize) as u32;
    // SAFETY: after the minimum every index has two words of `memory` at it, and fits a positive i32.
    unsafe {
        let index = _mm256_min_epu32(index, _mm256_set1_epi32(last as i32));
        let base = memory.as_ptr().cast();
        let low = _mm256_i32gather_epi64::<4>(base, _mm256_castsi256_si128(index));
        let high = _mm256_i32gather_epi64::<4>(base, _mm256_extracti128_si256::<1>(index));
        let (low, high) = (_mm256_castsi256_ps(low), _mm256_castsi256_ps(high));
        let even = _mm256_castps_si256(_mm256_shuffle_ps::<0x88>(low, high));
        let odd = _mm256_castps_si256(_mm256_shuffle_ps::<0xDD>(low, high));
        (_mm256_permute4x64_epi64::<0xD8>(even), _mm256_permute4x64_epi64::<0xD8>(odd))
    }
}
