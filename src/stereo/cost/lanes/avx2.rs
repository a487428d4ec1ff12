//! Lanes of AVX2: two registers.
//!
//! # Safety
//! Every intrinsic here needs AVX or AVX2. The type is only used by kernels that
//! [`Kernels::of`](super::super::Kernels::of) hands out after AVX2 was detected, and that are compiled with it enabled.
//! Loads and stores go through references; a gather's indices are held below the length of its slice.
#![allow(unsafe_code)]

use super::{Lanes, Pairs};
use crate::stereo::tile::{Row, Words};
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
    type Pairs = EightPairs;

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
    fn eq(self, other: Self) -> (__m256, __m256) {
        unsafe {
            (_mm256_cmp_ps::<_CMP_EQ_OQ>(self.0, other.0), _mm256_cmp_ps::<_CMP_EQ_OQ>(self.1, other.1))
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
    fn doubled(self) -> [Self; 2] {
        unsafe {
            let low = _mm256_setr_epi32(0, 0, 1, 1, 2, 2, 3, 3);
            let high = _mm256_setr_epi32(4, 4, 5, 5, 6, 6, 7, 7);
            [
                Two(_mm256_permutevar8x32_ps(self.0, low), _mm256_permutevar8x32_ps(self.0, high)),
                Two(_mm256_permutevar8x32_ps(self.1, low), _mm256_permutevar8x32_ps(self.1, high)),
            ]
        }
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
    fn inverted(a: Bits) -> Bits {
        let ones = Self::whole(!0);
        unsafe { (_mm256_xor_si256(a.0, ones.0), _mm256_xor_si256(a.1, ones.1)) }
    }

    #[inline(always)]
    fn shifted_left<const N: u32>(a: Bits) -> Bits {
        unsafe {
            let n = _mm_cvtsi32_si128(N as i32);
            (_mm256_sll_epi32(a.0, n), _mm256_sll_epi32(a.1, n))
        }
    }

    #[inline(always)]
    fn shifted_right<const N: u32>(a: Bits) -> Bits {
        unsafe {
            let n = _mm_cvtsi32_si128(N as i32);
            (_mm256_srl_epi32(a.0, n), _mm256_srl_epi32(a.1, n))
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
    fn load_words(words: &Words) -> Bits {
        // SAFETY: there are sixteen words.
        unsafe {
            (_mm256_loadu_si256(words.as_ptr().cast()), _mm256_loadu_si256(words.as_ptr().add(8).cast()))
        }
    }

    #[inline(always)]
    fn store_words(words: Bits, to: &mut Words) {
        // SAFETY: there are sixteen words.
        unsafe {
            _mm256_storeu_si256(to.as_mut_ptr().cast(), words.0);
            _mm256_storeu_si256(to.as_mut_ptr().add(8).cast(), words.1);
        }
    }

    #[inline(always)]
    fn store_halves(words: Bits, first: &mut [u32; 8], second: &mut [u32; 8]) {
        // SAFETY: each half has eight words.
        unsafe {
            _mm256_storeu_si256(first.as_mut_ptr().cast(), words.0);
            _mm256_storeu_si256(second.as_mut_ptr().cast(), words.1);
        }
    }

    #[inline(always)]
    fn truncated(self) -> Bits {
        unsafe { (_mm256_cvttps_epi32(self.0), _mm256_cvttps_epi32(self.1)) }
    }

    #[inline(always)]
    fn from_whole(bits: Bits) -> Self {
        unsafe { Two(_mm256_cvtepi32_ps(bits.0), _mm256_cvtepi32_ps(bits.1)) }
    }

    #[inline(always)]
    fn place(column: Bits, row: Bits, width: u32) -> Bits {
        let factors = Self::whole(1 | width << 16);
        let both = Self::paired(column, row);
        unsafe { (_mm256_madd_epi16(both.0, factors.0), _mm256_madd_epi16(both.1, factors.1)) }
    }

    #[inline(always)]
    fn gather(memory: &[u32], index: Bits) -> Bits {
        let Some(last) = memory.len().checked_sub(1) else { return Self::whole(0) };
        let last = Self::whole(last.min(i32::MAX as usize) as u32);
        // SAFETY: after the minimum every index is one of `memory`, and fits a positive i32.
        unsafe {
            let (a, b) = (_mm256_min_epu32(index.0, last.0), _mm256_min_epu32(index.1, last.1));
            let base = memory.as_ptr().cast();
            (_mm256_i32gather_epi32::<4>(base, a), _mm256_i32gather_epi32::<4>(base, b))
        }
    }

    #[inline(always)]
    fn bilinear(quad: Bits, column: Bits, row: Bits, base: Bits) -> Bits {
        (bilinear8(quad.0, column.0, row.0, base.0), bilinear8(quad.1, column.1, row.1, base.1))
    }

    #[inline(always)]
    fn paired(low: Bits, high: Bits) -> Bits {
        unsafe {
            let (a, b) = (_mm256_srli_epi32::<16>(low.0), _mm256_srli_epi32::<16>(low.1));
            (_mm256_blend_epi16::<0xAA>(a, high.0), _mm256_blend_epi16::<0xAA>(b, high.1))
        }
    }
}

/// Eight pairs in one register.
#[derive(Clone, Copy)]
pub(crate) struct EightPairs(__m256i);

impl Pairs for EightPairs {
    const WIDTH: usize = 8;

    #[inline(always)]
    fn splat(pair: u32) -> Self {
        EightPairs(unsafe { _mm256_set1_epi32(pair as i32) })
    }

    #[inline(always)]
    fn load(row: &[u32], at: usize) -> Self {
        let row: &[u32; 8] = row.get(at..).and_then(|r| r.first_chunk()).unwrap_or(&[0; 8]);
        // SAFETY: the reference is to eight words.
        EightPairs(unsafe { _mm256_loadu_si256(row.as_ptr().cast()) })
    }

    #[inline(always)]
    fn store(self, row: &mut Words, at: usize) {
        if let Some(to) = row.get_mut(at..).and_then(|r| r.first_chunk_mut::<8>()) {
            // SAFETY: the reference is to eight words.
            unsafe { _mm256_storeu_si256(to.as_mut_ptr().cast(), self.0) }
        }
    }

    #[inline(always)]
    fn scaled(self, b: Self) -> Self {
        EightPairs(unsafe { _mm256_mulhrs_epi16(self.0, b.0) })
    }

    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        EightPairs(unsafe { _mm256_add_epi16(self.0, other.0) })
    }

    #[inline(always)]
    fn plus_dot(self, a: Self, b: Self) -> Self {
        EightPairs(unsafe { _mm256_add_epi32(self.0, _mm256_madd_epi16(a.0, b.0)) })
    }
}

/// [`Lanes::bilinear`] of one register.
#[inline(always)]
fn bilinear8(quad: __m256i, column: __m256i, row: __m256i, base: __m256i) -> __m256i {
    const SECOND: i32 = 0x0101_0101;
    const EVEN: i32 = 0x8001_8001_u32 as i32;
    unsafe {
        let lane = _mm256_set1_epi64x(0x0404_0404_0000_0000);
        let lane =
            _mm256_add_epi8(lane, _mm256_setr_epi64x(0, 0x0808_0808_0808_0808, 0, 0x0808_0808_0808_0808));
        let across = _mm256_shuffle_epi8(column, _mm256_or_si256(lane, _mm256_set1_epi32(SECOND)));
        let down = _mm256_shuffle_epi8(row, _mm256_or_si256(lane, _mm256_set1_epi32(EVEN)));
        let across = _mm256_xor_si256(across, _mm256_set1_epi32(0x00ff_00ff));
        let down = _mm256_xor_si256(down, _mm256_set1_epi32(0x0000_00ff));
        let sample = _mm256_madd_epi16(_mm256_maddubs_epi16(across, quad), down);
        _mm256_slli_epi32::<5>(_mm256_add_epi32(sample, base))
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
