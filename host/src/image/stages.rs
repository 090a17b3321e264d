//! A strip of an [`ImageJob`] with the clock in hand, for `cargo bench --bench roofline`: the code and the
//! buffers of a real run, stage by stage. Nothing in the program calls it.
//!
//! The steps of the filter take turns for every vector, too fast for a clock. They are run one by one over the
//! whole strip, on the same frames in the same order, so that what a step reads comes from the same caches; all
//! else is timed in its place.

use super::doubts::Tally;
use super::filter::{Pair, Passes};
use super::fir::Sink;
use super::strip::{Columns, Layout};
use super::{ImageJob, Run, linked, worker};
use crate::error::Result;
use crate::lanes::{LaneTask, Lanes};
use crate::planes::Layers;
use crate::progress::Progress;
use num_complex::Complex;
use std::collections::BTreeMap;
use std::hint::black_box;
use std::ops::Range;
use std::time::Instant;

/// What is timed, in the order of the work.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Stage {
    /// Rows of all frames into lane blocks, beside the strip before; one lap.
    Load,
    /// C of a pair, and C/|C| where it is needed; a lap is a pair.
    Products,
    /// The Gaussian along y.
    Vertical,
    /// Halo, and the Gaussian along x.
    Horizontal,
    /// Least squares: arg and weight of the means into the strip's samples.
    Samples,
    /// Linked phases: the means over the roots of the powers.
    Normalise,
    /// All of the above in turns, as the program does it.
    Filter,
    /// Least squares: unwrap and set up the equations; a lap is a vector of pixels.
    Assemble,
    /// Eliminate and substitute back.
    Solve,
    /// Linked phases: phasors from the frames before; a lap is a frame.
    Walk,
    /// Residuals of its pairs.
    Residuals,
    /// The step of scoring; one lap.
    Score,
    /// Results out of the lanes, unwrapped where that is left, unusable pixels blanked; one lap, or one for
    /// each vector.
    Report,
}

/// Seconds of every lap of each stage.
#[derive(Clone, Debug, Default)]
pub struct Laps(BTreeMap<Stage, Vec<f64>>);

impl Laps {
    /// The laps of a stage.
    #[must_use]
    pub fn of(&self, stage: Stage) -> &[f64] {
        self.0.get(&stage).map_or(&[], Vec::as_slice)
    }

    /// The lap that began at `start` ends now.
    pub(super) fn end(&mut self, stage: Stage, start: Instant) {
        let seconds = start.elapsed().as_secs_f64();
        self.0.entry(stage).or_default().push(seconds);
    }
}

/// The timed strip.
#[derive(Clone, Debug)]
pub struct Timed {
    /// Its height, pixels.
    pub rows: usize,
    /// R: rows of halo above and below, and columns on each side.
    pub halo: usize,
    /// Vectors of a row.
    pub blocks: usize,
    /// Pixels of a vector.
    pub lanes: usize,
    /// One for each repetition.
    pub laps: Vec<Laps>,
}

/// Time the strip in the middle of the image `repetitions` times: least squares with the paper's weights, or
/// linked phases, of one depth in one recording.
///
/// # Errors
/// What [`ImageJob::run`] reports.
pub fn time(job: &ImageJob<'_>, repetitions: usize) -> Result<Timed> {
    let kernel = job.kernel()?;
    let rows = job.memory_plan()?.strip_rows;
    let (progress, doubts) = (Progress::hidden(), Tally::default());
    let (kernel, progress, each) = (&kernel, &progress, &|_: super::StripResult<'_>| Ok(()));
    let run = Run { job, kernel, rows, progress, each, doubts: &doubts };
    job.path.run(Strip { run, repetitions })?
}

/// The rows of the strip before the one that begins with `first_row`; none before the first.
pub(super) fn strip_before(first_row: usize, rows: usize) -> Option<Range<usize>> {
    Some(first_row.checked_sub(rows)?..first_row)
}

struct Strip<'a> {
    run: Run<'a>,
    repetitions: usize,
}

impl LaneTask for Strip<'_> {
    type Output = Result<Timed>;

    #[inline(always)]
    fn run<L: Lanes<Element = f32>>(self) -> Result<Timed> {
        let Self { run, repetitions } = self;
        let shape = run.job.series.shape();
        let halo = run.kernel.radius();
        let blocks = Layout::new(shape.width, L::WIDTH, halo).blocks;
        let first_row = shape.height / 2 / run.rows * run.rows;
        let laps = match run.job.tiles {
            Some(tiles) => linked::stages::time::<L>(&run, tiles, first_row, repetitions)?,
            None => worker::stages::time::<L>(&run, first_row, repetitions)?,
        };
        Ok(Timed { rows: run.rows, halo, blocks, lanes: L::WIDTH, laps })
    }
}

/// A strip's frames, and how the steps of the filter go over them.
pub(super) struct Frames<'a, L> {
    pub(super) layout: &'a Layout,
    pub(super) rows: usize,
    pub(super) fields: &'a [Complex<L>],
    pub(super) recordings: &'a [Layers],
    pub(super) pairs: &'a [(usize, usize)],
}

/// Time each step of the filter for all pairs; gives some of the means.
#[inline(always)]
pub(super) fn time_passes<L: Lanes, const CH: usize>(
    frames: &Frames<'_, L>,
    passes: &mut Passes<L>,
    laps: &mut Laps,
) -> Vec<[L; CH]> {
    let Frames { layout, rows, fields, recordings, pairs } = *frames;
    let columns = Columns::new(layout, rows);
    for &(t, s) in pairs {
        let source = Pair::of(fields, columns.plane(), [t, s], columns, recordings);
        let start = Instant::now();
        for vector in 0..layout.blocks {
            passes.gather::<CH>(layout, rows, &source, vector);
            black_box(&mut *passes);
        }
        laps.end(Stage::Products, start);
    }
    for _ in pairs {
        let start = Instant::now();
        for vector in 0..layout.blocks {
            passes.down::<CH>(layout, rows, vector);
            black_box(&mut *passes);
        }
        laps.end(Stage::Vertical, start);
    }
    let mut means = Means(vec![[L::zero(); CH]; MEANS]);
    for _ in pairs {
        let start = Instant::now();
        passes.across(layout, rows, &mut means);
        black_box(&mut means);
        laps.end(Stage::Horizontal, start);
    }
    means.0
}

/// Means that are kept: so few that they stay in the first-level cache, a power of two.
const MEANS: usize = 64;

/// In the program the means are worked on in registers; here they must go somewhere, or they would not be
/// computed.
struct Means<L, const CH: usize>(Vec<[L; CH]>);

impl<L: Lanes, const CH: usize> Sink<L, CH> for Means<L, CH> {
    #[inline(always)]
    fn take(&mut self, place: usize, means: [L; CH]) {
        self.0[place % MEANS] = means;
    }
}

/// Time what is done with the means of a pair over a strip of so many places.
#[inline(always)]
pub(super) fn time_sink<L: Lanes, const CH: usize>(
    stage: Stage,
    sink: &mut impl Sink<L, CH>,
    means: &[[L; CH]],
    places: usize,
    laps: &mut Laps,
) {
    let start = Instant::now();
    for place in 0..places {
        sink.take(place, means[place % MEANS]);
    }
    laps.end(stage, start);
}
