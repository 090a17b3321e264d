//! Phase images: the ensemble average is a Gaussian around each pixel, and the core solves as many
//! pixels at once as a vector register holds.
//!
//! The image is cut into strips of a few rows that all cores work through (`turns`). A strip holds its rows
//! of all frames (`fields`); pair by pair, `filter` gives arg ⟨C⟩ and the weight of every pixel, which are kept
//! until all pairs are there and `phase` solves vector after vector. Memory is bounded by the
//! height of the strips (`memory`), whatever the size of the series. Frames that come one after the other have their
//! newest image from `newest`.

mod band;
mod decorrelation;
mod dispatch;
mod doubts;
mod fields;
mod filter;
mod fir;
mod held;
mod kernel;
mod linked;
mod memory;
mod newest;
mod phase;
#[doc(hidden)]
pub mod stages;
mod strip;
mod tiles;
mod turns;
mod unwrapping;
mod worker;

pub use decorrelation::{Quantity, diffusion_um2, walk_nm};
pub use doubts::{Doubts, Gaps};
pub use held::{HeldImages, Images, Imaging};
pub use kernel::Kernel;
pub use linked::window_kernel;
pub use memory::MemoryPlan;
pub use newest::{NewestImage, NewestImages, NewestSettings};
pub use tiles::{Fit, Tile, Tiles};

use self::doubts::Tally;
use self::turns::Turns;
use crate::error::{Error, Result};
use crate::io::{Series, Shape};
use crate::lanes::Path;
use crate::method::{Average, Method, Plan};
use crate::progress::Progress;
use crate::series::Survey;
use phasewalk_core::weights::Weighting;
use std::ops::Range;
use std::sync::Mutex;

/// Everything that is the same for all pixels.
pub struct ImageJob<'a> {
    /// The frames.
    pub series: &'a dyn Series,
    /// Their usable pixels and scale.
    pub survey: &'a Survey,
    /// Method and parameters.
    pub plan: &'a Plan,
    /// sigma_Gauss, pixels.
    pub sigma_px: f64,
    /// Looks of the Gaussian for the weights' threshold and debiasing.
    pub looks: f64,
    /// Independent looks, for the standard deviation.
    pub effective_looks: f64,
    /// Fitted coherence: linked phases, whatever the plan's method.
    pub tiles: Option<&'a Tiles>,
    /// Compute standard deviations too (least squares and linked phases only).
    pub sigma: bool,
    /// Arithmetic in `f64` instead of `f32`.
    pub double: bool,
    /// Vector instructions of the `f32` arithmetic.
    pub path: Path,
    /// Number of threads.
    pub threads: usize,
    /// Bytes that the strips of all threads may take together.
    pub memory: u64,
}

/// One finished strip, C order.
pub struct StripResult<'a> {
    /// First row.
    pub first_row: usize,
    /// (time, rows, x), radians, NaN where the pixel is not usable.
    pub phases: &'a [f32],
    /// The same for the standard deviation, where asked for.
    pub sigmas: Option<&'a [f32]>,
    /// (rows, x): p of the closure, where the tiles prepare its test; NaN where the pixel has none.
    pub closure: Option<&'a [f32]>,
    /// (rows, x).
    pub valid: &'a [bool],
}

impl ImageJob<'_> {
    /// Height of the strips and the memory they take.
    ///
    /// # Errors
    /// When sigma does not fit the image, not even one row fits the memory, or linked phases lack their tiles.
    pub fn memory_plan(&self) -> Result<MemoryPlan> {
        if self.plan.method == Method::Linked && self.tiles.is_none() {
            return Err(Error::failed("linked phases need the coherence of the image's tiles"));
        }
        let kernel = self.kernel()?;
        dispatch::memory_plan(self, &kernel)
    }

    /// Compute all strips; `each` is called once per strip, from the threads, in any order. Gives what they could not tell.
    ///
    /// # Errors
    /// What [`Self::memory_plan`], the series or `each` report, or the user's interruption.
    pub fn run(
        &self,
        progress: &Progress,
        each: &(dyn Fn(StripResult<'_>) -> Result<()> + Sync),
    ) -> Result<Doubts> {
        let kernel = self.kernel()?;
        let MemoryPlan { strip_rows: rows, threads, .. } = self.memory_plan()?;
        let turns = Turns::new(self.series.shape().height.div_ceil(rows));
        let doubts = Tally::default();
        let run = Run { job: self, kernel: &kernel, rows, progress, each, doubts: &doubts };
        let failure = Mutex::new(None);
        std::thread::scope(|scope| {
            for _ in 0..threads {
                scope.spawn(|| {
                    if let Err(error) = dispatch::strips(&run, &turns) {
                        turns.stop();
                        if let Ok(mut failure) = failure.lock() {
                            failure.get_or_insert(error);
                        }
                    }
                });
            }
        });
        match failure.into_inner().ok().flatten() {
            Some(error) => Err(error),
            None => Ok(doubts.total()),
        }
    }

    /// Steps of progress that [`Self::run`] makes.
    ///
    /// # Errors
    /// As [`Self::memory_plan`].
    pub fn steps(&self) -> Result<u64> {
        let Shape { frames, height, .. } = self.series.shape();
        Ok((height.div_ceil(self.memory_plan()?.strip_rows) * frames) as u64)
    }

    fn kernel(&self) -> Result<Kernel> {
        let Shape { height, width, .. } = self.series.shape();
        Kernel::new(self.sigma_px, height, width, self.double)
    }

    /// ⟨C/|C|⟩ is needed by the paper's weights and by phases averaged over phasors.
    fn needs_phasor(&self) -> bool {
        self.plan.method == Method::Paper(Weighting::Paper) || self.plan.average == Average::Phasor
    }

    /// |gamma|^2 is needed by the Fisher weights and for standard deviations.
    fn needs_coherence(&self) -> bool {
        self.keeps_coherence() || self.plan.method == Method::Paper(Weighting::Fisher)
    }

    /// |gamma|^2 of every pair is kept until the standard deviation is computed.
    fn keeps_coherence(&self) -> bool {
        self.sigma && matches!(self.plan.method, Method::Paper(_))
    }
}

/// A job under way.
struct Run<'a> {
    job: &'a ImageJob<'a>,
    kernel: &'a Kernel,
    rows: usize,
    progress: &'a Progress,
    each: &'a (dyn Fn(StripResult<'_>) -> Result<()> + Sync),
    /// What the strips so far could not tell.
    doubts: &'a Tally,
}

impl Run<'_> {
    /// The rows of a strip.
    fn rows_of(&self, strip: usize) -> Range<usize> {
        let first = strip * self.rows;
        first..(first + self.rows).min(self.job.series.shape().height)
    }
}
