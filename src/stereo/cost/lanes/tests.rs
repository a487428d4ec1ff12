//! Every implementation of the lanes against the plain one, bit by bit.

use super::portable::Sixteen;
use super::{Lanes, Row};
use crate::stereo::rng::Rng;

const WORDS: usize = 500;

fn stored<L: Lanes>(lanes: L) -> [u32; 16] {
    let mut row = [0.0; 16];
    lanes.store(&mut row);
    row.map(f32::to_bits)
}

/// Rows of ordinary values, and one of odd ones.
fn rows() -> Vec<Row> {
    let mut rng = Rng::keyed(1, 2, 3, 4);
    let mut rows: Vec<Row> = (0..40).map(|_| std::array::from_fn(|_| rng.signed() * 300.0)).collect();
    rows.push(std::array::from_fn(|i| [0.0, -0.0, f32::INFINITY, f32::NAN, 1e-38, -1e30, 0.5, 7.0][i % 8]));
    rows
}

/// The bits of everything an implementation makes of two rows.
fn results<L: Lanes>(a: &Row, b: &Row, memory: &[u32]) -> Vec<[u32; 16]> {
    let (x, y) = (L::load(a), L::load(b));
    let less = L::both(x.lt(y), L::splat(-200.0).le(x));
    let indices = std::array::from_fn(|i| f32::from_bits((a[i].abs() as u32).min(WORDS as u32 - 2)));
    let (words, next) = L::fetch(memory, L::load(&indices).to_bits());
    let fractions = (x.abs() * L::splat(1.0 / 300.0)).min(L::splat(1.0));
    let (fraction, whole) = (x.abs() + L::splat(0.75)).min(L::splat(4e6)).fraction_and_whole();
    let bits = L::plus(L::row_major(whole, whole, 17), L::masked(L::shifted_left::<3>(y.to_bits()), 0xff00));
    let any = L::splat(f32::from(u8::from(L::any(less)) + 2 * u8::from(L::all(L::splat(-1e9).lt(x)))));
    [x + y, x - y, x * y, x / y, x.min(y), x.max(y), x.abs().sqrt(), L::select(less, x, y), any]
        .into_iter()
        .chain([L::from_bits(words), L::from_bits(next), L::from_bits(bits), fraction])
        .chain([L::lerp_halves(words, fractions), L::bell8(x.abs()), L::bell64(x.abs()), L::splat(x.sum())])
        .map(stored)
        .collect()
}

fn assert_same<L: Lanes>(name: &str) {
    // halves of twelve bits, signed
    let half = |i: usize| (i as i32 * 37 % 4096 - 2048) as i16 as u16;
    let memory: Vec<u32> = (0..WORDS).map(|i| u32::from(half(i)) | u32::from(half(i + 9)) << 16).collect();
    let rows = rows();
    for pair in rows.windows(2) {
        let want = results::<Sixteen>(&pair[0], &pair[1], &memory);
        let got = results::<L>(&pair[0], &pair[1], &memory);
        for (k, (want, got)) in want.iter().zip(&got).enumerate() {
            for (w, g) in want.iter().zip(got) {
                let both_nan = f32::from_bits(*w).is_nan() && f32::from_bits(*g).is_nan();
                assert!(w == g || both_nan, "{name}, result {k}: {w:x} {g:x} of {pair:?}");
            }
        }
    }
}

#[cfg(target_arch = "x86_64")]
#[test]
fn wide_registers_give_the_same_bits() {
    use crate::stereo::CpuLevel;
    if CpuLevel::Avx2.is_supported() {
        assert_same::<super::avx2::Two>("avx2");
    }
    if CpuLevel::Avx512.is_supported() {
        assert_same::<super::avx512::One>("avx512");
    }
}

#[test]
fn plain_lanes_compute_what_they_say() {
    assert_same::<Sixteen>("portable");
    let quarter = Sixteen::splat(0.25);
    let words = [0x0040_0010u32; 16]; // low half 16, high half 64
    assert_eq!(stored(Sixteen::lerp_halves(words, quarter)), [(4096.0f32 * 28.0).to_bits(); 16]);
    let (fraction, column) = Sixteen::splat(6.75).fraction_and_whole();
    let (_, row) = Sixteen::splat(2.25).fraction_and_whole();
    assert_eq!(
        (stored(fraction), Sixteen::row_major(column, row, 100)),
        ([0.75f32.to_bits(); 16], [206; 16])
    );
    assert_eq!(Sixteen::fetch(&[1, 2, 3], [1; 16]), ([2; 16], [3; 16]));
}

/// The bells fall below e⁻ˣ; by how much at most.
const BELL_TOLERANCE: [f32; 2] = [0.036, 0.005];

#[test]
fn bells_are_close_to_the_exponential() {
    for i in 0..400u16 {
        let x = f32::from(i) * 0.05;
        let [b8, b64] = [Sixteen::bell8(Sixteen::splat(x)), Sixteen::bell64(Sixteen::splat(x))]
            .map(|b| f32::from_bits(stored(b)[0]));
        let want = (-x).exp();
        assert!(b8 <= want + 1e-6 && want - b8 < BELL_TOLERANCE[0], "{x}: {b8} {want}");
        assert!(b64 <= want + 1e-6 && want - b64 < BELL_TOLERANCE[1], "{x}: {b64} {want}");
    }
}
