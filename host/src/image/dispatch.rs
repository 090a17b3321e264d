//! The imaging code in the lanes of the job's precision and path.

use super::linked;
use super::turns::Turns;
use super::worker::work;
use super::{ImageJob, Kernel, MemoryPlan, Run};
use crate::error::Result;
use crate::lanes::{Array, LaneTask, Lanes};

/// One thread: strips until there are none left.
pub(super) fn strips(run: &Run<'_>, turns: &Turns) -> Result<()> {
    if run.job.double {
        return in_lanes::<Array<f64, 8>>(run, turns);
    }
    run.job.path.run(Strips { run, turns })?
}

struct Strips<'a> {
    run: &'a Run<'a>,
    turns: &'a Turns,
}

impl LaneTask for Strips<'_> {
    type Output = Result<()>;

    #[inline(always)]
    fn run<L: Lanes<Element = f32>>(self) -> Result<()> {
        in_lanes::<L>(self.run, self.turns)
    }
}

#[inline(always)]
fn in_lanes<L: Lanes>(run: &Run<'_>, turns: &Turns) -> Result<()> {
    match run.job.tiles {
        Some(tiles) => linked::work::<L>(run, tiles, turns),
        None => work::<L>(run, turns),
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
