//! How far a pair of frames can be trusted: the paper's weight, the Fisher weight, the looks.

use crate::ensemble::PairMean;
use crate::scalar::Scalar;
use num_complex::Complex;

/// |C|^2 below which a pixel counts as dark: the smallest normal `f32`, under which reciprocal roots
/// lose their digits.
const DARK: f64 = f32::MIN_POSITIVE as f64;

/// C/|C|, and 0 where C is 0 or |C| below 1e-19 (dark or masked pixels).
#[inline(always)]
#[must_use]
pub fn unit_phasor<T: Scalar>(c: Complex<T>) -> Complex<T> {
    let (square, dark) = (c.re.mul_add(c.re, c.im * c.im), T::from_f64(DARK));
    let inverse = T::select(dark.lt(square), square.max(dark).inverse_sqrt(), T::zero());
    Complex { re: c.re * inverse, im: c.im * inverse }
}

/// Threshold b below which the mean of `looks` random unit phasors stays with probability `p0`.
///
/// The modulus follows a Rayleigh distribution (paper lines 795-806) with
/// sigma = 1/sqrt(2 looks) (line 814), whose inverse is
/// b = A_0(P_0) = sqrt(-2 sigma^2 ln(1 - P_0)) = sqrt(-ln(1 - P_0) / looks).
#[must_use]
pub fn rayleigh_threshold(looks: f64, p0: f64) -> f64 {
    libm::sqrt(-libm::log(1.0 - p0) / looks)
}

/// Nominal looks of a Gaussian average: 4 pi sigma_px^2, from sigma = 1/(sqrt(8 pi) sigma_Gauss)
/// (paper line 818) and sigma = 1/sqrt(2 looks). `sigma_px` in pixels.
#[must_use]
pub fn gaussian_looks(sigma_px: f64) -> f64 {
    4.0 * core::f64::consts::PI * sigma_px * sigma_px
}

/// Effective looks of a weighted average over *correlated* pixels:
/// L = 1 / sum over x,x' of w(x) w(x') |mu(x-x')|^2, with sum of w(x) = 1 and mu the spatial
/// coherence of the field. `terms` yields the products w(x) w(x') |mu(x-x')|^2.
///
/// Speckle filtered by an aperture is correlated between neighbours, so there are fewer
/// independent looks than pixels. 0 for no terms.
#[must_use]
pub fn effective_looks(terms: impl Iterator<Item = f64>) -> f64 {
    let sum: f64 = terms.sum();
    if sum > 0.0 { 1.0 / sum } else { 0.0 }
}

/// |gamma|^2 without the bias of a finite number of looks: (L |gamma|^2 - 1) / (L - 1), at least 0. With
/// fewer than two looks nothing is known of it: 0.
#[inline(always)]
#[must_use]
pub fn debias<T: Scalar>(coherence_squared: T, looks: f64) -> T {
    if looks < 2.0 {
        return T::zero();
    }
    let share = 1.0 / (looks - 1.0);
    let unbiased = coherence_squared.mul_add(T::from_f64(looks * share), T::from_f64(-share));
    unbiased.max(T::zero())
}

/// Variance, in rad^2, of arg⟨C⟩ for |gamma|^2 (debiased) and `looks` independent looks:
/// (1 - |gamma|^2) / (2 L |gamma|^2), but never above pi^2/3, that of a uniformly random phase.
/// (Rodriguez & Martin 1992, high-coherence limit of the phase's Cramer-Rao bound.)
#[inline(always)]
#[must_use]
pub fn pair_variance<T: Scalar>(coherence_squared: T, looks: f64) -> T {
    let random = core::f64::consts::PI * core::f64::consts::PI / 3.0;
    // Below this coherence the ratio exceeds the cap; it keeps the division away from 0/0.
    let floor = T::from_f64(1.0 / (1.0 + 2.0 * looks * random));
    let square = coherence_squared.max(floor);
    (T::one() - square).max(T::zero()) / (square * T::from_f64(2.0 * looks))
}

/// Which weight multiplies a pair's residual (its square enters the normal equations).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Weighting {
    /// w = T(|⟨C/|C|⟩| - b) with T(x) = max(x, 0) (paper lines 769-784, read as a mean and its modulus).
    Paper,
    /// w = |gamma|^2 / (1 - |gamma|^2) with |gamma|^2 debiased, 0 where |gamma| < b: the Fisher
    /// information of the pair's phase. That it enters squared is an empirical choice; pairs are
    /// not independent.
    Fisher,
}

/// The weight function with its constants worked out, one for all pairs and pixels.
#[derive(Clone, Copy, Debug)]
pub struct Weights {
    weighting: Weighting,
    threshold: f64,
    looks: f64,
}

impl Weights {
    /// 1 - |gamma|^2 is not taken for smaller than this, so that weights stay below 1e4 and `f32`
    /// can hold their squares beside mu_2^2 = 1e-6.
    const SMALLEST_LOSS: f64 = 1e-4;

    /// `looks` sets the threshold b (with probability `p0`) and the debiasing.
    #[must_use]
    pub fn new(weighting: Weighting, looks: f64, p0: f64) -> Self {
        Self { weighting, threshold: rayleigh_threshold(looks, p0), looks }
    }

    /// Which weight this is.
    #[must_use]
    pub const fn weighting(&self) -> Weighting {
        self.weighting
    }

    /// b.
    #[must_use]
    pub const fn threshold(&self) -> f64 {
        self.threshold
    }

    /// The paper's weight of a mean unit phasor.
    #[inline(always)]
    #[must_use]
    pub fn paper<T: Scalar>(&self, phasor: Complex<T>) -> T {
        let modulus = phasor.re.mul_add(phasor.re, phasor.im * phasor.im).sqrt();
        (modulus - T::from_f64(self.threshold)).max(T::zero())
    }

    /// The Fisher weight of |gamma|^2 (not debiased).
    #[inline(always)]
    #[must_use]
    pub fn fisher<T: Scalar>(&self, coherence_squared: T) -> T {
        let square = debias(coherence_squared, self.looks);
        let loss = (T::one() - square).max(T::from_f64(Self::SMALLEST_LOSS));
        let random = coherence_squared.lt(T::from_f64(self.threshold * self.threshold));
        T::select(random, T::zero(), square / loss)
    }

    /// The weight of a pair.
    #[inline(always)]
    #[must_use]
    pub fn weight<T: Scalar>(&self, pair: &PairMean<T>) -> T {
        match self.weighting {
            Weighting::Paper => self.paper(pair.phasor),
            Weighting::Fisher => self.fisher(pair.coherence_squared()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::params::RANDOM_PROBABILITY;

    #[test]
    fn threshold_is_the_inverse_of_the_rayleigh_distribution() {
        for looks in [1.0, 113.1, 5000.0] {
            let (b, variance) = (rayleigh_threshold(looks, 0.99999), 1.0 / (2.0 * looks));
            let p0 = 1.0 - libm::exp(-b * b / (2.0 * variance));
            assert!((p0 - 0.99999).abs() < 1e-12);
        }
    }

    #[test]
    fn gaussian_sigma_of_the_paper() {
        let sigma = 1.0 / (libm::sqrt(8.0 * core::f64::consts::PI) * 3.0);
        assert!((1.0 / libm::sqrt(2.0 * gaussian_looks(3.0)) - sigma).abs() < 1e-15);
    }

    #[test]
    fn weights_are_cut_off_at_the_threshold() {
        let weights = Weights::new(Weighting::Paper, 100.0, RANDOM_PROBABILITY);
        let b = weights.threshold();
        let of = |modulus: f64| weights.paper(Complex::from_polar(modulus, 0.7));
        assert_eq!((of(0.0), of(b * 0.999)), (0.0, 0.0));
        assert!((of(b + 0.25) - 0.25).abs() < 1e-14);
        let fisher = Weights::new(Weighting::Fisher, 100.0, RANDOM_PROBABILITY);
        assert_eq!(fisher.fisher(b * b * 0.999), 0.0);
        assert!(fisher.fisher(b * b * 1.001) > 0.0);
        assert!((fisher.fisher(1.0_f64) - 1e4).abs() < 1e-6, "capped");
        // (100 * 0.5 - 1) / 99 = 0.4949.., over its complement 0.5050..
        assert!((fisher.fisher(0.5_f64) - 49.0 / 50.0).abs() < 1e-12);
    }

    #[test]
    fn unit_phasors() {
        assert_eq!(unit_phasor(Complex::new(0.0_f32, 0.0)), Complex::new(0.0, 0.0));
        assert!(
            (unit_phasor(Complex::new(3.0_f64, -4.0)) - Complex::new(0.6, -0.8)).norm() < 1e-15
        );
    }

    #[test]
    fn variance_is_capped_at_that_of_a_random_phase() {
        let random = core::f64::consts::PI * core::f64::consts::PI / 3.0;
        assert!((pair_variance(0.0_f64, 20.0) - random).abs() < 1e-9);
        assert!((pair_variance(0.8_f64, 20.0) - 0.2 / (40.0 * 0.8)).abs() < 1e-15);
        assert_eq!(pair_variance(1.0_f64, 20.0), 0.0);
    }

    #[test]
    fn independent_pixels_count_fully_and_equal_ones_once() {
        let n = 16;
        let independent = (0..n * n).map(|i| if i / n == i % n { 1.0 / 256.0 } else { 0.0 });
        assert!((effective_looks(independent) - 16.0).abs() < 1e-12);
        assert!((effective_looks((0..n * n).map(|_| 1.0 / 256.0)) - 1.0).abs() < 1e-12);
    }
}
