//! The coherence matrix Gamma of a whole series, fitted to its sample coherences.

use crate::coherence::{Lag, Mixture};
use crate::lags::Lags;
use crate::periodic::{self, Dictionary};
use crate::quality::{first_quality, frame_quality};
use crate::scalar::Real;
use crate::square::{Square, dot};

/// Misfit of the lag means (rms, weighted with their pairs, over the shorter half of the lags) above
/// which a periodic part is tried.
const MISFIT: f64 = 0.045;

/// Gain in log likelihood above which a periodic part is kept.
const GAIN: f64 = 30.0;

/// Added to the diagonal of a model with a periodic part, which cosines leave nearly singular; the sum is scaled back to
/// 1, as if so much of each frame were its own noise.
const PERIODIC_RIDGE: f64 = 1e-3;

/// Buffers of a [`Model`] for N frames.
#[derive(Debug)]
pub struct Buffers<'a, T> {
    /// At least [`Buffers::reals`] numbers.
    pub reals: &'a mut [T],
    /// At least N (N - 1) / 2.
    pub lags: &'a mut [Lag<T>],
    /// At least [`Lags::indices`].
    pub indices: &'a mut [u32],
}

impl<T> Buffers<'_, T> {
    /// How many numbers a model of `frames` frames needs.
    #[must_use]
    pub const fn reals(frames: usize) -> usize {
        4 * frames * frames + frames + periodic::reals(frames)
    }
}

/// Standard deviations of chance that a mean squared coherence must exceed; a single pair (two frames) does with
/// a probability of exp(-1 - 4.6) = 0.4 %, as its square is exponentially distributed.
const CHANCE: f64 = 4.6;

/// Standard deviations of chance below which the mean squared coherence of one lag counts as none.
const SEEN: f64 = 3.0;

/// Least product of two qualities whose pair counts in a blind fit.
const LEAST_SHARE: f64 = 0.1;

/// How often the qualities and the mixture take turns in a blind fit.
const BLIND_REFITS: usize = 2;

/// Times that differ by less, in units of the shortest interval, have the same coherence.
const SAME: f64 = 1e-6;

/// |gamma|^2 of Gaussian speckle from S = sum of |C|^2 / sum of P_i P_j over blocks of L looks each, inside which the
/// phase is the same: S = (|gamma|^2 + 1/L) / (1 + |gamma|^2 / L), so |gamma|^2 = (S - 1/L) / (1 - S/L). It scatters
/// around 0 without coherence.
#[must_use]
pub fn debias_blocks(s: f64, looks: f64) -> f64 {
    (s - 1.0 / looks) / (1.0 - s / looks)
}

/// Cut the first `count` numbers off; fewer if there are not so many.
pub(crate) fn take<'a, T>(rest: &mut &'a mut [T], count: usize) -> &'a mut [T] {
    let all = core::mem::take(rest);
    let (first, second) = all.split_at_mut(count.min(all.len()));
    *rest = second;
    first
}

/// Gamma_ij = s_i s_j h(|t_i - t_j|), with what it is made of.
#[derive(Debug)]
pub struct Model<'a, T> {
    /// h without a periodic part.
    pub mixture: Mixture<T>,
    /// s_i.
    pub quality: &'a mut [T],
    /// Gamma, 1 on the diagonal.
    pub gamma: Square<'a, T>,
    periodic: bool,
    coherent: bool,
    /// Rms misfit of the lag means to the mixture, over the shorter half of the lags.
    pub misfit: T,
    looks: f64,
    lags: Lags<'a>,
    means: &'a mut [Lag<T>],
    /// Gamma without the qualities.
    bare: Square<'a, T>,
    trial: Square<'a, T>,
    scratch: Square<'a, T>,
    dictionary: &'a mut [T],
}

impl<'a, T: Real> Model<'a, T> {
    /// A model, not fitted yet, for frames at `times` (strictly ascending, at least 2) and L effective looks.
    #[must_use]
    pub fn new(times: &'a [f64], looks: f64, buffers: Buffers<'a, T>) -> Self {
        let n = times.len();
        let lags = Lags::new(times, buffers.indices);
        let mut rest = buffers.reals;
        let mut square = || Square::new(take(&mut rest, n * n), n);
        let (gamma, bare, trial, scratch) = (square(), square(), square(), square());
        let quality = take(&mut rest, n);
        Self {
            mixture: Mixture::new(lags.unit(), lags.longest()),
            quality,
            gamma,
            periodic: false,
            coherent: false,
            misfit: T::zero(),
            looks,
            lags,
            means: buffers.lags,
            bare,
            trial,
            scratch,
            dictionary: rest,
        }
    }

    /// Acquisition times and lags.
    #[must_use]
    pub const fn lags(&self) -> &Lags<'a> {
        &self.lags
    }

    /// Has the first fit found any coherence? Without, all qualities and shares are 0 and Gamma is the unit
    /// matrix.
    #[must_use]
    pub const fn is_coherent(&self) -> bool {
        self.coherent
    }

    /// Does it have a periodic part?
    #[must_use]
    pub const fn is_periodic(&self) -> bool {
        self.periodic
    }

    /// First fit, blind to the phases: `square` holds the debiased |gamma_ij|^2, which may be
    /// negative.
    pub fn fit_squares(&mut self, square: &Square<'_, T>) {
        let n = self.lags.frames();
        let (expected, medians) = self.dictionary.split_at_mut(n.min(self.dictionary.len()));
        first_quality(square, &self.lags, self.quality, expected, medians);
        self.fit_to_squares(square);
        self.coherent = self.is_beyond_chance(square);
        if !self.coherent {
            self.quality.fill(T::zero());
            self.mixture.shares.fill(T::zero());
            self.fill();
        }
    }

    /// Is there any coherence at all, between neighbours or on the whole? The mean of M debiased squares of frames
    /// without any has the standard deviation 1 / (L sqrt(M)).
    fn is_beyond_chance(&self, square: &Square<'_, T>) -> bool {
        let beyond = |mean: T, pairs: T| {
            let chance = CHANCE / (self.looks * libm::sqrt(pairs.to_f64().max(1.0)));
            mean >= T::from_f64(chance)
        };
        let value = |i, j| square.at(i, j);
        let near = self.lags.mean(0, value, |_, _| T::one());
        let (mut sum, mut pairs) = (T::zero(), T::zero());
        for group in 0..self.lags.groups() {
            let lag = self.lags.mean(group, value, |_, _| T::one());
            sum += lag.mean * lag.pairs;
            pairs += lag.pairs;
        }
        beyond(near.mean, near.pairs) || beyond(sum / pairs.max(T::one()), pairs)
    }

    /// Mixture from the lag means of squared coherences, each freed of the qualities of its frames.
    fn fit_to_squares(&mut self, square: &Square<'_, T>) {
        for (group, mean) in self.means.iter_mut().enumerate().take(self.lags.groups()) {
            let s = |i: usize| self.quality.get(i).copied().unwrap_or(T::zero());
            let shares = |i, j| {
                let both = s(i) * s(j);
                let both = if both > T::from_f64(LEAST_SHARE) { both } else { T::zero() };
                both * both
            };
            let value = |i, j| square.at(i, j) / shares(i, j).max(T::from_f64(1e-12));
            *mean = self.lags.mean(group, value, shares);
            let chance = SEEN / (self.looks * libm::sqrt(mean.pairs.to_f64().max(1.0)));
            let seen = mean.mean >= T::from_f64(chance);
            mean.mean = if seen { mean.mean.min(T::one()).sqrt() } else { T::zero() };
        }
        self.fit_mixture();
        self.fill();
    }

    /// Fit again, to the aligned coherences R_ij = Re(gamma_ij exp(-i (phi_i - phi_j))): decays, then qualities,
    /// then, where decays do not do, a periodic part.
    pub fn fit_aligned(&mut self, aligned: &Square<'_, T>) {
        for (group, mean) in self.means.iter_mut().enumerate().take(self.lags.groups()) {
            let s = |i: usize| self.quality.get(i).copied().unwrap_or(T::zero());
            let both = |i, j| T::max(s(i) * s(j), T::from_f64(1e-3));
            let value = |i, j| aligned.at(i, j) / both(i, j);
            *mean = self.lags.mean(group, value, |i, j| both(i, j) * both(i, j));
        }
        self.fit_mixture();
        self.fill();
        frame_quality(aligned, &self.bare, self.looks, self.quality, self.dictionary);
        self.fill();
        self.add_periodic(aligned);
    }

    /// All fits to debiased |gamma_ij|^2 alone, where the phases differ from place to place and only their
    /// mean is known; `root` is as large as `square` and becomes R, its root with its sign: where there is no
    /// coherence, R scatters around 0.
    pub fn fit_blind(&mut self, square: &Square<'_, T>, root: &mut Square<'_, T>) {
        self.fit_squares(square);
        root.fill_with(|i, j| {
            let x = square.at(i, j);
            if x < T::zero() { -(-x).sqrt() } else { x.sqrt() }
        });
        if !self.coherent {
            return;
        }
        for _ in 0..BLIND_REFITS {
            frame_quality(root, &self.bare, self.looks, self.quality, self.dictionary);
            self.fit_to_squares(square);
        }
        self.add_periodic(root);
    }

    fn add_periodic(&mut self, aligned: &Square<'_, T>) {
        self.find_misfit();
        if self.misfit > T::from_f64(MISFIT) {
            self.try_periodic(aligned);
        }
    }

    fn fit_mixture(&mut self) {
        let means = self.means.get(..self.lags.groups()).unwrap_or(&[]);
        self.mixture.fit(means.iter().copied());
        self.periodic = false;
    }

    /// Gamma from mixture and qualities.
    fn fill(&mut self) {
        let Self { lags, mixture, bare, .. } = self;
        fill_by_lag(lags, bare, |tau| mixture.at(tau));
        with_quality(&self.bare, self.quality, &mut self.gamma);
    }

    fn find_misfit(&mut self) {
        let half = T::from_f64(self.lags.longest() / 2.0);
        let (mut square, mut pairs) = (T::zero(), T::from_f64(1e-12));
        let means = self.means.get(..self.lags.groups()).unwrap_or(&[]);
        for lag in means.iter().filter(|lag| lag.tau <= half) {
            let error = lag.mean - self.mixture.at(lag.tau);
            square += lag.pairs * error * error;
            pairs += lag.pairs;
        }
        self.misfit = (square / pairs).sqrt();
    }

    /// Add non-negative cosines, and keep them if the likelihood gains enough.
    fn try_periodic(&mut self, aligned: &Square<'_, T>) {
        let (frames, longest) = (self.lags.frames(), self.lags.longest());
        let mut dictionary = Dictionary::new(self.mixture, frames, longest, self.dictionary);
        dictionary.fit(self.means.get(..self.lags.groups()).unwrap_or(&[]));
        fill_by_lag(&self.lags, &mut self.bare, |tau| dictionary.at(tau));
        with_quality(&self.bare, self.quality, &mut self.trial);
        let before = disagreement(&self.gamma, aligned, &mut self.scratch);
        let after = disagreement(&self.trial, aligned, &mut self.scratch);
        if T::from_f64(self.looks) * (before - after) > T::from_f64(GAIN) {
            self.periodic = true;
            self.gamma.copy_from(&self.trial);
            let share = T::from_f64(1.0 / (1.0 + PERIODIC_RIDGE));
            for i in 0..frames {
                self.gamma.row_mut(i).iter_mut().for_each(|gamma| *gamma = *gamma * share);
                self.gamma.set(i, i, T::one());
            }
        }
    }
}

/// M_ij = h(|t_i - t_j|); h is computed once for pairs at the same lag.
fn fill_by_lag<T: Real>(lags: &Lags<'_>, out: &mut Square<'_, T>, mut h: impl FnMut(T) -> T) {
    for group in 0..lags.groups() {
        let common = lags.tau(group);
        let at_common = h(T::from_f64(common));
        for (i, j) in lags.pairs(group) {
            let tau = lags.between(i, j);
            let same = (tau - common).abs() < SAME * lags.unit();
            out.set_both(i, j, if same { at_common } else { h(T::from_f64(tau)) });
        }
    }
    for i in 0..out.order() {
        out.set(i, i, T::one());
    }
}

/// Gamma_ij = s_i s_j M_ij, 1 on the diagonal.
fn with_quality<T: Real>(bare: &Square<'_, T>, quality: &[T], out: &mut Square<'_, T>) {
    for (i, &s) in quality.iter().enumerate() {
        let row = out.row_mut(i).iter_mut().zip(bare.row(i)).zip(quality).enumerate();
        for (j, ((place, &m), &other)) in row {
            *place = if i == j { T::one() } else { m * s * other };
        }
    }
}

/// Negative log likelihood of the aligned coherence R under Gamma, per look: ln det Gamma + sum of (Gamma^-1 o R).
fn disagreement<T: Real>(
    gamma: &Square<'_, T>,
    aligned: &Square<'_, T>,
    scratch: &mut Square<'_, T>,
) -> T {
    scratch.copy_from(gamma);
    let mut total = scratch.invert();
    for i in 0..gamma.order() {
        total += dot(scratch.row(i), aligned.row(i));
    }
    total
}

#[cfg(test)]
mod tests {
    use super::*;

    const N: usize = 30;

    /// A model fitted to coherences that are known exactly.
    fn fitted(gamma: impl Fn(usize, usize) -> f64, check: impl FnOnce(&Model<'_, f64>)) {
        let times: [f64; N] = core::array::from_fn(|i| i as f64);
        let mut reals = [0.0; Buffers::<f64>::reals(N)];
        let mut lags = [Lag { tau: 0.0, mean: 0.0, pairs: 0.0 }; N * N];
        let mut indices = [0; Lags::indices(N)];
        let buffers = Buffers { reals: &mut reals, lags: &mut lags, indices: &mut indices };
        let mut model = Model::new(&times, 1000.0, buffers);
        let mut data = [0.0; N * N];
        let mut sample = Square::new(&mut data, N);
        sample.fill_with(|i, j| gamma(i, j) * gamma(i, j));
        model.fit_squares(&sample);
        sample.fill_with(&gamma);
        model.fit_aligned(&sample);
        model.fit_aligned(&sample);
        check(&model);
    }

    fn lag(i: usize, j: usize) -> f64 {
        i.abs_diff(j) as f64
    }

    #[test]
    fn a_bad_frame_does_not_spoil_the_decay() {
        let bad = |i: usize| if i == 11 { 0.0 } else { 1.0 };
        let truth = |i, j| if i == j { 1.0 } else { 0.9 * libm::exp(-0.1 * lag(i, j)) };
        fitted(
            |i, j| if i == j { 1.0 } else { bad(i) * bad(j) * truth(i, j) },
            |model| {
                assert!(
                    model.quality[11] < 0.05 && model.quality[10] > 0.99,
                    "{:?}",
                    model.quality
                );
                assert!(!model.is_periodic() && model.misfit < 0.01, "{}", model.misfit);
                for j in 0..10 {
                    assert!((model.gamma.at(3, j) - truth(3, j)).abs() < 0.012, "{j}");
                }
            },
        );
    }

    #[test]
    fn coherence_that_returns_is_periodic() {
        let truth = |i, j| {
            let tau = lag(i, j);
            let wave = libm::cos(core::f64::consts::TAU * tau / 8.0);
            if i == j { 1.0 } else { 0.5 * libm::exp(-0.05 * tau) + 0.4 * wave }
        };
        fitted(truth, |model| {
            assert!(model.is_periodic());
            assert!((0..N).all(|i| model.gamma.at(i, i) == 1.0));
            for j in 0..10 {
                assert!((model.gamma.at(20, j) - truth(20, j)).abs() < 0.05, "{j}");
            }
        });
    }

    #[test]
    fn no_coherence_leaves_the_unit_matrix() {
        fitted(
            |i, j| if i == j { 1.0 } else { 0.0 },
            |model| {
                assert!((0..N).all(|i| (0..N).all(|j| i == j || model.gamma.at(i, j) == 0.0)));
                assert!(model.quality.iter().all(|&s| s < 0.3), "{:?}", model.quality);
                assert!(
                    !model.is_coherent() && model.mixture.noise() == 1.0,
                    "{:?}",
                    model.mixture
                );
            },
        );
    }
}
