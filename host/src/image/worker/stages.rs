//! The stages of the least squares, timed (`super::super::stages`).

use super::super::phase::take_sample;
use super::super::stages::{Frames, Laps, Stage, strip_before, time_passes, time_sink};
use super::{PairSamples, Run, Worker, put, unload};
use crate::error::Result;
use crate::lanes::{Lanes, Stream};
use crate::method::Average;
use phasewalk_core::batch::{assemble_series, finish_series};
use phasewalk_core::solver::{Solver, links_for};
use phasewalk_core::storage::{Link, Node};
use std::time::Instant;

/// Every repetition begins with the strip as the program does it, which leaves the samples that the equations
/// are set up from.
#[inline(always)]
pub(in super::super) fn time<L: Lanes>(
    run: &Run<'_>,
    first_row: usize,
    repetitions: usize,
) -> Result<Vec<Laps>> {
    let mut worker = Worker::<L>::new(run)?;
    let mut all = Vec::new();
    for _ in 0..repetitions {
        let mut laps = Laps::default();
        worker.fields.forget();
        if let Some(before) = strip_before(first_row, run.rows) {
            worker.load(run, before)?;
        }
        let start = Instant::now();
        worker.load(run, first_row..first_row + run.rows)?;
        laps.end(Stage::Load, start);
        let start = Instant::now();
        worker.filter_pairs::<4>(run, run.rows)?;
        laps.end(Stage::Filter, start);
        worker.time_solution(run, &mut laps);
        let start = Instant::now();
        worker.report(run, first_row..first_row + run.rows)?;
        laps.end(Stage::Report, start);
        worker.time_filter(run, &mut laps);
        all.push(laps);
    }
    Ok(all)
}

impl<L: Lanes> Worker<L> {
    #[inline(always)]
    fn time_filter(&mut self, run: &Run<'_>, laps: &mut Laps) {
        let Self { layout, pairs, recordings, weights, fields, passes, samples, .. } = self;
        let fields = &fields.numbers;
        let frames = Frames { layout, rows: run.rows, fields, recordings, pairs };
        let means = time_passes::<L, 4>(&frames, passes, laps);
        let stream = Stream::default();
        for index in 0..pairs.len() {
            let mut sink = PairSamples {
                weights: *weights,
                by_phasor: run.job.plan.average == Average::Phasor,
                powers: [&[], &[]],
                index,
                count: pairs.len(),
                samples,
                stream: &stream,
                coherences: &mut [],
            };
            time_sink(Stage::Samples, &mut sink, &means, run.rows * layout.blocks, laps);
        }
    }

    /// The two halves of the solution, in a solver as that of the workspace.
    #[inline(always)]
    fn time_solution(&mut self, run: &Run<'_>, laps: &mut Laps) {
        let plan = run.job.plan;
        let (frames, lags, params) = (plan.frames(), plan.params.max_lag, &plan.params);
        let links = vec![Link::new(); links_for(frames, lags)];
        let nodes = vec![Node::new(); frames];
        let references = params.reference_frames;
        let mut solver = Solver::with_storage(links, nodes, lags, plan.gauge(), references);
        let (mut phases, mut measured) = (vec![L::zero(); frames], vec![L::zero(); frames]);
        for (place, samples) in self.samples.chunks_exact(self.pairs.len()).enumerate() {
            let mut next = 0;
            let next = |_, _| take_sample(samples, &mut next);
            let start = Instant::now();
            assemble_series(&mut solver, params, &plan.times_s, next);
            laps.end(Stage::Assemble, start);
            let start = Instant::now();
            finish_series(&mut solver, params, &mut phases, &mut measured);
            laps.end(Stage::Solve, start);
            let start = Instant::now();
            let (blocks, row) = (self.layout.blocks, &mut self.row.phases);
            put(row, &phases, place % blocks, blocks);
            if (place + 1) % blocks == 0 {
                unload(&self.layout, row, [place / blocks, run.rows], &mut self.phases);
            }
            laps.end(Stage::Report, start);
        }
    }
}
