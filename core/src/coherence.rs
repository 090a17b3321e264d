//! How the speckle pattern forgets: a model of the coherence matrix, fitted to the data.
//!
//! The phases of a series are known best when the coherence between its frames is known, but the
//! sample coherence |⟨C⟩| is biased upward where there is none. It is therefore *modelled*:
//!
//! ```text
//! Gamma_ij = s_i s_j h(|t_i - t_j|)   for i != j,   1 on the diagonal
//! h(tau)   = sum over k of c_k exp(-r_k tau),   c_k >= 0,   sum of c_k < 1
//! ```
//!
//! s_i in 0..=1 is the quality of frame i ([`crate::quality`]). The rate r_0 = 0 is a static part that
//! never decorrelates, the others are spread evenly in log r; what is missing to 1 is noise. Such a
//! matrix is positive definite whatever the c_k are. Random walks of the scatterers give one decay
//! (`exp(-(2 k sigma)^2 tau / 2)`), additive noise lowers the sum.

use crate::scalar::Real;
use crate::square::{Square, add_times, dot};

/// Decays of the batch estimator: the static part and 13 rates.
pub const DECAYS: usize = 14;

/// Largest sum of the c_k: the model keeps a noise of at least 0.5 %, so that its inverse stays
/// within `f32`.
pub const LARGEST_SHARE: f64 = 0.995;

/// Fastest decay, per shortest interval between frames.
const FASTEST: f64 = 2.5;

/// Slowest decay over the longest lag.
const SLOWEST: f64 = 0.3;

/// Halvings of the ratio of two rates: 570 to below 1.0001.
const HALVINGS: usize = 16;

/// Passes of the non-negative least squares over all unknowns.
pub const PASSES: usize = 300;

/// h(tau): a mixture of `K` exponential decays.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mixture<T, const K: usize = DECAYS> {
    /// r_k, per unit of time: 0, then ascending.
    pub rates: [T; K],
    /// c_k.
    pub shares: [T; K],
}

impl<T: Real, const K: usize> Mixture<T, K> {
    /// Rates for lags from `unit` to `longest` (same unit of time, both above 0):
    /// 0, and K - 1 from 0.3/longest to 2.5/unit in equal ratios. All shares are 1/K.
    #[must_use]
    pub fn new(unit: f64, longest: f64) -> Self {
        let (slow, fast) = (SLOWEST / longest, FASTEST / unit);
        let steps = K.saturating_sub(2).max(1) as f64;
        let rate = |k: usize| {
            let along = k.saturating_sub(1) as f64 / steps;
            if k == 0 { 0.0 } else { slow * libm::pow(fast / slow, along) }
        };
        Self {
            rates: core::array::from_fn(|k| T::from_f64(rate(k))),
            shares: [T::from_f64(1.0 / K as f64); K],
        }
    }

    /// exp(-r_k tau) of every rate.
    #[inline]
    #[must_use]
    pub fn decays(&self, tau: T) -> [T; K] {
        self.rates.map(|rate| (-(rate * tau)).exp())
    }

    /// h(tau).
    #[inline]
    #[must_use]
    pub fn at(&self, tau: T) -> T {
        dot(&self.shares, &self.decays(tau))
    }

    /// The static share c_0.
    #[must_use]
    pub fn floor(&self) -> T {
        self.shares.first().copied().unwrap_or(T::zero())
    }

    /// The share of noise, 1 - sum of c_k.
    #[must_use]
    pub fn noise(&self) -> T {
        T::one() - sum(&self.shares)
    }

    /// Rate of the moving part: one over the time after which it has fallen to 1/e, per unit of time. 0 where less
    /// than a hundredth moves.
    #[must_use]
    pub fn decay_rate(&self) -> T {
        let whole = sum(&self.shares) - self.floor();
        if whole < T::from_f64(1e-2) {
            return T::zero();
        }
        // The time lies between those of the fastest and of the slowest term.
        let ends = (self.rates.last(), self.rates.get(1));
        let (Some(&fast), Some(&slow)) = ends else { return T::zero() };
        let left = whole * T::from_f64(core::f64::consts::E.recip());
        self.rate_to(self.floor() + left, slow, fast)
    }

    /// One over the lag at which h has fallen to `value`, between the rates `slow` and `fast` (above 0), per unit of time:
    /// 1e-4 of it, or the nearer end if it is not between them.
    #[must_use]
    pub fn rate_to(&self, value: T, slow: T, fast: T) -> T {
        let (mut low, mut high) = (slow, fast);
        for _ in 0..HALVINGS {
            let middle = (low * high).sqrt();
            if self.at(T::one() / middle) > value {
                high = middle;
            } else {
                low = middle;
            }
        }
        (low * high).sqrt()
    }

    /// Fit the shares to mean coherences: weighted non-negative least squares, twice, because the
    /// weights (number of pairs over the variance of a coherence) need the model.
    pub fn fit<I>(&mut self, lags: I)
    where
        I: Iterator<Item = Lag<T>> + Clone,
    {
        let mut first = true;
        for _ in 0..2 {
            let mut normal = Normal::<T, K>::new();
            let heaviest = lags.clone().fold(T::zero(), |w, lag| w.max(self.weight(&lag, first)));
            if heaviest <= T::zero() {
                return;
            }
            for lag in lags.clone() {
                normal.add(&self.decays(lag.tau), lag.mean, self.weight(&lag, first) / heaviest);
            }
            self.shares = normal.solve(self.shares, PASSES);
            limit_sum(&mut self.shares);
            first = false;
        }
    }

    /// Number of pairs over the variance of one coherence; by the mean itself before the first fit.
    fn weight(&self, lag: &Lag<T>, first: bool) -> T {
        let h = if first { lag.mean } else { self.at(lag.tau) };
        lag.pairs * information(h)
    }
}

/// The mean coherence of the pairs with the same lag.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lag<T> {
    /// |t_i - t_j|.
    pub tau: T,
    /// Their mean, with the qualities of the frames as weights.
    pub mean: T,
    /// Sum of the weights.
    pub pairs: T,
}

/// 1 / (variance of a coherence h over many looks, and a hundredth for what the model cannot follow):
/// 1 / ((1 - h^2)^2 / 2 + 0.02), h cut to 0..=0.999.
#[inline]
#[must_use]
pub fn information<T: Real>(h: T) -> T {
    let h = h.max(T::zero()).min(T::from_f64(0.999));
    let loss = T::one() - h * h;
    T::one() / (loss * loss * T::from_f64(0.5) + T::from_f64(0.02))
}

/// Normal equations of a mixture fit, which pairs can join one after the other.
#[derive(Clone, Copy, Debug)]
pub struct Normal<T, const K: usize> {
    matrix: [[T; K]; K],
    right: [T; K],
}

impl<T: Real, const K: usize> Normal<T, K> {
    /// No pairs.
    #[must_use]
    pub fn new() -> Self {
        Self { matrix: [[T::zero(); K]; K], right: [T::zero(); K] }
    }

    /// No pairs, and each share is held towards 0 as if by a coherence 0 that counts `strength` times.
    #[must_use]
    pub fn held(strength: T) -> Self {
        let mut normal = Self::new();
        for (k, row) in normal.matrix.iter_mut().enumerate() {
            if let Some(place) = row.get_mut(k) {
                *place = strength;
            }
        }
        normal
    }

    /// A coherence `mean` at the lag with these decays counts `weight` times.
    pub fn add(&mut self, decays: &[T; K], mean: T, weight: T) {
        for ((row, right), &e) in self.matrix.iter_mut().zip(&mut self.right).zip(decays) {
            let weighted = weight * e;
            add_times(row, weighted, decays);
            *right = weighted.mul_add(mean, *right);
        }
    }

    /// All that was added counts `factor` times as much.
    pub fn scale(&mut self, factor: T) {
        for place in self.matrix.as_flattened_mut().iter_mut().chain(&mut self.right) {
            *place = *place * factor;
        }
    }

    /// What both have been given.
    pub fn join(&mut self, other: &Self) {
        let own = self.matrix.as_flattened_mut().iter_mut().chain(&mut self.right);
        for (place, &value) in own.zip(other.matrix.as_flattened().iter().chain(&other.right)) {
            *place += value;
        }
    }

    /// Rows of the matrix with their right sides.
    pub(crate) fn rows(&self) -> impl Iterator<Item = (&[T; K], T)> {
        self.matrix.iter().zip(self.right.iter().copied())
    }

    /// The largest element of the matrix.
    #[must_use]
    pub fn largest(&self) -> T {
        self.matrix.as_flattened().iter().fold(T::zero(), |most, &x| most.max(x))
    }

    /// Shares that fit best, starting from `shares`.
    #[must_use]
    pub fn solve(mut self, mut shares: [T; K], passes: usize) -> [T; K] {
        for (k, row) in self.matrix.iter_mut().enumerate() {
            if let Some(place) = row.get_mut(k) {
                *place += T::from_f64(RIDGE);
            }
        }
        let matrix = Square::new(self.matrix.as_flattened_mut(), K);
        nonneg_least_squares(&matrix, &self.right, &mut shares, passes);
        shares
    }
}

impl<T: Real, const K: usize> Default for Normal<T, K> {
    fn default() -> Self {
        Self::new()
    }
}

/// Added to the diagonal of the normal equations, whose weights are at most 1.
pub(crate) const RIDGE: f64 = 1e-7;

/// Minimise c^T H c / 2 - b^T c for c >= 0 by descent along one unknown after the other.
///
/// No branches and a fixed number of passes; neighbouring decays are so alike that the last digits of
/// c are left open, h itself is not.
pub fn nonneg_least_squares<T: Real>(h: &Square<'_, T>, b: &[T], c: &mut [T], passes: usize) {
    for _ in 0..passes {
        for (k, &right) in b.iter().enumerate() {
            let row = h.row(k);
            let (Some(&own), Some(&before)) = (row.get(k), c.get(k)) else { break };
            let next = (right + own * before - dot(row, c)) / own;
            if let Some(place) = c.get_mut(k) {
                *place = T::zero().max(next);
            }
        }
    }
}

/// Scale the shares so that they sum to at most [`LARGEST_SHARE`].
pub(crate) fn limit_sum<T: Real>(shares: &mut [T]) {
    let (sum, most) = (sum(shares), T::from_f64(LARGEST_SHARE));
    if sum > most {
        for share in shares {
            *share = *share * (most / sum);
        }
    }
}

/// Sum of all.
pub(crate) fn sum<T: Real>(values: &[T]) -> T {
    values.iter().fold(T::zero(), |sum, &x| sum + x)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Lag means of h(tau) without noise, as 70 frames have them.
    fn lags<T: Real>(h: impl Fn(f64) -> f64 + Clone) -> impl Iterator<Item = Lag<T>> + Clone {
        (1..70).map(move |lag| Lag {
            tau: T::from_f64(f64::from(lag)),
            mean: T::from_f64(h(f64::from(lag))),
            pairs: T::from_f64(f64::from(70 - lag)),
        })
    }

    fn follows<T: Real>(h: impl Fn(f64) -> f64 + Clone, error: f64) {
        let mut mixture = Mixture::<T>::new(1.0, 69.0);
        mixture.fit(lags(h.clone()));
        for tau in 1..70 {
            let got = mixture.at(T::from_f64(f64::from(tau))).to_f64();
            assert!((got - h(f64::from(tau))).abs() < error, "{tau}: {got}");
        }
        assert!(mixture.shares.iter().all(|&c| c >= T::zero()));
        assert!(mixture.noise() > T::from_f64(0.0049));
    }

    #[test]
    fn decay_noise_and_floor_are_followed() {
        for rate in [0.0771, 0.308] {
            // What the distance of the rates and the passes leave.
            follows::<f64>(move |tau| libm::exp(-rate * tau), 0.013);
            follows::<f64>(move |tau| 0.5 * libm::exp(-rate * tau), 0.013);
            follows::<f64>(move |tau| 0.2 + 0.6 * libm::exp(-rate * tau), 0.013);
            follows::<f32>(move |tau| 0.2 + 0.6 * libm::exp(-rate * tau), 0.013);
        }
        follows::<f64>(|_| 0.0, 1e-6);
        follows::<f64>(|_| 1.0, 0.0051);
    }

    #[test]
    fn shares_tell_noise_floor_and_rate() {
        let mut mixture = Mixture::<f64>::new(1.0, 69.0);
        mixture.fit(lags(|tau| 0.3 + 0.5 * libm::exp(-0.3 * tau)));
        assert!((mixture.floor() - 0.3).abs() < 0.01, "{mixture:?}");
        assert!((mixture.noise() - 0.2).abs() < 0.02, "{mixture:?}");
        assert!((mixture.decay_rate() / 0.3 - 1.0).abs() < 0.05, "{mixture:?}");
    }

    #[test]
    fn negative_solutions_are_cut() {
        let mut data = [2.0, 1.0, 1.0, 2.0];
        let h = Square::new(&mut data, 2);
        let mut c = [1.0_f64, 1.0];
        nonneg_least_squares(&h, &[1.0, -1.0], &mut c, 50);
        assert!((c[0] - 0.5).abs() < 1e-12 && c[1] == 0.0, "{c:?}");
    }

    #[test]
    fn nothing_to_fit_changes_nothing() {
        let mut mixture = Mixture::<f64>::new(1.0, 10.0);
        let before = mixture;
        mixture.fit(core::iter::empty());
        assert_eq!(mixture, before);
    }
}
