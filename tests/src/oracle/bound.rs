//! The least uncertainty that any estimator can have.

use crate::wide::{self, Wide};

/// The Cramér–Rao bound of a linear functional of the phases, rad² (docs/mathematics.md; Guarnieri and
/// Tebaldini 2007): X = 2L(Γ∘Γ⁻¹ − I), var(eᵀφ) ≥ eᵀX⁺e.
///
/// `gamma` is Γ, the N×N matrix of coherences, row after row, symmetric and positive definite with
/// a unit diagonal; `looks` is L; `functional` is e, N values whose sum is 0 (only phase
/// differences are observable; the pseudo-inverse ignores any mean of e). Infinite if no chain of
/// coherent pairs joins all frames.
///
/// # Panics
/// If the lengths do not fit or Γ is singular.
pub fn crlb(gamma: &[f64], looks: f64, functional: &[f64]) -> f64 {
    let n = functional.len();
    assert_eq!(gamma.len(), n * n, "Γ must be N × N");
    let widened = |i: usize, j: usize| Wide::from(gamma[i * n + j]);
    let matrix: Vec<Vec<Wide>> = (0..n).map(|i| (0..n).map(|j| widened(i, j)).collect()).collect();
    let unit = |i, j| Wide::from(if i == j { 1.0 } else { 0.0 });
    let identity = (0..n).map(|i| (0..n).map(|j| unit(i, j)).collect()).collect();
    let inverse = wide::solve(matrix, identity).expect("Γ is singular");

    // The rows of X sum to 0. Filled up along (1, …, 1) by the mean of its diagonal, X becomes
    // invertible, and for e orthogonal to (1, …, 1) the inverse is the pseudo-inverse.
    let x =
        |i: usize, j: usize| Wide::from(2.0 * looks) * (widened(i, j) * inverse[i][j] - unit(i, j));
    let trace = (0..n).fold(Wide::ZERO, |sum, i| sum + x(i, i));
    let fill = trace / Wide::from((n * n) as f64);
    let filled = (0..n).map(|i| (0..n).map(|j| x(i, j) + fill).collect()).collect();
    let mean = functional.iter().sum::<f64>() / n as f64;
    let e: Vec<f64> = functional.iter().map(|value| value - mean).collect();
    let right = e.iter().map(|&value| vec![Wide::from(value)]).collect();
    match wide::solve(filled, right) {
        Some(solution) => e.iter().zip(solution).map(|(e, row)| e * row[0].to_f64()).sum(),
        None => f64::INFINITY,
    }
}

#[cfg(test)]
mod tests {
    use super::crlb;

    #[test]
    fn bound_of_a_random_walk() {
        let bound = |n: usize, rho: f64, looks: f64| {
            let gamma: Vec<f64> =
                (0..n * n).map(|k| rho.powi((k / n).abs_diff(k % n) as i32)).collect();
            let mut functional = vec![0.0; n];
            functional[0] -= 1.0;
            functional[n - 1] += 1.0;
            crlb(&gamma, looks, &functional)
        };
        for (n, rho, looks) in [(2, 0.5, 10.0), (5, 0.3, 100.0), (20, 0.97, 7.0), (70, 0.9, 1e4)] {
            let exact = (n - 1) as f64 * (1.0 - rho * rho) / (2.0 * looks * rho * rho);
            assert!((bound(n, rho, looks) / exact - 1.0).abs() < 1e-9);
        }
        // The table: std at λ/32 and λ/16, N = 70.
        for (looks, slow, fast) in [(100.0, 0.2398, 0.5425), (1000.0, 0.0758, 0.1716)] {
            assert!((bound(70, 0.9258, looks).sqrt() - slow).abs() < 1e-4);
            assert!((bound(70, 0.7346, looks).sqrt() - fast).abs() < 1e-4);
        }
        // Frames that nothing joins.
        assert_eq!(crlb(&[1.0, 0.0, 0.0, 1.0], 10.0, &[-1.0, 1.0]), f64::INFINITY);
    }
}
