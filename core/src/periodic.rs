//! Coherence that comes back: non-negative cosines beside the decays.
//!
//! h(tau) = sum of c_k exp(-r_k tau) + sum over m = 1 ... N-1 of a_m cos(2 pi nu_m tau), nu_m = m / (4 longest lag),
//! c_k, a_m >= 0. Each term is positive definite, so their sum is; periodic motion of the scatterers
//! (a pulse, a vibration) needs it.

use crate::coherence::{DECAYS, LARGEST_SHARE, Lag, Mixture, PASSES, RIDGE, information};
use crate::coherence::{nonneg_least_squares, sum};
use crate::scalar::Real;
use crate::square::{Square, add_times, dot};

/// Share that every term begins with.
const FIRST_SHARE: f64 = 1e-3;

/// Unknowns for a series of `frames` frames: decays and cosines.
pub(crate) const fn unknowns(frames: usize) -> usize {
    DECAYS + frames.saturating_sub(1)
}

/// Numbers that [`Dictionary`] needs for `frames` frames.
pub(crate) const fn reals(frames: usize) -> usize {
    let unknowns = unknowns(frames);
    unknowns * (unknowns + 3)
}

/// The terms of h and their shares.
#[derive(Debug)]
pub(crate) struct Dictionary<'a, T> {
    mixture: Mixture<T>,
    longest: f64,
    shares: &'a mut [T],
    column: &'a mut [T],
    right: &'a mut [T],
    normal: Square<'a, T>,
}

impl<'a, T: Real> Dictionary<'a, T> {
    /// The decays of `mixture` and the cosines of `frames` frames, whose longest lag is `longest`, in a buffer of
    /// [`reals`] numbers.
    pub(crate) fn new(
        mixture: Mixture<T>,
        frames: usize,
        longest: f64,
        buffer: &'a mut [T],
    ) -> Self {
        let unknowns = unknowns(frames).min(buffer.len() / 3);
        let (shares, rest) = buffer.split_at_mut(unknowns);
        let (column, rest) = rest.split_at_mut(unknowns);
        let (right, rest) = rest.split_at_mut(unknowns);
        Self { mixture, longest, shares, column, right, normal: Square::new(rest, unknowns) }
    }

    /// Fit all shares to the lag means.
    pub(crate) fn fit(&mut self, means: &[Lag<T>]) {
        self.normal.fill_with(|_, _| T::zero());
        self.right.fill(T::zero());
        let weight = |lag: &Lag<T>| lag.pairs * information(lag.mean);
        let heaviest = means.iter().fold(T::zero(), |most, lag| most.max(weight(lag)));
        for lag in means {
            self.fill_column(lag.tau);
            for (k, &e) in self.column.iter().enumerate() {
                let weighted = weight(lag) / heaviest * e;
                add_times(self.normal.row_mut(k), weighted, self.column);
                if let Some(place) = self.right.get_mut(k) {
                    *place = weighted.mul_add(lag.mean, *place);
                }
            }
        }
        for k in 0..self.normal.order() {
            let ridged = self.normal.at(k, k) + T::from_f64(RIDGE);
            self.normal.set(k, k, ridged);
        }
        self.shares.fill(T::from_f64(FIRST_SHARE));
        nonneg_least_squares(&self.normal, self.right, self.shares, PASSES);
        let scale = (T::from_f64(LARGEST_SHARE) / sum(self.shares)).min(T::one());
        for share in self.shares.iter_mut() {
            *share = *share * scale;
        }
    }

    /// h(tau).
    pub(crate) fn at(&mut self, tau: T) -> T {
        self.fill_column(tau);
        dot(self.shares, self.column)
    }

    fn fill_column(&mut self, tau: T) {
        let (decays, cosines) = self.column.split_at_mut(DECAYS.min(self.column.len()));
        decays.copy_from_slice(self.mixture.decays(tau).get(..decays.len()).unwrap_or(&[]));
        let turn = core::f64::consts::TAU * tau.to_f64() / (4.0 * self.longest);
        for (m, place) in (1..).zip(cosines) {
            *place = T::from_f64(libm::cos(turn * f64::from(m)));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_period_is_found() {
        let h = |tau: f64| {
            0.6 * libm::exp(-0.08 * tau) + 0.4 * libm::cos(core::f64::consts::TAU * tau / 20.0)
        };
        let means: [Lag<f64>; 69] = core::array::from_fn(|i| {
            let tau = (i + 1) as f64;
            Lag { tau, mean: h(tau), pairs: (69 - i) as f64 }
        });
        let mut buffer = [0.0; reals(70)];
        let mut dictionary = Dictionary::new(Mixture::new(1.0, 69.0), 70, 69.0, &mut buffer);
        dictionary.fit(&means);
        for lag in means {
            // At the longest lags, which few pairs have, the sum of the shares limits it.
            assert!((dictionary.at(lag.tau) - lag.mean).abs() < 0.06, "{lag:?}");
        }
    }
}
