//! Every implementation of the lanes against the plain one, bit by bit.

use super::portable::{FourPairs, Sixteen};
use super::{Lanes, Pairs, Row, Words};
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

/// Sixteen random words, kept bits only.
fn words(rng: &mut Rng, kept: u32) -> Words {
    std::array::from_fn(|_| (rng.below(1 << 16) as u32 * 65_537 + rng.below(1 << 16) as u32) & kept)
}

/// The bits of everything an implementation makes of two rows and random words.
fn results<L: Lanes>(a: &Row, b: &Row, memory: &[u32], seed: u32) -> Vec<Words> {
    let rng = &mut Rng::keyed(5, 6, 7, seed);
    let (x, y) = (L::load(a), L::load(b));
    let less = L::both(x.lt(y), L::splat(-200.0).le(x));
    let index = L::load_words(&words(rng, 0xff));
    let (first, next) = L::fetch(memory, index);
    let (above, whole) = (x.abs() + L::splat(0.75)).min(L::splat(3e4)).nearest();
    let any = L::splat(f32::from(u8::from(L::any(less)) + 2 * u8::from(L::all(L::splat(-1e9).lt(x)))));
    let small = x.min(L::splat(1e6)).max(L::splat(-1e6));
    let [quad, u, v] = [!0, 0x7f_ffff, 0x3f_ffff].map(|kept| L::load_words(&words(rng, kept)));
    let (mut halves, mut stored_words) = ([[0; 8]; 2], [0; 16]);
    let [top, bottom] = &mut halves;
    L::store_halves(quad, top, bottom);
    L::store_words(L::paired(quad, u), &mut stored_words);
    let numbers =
        [x + y, x - y, x * y, x / y, x.min(y), x.max(y), x.abs().inverse_sqrt(), L::select(less, x, y)]
            .into_iter()
            .chain([
                any,
                above,
                L::select(x.eq(x.max(y)), x, L::splat(1.0)),
                L::bell64(x.abs()),
                L::splat(x.sum()),
                L::from_whole(quad),
            ])
            .map(L::to_bits);
    let bits = [first, next, L::row_major(whole, whole, 17), L::masked(L::shifted_left::<3>(quad), 0xff00)]
        .into_iter()
        .chain([L::shifted_right::<5>(quad)])
        .chain([L::plus(quad, u), L::negated(quad), small.truncated(), L::place(u, v, 300)])
        .chain([L::gather(memory, index), L::bilinear(quad, u, v, quad)]);
    numbers
        .chain(bits)
        .map(|bits| stored(L::from_bits(bits)))
        .chain([stored_words, std::array::from_fn(|i| halves[i / 8][i % 8])])
        .collect()
}

/// Products of pairs of 14-bit numbers, sums of them, and sums of pairs.
fn products<P: Pairs>(seed: u32) -> [Words; 3] {
    let rng = &mut Rng::keyed(8, 9, 10, seed);
    let mut out = [[0; 16]; 3];
    let weights = words(rng, 0x7fff_7fff);
    // signed halves of fourteen bits
    let [a, b] = [(); 2].map(|()| words(rng, !0).map(|w| (w & 0xffff) as i16 >> 2).map(|v| v as u16));
    let pair =
        |h: [u16; 16]| -> Words { std::array::from_fn(|i| u32::from(h[i]) | u32::from(h[15 - i]) << 16) };
    let (a, b) = (pair(a), pair(b));
    for at in (0..16).step_by(P::WIDTH) {
        let scaled = P::load(&weights, at).scaled(P::load(&a, at));
        scaled.store(&mut out[0], at);
        P::splat(77).plus_dot(scaled, P::load(&b, at)).store(&mut out[1], at);
        P::load(&a, at).plus(P::load(&b, at)).store(&mut out[2], at);
    }
    out
}

fn assert_same<L: Lanes>(name: &str) {
    let memory = words(&mut Rng::keyed(1, 1, 1, 1), !0).repeat(WORDS / 16);
    for (seed, pair) in rows().windows(2).enumerate() {
        let want = results::<Sixteen>(&pair[0], &pair[1], &memory, seed as u32);
        let got = results::<L>(&pair[0], &pair[1], &memory, seed as u32);
        for (k, (want, got)) in want.iter().zip(&got).enumerate() {
            for (w, g) in want.iter().zip(got) {
                let both_nan = f32::from_bits(*w).is_nan() && f32::from_bits(*g).is_nan();
                assert!(w == g || both_nan, "{name}, result {k}: {w:x} {g:x} of {pair:?}");
            }
        }
        let (want, got) = (products::<FourPairs>(seed as u32), products::<L::Pairs>(seed as u32));
        assert_eq!(want, got, "{name}, pairs {seed}");
    }
}

/// Looks quads up in tables and gathers them from memory.
fn assert_lookup_gathers<L: Lanes>() {
    const STRIDE: usize = 40;
    // The table begins here.
    const CORNER: (u32, u32) = (7, 2);
    let rng = &mut Rng::keyed(3, 3, 3, 3);
    let bytes: Vec<u8> = (0..STRIDE * 12).map(|_| rng.below(256) as u8).collect();
    let quad = |at: usize| {
        u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + STRIDE], bytes[at + STRIDE + 1]])
    };
    let quads: Vec<u32> = (0..STRIDE * 10).map(quad).collect();
    let from = ((CORNER.1 * STRIDE as u32 + CORNER.0) as usize, (CORNER.1 * 16 + CORNER.0).wrapping_neg());
    let (columns, rows) = (words(rng, !0), words(rng, !0));
    for height in [4, 8] {
        let column = columns.map(|c| (CORNER.0 << 16) + c % (15 << 16));
        let row = rows.map(|r| (CORNER.1 << 16) + r % ((height - 1) << 16));
        let want: Words =
            std::array::from_fn(|i| quads[(row[i] >> 16) as usize * STRIDE + (column[i] >> 16) as usize]);
        let (column, row) = (L::load_words(&column), L::load_words(&row));
        let got = if height == 4 {
            L::lookup::<4>(&bytes, from, STRIDE, column, row)
        } else {
            L::lookup::<8>(&bytes, from, STRIDE, column, row)
        };
        let mut stored = [0; 16];
        L::store_words(got, &mut stored);
        assert_eq!(stored, want, "{height} rows");
    }
}

#[cfg(target_arch = "x86_64")]
#[test]
fn wide_registers_give_the_same_bits() {
    use crate::stereo::CpuLevel;
    assert_same::<super::sse2::Four>("sse2");
    if CpuLevel::Avx2.is_supported() {
        assert_same::<super::avx2::Two>("avx2");
    }
    if CpuLevel::Avx512.is_supported() {
        assert_same::<super::avx512::One>("avx512");
        assert_lookup_gathers::<super::avx512::One>();
    }
}

#[cfg(target_arch = "aarch64")]
#[test]
fn neon_gives_the_same_bits() {
    assert_same::<super::neon::Four>("neon");
}

#[test]
fn plain_lanes_compute_what_they_say() {
    assert_same::<Sixteen>("portable");
    // a quarter of a pixel right of and half a pixel below bytes 16, 32 / -16, 0; one is 255 steps of 256
    let quad = [u32::from_le_bytes([16, 32, -16i8 as u8, 0]); 16];
    let (f, g) = (64.0 / 255.0, 128.0 / 255.0);
    let want = (16.0 + f * 16.0) * (1.0 - g) + (-16.0 + f * 16.0) * g;
    let got =
        Sixteen::bilinear(quad, [3 << 16 | 64 << 8; 16], [7 << 16 | 128 << 8; 16], [1000; 16])[0] as i32;
    assert!((f64::from(got) - (want * 255.0 * 255.0 + 1000.0) * 32.0).abs() < 1.0, "{got} {want}");
    assert_eq!(Sixteen::place([5 << 16 | 9; 16], [2 << 16 | 9; 16], 100), [205; 16]);
    assert_eq!(FourPairs::splat(0x4000_2000).scaled(FourPairs::splat(0x0064_ff9c)).0, [0x0032_ffe7; 4]);
    let (above, column) = Sixteen::splat(5.75).nearest();
    let (_, row) = Sixteen::splat(2.25).nearest();
    assert_eq!(
        (stored(above), Sixteen::row_major(column, row, 100)),
        ([(-0.25f32).to_bits(); 16], [206; 16])
    );
    assert_eq!(Sixteen::fetch(&[1, 2, 3], [1; 16]), ([2; 16], [3; 16]));
}

/// Largest relative error of an inverse square root.
const ROOT_TOLERANCE: f32 = 2.1e-5;

#[test]
fn inverse_roots_are_close_and_finite() {
    for i in 0..4000u16 {
        let x = (1e-30 * 1.03f64.powi(i32::from(i))) as f32;
        let got = f32::from_bits(stored(Sixteen::splat(x).inverse_sqrt())[0]);
        assert!((got * x.sqrt() - 1.0).abs() < ROOT_TOLERANCE, "{x}: {got}");
    }
    assert!(f32::from_bits(stored(Sixteen::splat(0.0).inverse_sqrt())[0]).is_finite());
}

/// The bell falls below e⁻ˣ; by how much at most.
const BELL_TOLERANCE: f32 = 0.005;

#[test]
fn the_bell_is_close_to_the_exponential() {
    for i in 0..400u16 {
        let x = f32::from(i) * 0.05;
        let bell = f32::from_bits(stored(Sixteen::bell64(Sixteen::splat(x)))[0]);
        let want = (-x).exp();
        assert!(bell <= want + 1e-6 && want - bell < BELL_TOLERANCE, "{x}: {bell} {want}");
    }
}
