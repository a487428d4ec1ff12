//! The kernels compiled for wider x86-64 registers.
//!
//! # Safety
//! The tables below call functions that need processor features. They are only handed out by
//! [`Kernels::of`](super::Kernels::of) after `CpuLevel::is_supported` has found those features.
#![allow(unsafe_code)]

use super::super::level::Level;
use super::super::plane::InversePlane;
use super::super::tile::Tile;
use super::lanes::{avx2::Two, avx512::One};
use super::{Kernels, kernels};

macro_rules! compiled_for {
    ($module:ident, $lanes:ty, $features:literal) => {
        mod $module {
            use super::*;

            #[target_feature(enable = $features)]
            pub(super) fn prepare(tile: &mut Tile, level: &Level) {
                kernels::prepare::<$lanes>(tile, level);
            }

            #[target_feature(enable = $features)]
            pub(super) fn begin(tile: &mut Tile, level: &Level) {
                kernels::begin::<$lanes>(tile, level);
            }

            #[target_feature(enable = $features)]
            pub(super) fn survey(tile: &mut Tile, level: &Level, plane: InversePlane) {
                kernels::survey::<$lanes>(tile, level, plane);
            }

            #[target_feature(enable = $features)]
            pub(super) fn score_own(tile: &mut Tile, level: &Level) {
                kernels::score_own::<$lanes>(tile, level);
            }

            #[target_feature(enable = $features)]
            pub(super) fn try_plane(tile: &mut Tile, level: &Level, plane: InversePlane) -> bool {
                kernels::try_plane::<$lanes>(tile, level, plane)
            }

            // SAFETY: the table is handed out only where the features were detected.
            pub(super) const KERNELS: Kernels = Kernels {
                prepare: |tile, level| unsafe { prepare(tile, level) },
                begin: |tile, level| unsafe { begin(tile, level) },
                survey: |tile, level, plane| unsafe { survey(tile, level, plane) },
                score_own: |tile, level| unsafe { score_own(tile, level) },
                try_plane: |tile, level, plane| unsafe { try_plane(tile, level, plane) },
            };
        }
    };
}

compiled_for!(avx2, Two, "avx2");
compiled_for!(avx512, One, "avx2,avx512f,avx512bw,avx512dq,avx512vl,avx512vnni,avx512vbmi");

/// Kernels for AVX2.
pub(super) const AVX2: Kernels = avx2::KERNELS;
/// Kernels for AVX-512.
pub(super) const AVX512: Kernels = avx512::KERNELS;
