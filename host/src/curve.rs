//! The phase curve of a region: the ensemble average is the mean over a mask, in `f64`.

use crate::allocate::{reserve, zeros};
use crate::error::{Error, Result};
use crate::io::{CurveRow, Series, Shape};
use crate::method::{Average, Method, Plan};
use crate::progress::Progress;
use crate::series::Survey;
use num_complex::{Complex, Complex32, Complex64};
use phasewalk_core::baseline::{
    direct_difference, direct_variance, one_step, one_step_variance, unwrap_in_time,
};
use phasewalk_core::batch::solve_series;
use phasewalk_core::cross_spectrum::cross_spectrum;
use phasewalk_core::ensemble::{Ensemble, PairMean};
use phasewalk_core::layers::layer_difference;
use phasewalk_core::reference::subtract_reference;
use phasewalk_core::regularize::batch_links;
use phasewalk_core::solver::Solver;
use phasewalk_core::storage::{Link, Node};
use phasewalk_core::variance::phase_variance;
use phasewalk_core::weights::{debias, pair_variance};
use rayon::prelude::*;

/// The fields of the pixels of a mask, all frames, in memory.
pub struct Region {
    /// (frame, depth, pixel).
    fields: Vec<Complex32>,
    pixels: usize,
    depths: usize,
    in_first: usize,
    /// Pixels of the mask that had to be left out.
    pub left_out: usize,
}

impl Region {
    /// Bytes a region of so many pixels takes.
    #[must_use]
    pub fn bytes(pixels: usize, frames: usize, depths: usize) -> u64 {
        (pixels * frames * depths * size_of::<Complex32>()) as u64
    }

    /// Read the usable pixels of `mask` (y, x).
    ///
    /// # Errors
    /// When none is usable, the series cannot be read, or the user interrupts.
    pub fn read(
        series: &dyn Series,
        survey: &Survey,
        mask: &[bool],
        plan: &Plan,
        progress: &Progress,
    ) -> Result<Self> {
        let Shape { frames, height, width, .. } = series.shape();
        let chosen: Vec<usize> =
            (0..height * width).filter(|&i| mask[i] && survey.valid[i]).collect();
        let asked = mask.iter().filter(|&&m| m).count();
        if chosen.is_empty() {
            return Err(Error::failed(format!(
                "none of the {asked} pixels of the mask is usable (not finite, or zero in all frames)"
            )));
        }
        let depths = plan.depths.all();
        let mut fields = reserve(chosen.len() * frames * depths.len(), "the pixels of the mask")?;
        let mut image = zeros(height * width, "one frame")?;
        for frame in 0..frames {
            for &depth in &depths {
                series.read_rows(frame, depth, 0..height, &mut image)?;
                fields.extend(chosen.iter().map(|&i| image[i] * survey.scale));
            }
            progress.advance(1)?;
        }
        Ok(Self {
            fields,
            pixels: chosen.len(),
            depths: depths.len(),
            in_first: plan.depths.in_first(),
            left_out: asked - chosen.len(),
        })
    }

    /// Number of pixels used.
    #[must_use]
    pub fn pixels(&self) -> usize {
        self.pixels
    }

    /// ⟨C(t,s-t)⟩ and ⟨C/|C|⟩ over the region; `powers` as [`Self::powers`] gives them.
    #[must_use]
    pub fn pair_mean(&self, t: usize, s: usize, powers: &[f64]) -> PairMean<f64> {
        let mut ensemble = Ensemble::new();
        for pixel in 0..self.pixels {
            ensemble.add(self.cross_spectrum(t, s, pixel));
        }
        ensemble.mean(powers[t], powers[s])
    }

    /// ⟨C(t,0)⟩ of every frame.
    #[must_use]
    pub fn powers(&self) -> Vec<f64> {
        let frames = self.fields.len() / (self.pixels * self.depths);
        let mean = |t: usize| {
            let sum: f64 = (0..self.pixels).map(|pixel| self.cross_spectrum(t, t, pixel).re).sum();
            sum / self.pixels as f64
        };
        (0..frames).into_par_iter().map(mean).collect()
    }

    fn cross_spectrum(&self, t: usize, s: usize, pixel: usize) -> Complex64 {
        let field = |frame: usize, z: usize| {
            let u = self.fields[(frame * self.depths + z) * self.pixels + pixel];
            Complex { re: f64::from(u.re), im: f64::from(u.im) }
        };
        let sum = |zs: std::ops::Range<usize>| -> Complex64 {
            zs.map(|z| cross_spectrum(field(t, z), field(s, z))).sum()
        };
        let first = sum(0..self.in_first);
        if self.in_first == self.depths {
            return first;
        }
        layer_difference(first, sum(self.in_first..self.depths))
    }
}

/// Phase and standard deviation of each frame of the region.
///
/// `looks` are those of the weights, `effective_looks` those of the standard deviation.
///
/// # Errors
/// When the user interrupts.
pub fn curve(
    region: &Region,
    plan: &Plan,
    looks: f64,
    effective_looks: f64,
    progress: &Progress,
) -> Result<Vec<CurveRow>> {
    let powers = region.powers();
    let pairs = plan.pairs();
    let mut means = Vec::with_capacity(pairs.len());
    let frames = plan.frames();
    for chunk in pairs.chunks(pairs.len().div_ceil(frames)) {
        let part: Vec<_> =
            chunk.par_iter().map(|&(t, s)| region.pair_mean(t, s, &powers)).collect();
        means.extend(part);
        progress.advance(1)?;
    }
    let estimate = Estimate { plan, pairs: &pairs, means: &means, looks, effective_looks };
    let (phases, sigmas) = match plan.method {
        Method::Direct => estimate.direct(),
        Method::OneStep => estimate.one_step(),
        Method::Paper(_) => estimate.least_squares(),
    };
    let rows = phases.into_iter().zip(sigmas).zip(&plan.times_s).enumerate();
    Ok(rows
        .map(|(frame, ((phase_rad, sigma_rad), &time_s))| CurveRow {
            frame,
            time_s,
            phase_rad,
            sigma_rad,
        })
        .collect())
}

/// What the phase of a region does beyond that of another: phases are subtracted, variances add.
///
/// `control` has a row for each of `rows`.
pub fn subtract(rows: &mut [CurveRow], control: &[CurveRow]) {
    for (row, control) in rows.iter_mut().zip(control) {
        row.phase_rad -= control.phase_rad;
        row.sigma_rad = row.sigma_rad.hypot(control.sigma_rad);
    }
}

/// What the three methods start from.
struct Estimate<'a> {
    plan: &'a Plan,
    pairs: &'a [(usize, usize)],
    means: &'a [PairMean<f64>],
    looks: f64,
    effective_looks: f64,
}

impl Estimate<'_> {
    fn direct(&self) -> (Vec<f64>, Vec<f64>) {
        let mut phases: Vec<f64> =
            self.means.iter().map(|mean| direct_difference(self.averaged(mean))).collect();
        unwrap_in_time(&mut phases);
        let mut variances = self.variances();
        variances[self.plan.direct_frame] = 0.0;
        self.finish_baseline(phases, |frame, n0| direct_variance(&variances, frame, n0))
    }

    fn one_step(&self) -> (Vec<f64>, Vec<f64>) {
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

    fn least_squares(&self) -> (Vec<f64>, Vec<f64>) {
        let Self { plan, pairs, means, .. } = self;
        let (frames, lags) = (plan.frames(), plan.params.max_lag);
        let n0 = plan.params.reference_frames;
        let nodes = vec![Node::new(); frames];
        let mut solver =
            Solver::with_storage(vec![Link::new(); frames * lags], nodes, lags, plan.gauge(), n0);
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
        (phases, (0..frames).into_par_iter().map(sigma).collect())
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
