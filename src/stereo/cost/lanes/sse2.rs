//! Lanes of SSE2, which every x86-64 processor has: four registers.
//!
//! # Safety
//! Every intrinsic here needs SSE or SSE2, which are part of the architecture. Loads and stores go through references.
#![allow(unsafe_code)]

use super::{Lanes, Pairs};
use crate::stereo::tile::{Row, Words};
use std::arch::x86_64::*;
use std::ops::{Add, Div, Mul, Sub};

/// Sixteen lanes in four registers.
#[derive(Clone, Copy)]
pub(crate) struct Four([__m128; 4]);

/// Sixteen integers in four registers.
type Bits = [__m128i; 4];

/// The same expression for each of the four registers.
macro_rules! each {
    ($i:ident => $e:expr) => {{
        #[allow(unused_unsafe)]
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

operator!(Add, add, _mm_add_ps);
operator!(Sub, sub, _mm_sub_ps);
operator!(Mul, mul, _mm_mul_ps);
operator!(Div, div, _mm_div_ps);

impl Lanes for Four {
    type Bits = Bits;
    type Mask = [__m128; 4];
    type Pairs = FourPairs;

    #[inline(always)]
    fn splat(v: f32) -> Self {
        Four([unsafe { _mm_set1_ps(v) }; 4])
    }

    #[inline(always)]
    fn load(row: &Row) -> Self {
        // SAFETY: a row has sixteen values.
        Four(each!(I => _mm_loadu_ps(row.as_ptr().add(4 * I))))
    }

    #[inline(always)]
    fn store(self, row: &mut Row) {
        // SAFETY: a row has sixteen values.
        each!(I => _mm_storeu_ps(row.as_mut_ptr().add(4 * I), self.0[I]));
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Four(each!(I => _mm_min_ps(self.0[I], other.0[I])))
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Four(each!(I => _mm_max_ps(self.0[I], other.0[I])))
    }

    #[inline(always)]
    fn abs(self) -> Self {
        Four(each!(I => _mm_andnot_ps(_mm_set1_ps(-0.0), self.0[I])))
    }

    #[inline(always)]
    fn lt(self, other: Self) -> [__m128; 4] {
        each!(I => _mm_cmplt_ps(self.0[I], other.0[I]))
    }

    #[inline(always)]
    fn le(self, other: Self) -> [__m128; 4] {
        each!(I => _mm_cmple_ps(self.0[I], other.0[I]))
    }

    #[inline(always)]
    fn eq(self, other: Self) -> [__m128; 4] {
        each!(I => _mm_cmpeq_ps(self.0[I], other.0[I]))
    }

    #[inline(always)]
    fn both(a: [__m128; 4], b: [__m128; 4]) -> [__m128; 4] {
        each!(I => _mm_and_ps(a[I], b[I]))
    }

    #[inline(always)]
    fn any(m: [__m128; 4]) -> bool {
        unsafe { _mm_movemask_ps(_mm_or_ps(_mm_or_ps(m[0], m[1]), _mm_or_ps(m[2], m[3]))) != 0 }
    }

    #[inline(always)]
    fn all(m: [__m128; 4]) -> bool {
        unsafe { _mm_movemask_ps(_mm_and_ps(_mm_and_ps(m[0], m[1]), _mm_and_ps(m[2], m[3]))) == 0xf }
    }

    #[inline(always)]
    fn select(mask: [__m128; 4], yes: Self, no: Self) -> Self {
        Four(each!(I => _mm_or_ps(_mm_and_ps(mask[I], yes.0[I]), _mm_andnot_ps(mask[I], no.0[I]))))
    }

    #[inline(always)]
    fn doubled(self) -> [Self; 2] {
        let [a, b, c, d] = self.0;
        unsafe {
            let twice = |a, b| {
                Four([
                    _mm_unpacklo_ps(a, a),
                    _mm_unpackhi_ps(a, a),
                    _mm_unpacklo_ps(b, b),
                    _mm_unpackhi_ps(b, b),
                ])
            };
            [twice(a, b), twice(c, d)]
        }
    }

    #[inline(always)]
    fn to_bits(self) -> Bits {
        each!(I => _mm_castps_si128(self.0[I]))
    }

    #[inline(always)]
    fn from_bits(bits: Bits) -> Self {
        Four(each!(I => _mm_castsi128_ps(bits[I])))
    }

    #[inline(always)]
    fn whole(v: u32) -> Bits {
        [unsafe { _mm_set1_epi32(v as i32) }; 4]
    }

    #[inline(always)]
    fn plus(a: Bits, b: Bits) -> Bits {
        each!(I => _mm_add_epi32(a[I], b[I]))
    }

    #[inline(always)]
    fn inverted(a: Bits) -> Bits {
        each!(I => _mm_xor_si128(a[I], _mm_set1_epi32(-1)))
    }

    #[inline(always)]
    fn shifted_left<const N: u32>(a: Bits) -> Bits {
        each!(I => _mm_sll_epi32(a[I], _mm_cvtsi32_si128(N as i32)))
    }

    #[inline(always)]
    fn shifted_right<const N: u32>(a: Bits) -> Bits {
        each!(I => _mm_srl_epi32(a[I], _mm_cvtsi32_si128(N as i32)))
    }

    #[inline(always)]
    fn masked(a: Bits, mask: u32) -> Bits {
        each!(I => _mm_and_si128(a[I], _mm_set1_epi32(mask as i32)))
    }

    #[inline(always)]
    fn fetch(memory: &[u32], index: Bits) -> (Bits, Bits) {
        let next = Self::plus(index, Self::whole(1));
        (Self::gather(memory, index), Self::gather(memory, next))
    }

    #[inline(always)]
    fn load_words(words: &Words) -> Bits {
        // SAFETY: there are sixteen words.
        each!(I => _mm_loadu_si128(words.as_ptr().add(4 * I).cast()))
    }

    #[inline(always)]
    fn store_words(words: Bits, to: &mut Words) {
        // SAFETY: there are sixteen words.
        each!(I => _mm_storeu_si128(to.as_mut_ptr().add(4 * I).cast(), words[I]));
    }

    #[inline(always)]
    fn store_halves(words: Bits, first: &mut [u32; 8], second: &mut [u32; 8]) {
        // SAFETY: each half has eight words.
        unsafe {
            _mm_storeu_si128(first.as_mut_ptr().cast(), words[0]);
            _mm_storeu_si128(first.as_mut_ptr().add(4).cast(), words[1]);
            _mm_storeu_si128(second.as_mut_ptr().cast(), words[2]);
            _mm_storeu_si128(second.as_mut_ptr().add(4).cast(), words[3]);
        }
    }

    #[inline(always)]
    fn truncated(self) -> Bits {
        each!(I => _mm_cvttps_epi32(self.0[I]))
    }

    #[inline(always)]
    fn from_whole(bits: Bits) -> Self {
        Four(each!(I => _mm_cvtepi32_ps(bits[I])))
    }

    #[inline(always)]
    fn place(column: Bits, row: Bits, width: u32) -> Bits {
        let both = Self::paired(column, row);
        each!(I => _mm_madd_epi16(both[I], _mm_set1_epi32((1 | width << 16) as i32)))
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
        each!(I => {
            let high = _mm_and_si128(high[I], _mm_set1_epi32(0xffff_0000_u32 as i32));
            _mm_or_si128(_mm_srli_epi32::<16>(low[I]), high)
        })
    }
}

/// [`Lanes::gather`] of one register.
#[inline(always)]
fn gather4(memory: &[u32], index: __m128i) -> __m128i {
    let mut at = [0u32; 4];
    // SAFETY: the array has four words.
    unsafe { _mm_storeu_si128(at.as_mut_ptr().cast(), index) };
    let [a, b, c, d] = at.map(|i| memory.get(i as usize).copied().unwrap_or(0) as i32);
    unsafe { _mm_setr_epi32(a, b, c, d) }
}

/// [`Lanes::bilinear`] of one register.
#[inline(always)]
fn bilinear4(quad: __m128i, column: __m128i, row: __m128i, base: __m128i) -> __m128i {
    unsafe {
        let byte = _mm_set1_epi32(0xff);
        let f = _mm_and_si128(_mm_srli_epi32::<8>(column), byte);
        let f = _mm_or_si128(f, _mm_slli_epi32::<16>(f));
        let g = _mm_and_si128(_mm_srli_epi32::<8>(row), byte);
        let down = _mm_xor_si128(_mm_or_si128(g, _mm_slli_epi32::<16>(g)), byte);
        let left = _mm_srai_epi16::<8>(_mm_slli_epi16::<8>(quad));
        let right = _mm_srai_epi16::<8>(quad);
        // left · (255 − f) + right · f, modulo 2¹⁶
        let across = _mm_mullo_epi16(_mm_sub_epi16(right, left), f);
        let across = _mm_add_epi16(across, _mm_sub_epi16(_mm_slli_epi16::<8>(left), left));
        _mm_slli_epi32::<5>(_mm_add_epi32(_mm_madd_epi16(across, down), base))
    }
}

/// Four pairs in one register.
#[derive(Clone, Copy)]
pub(crate) struct FourPairs(__m128i);

impl Pairs for FourPairs {
    const WIDTH: usize = 4;

    #[inline(always)]
    fn splat(pair: u32) -> Self {
        FourPairs(unsafe { _mm_set1_epi32(pair as i32) })
    }

    #[inline(always)]
    fn load(row: &[u32], at: usize) -> Self {
        let row: &[u32; 4] = row.get(at..).and_then(|r| r.first_chunk()).unwrap_or(&[0; 4]);
        // SAFETY: the reference is to four words.
        FourPairs(unsafe { _mm_loadu_si128(row.as_ptr().cast()) })
    }

    #[inline(always)]
    fn store(self, row: &mut Words, at: usize) {
        if let Some(to) = row.get_mut(at..).and_then(|r| r.first_chunk_mut::<4>()) {
            // SAFETY: the reference is to four words.
            unsafe { _mm_storeu_si128(to.as_mut_ptr().cast(), self.0) }
        }
    }

    #[inline(always)]
    fn scaled(self, b: Self) -> Self {
        unsafe {
            // 14 bits twice doubled are 16, so that the high half of the product is a · b / 2¹⁴
            let twice = _mm_mulhi_epi16(self.0, _mm_slli_epi16::<2>(b.0));
            FourPairs(_mm_srai_epi16::<1>(_mm_add_epi16(twice, _mm_set1_epi16(1))))
        }
    }

    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        FourPairs(unsafe { _mm_add_epi16(self.0, other.0) })
    }

    #[inline(always)]
    fn plus_dot(self, a: Self, b: Self) -> Self {
        FourPairs(unsafe { _mm_add_epi32(self.0, _mm_madd_epi16(a.0, b.0)) })
    }
}
