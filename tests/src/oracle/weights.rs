//! The weights.

use super::pairs::{Pairs, pair_list};
use std::f64::consts::PI;

/// P₀, the probability that random phasors stay below the threshold b (line 806).
pub const THRESHOLD_PROBABILITY: f64 = 0.99999;

/// Number of looks of a Gaussian average that has the paper's σ: 1/√(2L) = 1/(√(8π) σ_Gauss), so
/// L = 4π σ_Gauss² (lines 814, 818). Independent pixels assumed; σ_Gauss in pixels.
pub fn gaussian_looks(sigma_px: f64) -> f64 {
    4.0 * PI * sigma_px * sigma_px
}

/// b = A₀(P₀) = √(−2σ² ln(1 − P₀)), P₀ = 0.99999, σ = 1/√(2L) (lines 800–818).
///
/// L is |M| for a mask and [`gaussian_looks`] (that is, σ = 1/(√(8π) σ_Gauss)) for images.
pub fn rayleigh_threshold(looks: f64) -> f64 {
    let sigma = 1.0 / (2.0 * looks).sqrt();
    (-2.0 * sigma * sigma * (1.0 - THRESHOLD_PROBABILITY).ln()).sqrt()
}

/// w = T(|⟨C/|C|⟩| − b), T(x) = max(x, 0) (lines 770–786).
pub fn paper_weight(phasor_modulus: f64, looks: f64) -> f64 {
    (phasor_modulus - rayleigh_threshold(looks)).max(0.0)
}

/// γ² = max(0, (Lγ̂² − 1)/(L − 1)): the squared coherence without its bias (docs/mathematics.md). Zero
/// for L ≤ 1, where nothing is known.
pub fn debiased_squared_coherence(coherence: f64, looks: f64) -> f64 {
    if looks <= 1.0 {
        return 0.0;
    }
    ((looks * coherence * coherence - 1.0) / (looks - 1.0)).max(0.0)
}

/// √(−ln 1e−5 / L): below this coherence γ̂ the Fisher weight is zero (docs/mathematics.md).
pub fn fisher_threshold(looks: f64) -> f64 {
    (-(1e-5f64.ln()) / looks).sqrt()
}

/// w = γ²/(1 − γ²) with γ² from [`debiased_squared_coherence`] and 1 − γ² not below 1e−4, so w ≤
/// 1e4; zero where γ̂ < [`fisher_threshold`]. It takes the place of the paper's w, and so enters as
/// w² (docs/mathematics.md).
pub fn fisher_weight(coherence: f64, looks: f64) -> f64 {
    if coherence < fisher_threshold(looks) {
        return 0.0;
    }
    let squared = debiased_squared_coherence(coherence, looks).min(1.0);
    squared / (1.0 - squared).max(1e-4)
}

/// Which weights the least squares use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Weighting {
    /// The paper's, [`paper_weight`] of [`Pairs::phasor`].
    Paper,
    /// [`fisher_weight`] of [`Pairs::coherence`].
    Fisher,
}

/// One weight per pair, in the order of [`pair_list`].
pub fn weights(pairs: &Pairs, weighting: Weighting, looks: f64) -> Vec<f64> {
    match weighting {
        Weighting::Paper => pairs.phasor.iter().map(|&p| paper_weight(p, looks)).collect(),
        Weighting::Fisher => pairs.coherence.iter().map(|&g| fisher_weight(g, looks)).collect(),
    }
}

/// Which frames are valid: those with at least one pair of weight > 0.
pub fn valid_frames(frames: usize, max_lag: usize, weights: &[f64]) -> Vec<bool> {
    let mut valid = vec![false; frames];
    for ((t, lag), &weight) in pair_list(frames, max_lag).into_iter().zip(weights) {
        if weight > 0.0 {
            valid[t] = true;
            valid[t + lag] = true;
        }
    }
    valid
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::oracle::fixtures::Random;
    use crate::oracle::sigma::pair_variance;
    use num_complex::Complex;

    #[test]
    fn thresholds_and_weights() {
        assert!((rayleigh_threshold(1000.0) - 0.107298).abs() < 1e-6);
        // σ = 1/√(2|M|) and 1/(√(8π) σ_Gauss) as the paper has them.
        let sigma = 1.0 / ((8.0 * PI).sqrt() * 3.0);
        let b = (-2.0 * sigma * sigma * 1e-5f64.ln()).sqrt();
        assert!((rayleigh_threshold(gaussian_looks(3.0)) - b).abs() < 1e-11);
        assert_eq!(paper_weight(0.05, 1000.0), 0.0);
        assert!((paper_weight(1.0, 1000.0) - (1.0 - 0.107298)).abs() < 1e-6);
        assert!((fisher_weight(1.0, 100.0) - 1e4).abs() < 1e-6);
        assert_eq!(fisher_weight(0.33, 100.0), 0.0);
        let squared = (100.0 * 0.25 - 1.0) / 99.0;
        assert!((fisher_weight(0.5, 100.0) - squared / (1.0 - squared)).abs() < 1e-14);
        assert!((pair_variance(0.0, 100.0) - PI * PI / 3.0).abs() < 1e-14);
        assert_eq!(pair_variance(1.0, 100.0), 0.0);
    }

    #[test]
    fn rayleigh_threshold_is_seldom_passed() {
        // Mean of L random phasors above A₀(P): with P = 0.99999 about 1 in 1e5.
        let mut random = Random(5);
        let over = (0..20_000)
            .filter(|_| {
                let sum: Complex<f64> =
                    (0..50).map(|_| Complex::from_polar(1.0, 2.0 * PI * random.uniform())).sum();
                (sum / 50.0).norm() > rayleigh_threshold(50.0) / 5.0f64.sqrt()
            })
            .count();
        // b/√5 is the threshold of probability 1e−5^(1/5) = 0.1.
        assert!((1850..2150).contains(&over), "{over}");
    }
}
