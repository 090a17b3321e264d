//! Uncertainty of the phases.

use super::least_squares::{Regularisation, add_normal, difference_matrix, gamma_2};
use super::pairs::pair_list;
use super::weights::{debiased_squared_coherence, valid_frames};
use crate::wide::{self, Wide};
use std::f64::consts::PI;

/// Variance of arg⟨C⟩ of one pair, rad²: (1 − γ²)/(2Lγ²), γ² from [`debiased_squared_coherence`],
/// not above π²/3 (a phase that is anywhere in −π … π) (docs/mathematics.md).
pub fn pair_variance(coherence: f64, looks: f64) -> f64 {
    let squared = debiased_squared_coherence(coherence, looks).min(1.0);
    let variance = (1.0 - squared) / (2.0 * looks * squared);
    // With γ² = 0 the quotient is infinite, or not a number should L be 0 as well.
    if variance < PI * PI / 3.0 { variance } else { PI * PI / 3.0 }
}

/// Standard deviation of the phases that [`solve`] returns, that is of φ_n − the mean of the valid
/// reference frames; rad, one per frame (docs/mathematics.md; pairs taken as independent).
///
/// Cov φ = A⁻¹ (SᵀW²VW²S + μ₂²Γ₂ᵀΓ₂) A⁻¹ with A = SᵀW²S + μ₂²Γ₂ᵀΓ₂, V the diagonal of
/// [`pair_variance`]: Γ₂ counts as a measurement of variance 1/μ₂², and in place of Γ₁ the phase
/// of the gauge frame is fixed at 0. With e_n picking φ_n − the reference mean and ψ = A⁻¹e_n the
/// variance is e_nᵀ Cov e_n = Σ_pairs w⁴ v (ψ_t − ψ_{t+Δt})² + μ₂² Σ_i (ψ_i − ψ_{i−1})², and this is
/// summed. Infinite for all frames if no reference frame is valid, or if A is singular (only with
/// μ₂ = 0).
///
/// `coherence` (γ̂) and `weights` are in the order of [`pair_list`]; `looks` is L.
///
/// # Panics
/// If the lengths do not fit.
///
/// [`solve`]: super::solve
pub fn phase_sigma(
    frames: usize,
    max_lag: usize,
    coherence: &[f64],
    weights: &[f64],
    looks: f64,
    regularisation: &Regularisation,
) -> Vec<f64> {
    let s = difference_matrix(frames, max_lag);
    assert_eq!(coherence.len(), s.len(), "one coherence per pair");
    let Regularisation { mu_2, gauge, reference_frames, .. } = *regularisation;
    let (zero, one) = (Wide::ZERO, Wide::from(1.0));

    let mut normal = vec![vec![zero; frames]; frames];
    add_normal(&mut normal, &s, weights);
    add_normal(&mut normal, &gamma_2(frames), &vec![mu_2; frames]);

    // Column n of `functionals` is e_n.
    let valid = valid_frames(frames, max_lag, weights);
    let reference: Vec<usize> = (0..reference_frames).filter(|&frame| valid[frame]).collect();
    if reference.is_empty() {
        return vec![f64::INFINITY; frames];
    }
    let share = one / Wide::from(reference.len() as f64);
    let entry = |frame: usize, n: usize| {
        let own = if frame == n { one } else { zero };
        if reference.contains(&frame) { own - share } else { own }
    };
    let mut functionals: Vec<Vec<Wide>> =
        (0..frames).map(|frame| (0..frames).map(|n| entry(frame, n)).collect()).collect();

    // φ_gauge = 0: its row and column become those of the identity.
    for row in &mut normal {
        row[gauge] = zero;
    }
    normal[gauge] = vec![zero; frames];
    normal[gauge][gauge] = one;
    functionals[gauge] = vec![zero; frames];

    let Some(psi) = wide::solve(normal, functionals) else {
        return vec![f64::INFINITY; frames];
    };
    let mut variance = vec![0.0; frames];
    for (((t, lag), &weight), &coherence) in
        pair_list(frames, max_lag).into_iter().zip(weights).zip(coherence)
    {
        for (n, variance) in variance.iter_mut().enumerate() {
            let gain = weight * weight * (psi[t][n] - psi[t + lag][n]).to_f64();
            *variance += gain * gain * pair_variance(coherence, looks);
        }
    }
    for i in 1..frames {
        for (n, variance) in variance.iter_mut().enumerate() {
            let gain = mu_2 * (psi[i][n] - psi[i - 1][n]).to_f64();
            *variance += gain * gain;
        }
    }
    variance.iter().map(|variance| variance.sqrt()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::oracle::ensemble::mask_mean;
    use crate::oracle::fixtures::{ramp, walking, worst};
    use crate::oracle::least_squares::solve;
    use crate::oracle::weights::{Weighting, weights};

    #[test]
    fn sigma_is_that_of_the_linear_map() {
        // φ is linear in c: perturb each c in turn, and add up.
        let n = 9;
        let series = walking(10, 10, &ramp(n, 0.1), 0.8, 4);
        let pairs = mask_mean(&series, &[true; 100]).up_to_lag(6);
        let w = weights(&pairs, Weighting::Fisher, 100.0);
        let plain = Regularisation { mu_2: 1e-7, ..Regularisation::paper(n) };
        let sigma = phase_sigma(n, 6, &pairs.coherence, &w, 100.0, &plain);
        let mut variance = vec![0.0; n];
        for p in 0..w.len() {
            let mut c = vec![0.0; w.len()];
            c[p] = 1.0;
            for (sum, gain) in variance.iter_mut().zip(solve(n, 6, &c, &w, &plain)) {
                *sum += gain * gain * pair_variance(pairs.coherence[p], 100.0);
            }
        }
        for (sigma, variance) in sigma.iter().zip(variance) {
            assert!((sigma - variance.sqrt()).abs() < 1e-9);
        }
        // A frame without any pair: Γ₂ alone holds it between its neighbours, each by 1/μ₂.
        let list = pair_list(n, n - 1);
        let w: Vec<f64> =
            list.iter().map(|&(t, lag)| if t == 6 || t + lag == 6 { 0.0 } else { 1.0 }).collect();
        let sigma =
            phase_sigma(n, n - 1, &vec![0.9; w.len()], &w, 100.0, &Regularisation::paper(n));
        assert!((sigma[6] - 1000.0 / 2f64.sqrt()).abs() < 1.0, "{sigma:?}");
        assert!(sigma[5] < 0.1 && sigma[8] < 0.1);
    }

    #[test]
    fn sigma_of_two_frames() {
        // φ₁ − (φ₀ + φ₁)/2 is half the one difference, the mean of c (weight 1, variance v) and of
        // Γ₂'s 0 (weight μ₂², variance 1/μ₂²).
        let sigma = phase_sigma(2, 1, &[0.8], &[1.0], 50.0, &Regularisation::paper(2));
        let expected = 0.5 * (pair_variance(0.8, 50.0) + 1e-6).sqrt() / (1.0 + 1e-6);
        assert!(worst(&sigma, &[expected, expected]) < 1e-12);
    }
}
