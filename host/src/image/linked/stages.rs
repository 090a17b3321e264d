//! The stages of linked phases, timed (`super::super::stages`).

use super::super::stages::{Frames, Laps, Stage, strip_before, time_passes, time_sink};
use super::super::tiles::Tiles;
use super::{Normalised, Run, Worker};
use crate::error::Result;
use crate::lanes::Lanes;
use std::time::Instant;

/// Every repetition begins with the strip as the program does it.
#[inline(always)]
pub(in super::super) fn time<L: Lanes>(
    run: &Run<'_>,
    tiles: &Tiles,
    first_row: usize,
    repetitions: usize,
) -> Result<Vec<Laps>> {
    let mut worker = Worker::<L>::new(run, tiles.test_closure())?;
    let rows = first_row..first_row + run.rows;
    // In the order of `Worker::link`: each frame with all before it.
    let pairs: Vec<_> =
        (0..run.job.plan.frames()).flat_map(|i| (0..i).map(move |j| (i, j))).collect();
    let mut all = Vec::new();
    for _ in 0..repetitions {
        let mut laps = Laps::default();
        worker.fields.forget();
        if let Some(before) = strip_before(first_row, run.rows) {
            worker.load(run, before)?;
        }
        let start = Instant::now();
        worker.load(run, rows.clone())?;
        laps.end(Stage::Load, start);
        worker.expand_models(tiles, &rows);
        worker.time_link(run, &mut laps);
        let start = Instant::now();
        worker.report(run, tiles, rows.clone())?;
        laps.end(Stage::Report, start);
        worker.time_filter(run, &pairs, &mut laps);
        all.push(laps);
    }
    Ok(all)
}

impl<L: Lanes> Worker<L> {
    /// [`Self::link`], with the clock.
    #[inline(always)]
    fn time_link(&mut self, run: &Run<'_>, laps: &mut Laps) {
        self.score.fill(L::zero());
        for i in 0..run.job.plan.frames() {
            let start = Instant::now();
            self.filter_power(run.rows, i);
            for j in 0..i {
                self.filter_pair(run.rows, i, j);
            }
            laps.end(Stage::Filter, start);
            let start = Instant::now();
            self.walk(run.rows, i);
            laps.end(Stage::Walk, start);
            let start = Instant::now();
            self.add_frame(run.rows, i);
            laps.end(Stage::Residuals, start);
        }
        let start = Instant::now();
        self.finish(run, run.rows);
        laps.end(Stage::Score, start);
    }

    /// The steps of the filter, for the pairs (i, j).
    #[inline(always)]
    fn time_filter(&mut self, run: &Run<'_>, pairs: &[(usize, usize)], laps: &mut Laps) {
        let places = run.rows * self.layout.blocks;
        let Self { layout, fields, recordings, averager, inverse_root, gamma, .. } = self;
        let fields = &fields.numbers;
        let frames = Frames { layout, rows: run.rows, fields, recordings, pairs };
        let means = time_passes::<L, 2>(&frames, &mut averager.whole, laps);
        for &(i, j) in pairs {
            let root = |frame: usize| &inverse_root[frame * places..][..places];
            let roots = [root(i), root(j)];
            let mut sink = Normalised { roots, gamma: &mut gamma[j * places..][..places] };
            time_sink(Stage::Normalise, &mut sink, &means, places, laps);
        }
    }
}
