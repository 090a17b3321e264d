//! The body of the simulation compiled for each instruction set, and the choice between them.
//!
//! The arithmetic is the same in all of them, bit for bit; only the number of scatterers per
//! instruction differs.

use super::scatterers::{Block, Raster, Walk, advance};

/// Instruction sets the simulation is compiled for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Simd {
    /// What every machine of the target has.
    Portable,
    /// 8 lanes of 32 bits.
    #[cfg(target_arch = "x86_64")]
    Avx2,
    /// 16 lanes of 32 bits.
    #[cfg(target_arch = "x86_64")]
    Avx512,
}

impl Simd {
    /// Those this machine can run, the widest last.
    pub fn available() -> Vec<Self> {
        let mut sets = vec![Self::Portable];
        #[cfg(target_arch = "x86_64")]
        {
            if is_x86_feature_detected!("avx2") {
                sets.push(Self::Avx2);
            }
            let avx512 = is_x86_feature_detected!("avx512f")
                && is_x86_feature_detected!("avx512dq")
                && is_x86_feature_detected!("avx512vl")
                && is_x86_feature_detected!("avx512bw");
            if avx512 {
                sets.push(Self::Avx512);
            }
        }
        sets
    }

    /// The widest this machine can run.
    pub fn widest() -> Self {
        Self::available().pop().unwrap_or(Self::Portable)
    }
}

/// [`advance`] in an instruction set that this machine has been seen to run.
pub struct Kernel(Simd);

impl Kernel {
    /// The kernel of `simd`, or the portable one where the machine cannot run that.
    pub fn new(simd: Simd) -> Self {
        Self(if Simd::available().contains(&simd) { simd } else { Simd::Portable })
    }

    /// See [`advance`].
    pub fn advance(
        &self,
        blocks: &mut [Block],
        first: usize,
        walk: Option<&Walk>,
        raster: &Raster,
        sums: &mut [i64],
    ) {
        match self.0 {
            Simd::Portable => advance(blocks, first, walk, raster, sums),
            // SAFETY: `Kernel::new` has seen that this machine runs AVX2.
            #[cfg(target_arch = "x86_64")]
            Simd::Avx2 => unsafe { advance_avx2(blocks, first, walk, raster, sums) },
            // SAFETY: `Kernel::new` has seen that this machine runs these parts of AVX-512.
            #[cfg(target_arch = "x86_64")]
            Simd::Avx512 => unsafe { advance_avx512(blocks, first, walk, raster, sums) },
        }
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn advance_avx2(
    blocks: &mut [Block],
    first: usize,
    walk: Option<&Walk>,
    raster: &Raster,
    sums: &mut [i64],
) {
    advance(blocks, first, walk, raster, sums);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512dq,avx512vl,avx512bw")]
fn advance_avx512(
    blocks: &mut [Block],
    first: usize,
    walk: Option<&Walk>,
    raster: &Raster,
    sums: &mut [i64],
) {
    advance(blocks, first, walk, raster, sums);
}
