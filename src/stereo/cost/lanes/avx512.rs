//! Lanes of AVX-512: one register.
//!
//! # Safety
//! Every intrinsic here needs AVX-512 F, BW, DQ or VL. The type is only used by kernels that
//! [`Kernels::of`](super::super::Kernels::of) hands out after those features were detected, and that are compiled with
//! them enabled. Loads and stores go through references; a gather's indices are held below the length of its slice.
#![allow(unsafe_code)]

use super::{LERP_STEPS, Lanes, MAGIC, MAGIC_BITS};
use crate::stereo::tile::Row;
use std::arch::x86_64::*;
use std::ops::{Add, Div, Mul, Sub};

/// Sixteen lanes in one register.
#[derive(Clone, Copy)]
pub(crate) struct One(__m512);

macro_rules! operator {
    ($trait:ident, $name:ident, $intrinsic:ident) => {
        impl $trait for One {
            type Output = Self;

            #[inline(always)]
            fn $name(self, other: Self) -> Self {
                One(unsafe { $intrinsic(self.0, other.0) })
            }
        }
    };
}

operator!(Add, add, _mm512_add_ps);
operator!(Sub, sub, _mm512_sub_ps);
operator!(Mul, mul, _mm512_mul_ps);
operator!(Div, div, _mm512_div_ps);

impl Lanes for One {
    type Bits = __m512i;
    type Mask = __mmask16;
    const ROWS: usize = 2;

    #[inline(always)]
    fn splat(v: f32) -> Self {
        One(unsafe { _mm512_set1_ps(v) })
    }

    #[inline(always)]
    fn load(row: &Row) -> Self {
        One(unsafe { _mm512_loadu_ps(row.as_ptr()) })
    }

    #[inline(always)]
    fn store(self, row: &mut Row) {
        unsafe { _mm512_storeu_ps(row.as_mut_ptr(), self.0) }
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        One(unsafe { _mm512_min_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        One(unsafe { _mm512_max_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        One(unsafe { _mm512_sqrt_ps(self.0) })
    }

    #[inline(always)]
    fn abs(self) -> Self {
        One(unsafe { _mm512_abs_ps(self.0) })
    }

    #[inline(always)]
    fn lt(self, other: Self) -> __mmask16 {
        unsafe { _mm512_cmp_ps_mask::<_CMP_LT_OQ>(self.0, other.0) }
    }

    #[inline(always)]
    fn le(self, other: Self) -> __mmask16 {
        unsafe { _mm512_cmp_ps_mask::<_CMP_LE_OQ>(self.0, other.0) }
    }

    #[inline(always)]
    fn both(a: __mmask16, b: __mmask16) -> __mmask16 {
        a & b
    }

    #[inline(always)]
    fn any(mask: __mmask16) -> bool {
        mask != 0
    }

    #[inline(always)]
    fn all(mask: __mmask16) -> bool {
        mask == __mmask16::MAX
    }

    #[inline(always)]
    fn select(mask: __mmask16, yes: Self, no: Self) -> Self {
        One(unsafe { _mm512_mask_blend_ps(mask, no.0, yes.0) })
    }

    #[inline(always)]
    fn to_bits(self) -> __m512i {
        unsafe { _mm512_castps_si512(self.0) }
    }

    #[inline(always)]
    fn from_bits(bits: __m512i) -> Self {
        One(unsafe { _mm512_castsi512_ps(bits) })
    }

    #[inline(always)]
    fn whole(v: u32) -> __m512i {
        unsafe { _mm512_set1_epi32(v as i32) }
    }

    #[inline(always)]
    fn plus(a: __m512i, b: __m512i) -> __m512i {
        unsafe { _mm512_add_epi32(a, b) }
    }

    #[inline(always)]
    fn times(a: __m512i, b: __m512i) -> __m512i {
        unsafe { _mm512_mullo_epi32(a, b) }
    }

    #[inline(always)]
    fn shifted_left<const N: u32>(a: __m512i) -> __m512i {
        unsafe { _mm512_slli_epi32::<N>(a) }
    }

    #[inline(always)]
    fn masked(a: __m512i, mask: u32) -> __m512i {
        unsafe { _mm512_and_si512(a, Self::whole(mask)) }
    }

    #[inline(always)]
    fn fetch(memory: &[u32], index: __m512i) -> (__m512i, __m512i) {
        let last = memory.len().saturating_sub(2).min(i32::MAX as usize) as u32;
        if memory.len() < 2 {
            return (Self::whole(0), Self::whole(0));
        }
        // SAFETY: after the minimum every index has two words of `memory` at it, and fits a positive i32.
        unsafe {
            let index = _mm512_min_epu32(index, Self::whole(last));
            let base = memory.as_ptr().cast();
            let low = _mm512_i32gather_epi64::<4>(_mm512_castsi512_si256(index), base);
            let high = _mm512_i32gather_epi64::<4>(_mm512_extracti64x4_epi64::<1>(index), base);
            let even = _mm512_setr_epi32(0, 2, 4, 6, 8, 10, 12, 14, 16, 18, 20, 22, 24, 26, 28, 30);
            let odd = _mm512_setr_epi32(1, 3, 5, 7, 9, 11, 13, 15, 17, 19, 21, 23, 25, 27, 29, 31);
            (_mm512_permutex2var_epi32(low, even, high), _mm512_permutex2var_epi32(low, odd, high))
        }
    }

    #[inline(always)]
    fn lerp_halves(words: __m512i, fraction: Self) -> Self {
        unsafe {
            let t = (fraction * Self::splat(LERP_STEPS) + Self::splat(MAGIC)).to_bits();
            let t = Self::plus(t, Self::whole(MAGIC_BITS.wrapping_neg()));
            let down = _mm512_sub_epi32(Self::whole(LERP_STEPS as u32), t);
            let weights = Self::plus(Self::shifted_left::<16>(t), down);
            One(_mm512_cvtepi32_ps(_mm512_madd_epi16(words, weights)))
        }
    }
}
