//! Lanes of AVX-512: one register.
//!
//! # Safety
//! Every intrinsic here needs AVX-512 F, BW, DQ or VL. The type is only used by kernels that
//! [`Kernels::of`](super::super::Kernels::of) hands out after those features were detected, and that are compiled with
//! them enabled. Loads and stores go through references; a gather's indices are held below the length of its slice.
#![allow(unsafe_code)]

use super::{Lanes, Pairs};
use crate::stereo::tile::{Row, Words};
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
    type Pairs = SixteenPairs;

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
    fn eq(self, other: Self) -> __mmask16 {
        unsafe { _mm512_cmp_ps_mask::<_CMP_EQ_OQ>(self.0, other.0) }
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
    fn doubled(self) -> [Self; 2] {
        unsafe {
            let low = _mm512_setr_epi32(0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 5, 5, 6, 6, 7, 7);
            let high = _mm512_add_epi32(low, Self::whole(8));
            [One(_mm512_permutexvar_ps(low, self.0)), One(_mm512_permutexvar_ps(high, self.0))]
        }
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
    fn inverted(a: __m512i) -> __m512i {
        unsafe { _mm512_xor_si512(a, Self::whole(!0)) }
    }

    #[inline(always)]
    fn shifted_left<const N: u32>(a: __m512i) -> __m512i {
        unsafe { _mm512_slli_epi32::<N>(a) }
    }

    #[inline(always)]
    fn shifted_right<const N: u32>(a: __m512i) -> __m512i {
        unsafe { _mm512_srli_epi32::<N>(a) }
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
    fn load_words(words: &Words) -> __m512i {
        unsafe { _mm512_loadu_si512(words.as_ptr().cast()) }
    }

    #[inline(always)]
    fn store_words(words: __m512i, to: &mut Words) {
        unsafe { _mm512_storeu_si512(to.as_mut_ptr().cast(), words) }
    }

    #[inline(always)]
    fn store_halves(words: __m512i, first: &mut [u32; 8], second: &mut [u32; 8]) {
        // SAFETY: each half has eight words.
        unsafe {
            _mm256_storeu_si256(first.as_mut_ptr().cast(), _mm512_castsi512_si256(words));
            _mm256_storeu_si256(second.as_mut_ptr().cast(), _mm512_extracti64x4_epi64::<1>(words));
        }
    }

    #[inline(always)]
    fn truncated(self) -> __m512i {
        unsafe { _mm512_cvttps_epi32(self.0) }
    }

    #[inline(always)]
    fn from_whole(bits: __m512i) -> Self {
        One(unsafe { _mm512_cvtepi32_ps(bits) })
    }

    #[inline(always)]
    fn place(column: __m512i, row: __m512i, width: u32) -> __m512i {
        unsafe { _mm512_madd_epi16(Self::paired(column, row), Self::whole(1 | width << 16)) }
    }

    #[inline(always)]
    fn gather(memory: &[u32], index: __m512i) -> __m512i {
        let Some(last) = memory.len().checked_sub(1) else { return Self::whole(0) };
        let last = Self::whole(last.min(i32::MAX as usize) as u32);
        // SAFETY: after the minimum every index is one of `memory`, and fits a positive i32.
        unsafe { _mm512_i32gather_epi32::<4>(_mm512_min_epu32(index, last), memory.as_ptr().cast()) }
    }

    const LOOKUP: bool = true;

    #[inline(always)]
    fn lookup<const ROWS: usize>(
        memory: &[u8],
        (first, origin): (usize, u32),
        stride: usize,
        column: __m512i,
        row: __m512i,
    ) -> __m512i {
        let Some(last) = memory.len().checked_sub((ROWS - 1) * stride + 16) else { return column };
        // SAFETY: from the minimum on, `memory` holds all rows of sixteen bytes.
        unsafe {
            let number = plus_dot(Self::whole(origin), Self::paired(column, row), Self::whole(1 | 16 << 16));
            let lane = _mm512_set4_epi32(0x0c0c_0c0c, 0x0808_0808, 0x0404_0404, 0);
            let index = _mm512_add_epi8(_mm512_shuffle_epi8(number, lane), Self::whole(0x1110_0100));
            let first = memory.as_ptr().add(first.min(last));
            let row = |k: usize| _mm_loadu_si128(first.add(k * stride).cast());
            let four = |k: usize| {
                let low = _mm256_inserti128_si256::<1>(_mm256_castsi128_si256(row(k)), row(k + 1));
                let high = _mm256_inserti128_si256::<1>(_mm256_castsi128_si256(row(k + 2)), row(k + 3));
                _mm512_inserti64x4::<1>(_mm512_castsi256_si512(low), high)
            };
            if ROWS == 8 {
                _mm512_permutex2var_epi8(four(0), index, four(4))
            } else {
                _mm512_permutexvar_epi8(index, four(0))
            }
        }
    }

    #[inline(always)]
    fn bilinear(quad: __m512i, column: __m512i, row: __m512i, base: __m512i) -> __m512i {
        unsafe {
            let lane = _mm512_set4_epi32(0x0c0c_0c0c, 0x0808_0808, 0x0404_0404, 0);
            let all = _mm512_or_si512(lane, Self::whole(0x0101_0101));
            let even = _mm512_or_si512(lane, Self::whole(0x8001_8001));
            let across = _mm512_xor_si512(_mm512_shuffle_epi8(column, all), Self::whole(0x00ff_00ff));
            let down = _mm512_xor_si512(_mm512_shuffle_epi8(row, even), Self::whole(0x0000_00ff));
            _mm512_slli_epi32::<5>(plus_dot(base, _mm512_maddubs_epi16(across, quad), down))
        }
    }

    #[inline(always)]
    fn paired(low: __m512i, high: __m512i) -> __m512i {
        // `low | high & mask`; compilers would make a slower permutation of it
        let mask = Self::whole(0xffff_0000);
        unsafe { _mm512_ternarylogic_epi32::<0b1111_1000>(_mm512_srli_epi32::<16>(low), high, mask) }
    }
}

/// Sixteen pairs in one register.
#[derive(Clone, Copy)]
pub(crate) struct SixteenPairs(__m512i);

impl Pairs for SixteenPairs {
    const WIDTH: usize = 16;

    #[inline(always)]
    fn splat(pair: u32) -> Self {
        SixteenPairs(unsafe { _mm512_set1_epi32(pair as i32) })
    }

    #[inline(always)]
    fn load(row: &[u32], at: usize) -> Self {
        let row: &Words = row.get(at..).and_then(|r| r.first_chunk()).unwrap_or(&[0; 16]);
        // SAFETY: the reference is to sixteen words.
        SixteenPairs(unsafe { _mm512_loadu_si512(row.as_ptr().cast()) })
    }

    #[inline(always)]
    fn store(self, row: &mut Words, at: usize) {
        if at == 0 {
            // SAFETY: the reference is to sixteen words.
            unsafe { _mm512_storeu_si512(row.as_mut_ptr().cast(), self.0) }
        }
    }

    #[inline(always)]
    fn scaled(self, b: Self) -> Self {
        SixteenPairs(unsafe { _mm512_mulhrs_epi16(self.0, b.0) })
    }

    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        SixteenPairs(unsafe { _mm512_add_epi16(self.0, other.0) })
    }

    #[inline(always)]
    fn plus_dot(self, a: Self, b: Self) -> Self {
        // SAFETY: the feature is there.
        SixteenPairs(unsafe { plus_dot(self.0, a.0, b.0) })
    }
}

/// `VPDPWSSD`, which compilers tear into two instructions where it is written as an intrinsic.
#[inline]
#[target_feature(enable = "avx512f,avx512vnni")]
fn plus_dot(mut sum: __m512i, a: __m512i, b: __m512i) -> __m512i {
    // SAFETY: it reads and writes the named registers alone.
    unsafe {
        std::arch::asm!(
            "vpdpwssd {sum}, {a}, {b}",
            sum = inout(zmm_reg) sum,
            a = in(zmm_reg) a,
            b = in(zmm_reg) b,
            options(pure, nomem, nostack, preserves_flags),
        );
    }
    sum
}
