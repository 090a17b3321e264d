//! The coherence as the tracker models it: decays, and cosines for a pattern that comes back.
//!
//! ```text
//! h(tau) = sum over k of c_k exp(-r_k tau) + sum over m of a_m cos(w_m tau),   c_k, a_m >= 0
//! ```
//! w_m: twelve frequencies in equal steps up to a period of 6 shortest intervals, so that over the lags of a window any
//! other frequency below is near one of them. [`super::equations`] says when the a_m are used.

use crate::coherence::Mixture;
use crate::linking::turn;
use crate::scalar::Real;
use crate::square::dot;
use num_complex::Complex;

/// Decays of the model: the static part and 8 rates, fewer than in a batch because a few lags have to fix
/// them.
pub const DECAYS: usize = 9;

/// Cosines of the model beside the decays, where there are any.
pub const COSINES: usize = 12;

/// Shortest period, in shortest intervals.
const PERIOD: f64 = 6.0;

/// What the shares are multiplied with at one lag.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Terms<T, const M: usize> {
    /// exp(-r_k tau).
    pub(super) decays: [T; DECAYS],
    /// exp(i w_m tau), of which the real part counts.
    pub(super) turns: [Complex<T>; M],
}

impl<T: Real, const M: usize> Terms<T, M> {
    /// All are the same real number.
    pub(super) fn filled(value: T) -> Self {
        Self { decays: [value; DECAYS], turns: [Complex { re: value, im: T::zero() }; M] }
    }

    /// Go on from one lag to its sum with another, `step`.
    pub(super) fn follow(&mut self, step: &Self) {
        for (e, &factor) in self.decays.iter_mut().zip(&step.decays) {
            *e = *e * factor;
        }
        for (z, &factor) in self.turns.iter_mut().zip(&step.turns) {
            *z = turn(*z, factor);
        }
    }

    /// All `factor` times.
    pub(super) fn scale(&mut self, factor: T) {
        for e in &mut self.decays {
            *e = *e * factor;
        }
        for z in &mut self.turns {
            *z = Complex { re: z.re * factor, im: z.im * factor };
        }
    }

    /// cos(w_m tau).
    pub(super) fn cosines(&self) -> [T; M] {
        self.turns.map(|z| z.re)
    }
}

/// h, with the shares as fitted.
#[derive(Clone, Debug)]
pub(super) struct Coherence<T, const M: usize> {
    /// r_k, and c_k fitted without cosines.
    pub(super) mixture: Mixture<T, DECAYS>,
    /// w_m, rad per unit of time.
    frequencies: [T; M],
    /// c_k fitted together with cosines.
    pub(super) together: [T; DECAYS],
    /// a_m.
    pub(super) amplitudes: [T; M],
    /// Are the cosines used, and the decays fitted with them?
    pub(super) periodic: bool,
}

impl<T: Real, const M: usize> Coherence<T, M> {
    /// Decay rates for lags from `unit` to `longest`, periods in units of `unit`; no cosines used.
    pub(super) fn new(unit: f64, longest: f64) -> Self {
        let fastest = core::f64::consts::TAU / (PERIOD * unit);
        let frequency = |m: usize| fastest * (m + 1) as f64 / M as f64;
        Self {
            mixture: Mixture::new(unit, longest),
            frequencies: core::array::from_fn(|m| T::from_f64(frequency(m))),
            together: [T::zero(); DECAYS],
            amplitudes: [T::zero(); M],
            periodic: false,
        }
    }

    /// All terms at the lag tau.
    pub(super) fn terms(&self, tau: T) -> Terms<T, M> {
        let turns = self.frequencies.map(|frequency| {
            let (im, re) = (frequency * tau).sin_cos();
            Complex { re, im }
        });
        Terms { decays: self.mixture.decays(tau), turns }
    }

    /// c_k as used.
    pub(super) fn shares(&self) -> &[T; DECAYS] {
        if self.periodic { &self.together } else { &self.mixture.shares }
    }

    /// h from its terms.
    pub(super) fn of(&self, terms: &Terms<T, M>) -> T {
        let h = dot(self.shares(), &terms.decays);
        if self.periodic { h + self.returning(terms) } else { h }
    }

    /// h(tau).
    pub(super) fn at(&self, tau: T) -> T {
        if self.periodic { self.of(&self.terms(tau)) } else { self.mixture.at(tau) }
    }

    /// The sum of the cosines.
    pub(super) fn returning(&self, terms: &Terms<T, M>) -> T {
        dot(&self.amplitudes, &terms.cosines())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two steps, one after the other, are one.
    #[test]
    fn terms_follow_the_lag() {
        let mut coherence = Coherence::<f64, COSINES>::new(0.5, 24.0);
        coherence.periodic = true;
        coherence.together = coherence.mixture.shares;
        coherence.amplitudes = [0.05; COSINES];
        let mut terms = coherence.terms(1.5);
        terms.follow(&coherence.terms(4.0));
        assert!((coherence.of(&terms) - coherence.at(5.5)).abs() < 1e-14);
        // Periods of 36 / m, 72 intervals of 0.5.
        let cosine = |m: u8| libm::cos(core::f64::consts::TAU * f64::from(m) * 5.5 / 36.0);
        let cosines: f64 = (1..=12).map(cosine).sum();
        assert!((coherence.at(5.5) - coherence.mixture.at(5.5) - 0.05 * cosines).abs() < 1e-14);
        coherence.periodic = false;
        assert_eq!(coherence.at(5.5), coherence.mixture.at(5.5));
        assert_eq!(coherence.of(&coherence.terms(5.5)), coherence.mixture.at(5.5));
    }
}
