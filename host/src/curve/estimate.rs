//! The direct difference, the one-step walk and the paper's least squares of one region.

use crate::method::{Average, Plan};
use num_complex::Complex64;
use phasewalk_core::baseline::{
    direct_difference, direct_variance, one_step, one_step_variance, unwrap_in_time,
};
use phasewalk_core::batch::solve_series;
use phasewalk_core::ensemble::PairMean;
use phasewalk_core::reference::subtract_reference;
use phasewalk_core::regularize::batch_links;
use phasewalk_core::solver::{Solver, links_for};
use phasewalk_core::storage::{Link, Node};
use phasewalk_core::variance::phase_variance;
use phasewalk_core::weights::{debias, pair_variance};
use rayon::prelude::*;

/// Frames whose standard deviations one thread finds in one go.
const FRAMES_AT_ONCE: usize = 128;

/// What the three methods start from.
pub(super) struct Estimate<'a> {
    pub plan: &'a Plan,
    pub pairs: &'a [(usize, usize)],
    pub means: &'a [PairMean<f64>],
    pub looks: f64,
    pub effective_looks: f64,
}

impl Estimate<'_> {
    pub fn direct(&self) -> (Vec<f64>, Vec<f64>) {
        let mut phases: Vec<f64> =
            self.means.iter().map(|mean| direct_difference(self.averaged(mean))).collect();
        unwrap_in_time(&mut phases);
        let mut variances = self.variances();
        variances[self.plan.direct_frame] = 0.0;
        self.finish_baseline(phases, |frame, n0| direct_variance(&variances, frame, n0))
    }

    pub fn one_step(&self) -> (Vec<f64>, Vec<f64>) {
        let mut phases = vec![0.0];
        for mean in self.means {
            phases.push(one_step(phases[phases.len() - 1], self.averaged(mean)));
        }
        let variances = self.variances();
        self.finish_baseline(phases, |frame, n0| one_step_variance(&variances, frame, n0))
    }

    /// Reference mean and standard deviations of the two baselines, which have no weights.
    fn finish_baseline(
        &self,
        mut phases: Vec<f64>,
        variance: impl Fn(usize, usize) -> f64,
    ) -> (Vec<f64>, Vec<f64>) {
        let n0 = self.plan.params.reference_frames;
        let measured = vec![1.0; phases.len()];
        subtract_reference(&mut phases, &measured, n0);
        let sigmas = (0..phases.len()).map(|frame| variance(frame, n0).sqrt()).collect();
        (phases, sigmas)
    }

    pub fn least_squares(&self) -> (Vec<f64>, Vec<f64>) {
        let Self { plan, pairs, means, .. } = self;
        let (frames, lags) = (plan.frames(), plan.params.max_lag);
        let n0 = plan.params.reference_frames;
        let links = vec![Link::new(); links_for(frames, lags)];
        let nodes = vec![Node::new(); frames];
        let mut solver = Solver::with_storage(links, nodes, lags, plan.gauge(), n0);
        let weights = plan.weights(self.looks);
        let weight: Vec<f64> = means.iter().map(|mean| weights.weight(mean)).collect();
        let (mut phases, mut measured) = (vec![0.0; frames], vec![0.0; frames]);
        let mut input = means.iter().zip(&weight);
        let phase = |mean: &PairMean<f64>| PairMean { cross: self.averaged(mean), ..*mean }.phase();
        let next = |_, _| input.next().map_or((0.0, 0.0), |(mean, &w)| (phase(mean), w));
        solve_series(&mut solver, &plan.params, &plan.times_s, next, &mut phases, &mut measured);

        let mut noise = vec![0.0; frames * lags];
        for ((&(t, s), w), variance) in pairs.iter().zip(&weight).zip(self.variances()) {
            noise[t * lags + s - t - 1] = w.powi(4) * variance;
        }
        for (t, dt, conductance) in batch_links(&plan.params, &plan.times_s) {
            noise[t * lags + dt - 1] += conductance;
        }
        let sigma = |frame| {
            let mut scratch = vec![0.0; frames];
            phase_variance(&solver, &noise, &measured, n0, frame, &mut scratch).sqrt()
        };
        // In a study a thread that waited for parts of a short series would begin other series meanwhile, and hold them all.
        let all = (0..frames).into_par_iter().with_min_len(FRAMES_AT_ONCE);
        (phases, all.map(sigma).collect())
    }

    /// The average whose argument is the pair's phase.
    fn averaged(&self, mean: &PairMean<f64>) -> Complex64 {
        match self.plan.average {
            Average::Field => mean.cross,
            Average::Phasor => mean.phasor,
        }
    }

    /// Variance of each pair's phase, rad^2.
    fn variances(&self) -> Vec<f64> {
        let looks = self.effective_looks;
        let of =
            |mean: &PairMean<f64>| pair_variance(debias(mean.coherence_squared(), looks), looks);
        self.means.iter().map(of).collect()
    }
}
