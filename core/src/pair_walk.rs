//! The chain from the pairs' averages on, frame by frame in fixed memory: weights, unwrapping, the paper's
//! solution (lines 916-918) for the frames so far, and its standard deviation.

use crate::ensemble::PairMean;
use crate::error::Error;
use crate::params::Params;
use crate::regularize::difference_links;
use crate::scalar::Scalar;
use crate::solver::FixedSolver;
use crate::unwrap::Unwrapper;
use crate::variance::NoiseStream;
use crate::weights::{Weights, debias, pair_variance};
use heapless::Deque;

/// What is known after a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate<T> {
    /// Number of the frame, from 0.
    pub frame: usize,
    /// Its phase against the mean of the reference frames so far, radians.
    pub phase_rad: T,
    /// Standard deviation of that, radians (see `variance` for what it counts).
    pub sigma_rad: T,
}

/// Streaming solution for pairs up to `LAGS` frames apart with `ROWS` >= `LAGS` + 1 frames of history.
///
/// Memory: 3 ROWS LAGS + 7 ROWS + 12 LAGS numbers; [`Self::push`] takes 3 ROWS LAGS + 7 ROWS of them once more
/// on the stack, to look ahead on a copy.
#[derive(Clone, Debug)]
pub struct PairWalk<T, const LAGS: usize, const ROWS: usize> {
    params: Params,
    weights: Weights,
    looks: f64,
    /// One row per past frame, newest first.
    rows: Deque<Unwrapper<T>, LAGS>,
    solver: FixedSolver<T, ROWS, LAGS>,
    noise: NoiseStream<T, ROWS, LAGS>,
}

impl<T: Scalar, const LAGS: usize, const ROWS: usize> PairWalk<T, LAGS, ROWS> {
    /// No frames yet. `looks` are the effective looks of the averages, for the standard deviation.
    ///
    /// # Errors
    /// Parameters out of range, or a largest lag above `LAGS`.
    pub fn new(params: Params, weights: Weights, looks: f64) -> Result<Self, Error> {
        params.validate(usize::MAX)?;
        if params.max_lag > LAGS {
            let allowed = "at most the LAGS that the buffers were made for";
            return Err(Error { parameter: "max lag", value: params.max_lag as f64, allowed });
        }
        if !(looks > 0.0 && looks.is_finite()) {
            return Err(Error { parameter: "looks", value: looks, allowed: "above 0 and finite" });
        }
        Ok(Self {
            params,
            weights,
            looks,
            rows: Deque::new(),
            solver: FixedSolver::new(params.max_lag, params.gauge_frame, params.reference_frames),
            noise: NoiseStream::new(),
        })
    }

    /// Take the next frame n, evenly spaced in time, and say where the phase is now: `means` are the averages of
    /// the pairs (n-1, n), (n-2, n), ...; those beyond the largest lag are left out.
    pub fn push(&mut self, means: &[PairMean<T>]) -> Estimate<T> {
        let frame = self.solver.frames();
        self.begin_frame(frame);
        let Self { params, weights, looks, rows, solver, noise, .. } = self;
        for (dt, (mean, row)) in (1..=params.max_lag).zip(means.iter().zip(rows.iter_mut())) {
            let weight = weights.weight(mean);
            let variance = pair_variance(debias(mean.coherence_squared(), *looks), *looks);
            let square = weight * weight;
            solver.add_pair(frame - dt, dt, row.push(mean.phase()), weight);
            noise.add_pair(frame - dt, dt, square * square * variance);
        }
        if self.rows.is_full() {
            self.rows.pop_back();
        }
        // Cannot fail: one place has just been made.
        let _ = self.rows.push_front(Unwrapper::new());
        self.newest(frame)
    }

    /// The smoothed phases of the frames still held, against their gauge; `phases[0]` is frame
    /// `self.first_kept()`.
    pub fn smoothed(&self, phases: &mut [T]) {
        let mut trial = self.solver;
        trial.finish();
        trial.phases(phases);
    }

    /// First frame whose smoothed phase is still held.
    #[must_use]
    pub const fn first_kept(&self) -> usize {
        self.solver.first_kept()
    }

    /// Make room for the frame and link it to its predecessors by Gamma_2.
    fn begin_frame(&mut self, frame: usize) {
        let Self { params, solver, noise, .. } = self;
        solver.push_frame_with(|done| noise.eliminate(done));
        noise.push_frame();
        let known = params.difference.reach().min(frame);
        let times = [0.0, 1.0, 2.0];
        let times = times.get(..=known).unwrap_or(&times);
        for (back, dt, conductance) in difference_links(params, times, 1.0) {
            solver.add_prior(frame - back.min(frame), dt, T::from_f64(conductance));
            noise.add_pair(frame - back.min(frame), dt, T::from_f64(conductance));
        }
    }

    fn newest(&self, frame: usize) -> Estimate<T> {
        let (mut solver, mut noise) = (self.solver, self.noise);
        solver.finish_with(|done| noise.eliminate(done));
        Estimate {
            frame,
            phase_rad: solver.newest_after_finish(),
            sigma_rad: noise.newest_after_finish(&solver).sqrt(),
        }
    }
}
