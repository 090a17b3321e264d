//! The one program text compiled for each machine: which instance a job runs.
//!
//! `unsafe` is here for one reason: a function compiled for certain instructions may only be called
//! where the processor has them, which [`entry`] asks before it hands the function out.

use super::worker::work;
use super::{ImageJob, Kernel, MemoryPlan, Run};
use crate::error::{Error, Result};
#[cfg(target_arch = "x86_64")]
use crate::lanes::x86::{F32x8, F32x16};
use crate::lanes::{Array, Path};
use std::sync::atomic::AtomicUsize;

/// One thread's work: strips, numbered by the counter, until there are none left.
pub(super) type Entry = fn(&Run<'_>, &AtomicUsize) -> Result<()>;

/// The instance for the job's precision and path.
pub(super) fn entry(job: &ImageJob<'_>) -> Result<Entry> {
    if job.double {
        return Ok(work::<Array<f64, 4>>);
    }
    if !job.path.is_available() {
        return Err(Error::usage(format!("{:?} is not available on this processor", job.path)));
    }
    Ok(match job.path {
        #[cfg(target_arch = "x86_64")]
        Path::Avx512 => x86::work_in_avx512,
        #[cfg(target_arch = "x86_64")]
        Path::Avx2 => x86::work_in_avx2,
        _ => work::<Array<f32, 8>>,
    })
}

/// What that instance will take.
pub(super) fn memory_plan(job: &ImageJob<'_>, kernel: &Kernel) -> Result<MemoryPlan> {
    if job.double {
        return MemoryPlan::new::<Array<f64, 4>>(job, kernel);
    }
    match job.path {
        #[cfg(target_arch = "x86_64")]
        Path::Avx512 => MemoryPlan::new::<F32x16>(job, kernel),
        #[cfg(target_arch = "x86_64")]
        Path::Avx2 => MemoryPlan::new::<F32x8>(job, kernel),
        _ => MemoryPlan::new::<Array<f32, 8>>(job, kernel),
    }
}

/// All of `work` is inlined into these two and so compiled with their instructions.
#[cfg(target_arch = "x86_64")]
mod x86 {
    use super::{AtomicUsize, F32x8, F32x16, Result, Run, work};

    #[target_feature(enable = "avx512f,avx512dq,avx512vl,avx512bw,fma")]
    fn avx512(run: &Run<'_>, next: &AtomicUsize) -> Result<()> {
        work::<F32x16>(run, next)
    }

    #[target_feature(enable = "avx2,fma")]
    fn avx2(run: &Run<'_>, next: &AtomicUsize) -> Result<()> {
        work::<F32x8>(run, next)
    }

    pub(super) fn work_in_avx512(run: &Run<'_>, next: &AtomicUsize) -> Result<()> {
        // SAFETY: `entry`, the only way here, has asked the processor for these features.
        unsafe { avx512(run, next) }
    }

    pub(super) fn work_in_avx2(run: &Run<'_>, next: &AtomicUsize) -> Result<()> {
        // SAFETY: as above.
        unsafe { avx2(run, next) }
    }
}
