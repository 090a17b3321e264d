//! One thread's way through the strips: load, filter pair by pair, solve, report.

pub(super) mod stages;

use super::fields::{Fields, Source};
use super::filter::{Pair, Passes};
use super::fir::Sink;
use super::phase::{Sample, Workspace};
use super::strip::{Columns, Layout};
use super::turns::Turns;
use super::{Doubts, Run, StripResult};
use crate::allocate::filled;
use crate::error::Result;
use crate::io::Shape;
use crate::lanes::{Lanes, Stream};
use crate::method::Average;
use crate::planes::Layers;
use crate::series::Survey;
use num_complex::Complex;
use phasewalk_core::ensemble::coherence_squared;
use phasewalk_core::weights::{Weighting, Weights};
use std::ops::Range;

/// What the buffers are called when memory is short.
pub(super) const STRIPS: &str = "the strips (see --memory)";

/// One thread: strips until there are none left.
#[inline(always)]
pub(super) fn work<L: Lanes>(run: &Run<'_>, turns: &Turns) -> Result<()> {
    let mut worker = Worker::<L>::new(run)?;
    let mut strip = turns.next(None);
    while let Some(number) = strip {
        let rows = run.rows_of(number);
        worker.load(run, rows.clone())?;
        worker.filter_powers(run, rows.len());
        if run.job.needs_phasor() {
            worker.filter_pairs::<4>(run, rows.len())?;
        } else {
            worker.filter_pairs::<2>(run, rows.len())?;
        }
        worker.solve(run, rows.len());
        worker.report(run, rows)?;
        strip = turns.next(strip);
    }
    Ok(())
}

/// Buffers of one thread, allocated once.
struct Worker<L> {
    layout: Layout,
    pairs: Vec<(usize, usize)>,
    depths: Vec<usize>,
    recordings: Vec<Layers>,
    weights: Weights,
    fields: Fields<L>,
    passes: Passes<L>,
    /// ⟨C(t,0)⟩, (frame, row, vector).
    powers: Vec<L>,
    /// (row, vector, pair).
    samples: Vec<Sample<L>>,
    /// (row, vector, pair), |gamma|^2.
    coherences: Vec<L>,
    workspace: Workspace<L>,
    /// Results of a row.
    row: Row<L>,
    /// (time, row, x).
    phases: Vec<f32>,
    sigmas: Vec<f32>,
    /// (row, x), 0 where no pair had a weight.
    measured: Vec<f32>,
}

impl<L: Lanes> Worker<L> {
    fn new(run: &Run<'_>) -> Result<Self> {
        let job = run.job;
        let Shape { frames, width, .. } = job.series.shape();
        let layout = Layout::new(width, L::WIDTH, run.kernel.radius());
        let pairs = job.plan.pairs();
        let depths = job.plan.depths.all();
        let places = run.rows * layout.blocks;
        let nothing = Sample { phase: L::zero(), weight: L::zero() };
        let when = |wanted: bool, count: usize| if wanted { count } else { 0 };
        Ok(Self {
            weights: job.plan.weights(job.looks),
            fields: Fields::new(frames * depths.len(), &layout, run.rows)?,
            passes: Passes::new(&layout, run.rows, &run.kernel.half),
            powers: filled(L::zero(), when(job.needs_coherence(), frames * places), STRIPS)?,
            samples: filled(nothing, pairs.len() * places, STRIPS)?,
            coherences: filled(
                L::zero(),
                when(job.keeps_coherence(), pairs.len() * places),
                STRIPS,
            )?,
            workspace: Workspace::new(job.plan, job.keeps_coherence()),
            row: Row::new(frames, layout.blocks, job.keeps_coherence()),
            phases: vec![0.0; frames * run.rows * width],
            sigmas: vec![0.0; when(job.keeps_coherence(), frames * run.rows * width)],
            measured: vec![0.0; run.rows * width],
            layout,
            pairs,
            depths,
            recordings: job.plan.depths.layers(),
        })
    }

    #[inline(always)]
    fn load(&mut self, run: &Run<'_>, rows: Range<usize>) -> Result<()> {
        let Survey { valid, scale, .. } = run.job.survey;
        let (series, depths) = (run.job.series, &self.depths);
        let source = Source { series, depths, valid, scale: *scale };
        self.fields.load(&source, &self.layout, rows)
    }

    /// ⟨C(t,0)⟩ of all frames, where needed.
    #[inline(always)]
    fn filter_powers(&mut self, run: &Run<'_>, rows: usize) {
        if !run.job.needs_coherence() {
            return;
        }
        let Self { layout, depths, recordings, fields, passes, powers, .. } = self;
        let places = rows * layout.blocks;
        let columns = Columns::new(layout, rows);
        let frame_size = depths.len() * columns.plane();
        let frames = fields.numbers.chunks_exact(frame_size);
        for (field, power) in frames.zip(powers.chunks_exact_mut(places)) {
            let pair = Pair { columns, earlier: field, later: field, recordings };
            passes.run::<2>(layout, rows, pair, &mut Powers(power));
        }
    }

    /// Phase and weight of all pairs.
    #[inline(always)]
    fn filter_pairs<const CH: usize>(&mut self, run: &Run<'_>, rows: usize) -> Result<()> {
        let Self {
            layout,
            pairs,
            depths,
            recordings,
            weights,
            fields,
            passes,
            powers,
            samples,
            coherences,
            ..
        } = self;
        let (places, count) = (rows * layout.blocks, pairs.len());
        let columns = Columns::new(layout, rows);
        let frame_size = depths.len() * columns.plane();
        let coherent = run.job.needs_coherence();
        let power = |frame: usize| if coherent { &powers[frame * places..][..places] } else { &[] };
        let (stream, mut frames_begun) = (Stream::default(), 0);
        for (index, &(t, s)) in pairs.iter().enumerate() {
            let pair = Pair::of(&fields.numbers, frame_size, [t, s], columns, recordings);
            let mut sink = PairSamples {
                weights: *weights,
                by_phasor: run.job.plan.average == Average::Phasor,
                powers: [power(t), power(s)],
                index,
                count,
                samples,
                stream: &stream,
                coherences,
            };
            passes.run::<CH>(layout, rows, pair, &mut sink);
            let begun = frames_of_progress(index + 1, count, run.job.plan.frames());
            run.progress.advance(begun - frames_begun)?;
            frames_begun = begun;
        }
        Ok(())
    }

    /// All vectors of the strip.
    #[inline(always)]
    fn solve(&mut self, run: &Run<'_>, rows: usize) {
        let (blocks, count) = (self.layout.blocks, self.pairs.len());
        for place in 0..rows * blocks {
            let samples = &self.samples[place * count..][..count];
            self.workspace.solve(run.job.plan, samples);
            if run.job.keeps_coherence() {
                let coherences = &self.coherences[place * count..][..count];
                let looks = run.job.effective_looks;
                self.workspace.find_sigmas(run.job.plan, &self.pairs, samples, coherences, looks);
            }
            self.row.keep(&self.workspace, place % blocks);
            if (place + 1) % blocks == 0 {
                self.unload_row(place / blocks, rows);
            }
        }
    }

    /// What [`Self::row`] holds into the results of the strip's `rows` rows.
    #[inline(always)]
    fn unload_row(&mut self, row: usize, rows: usize) {
        let Self { layout, row: results, .. } = self;
        unload(layout, &results.phases, [row, rows], &mut self.phases);
        unload(layout, &results.sigmas, [row, rows], &mut self.sigmas);
        unload(layout, &results.measured, [row, rows], &mut self.measured);
    }

    /// Hand the strip over, NaN where the pixel is not usable.
    fn report(&mut self, run: &Run<'_>, rows: Range<usize>) -> Result<()> {
        let Shape { frames, width, .. } = run.job.series.shape();
        let valid = &run.job.survey.valid[rows.start * width..rows.end * width];
        let size = frames * valid.len();
        for results in [&mut self.phases, &mut self.sigmas] {
            blank_unusable(results, valid, frames);
        }
        let pixels = valid.iter().zip(&self.measured);
        let unmeasured = pixels.filter(|&(&valid, &measured)| valid && measured == 0.0).count();
        run.doubts.add(Doubts { unmeasured, ..Doubts::default() });
        let sigmas = run.job.keeps_coherence().then(|| &self.sigmas[..size]);
        let phases = &self.phases[..size];
        let closure = None;
        (run.each)(StripResult { first_row: rows.start, phases, sigmas, closure, valid })
    }
}

/// Results of a row of vectors, (frame, vector).
struct Row<L> {
    phases: Vec<L>,
    /// Empty where they are not asked for.
    sigmas: Vec<L>,
    /// (vector), 0 where no pair had a weight.
    measured: Vec<L>,
}

impl<L: Lanes> Row<L> {
    fn new(frames: usize, blocks: usize, sigma: bool) -> Self {
        let zeros = |count: usize| vec![L::zero(); count];
        Self {
            phases: zeros(frames * blocks),
            sigmas: zeros(if sigma { frames * blocks } else { 0 }),
            measured: zeros(blocks),
        }
    }

    /// Take the vector that has just been solved.
    #[inline(always)]
    fn keep(&mut self, solved: &Workspace<L>, vector: usize) {
        let blocks = self.measured.len();
        put(&mut self.phases, &solved.phases, vector, blocks);
        put(&mut self.sigmas, &solved.sigmas, vector, blocks);
        self.measured[vector] = solved.measured_at_all();
    }
}

/// A vector's results, (frame), into those of its row, (frame, vector).
#[inline(always)]
pub(super) fn put<L: Copy>(row: &mut [L], results: &[L], vector: usize, blocks: usize) {
    for (places, &result) in row.chunks_exact_mut(blocks).zip(results) {
        places[vector] = result;
    }
}

/// ⟨C(t,0)⟩.
struct Powers<'a, L>(&'a mut [L]);

impl<L: Lanes> Sink<L, 2> for Powers<'_, L> {
    #[inline(always)]
    fn take(&mut self, place: usize, [power, _]: [L; 2]) {
        self.0[place] = power;
    }
}

/// Phase and weight of one of `count` pairs.
struct PairSamples<'a, L> {
    weights: Weights,
    by_phasor: bool,
    /// ⟨C(t,0)⟩ and ⟨C(s,0)⟩; empty where no coherence is needed.
    powers: [&'a [L]; 2],
    index: usize,
    count: usize,
    samples: &'a mut [Sample<L>],
    stream: &'a Stream,
    /// Empty where they are not kept.
    coherences: &'a mut [L],
}

impl<L: Lanes, const CH: usize> Sink<L, CH> for PairSamples<'_, L> {
    #[inline(always)]
    fn take(&mut self, place: usize, means: [L; CH]) {
        let cross = Complex { re: means[0], im: means[1] };
        let phasor = Complex { re: means[CH - 2], im: means[CH - 1] };
        let coherence = match (self.powers[0].get(place), self.powers[1].get(place)) {
            (Some(&t), Some(&s)) => coherence_squared(cross, t * s),
            _ => L::zero(),
        };
        let weight = match self.weights.weighting() {
            Weighting::Paper if CH == 4 => self.weights.paper(phasor),
            Weighting::Paper => L::one(),
            Weighting::Fisher => self.weights.fisher(coherence),
        };
        let averaged = if CH == 4 && self.by_phasor { phasor } else { cross };
        let phase = averaged.im.atan2(averaged.re);
        let at = place * self.count + self.index;
        // It is read again when all pairs of the strip are there, long after it would have left the caches.
        let sample = &mut self.samples[at];
        phase.stream_to(&mut sample.phase, self.stream);
        weight.stream_to(&mut sample.weight, self.stream);
        if let Some(kept) = self.coherences.get_mut(at) {
            *kept = coherence;
        }
    }
}

/// NaN where the pixel is not usable; `images` are (time, row, x).
pub(super) fn blank_unusable(images: &mut [f32], valid: &[bool], frames: usize) {
    for image in images.chunks_exact_mut(valid.len().max(1)).take(frames) {
        for (value, _) in image.iter_mut().zip(valid).filter(|(_, valid)| !**valid) {
            *value = f32::NAN;
        }
    }
}

/// Progress is told in frames: `done` of `pairs` pairs stand for so many of `frames`.
fn frames_of_progress(done: usize, pairs: usize, frames: usize) -> u64 {
    (done * frames / pairs.max(1)) as u64
}

/// Copy the results of a row, (frame, vector), to (frame, row, x); `row` is which, and of how many.
#[inline(always)]
pub(super) fn unload<L: Lanes>(
    layout: &Layout,
    values: &[L],
    [row, rows]: [usize; 2],
    results: &mut [f32],
) {
    let Layout { width, blocks, .. } = *layout;
    for (values, frame) in values.chunks_exact(blocks).zip(results.chunks_exact_mut(rows * width)) {
        let numbers = L::flat(values);
        let line = &mut frame[row * width..][..width];
        for (lane, piece) in line.chunks_mut(blocks).enumerate() {
            for (vector, place) in piece.iter_mut().enumerate() {
                *place = numbers[vector * L::WIDTH + lane].into() as f32;
            }
        }
    }
}
