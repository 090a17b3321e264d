//! Maximum-likelihood phase linking with a modelled coherence: at the Cramer-Rao bound, without
//! unwrapping pairs of frames.
//!
//! For circular Gaussian speckle U_i = H_i exp(i phi_i) with E[H_i conj H_j] = Gamma_ij real, and L independent looks, the
//! phases minimise sum over i,j of Q_ij gamma_ij conj(z_i) z_j, where Q = Gamma^-1, gamma the normalised ⟨C⟩ and
//! z = exp(i phi). With
//!
//! ```text
//! residual  r_ij = Im(conj(z_i) gamma_ij z_j)           = -r_ji, small where the phases fit
//! score     g_i  = -sum over j of Q_ij r_ij
//! scoring   phi <- phi + F^-1 g                          F of `bound::information`
//! start     z_i  = unit(sum over j = i-16 ... i-1 of max(-Q_ij, 0) gamma_ij z_j)
//! ```
//! the start is good to a fraction of a radian and one or two steps of scoring reach the minimum. Only residual
//! phasors enter: no phase is unwrapped before the final curve (`chain`).
//!
//! What decides is Gamma, so it is fitted ([`crate::model`]): first blind to the phases, then twice to the
//! coherences aligned with them.

use crate::bound::{information, invert_laplacian, reported_variance, sandwich, scale};
use crate::chain::unwrap_chain;
use crate::closure::{Closure, Contrasts, Room};
use crate::coherence::{Lag, Mixture};
use crate::model::{self, Model, take};
use crate::prior::{acceleration_prior, add_prior, pull_of};
use crate::quality::USABLE;
use crate::reference::{reference_span, subtract_reference};
use crate::scalar::{Real, Scalar};
use crate::square::{Square, dot};
use crate::weights::unit_phasor;
use num_complex::Complex;

/// How many frames back the start looks.
pub const START_FRAMES: usize = 16;

/// How often the model is fitted to the aligned coherences.
const REFITS: usize = 2;

/// Steps of scoring after each fit.
const STEPS: usize = 2;

/// Steps with a prior, whose pull is not part of the start.
const PRIOR_STEPS: usize = 3;

/// Information, 1/rad^2, about one phase when all others are known, below which it is as good as random
/// (variance pi^2/3).
pub(crate) const RANDOM: f64 = 3.0 / (core::f64::consts::PI * core::f64::consts::PI);

/// Is the phase of frame i worth reporting? Its quality must be above 0.3, and what the other frames tell of
/// it more than a random phase.
#[must_use]
pub fn is_usable<T: Real>(
    model: &Model<'_, T>,
    precision: &Square<'_, T>,
    looks: f64,
    i: usize,
) -> bool {
    // Sum over j != i of -Q_ij Gamma_ij, because Q Gamma = 1.
    let certainty = precision.at(i, i) * model.gamma.at(i, i) - T::one();
    let good = model.quality.get(i).is_some_and(|&s| s > T::from_f64(USABLE));
    good && certainty * T::from_f64(2.0 * looks) > T::from_f64(RANDOM)
}

/// r_ij = Im(conj(z_i) gamma_ij z_j), with z the phasors of the present phases.
#[inline(always)]
#[must_use]
pub fn residual<T: Scalar>(z_i: Complex<T>, gamma: Complex<T>, z_j: Complex<T>) -> T {
    let turned = turn(gamma, z_j);
    turned.im.mul_add(z_i.re, -(turned.re * z_i.im))
}

/// Re(conj(z_i) gamma_ij z_j): the coherence of a pair, aligned with the present phases.
#[inline(always)]
#[must_use]
pub fn aligned<T: Scalar>(z_i: Complex<T>, gamma: Complex<T>, z_j: Complex<T>) -> T {
    let turned = turn(gamma, z_j);
    turned.re.mul_add(z_i.re, turned.im * z_i.im)
}

/// a * b.
#[inline(always)]
#[must_use]
pub fn turn<T: Scalar>(a: Complex<T>, b: Complex<T>) -> Complex<T> {
    Complex { re: a.re.mul_add(b.re, -(a.im * b.im)), im: a.re.mul_add(b.im, a.im * b.re) }
}

/// The phasor of a frame from the weighted sum over its predecessors; where that is nothing, the phasor of
/// the frame before.
#[inline(always)]
#[must_use]
pub fn start_phasor<T: Scalar>(sum: Complex<T>, before: Complex<T>) -> Complex<T> {
    let unit = unit_phasor(sum);
    let nothing = unit.re.abs().max(unit.im.abs()).lt(T::from_f64(0.5));
    Complex {
        re: T::select(nothing, before.re, unit.re),
        im: T::select(nothing, before.im, unit.im),
    }
}

/// What the estimate needs to be told.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// L: effective looks behind each ⟨C⟩, above 1.
    pub looks: f64,
    /// N_0: the phase is reported against the mean of the usable ones of the first so many frames, and where there is
    /// none, of the first so many usable frames.
    pub reference_frames: usize,
    /// Standard deviation of the phase's second derivative, rad per (unit of time)^2, independent from one
    /// mean interval to the next: known beforehand, if at all.
    pub acceleration: Option<f64>,
}

/// Buffers of [`link_series`] for N frames.
#[derive(Debug)]
pub struct Buffers<'a, T> {
    /// At least [`Buffers::reals`] numbers.
    pub reals: &'a mut [T],
    /// At least N.
    pub phasors: &'a mut [Complex<T>],
    /// At least N (N - 1) / 2.
    pub lags: &'a mut [Lag<T>],
    /// At least [`crate::lags::Lags::indices`].
    pub indices: &'a mut [u32],
}

impl<T> Buffers<'_, T> {
    /// How many numbers `frames` frames need.
    #[must_use]
    pub const fn reals(frames: usize) -> usize {
        let own = 6 * frames * frames + 2 * frames;
        model::Buffers::<T>::reals(frames) + own + Room::<T>::reals(frames)
    }
}

/// Where the results go, N numbers each.
#[derive(Debug)]
pub struct Results<'a, T> {
    /// Phase against the mean of the usable reference frames, rad; NaN for frames that are not usable.
    pub phases: &'a mut [T],
    /// Standard deviation of that, rad; infinite for frames that are not usable.
    pub sigmas: &'a mut [T],
    /// s_i, 0..=1; usable above 0.3.
    pub quality: &'a mut [T],
    /// Fitted Gamma, N x N.
    pub gamma: &'a mut [T],
}

/// What else is known of the series.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Summary<T> {
    /// h without its periodic part.
    pub mixture: Mixture<T>,
    /// Does Gamma have a periodic part?
    pub periodic: bool,
    /// Rms misfit of the mean coherences to `mixture`.
    pub misfit: T,
    /// Does the model hold?
    pub closure: Closure,
}

/// Phases of a series from all its pairs.
///
/// `cross` holds ⟨C(t_i, t_j - t_i)⟩ = ⟨U_i conj U_j⟩, N x N, row after row, and comes back normalised to gamma
/// (1 on the diagonal). `times` are strictly ascending. At least two frames; without them, or with too
/// small buffers, the results are NaN and infinite.
pub fn link_series<T: Real>(
    cross: &mut [Complex<T>],
    times: &[f64],
    settings: &Settings,
    buffers: Buffers<'_, T>,
    results: Results<'_, T>,
) -> Summary<T> {
    let n = times.len();
    normalise(cross, n);
    let mut reals = buffers.reals;
    let model_reals = take(&mut reals, model::Buffers::<T>::reals(n));
    let model_buffers =
        model::Buffers { reals: model_reals, lags: buffers.lags, indices: buffers.indices };
    let mut model = Model::new(times, settings.looks, model_buffers);
    let mut square = || Square::new(take(&mut reals, n * n), n);
    let work = Work {
        aligned: square(),
        precision: square(),
        inverse: square(),
        scratch: [square(), square(), square()],
        score: take(&mut reals, n),
        usable: take(&mut reals, n),
        contrasts: reals,
        phasors: buffers.phasors,
        gamma: cross,
    };
    let mut link = Link { settings, work, phases: results.phases };
    link.start(&mut model);
    // Aligned with themselves even random phases seem coherent.
    let refits = if model.is_coherent() { REFITS } else { 0 };
    for _ in 0..refits {
        link.align();
        model.fit_aligned(&link.work.aligned);
        link.precision_of(&model);
        link.score(STEPS);
    }
    link.finish(&model, results.sigmas);
    for (place, &s) in results.quality.iter_mut().zip(model.quality.iter()) {
        *place = s;
    }
    Square::new(results.gamma, n).copy_from(&model.gamma);
    Summary {
        mixture: model.mixture,
        periodic: model.is_periodic(),
        misfit: model.misfit,
        closure: link.close(&model),
    }
}

/// gamma_ij = C_ij / sqrt(C_ii C_jj).
fn normalise<T: Real>(cross: &mut [Complex<T>], n: usize) {
    let power = |cross: &[Complex<T>], i: usize| cross.get(i * n + i).map_or(T::zero(), |c| c.re);
    for i in 0..n {
        for j in 0..n {
            // The diagonal last: the others need it.
            if i == j {
                continue;
            }
            let product = power(cross, i) * power(cross, j);
            let lit = product > T::from_f64(f64::from(f32::MIN_POSITIVE));
            let share = if lit { T::one() / product.sqrt() } else { T::zero() };
            if let Some(c) = cross.get_mut(i * n + j) {
                let gamma = Complex { re: c.re * share, im: c.im * share };
                // Not above 1 but for rounding; NaN and infinity count as no coherence.
                let sound = gamma.re.abs() + gamma.im.abs() < T::from_f64(2.0);
                *c = if sound { gamma } else { Complex { re: T::zero(), im: T::zero() } };
            }
        }
    }
    for i in 0..n {
        if let Some(c) = cross.get_mut(i * n + i) {
            *c = Complex { re: T::one(), im: T::zero() };
        }
    }
}

struct Work<'a, T> {
    /// Debiased |gamma|^2, then R.
    aligned: Square<'a, T>,
    /// Q.
    precision: Square<'a, T>,
    /// (F + 1 1^T / N)^-1.
    inverse: Square<'a, T>,
    scratch: [Square<'a, T>; 3],
    score: &'a mut [T],
    usable: &'a mut [T],
    /// For [`Contrasts`].
    contrasts: &'a mut [T],
    /// z.
    phasors: &'a mut [Complex<T>],
    gamma: &'a [Complex<T>],
}

struct Link<'a, 'b, T> {
    settings: &'b Settings,
    work: Work<'a, T>,
    phases: &'a mut [T],
}

impl<T: Real> Link<'_, '_, T> {
    /// Row i of gamma.
    fn gamma_row(&self, i: usize) -> &[Complex<T>] {
        let n = self.work.aligned.order();
        self.work.gamma.get(i * n..(i + 1) * n).unwrap_or(&[])
    }

    /// First model and first phases.
    fn start(&mut self, model: &mut Model<'_, T>) {
        let looks = self.settings.looks;
        let Self { work, .. } = self;
        let (n, gamma) = (work.aligned.order(), work.gamma);
        let (factor, bias) = (looks / (looks - 1.0), 1.0 / (looks - 1.0));
        work.aligned.fill_with(|i, j| {
            let square = gamma.get(i * n + j).map_or(T::zero(), |c| c.re * c.re + c.im * c.im);
            if i == j { T::one() } else { square * T::from_f64(factor) - T::from_f64(bias) }
        });
        model.fit_squares(&work.aligned);
        self.precision_of(model);
        self.walk();
        self.score(STEPS);
    }

    /// Q and (F + 1 1^T / N)^-1 of the model.
    fn precision_of(&mut self, model: &Model<'_, T>) {
        let Work { precision, inverse, .. } = &mut self.work;
        precision.copy_from(&model.gamma);
        precision.invert();
        information(&model.gamma, precision, inverse);
        invert_laplacian(inverse);
    }

    /// Each phasor from its predecessors.
    fn walk(&mut self) {
        let mut before = Complex { re: T::one(), im: T::zero() };
        for i in 0..self.work.precision.order() {
            let first = i.saturating_sub(START_FRAMES);
            let pairs = self.work.precision.row(i).iter().zip(self.gamma_row(i));
            let known = pairs.zip(self.work.phasors.iter()).take(i).skip(first);
            let mut sum = Complex { re: T::zero(), im: T::zero() };
            for ((&q, &gamma), &z) in known {
                let (weight, c) = ((-q).max(T::zero()), turn(gamma, z));
                sum.re += weight * c.re;
                sum.im += weight * c.im;
            }
            before = start_phasor(sum, before);
            if let (Some(z), Some(phase)) = (self.work.phasors.get_mut(i), self.phases.get_mut(i)) {
                *z = before;
                *phase = before.im.atan2(before.re);
            }
        }
    }

    /// The gradient of the log likelihood, per 2 looks.
    fn fill_score(&mut self) {
        for i in 0..self.work.precision.order() {
            let Some(&z_i) = self.work.phasors.get(i) else { return };
            let pairs = self.work.precision.row(i).iter().zip(self.gamma_row(i));
            let mut sum = T::zero();
            for ((&q, &gamma), &z_j) in pairs.zip(self.work.phasors.iter()) {
                sum += q * residual(z_i, gamma, z_j);
            }
            if let Some(place) = self.work.score.get_mut(i) {
                *place = -sum;
            }
        }
    }

    fn score(&mut self, steps: usize) {
        for _ in 0..steps {
            self.fill_score();
            self.step();
        }
    }

    /// phi <- phi + F^-1 g.
    fn step(&mut self) {
        for (i, phase) in self.phases.iter_mut().enumerate() {
            *phase += dot(self.work.inverse.row(i), self.work.score);
        }
        for (z, phase) in self.work.phasors.iter_mut().zip(self.phases.iter()) {
            let (im, re) = phase.sin_cos();
            *z = Complex { re, im };
        }
    }

    /// R_ij = Re(conj(z_i) gamma_ij z_j).
    fn align(&mut self) {
        let Work { aligned, phasors, gamma, .. } = &mut self.work;
        let n = aligned.order();
        let zero = Complex { re: T::zero(), im: T::zero() };
        let z = |i: usize| phasors.get(i).copied().unwrap_or(zero);
        aligned.fill_with(|i, j| {
            self::aligned(z(i), gamma.get(i * n + j).copied().unwrap_or(zero), z(j))
        });
    }

    /// Unwrap, apply the prior, and say how exact it is.
    fn finish(&mut self, model: &Model<'_, T>, sigmas: &mut [T]) {
        let times = model.lags().times();
        let Work { precision, usable, .. } = &mut self.work;
        for (i, place) in usable.iter_mut().enumerate() {
            let counts = is_usable(model, precision, self.settings.looks, i);
            *place = if counts { T::one() } else { T::zero() };
        }
        unwrap_chain(self.phases, times, model.quality);
        if let Some(acceleration) = self.settings.acceleration {
            self.apply_prior(model, acceleration);
        }
        self.fill_sigmas(sigmas);
        subtract_reference(self.phases, self.work.usable, self.references());
        let results = self.phases.iter_mut().zip(sigmas).zip(self.work.usable.iter());
        for ((phase, sigma), &usable) in results {
            if usable <= T::zero() {
                *phase = T::from_f64(f64::NAN);
                *sigma = T::from_f64(f64::INFINITY);
            }
        }
    }

    /// How many leading frames hold the reference.
    fn references(&self) -> usize {
        reference_span(self.work.usable, self.settings.reference_frames)
    }

    /// Scoring with the quadratic penalty phi^T P phi / 2 of the accelerations.
    fn apply_prior(&mut self, model: &Model<'_, T>, acceleration: f64) {
        let twice = 2.0 * self.settings.looks;
        let Work { precision, inverse, scratch: [prior, ..], .. } = &mut self.work;
        acceleration_prior(model.lags().times(), acceleration, prior);
        scale(prior, 1.0 / twice);
        information(&model.gamma, precision, inverse);
        add_prior(inverse, prior);
        invert_laplacian(inverse);
        for _ in 0..PRIOR_STEPS {
            self.fill_score();
            let Work { score, scratch: [prior, ..], .. } = &mut self.work;
            pull_of(prior, self.phases, score);
            self.step();
        }
    }

    /// The larger of the model's standard deviation and that of the sandwich.
    fn fill_sigmas(&mut self, sigmas: &mut [T]) {
        let references = self.references();
        scale(&mut self.work.inverse, 0.5 / self.settings.looks);
        let with_prior = self.settings.acceleration.is_some();
        if !with_prior {
            self.align();
            let Work { aligned, precision, scratch: [out, a, b], .. } = &mut self.work;
            sandwich(precision, aligned, self.settings.looks, out, a, b);
        }
        let Work { inverse, usable, scratch: [honest, ..], .. } = &self.work;
        for (frame, sigma) in sigmas.iter_mut().enumerate() {
            let variance = reported_variance(inverse, usable, references, frame);
            let other = reported_variance(honest, usable, references, frame);
            *sigma = (if with_prior { variance } else { variance.max(other) }).sqrt();
        }
    }

    /// How well the phases of the usable frames close.
    fn close(self, model: &Model<'_, T>) -> Closure {
        let Work { aligned, precision, inverse, scratch: [a, b, c], .. } = self.work;
        let Work { usable, contrasts: reals, phasors, gamma, .. } = self.work;
        let room = Room { squares: [precision, inverse, a, b, c], reals };
        let contrasts = Contrasts::new(&model.gamma, usable, self.settings.looks, room);
        let n = aligned.order();
        let zero = Complex { re: T::zero(), im: T::zero() };
        let z = |i: usize| phasors.get(i).copied().unwrap_or(zero);
        let gamma = |i: usize, j: usize| gamma.get(i * n + j).copied().unwrap_or(zero);
        contrasts.test(
            |i, j| residual(z(i), gamma(i, j), z(j)),
            |i, j| self::aligned(z(i), gamma(i, j), z(j)),
        )
    }
}
