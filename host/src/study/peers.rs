//! What others estimate from the same cross-spectra: phase linking as satellite interferometry (InSAR) does it.
//!
//! All start from the normalised sample coherence gamma, N x N, and give the phases of a vector theta:
//!
//! | | theta |
//! |---|---|
//! | EVD | eigenvector of the largest eigenvalue of gamma (Fornaro et al., IEEE TGRS 53, 2015) |
//! | EMI | eigenvector of the smallest eigenvalue of abs(gamma)^-1 o gamma (Ansari et al., IEEE TGRS 56, 2018) |
//! | EMI, tapered | the same, gamma tapered to zero at long lags and shrunk towards 1 on the diagonal |
//! | COFI, banded | least squares of gamma and abs(gamma) theta theta^H over lags up to 16, by majorisation and minimisation (COFI-PL, arXiv 2403.08646) |
//!
//! abs(gamma) of few looks has no positive inverse; EMI takes it with the smallest load on the diagonal that makes it
//! positive definite. The load is added to gamma itself, so that exact coherences still give exact phases.

use nalgebra::{Complex, DMatrix, SymmetricEigen};
use num_complex::Complex64;
use phasewalk_core::chain::unwrap_chain;

/// Estimators of others.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Peer {
    /// Principal eigenvector.
    Evd,
    /// Eigendecomposition of the inverse coherence.
    Emi,
    /// EMI with a tapered and shrunk coherence.
    TaperedEmi,
    /// Banded covariance fitting.
    Cofi,
}

/// Lag at which the taper has fallen to exp(-1/2), and to which the fit of covariances reaches, frames.
const REACH: usize = 16;

/// Share of the unit matrix in the shrunk coherence.
const SHRINKAGE: f64 = 0.1;

/// Smallest eigenvalue that is left to abs(gamma).
const DEFINITE: f64 = 0.01;

/// Most steps of the fit of covariances.
const STEPS: usize = 400;

/// Largest change of a component in one step at which it ends.
const SETTLED: f64 = 1e-6;

type Matrix = DMatrix<Complex64>;

impl Peer {
    /// Phases against the first frame, unwrapped in time, from C, N x N.
    #[must_use]
    pub fn phases(self, cross: &[Complex64], times: &[f64]) -> Vec<f64> {
        let n = times.len();
        let gamma = normalised(cross, n);
        let theta = match self {
            Self::Evd => eigenvector(gamma, |values| values.imax()),
            Self::Emi => inverse_weighted(gamma),
            Self::TaperedEmi => inverse_weighted(tapered(&gamma)),
            Self::Cofi => fitted(&gamma),
        };
        let mut phases: Vec<f64> = theta.iter().map(|z| z.arg()).collect();
        unwrap_chain(&mut phases, times, &vec![1.0; n]);
        let first = phases[0];
        phases.iter().map(|phase| phase - first).collect()
    }
}

fn normalised(cross: &[Complex64], n: usize) -> Matrix {
    let power = |i: usize| cross[i * n + i].re.max(f64::MIN_POSITIVE);
    Matrix::from_fn(n, n, |i, j| cross[i * n + j] / (power(i) * power(j)).sqrt())
}

/// The eigenvector of the eigenvalue whose place `choose` tells.
fn eigenvector(
    matrix: Matrix,
    choose: impl Fn(&nalgebra::DVector<f64>) -> usize,
) -> Vec<Complex64> {
    let eigen = SymmetricEigen::new(matrix);
    eigen.eigenvectors.column(choose(&eigen.eigenvalues)).iter().copied().collect()
}

/// gamma with its lags tapered by a Gaussian, shrunk towards the unit matrix.
fn tapered(gamma: &Matrix) -> Matrix {
    let n = gamma.nrows();
    let taper = |lag: usize| (-0.5 * (lag as f64 / REACH as f64).powi(2)).exp();
    let share = |i: usize, j: usize| if i == j { 1.0 } else { 1.0 - SHRINKAGE };
    Matrix::from_fn(n, n, |i, j| gamma[(i, j)] * (taper(i.abs_diff(j)) * share(i, j)))
}

/// Eigenvector of the smallest eigenvalue of abs(gamma)^-1 o gamma.
fn inverse_weighted(mut gamma: Matrix) -> Vec<Complex64> {
    let mut modulus = gamma.map(|z: Complex<f64>| z.norm());
    let load = (DEFINITE - modulus.symmetric_eigenvalues().min()).max(0.0);
    for i in 0..gamma.nrows() {
        modulus[(i, i)] += load;
        gamma[(i, i)] += load;
    }
    // Positive definite, so it has an inverse; a NaN among the coherences leaves phases of NaN.
    let inverse = modulus.try_inverse().unwrap_or_else(|| DMatrix::from_element(1, 1, f64::NAN));
    eigenvector(gamma.zip_map(&inverse, |z, q| z * q), |values| values.imin())
}

/// theta_i <- unit(sum over |i - j| <= 16 of |gamma_ij| gamma_ij theta_j).
fn fitted(gamma: &Matrix) -> Vec<Complex64> {
    let n = gamma.nrows();
    let near = |i: usize, j: usize| f64::from(u8::from(i.abs_diff(j) <= REACH));
    let banded = Matrix::from_fn(n, n, |i, j| gamma[(i, j)] * (gamma[(i, j)].norm() * near(i, j)));
    let mut theta = nalgebra::DVector::from_vec(walked(gamma));
    for _ in 0..STEPS {
        let next = (&banded * &theta).map(|z| z / z.norm());
        let change = (&next - &theta).iter().map(|z| z.norm()).fold(0.0, f64::max);
        theta = next;
        if change < SETTLED {
            break;
        }
    }
    theta.iter().copied().collect()
}

/// Start: single steps added up.
fn walked(gamma: &Matrix) -> Vec<Complex64> {
    let mut theta = vec![Complex64::new(1.0, 0.0)];
    for i in 1..gamma.nrows() {
        let step = gamma[(i, i - 1)] * theta[i - 1];
        theta.push(if step.norm() > 0.0 { step / step.norm() } else { theta[i - 1] });
    }
    theta
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Without noise every one of them finds the phases.
    #[test]
    fn exact_coherences_give_exact_phases() {
        let n: usize = 20;
        let phase = |i: usize| 0.3 * i as f64 + 0.2 * (i as f64).sin();
        let gamma: Vec<Complex64> = (0..n * n)
            .map(|place| {
                let (i, j) = (place / n, place % n);
                let modulus = if i == j { 1.0 } else { 0.9 * 0.9_f64.powi(i.abs_diff(j) as i32) };
                Complex64::from_polar(modulus, phase(i) - phase(j))
            })
            .collect();
        let times: Vec<f64> = (0..n).map(|i| i as f64).collect();
        for peer in [Peer::Evd, Peer::Emi, Peer::TaperedEmi, Peer::Cofi] {
            for (i, found) in peer.phases(&gamma, &times).iter().enumerate() {
                let error = found - (phase(i) - phase(0));
                assert!(error.abs() < 1e-6, "{peer:?} {i}: {error:e}");
            }
        }
    }
}
