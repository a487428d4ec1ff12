//! Kernels of the estimator: the contract, and the choice of the instruction set.
//!
//! Every kernel works on one [`Tile`] and is written once, in [`kernels`], over sixteen lanes ([`lanes::Lanes`]) that
//! each instruction set implements. No operation is fused or reassociated, so all levels give the same bytes.

mod kernels;
mod lanes;
#[cfg(test)]
mod oracle_tests;
#[cfg(target_arch = "x86_64")]
mod x86;

use super::level::Level;
use super::plane::InversePlane;
use super::tile::Tile;

/// Lanes of what every processor of the architecture has.
#[cfg(target_arch = "x86_64")]
type Baseline = lanes::sse2::Four;
#[cfg(not(target_arch = "x86_64"))]
type Baseline = lanes::portable::Sixteen;

/// Instruction set used by the kernels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CpuLevel {
    /// What every x86-64 processor has; elsewhere plain code.
    Scalar,
    /// 64-bit ARM.
    Neon,
    /// x86-64 with AVX2.
    Avx2,
    /// x86-64 with AVX-512 F, BW, DQ, VL, VNNI and VBMI: Ice Lake, Zen 4 and later.
    Avx512,
}

impl CpuLevel {
    /// The best level that this processor has.
    pub fn detect() -> Self {
        [CpuLevel::Avx512, CpuLevel::Avx2, CpuLevel::Neon]
            .into_iter()
            .find(|l| l.is_supported())
            .unwrap_or(CpuLevel::Scalar)
    }

    /// Whether this processor has the level.
    pub fn is_supported(self) -> bool {
        match self {
            CpuLevel::Scalar => true,
            CpuLevel::Neon => cfg!(target_arch = "aarch64"),
            #[cfg(target_arch = "x86_64")]
            CpuLevel::Avx2 => std::is_x86_feature_detected!("avx2"),
            #[cfg(target_arch = "x86_64")]
            CpuLevel::Avx512 => {
                std::is_x86_feature_detected!("avx2")
                    && std::is_x86_feature_detected!("avx512f")
                    && std::is_x86_feature_detected!("avx512bw")
                    && std::is_x86_feature_detected!("avx512dq")
                    && std::is_x86_feature_detected!("avx512vl")
                    && std::is_x86_feature_detected!("avx512vnni")
                    && std::is_x86_feature_detected!("avx512vbmi")
            }
            #[cfg(not(target_arch = "x86_64"))]
            _ => false,
        }
    }

    /// Name as given on the command line and in reports.
    pub fn name(self) -> &'static str {
        match self {
            CpuLevel::Scalar => "scalar",
            CpuLevel::Neon => "neon",
            CpuLevel::Avx2 => "avx2",
            CpuLevel::Avx512 => "avx512",
        }
    }
}

impl std::str::FromStr for CpuLevel {
    type Err = crate::Error;

    fn from_str(s: &str) -> crate::Result<Self> {
        let all = [CpuLevel::Scalar, CpuLevel::Neon, CpuLevel::Avx2, CpuLevel::Avx512];
        let level = all.into_iter().find(|l| l.name() == s).ok_or_else(|| {
            crate::Error::invalid(format!(
                "unknown CPU level \"{s}\"; known are scalar, neon, avx2 and avx512"
            ))
        })?;
        if !level.is_supported() {
            return Err(crate::Error::invalid(format!("this processor does not have CPU level {s}")));
        }
        Ok(level)
    }
}

/// The kernels of one level.
#[derive(Clone, Copy)]
pub(crate) struct Kernels {
    /// Bilateral weights and statistics of the loaded tile's patches, and the weight of its prior.
    pub(crate) prepare: fn(&mut Tile, &Level),
    /// Unit normals of the surround and total costs of the loaded estimates.
    pub(crate) begin: fn(&mut Tile, &Level),
    /// Compares a plane anchored at the tile's centre with all views, to order them; all are in use.
    pub(crate) survey: fn(&mut Tile, &Level, InversePlane),
    /// Matching cost of every pixel's own plane over the views in use.
    pub(crate) score_own: fn(&mut Tile, &Level),
    /// Tries a plane anchored at the tile's centre on all pixels; whether any took it.
    pub(crate) try_plane: fn(&mut Tile, &Level, InversePlane) -> bool,
}

impl Kernels {
    /// The kernels of `level`, or portable ones if this processor lacks it.
    pub(crate) fn of(level: CpuLevel) -> Self {
        match level {
            #[cfg(target_arch = "x86_64")]
            CpuLevel::Avx2 if level.is_supported() => x86::AVX2,
            #[cfg(target_arch = "x86_64")]
            CpuLevel::Avx512 if level.is_supported() => x86::AVX512,
            #[cfg(target_arch = "aarch64")]
            CpuLevel::Neon => Kernels::over::<lanes::neon::Four>(),
            _ => Kernels::over::<Baseline>(),
        }
    }

    /// The kernels over lanes that every processor of the architecture has.
    fn over<L: lanes::Lanes>() -> Self {
        Kernels {
            prepare: kernels::prepare::<L>,
            begin: kernels::begin::<L>,
            survey: kernels::survey::<L>,
            score_own: kernels::score_own::<L>,
            try_plane: kernels::try_plane::<L>,
        }
    }
}
