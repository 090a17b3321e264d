//! From the filtered pairs of one vector of pixels to their phases.

use crate::lanes::{Lanes, fetch_ahead};
use crate::method::{Method, Plan};
use phasewalk_core::batch::solve_series;
use phasewalk_core::reference::subtract_reference;
use phasewalk_core::regularize::batch_links;
use phasewalk_core::solver::{Solver, links_for};
use phasewalk_core::storage::{Link, Node};
use phasewalk_core::variance::phase_variance;
use phasewalk_core::weights::{debias, pair_variance};

/// What is kept of a pair until the pixel is solved.
#[derive(Clone, Copy)]
pub struct Sample<L> {
    /// arg ⟨C⟩, radians.
    pub phase: L,
    /// w.
    pub weight: L,
}

/// How many samples ahead memory is asked for them.
const SAMPLES_AHEAD: usize = 16;

/// Phase and weight of sample `next`, which moves on; zeros behind the last one.
#[inline(always)]
pub(super) fn take_sample<L: Lanes>(samples: &[Sample<L>], next: &mut usize) -> (L, L) {
    fetch_ahead(samples, *next + SAMPLES_AHEAD);
    let sample = samples.get(*next).map_or((L::zero(), L::zero()), |s| (s.phase, s.weight));
    *next += 1;
    sample
}

/// Buffers of the solution, one vector of pixels wide, and the vector's results.
pub struct Workspace<L> {
    solver: Solver<L, Vec<Link<L>>, Vec<Node<L>>>,
    /// Noise q of each link, in the solver's rows.
    noise: Vec<L>,
    sensitivity: Vec<L>,
    measured: Vec<L>,
    /// phi(t) of the vector just solved, radians.
    pub phases: Vec<L>,
    /// Its standard deviation, where asked for.
    pub sigmas: Vec<L>,
}

impl<L: Lanes> Workspace<L> {
    /// Buffers for the plan.
    pub fn new(plan: &Plan, sigma: bool) -> Self {
        let frames = plan.frames();
        let lags = plan.params.max_lag;
        let line = || vec![L::zero(); frames];
        Self {
            solver: Solver::with_storage(
                vec![Link::new(); links_for(frames, lags)],
                vec![Node::new(); frames],
                lags,
                plan.gauge(),
                plan.params.reference_frames,
            ),
            noise: if sigma { vec![L::zero(); frames * lags] } else { Vec::new() },
            sensitivity: line(),
            measured: line(),
            phases: line(),
            sigmas: line(),
        }
    }

    /// Bytes that [`Self::new`] takes.
    pub fn bytes(plan: &Plan, sigma: bool) -> usize {
        let (frames, lags) = (plan.frames(), plan.params.max_lag);
        let noise = if sigma { frames * lags } else { 0 };
        let of_frame = size_of::<Node<L>>() + 4 * size_of::<L>();
        links_for(frames, lags) * size_of::<Link<L>>() + noise * size_of::<L>() + frames * of_frame
    }

    /// Solve one vector from its samples, in the order of `Plan::pairs`.
    #[inline(always)]
    pub fn solve(&mut self, plan: &Plan, samples: &[Sample<L>]) {
        match plan.method {
            Method::Direct => {
                for (phase, sample) in self.phases.iter_mut().zip(samples) {
                    *phase = -sample.phase;
                }
                self.subtract_reference(plan);
            }
            Method::OneStep => {
                let mut walked = L::zero();
                for (phase, step) in self.phases.iter_mut().skip(1).zip(samples) {
                    walked = walked - step.phase;
                    *phase = walked;
                }
                if let Some(first) = self.phases.first_mut() {
                    *first = L::zero();
                }
                self.subtract_reference(plan);
            }
            // Linked phases are computed frame by frame (`linked`).
            Method::Paper(_) | Method::Linked => {
                let mut next = 0;
                solve_series(
                    &mut self.solver,
                    &plan.params,
                    &plan.times_s,
                    |_, _| take_sample(samples, &mut next),
                    &mut self.phases,
                    &mut self.measured,
                );
            }
        }
    }

    /// 0 in lanes where no frame of the vector just solved had a weight, 1 in the others.
    #[inline(always)]
    pub fn measured_at_all(&self) -> L {
        let mut any = L::zero();
        for &measured in &self.measured {
            any = any.max(measured);
        }
        any
    }

    #[inline(always)]
    fn subtract_reference(&mut self, plan: &Plan) {
        self.measured.fill(L::one());
        subtract_reference(&mut self.phases, &self.measured, plan.params.reference_frames);
    }

    /// Standard deviations of the phases just solved, from the coherences |gamma|^2 of the `pairs`
    /// (least squares only).
    #[inline(always)]
    pub fn find_sigmas(
        &mut self,
        plan: &Plan,
        pairs: &[(usize, usize)],
        samples: &[Sample<L>],
        coherences: &[L],
        looks: f64,
    ) {
        let lags = plan.params.max_lag;
        self.noise.fill(L::zero());
        for (&(t, s), (sample, &coherence)) in pairs.iter().zip(samples.iter().zip(coherences)) {
            let square = sample.weight * sample.weight;
            let variance = pair_variance(debias(coherence, looks), looks);
            self.noise[t * lags + s - t - 1] = square * square * variance;
        }
        for (t, dt, conductance) in batch_links(&plan.params, &plan.times_s) {
            self.noise[t * lags + dt - 1] += L::from_f64(conductance);
        }
        for (frame, sigma) in self.sigmas.iter_mut().enumerate() {
            let variance = phase_variance(
                &self.solver,
                &self.noise,
                &self.measured,
                plan.params.reference_frames,
                frame,
                &mut self.sensitivity,
            );
            *sigma = variance.sqrt();
        }
    }
}
