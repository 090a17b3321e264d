//! Which instructions work runs on, chosen at run time.
//!
//! `unsafe` is here for one reason: a function compiled for certain instructions may only be called
//! where the processor has them, which [`Path::run`] asks first. It is the only way to the vector
//! types, so safe code cannot make one on a processor that lacks it.

#[cfg(target_arch = "x86_64")]
use super::x86::{F32x8, F32x16};
use super::{Array, Lanes};
use crate::error::{Error, Result};

/// Work that is written once and compiled for every lane type of `f32`.
pub trait LaneTask {
    /// What it gives.
    type Output;

    /// Do it in lanes `L`. Mark implementations `#[inline(always)]`, and all they call: only what is
    /// inlined is compiled with the path's instructions.
    fn run<L: Lanes<Element = f32>>(self) -> Self::Output;
}

/// Which instructions the imaging code runs on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Path {
    /// 16 x f32, AVX-512 (F, DQ, VL, BW) with FMA.
    Avx512,
    /// 8 x f32, AVX2 with FMA.
    Avx2,
    /// 8 x f32 in plain Rust.
    Portable,
}

impl Path {
    /// Can this machine run it?
    #[must_use]
    pub fn is_available(self) -> bool {
        match self {
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => {
                is_x86_feature_detected!("avx512f")
                    && is_x86_feature_detected!("avx512dq")
                    && is_x86_feature_detected!("avx512vl")
                    && is_x86_feature_detected!("avx512bw")
                    && is_x86_feature_detected!("fma")
            }
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma"),
            #[cfg(not(target_arch = "x86_64"))]
            Self::Avx512 | Self::Avx2 => false,
            Self::Portable => true,
        }
    }

    /// Do the task in this path's lanes.
    ///
    /// # Errors
    /// When the machine does not have the path.
    pub fn run<T: LaneTask>(self, task: T) -> Result<T::Output> {
        if !self.is_available() {
            return Err(Error::usage(format!("{self:?} is not available on this processor")));
        }
        Ok(match self {
            #[cfg(target_arch = "x86_64")]
            // SAFETY: is_available has asked the processor for these features.
            Self::Avx512 => unsafe { in_avx512(task) },
            #[cfg(target_arch = "x86_64")]
            // SAFETY: as above.
            Self::Avx2 => unsafe { in_avx2(task) },
            _ => task.run::<Array<f32, 8>>(),
        })
    }

    /// All paths that this machine can run, fastest first.
    #[must_use]
    pub fn available() -> Vec<Self> {
        let all = [Self::Avx512, Self::Avx2, Self::Portable];
        all.into_iter().filter(|path| path.is_available()).collect()
    }

    /// The path of `PHASEWALK_SIMD`, else the fastest.
    ///
    /// # Errors
    /// When the variable names no path, or one that this machine cannot run.
    pub fn best() -> Result<Self> {
        let wanted = std::env::var("PHASEWALK_SIMD").unwrap_or_default();
        let path = match wanted.as_str() {
            "" => return Ok(Self::available().first().copied().unwrap_or(Self::Portable)),
            "avx512" => Self::Avx512,
            "avx2" => Self::Avx2,
            "portable" => Self::Portable,
            _ => {
                return Err(Error::usage(format!(
                    "PHASEWALK_SIMD={wanted} is not known: use avx512, avx2 or portable"
                )));
            }
        };
        if path.is_available() {
            return Ok(path);
        }
        Err(Error::usage(format!("PHASEWALK_SIMD={wanted}: this processor does not have it")))
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512dq,avx512vl,avx512bw,fma")]
fn in_avx512<T: LaneTask>(task: T) -> T::Output {
    task.run::<F32x16>()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn in_avx2<T: LaneTask>(task: T) -> T::Output {
    task.run::<F32x8>()
}
