//! The imaging code in the lanes of the job's precision and path.

use super::linked;
use super::worker::work;
use super::{ImageJob, Kernel, MemoryPlan, Run};
use crate::error::Result;
use crate::lanes::{Array, LaneTask, Lanes};
use std::sync::atomic::AtomicUsize;

/// One thread: strips, numbered by the counter, until there are none left.
pub(super) fn strips(run: &Run<'_>, next: &AtomicUsize) -> Result<()> {
    if run.job.double {
        return in_lanes::<Array<f64, 8>>(run, next);
    }
    run.job.path.run(Strips { run, next })?
}

struct Strips<'a> {
    run: &'a Run<'a>,
    next: &'a AtomicUsize,
}

impl LaneTask for Strips<'_> {
    type Output = Result<()>;

    #[inline(always)]
    fn run<L: Lanes<Element = f32>>(self) -> Result<()> {
        in_lanes::<L>(self.run, self.next)
    }
}

#[inline(always)]
fn in_lanes<L: Lanes>(run: &Run<'_>, next: &AtomicUsize) -> Result<()> {
    match run.job.tiles {
        Some(tiles) => linked::work::<L>(run, tiles, next),
        None => work::<L>(run, next),
    }
}

/// What that will take.
pub(super) fn memory_plan(job: &ImageJob<'_>, kernel: &Kernel) -> Result<MemoryPlan> {
    if job.double {
        return MemoryPlan::new::<Array<f64, 8>>(job, kernel);
    }
    job.path.run(Planning { job, kernel })?
}

struct Planning<'a> {
    job: &'a ImageJob<'a>,
    kernel: &'a Kernel,
}

impl LaneTask for Planning<'_> {
    type Output = Result<MemoryPlan>;

    fn run<L: Lanes<Element = f32>>(self) -> Result<MemoryPlan> {
        MemoryPlan::new::<L>(self.job, self.kernel)
    }
}
