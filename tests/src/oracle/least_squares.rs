//! Least squares.

use super::pairs::pair_list;
use super::weights::valid_frames;
use crate::wide::{self, Wide};

/// μ₁, the regularisation that fixes the gauge (line 936).
pub const MU_1: f64 = 0.02;
/// μ₂, the regularisation of first differences, which bridges gaps (line 936).
pub const MU_2: f64 = 0.001;
/// Index of the frame whose phase Γ₁ pulls to zero, where there are that many (line 923).
pub const GAUGE_FRAME: usize = 4;
/// N₀, the number of frames whose mean phase is taken as zero, where there are that many
/// (line 948).
pub const REFERENCE_FRAMES: usize = 5;

/// S, one row per pair with 1 at t and −1 at t+Δt, so that c_φ = S φ (lines 884–906). P rows of N.
pub fn difference_matrix(frames: usize, max_lag: usize) -> Vec<Vec<f64>> {
    let mut matrix = Vec::new();
    for (t, lag) in pair_list(frames, max_lag) {
        let mut row = vec![0.0; frames];
        row[t] = 1.0;
        row[t + lag] = -1.0;
        matrix.push(row);
    }
    matrix
}

/// Γ₁, 1 at i = j = `gauge` and 0 otherwise (line 923). N rows of N.
pub fn gamma_1(frames: usize, gauge: usize) -> Vec<Vec<f64>> {
    let entry = |i, j| if i == j && i == gauge { 1.0 } else { 0.0 };
    (0..frames).map(|i| (0..frames).map(|j| entry(i, j)).collect()).collect()
}

/// Γ₂, 1 at i = j ≠ 0, −1 at i = j+1 and 0 otherwise: the first differences φ_i − φ_{i−1}
/// (line 930). N rows of N.
pub fn gamma_2(frames: usize) -> Vec<Vec<f64>> {
    let entry = |i: usize, j: usize| {
        if i == j && i != 0 {
            1.0
        } else if i == j + 1 {
            -1.0
        } else {
            0.0
        }
    };
    (0..frames).map(|i| (0..frames).map(|j| entry(i, j)).collect()).collect()
}

/// What the least squares need besides the data.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Regularisation {
    /// μ₁, the strength of Γ₁.
    pub mu_1: f64,
    /// μ₂, the strength of Γ₂.
    pub mu_2: f64,
    /// Index of the frame that Γ₁ pulls to zero.
    pub gauge: usize,
    /// N₀, the number of frames at the start whose mean is taken as zero phase.
    pub reference_frames: usize,
}

impl Regularisation {
    /// The paper's: μ₁ = 0.02, μ₂ = 0.001, frame 4, N₀ = 5 (lines 922-935, 936, 948); with fewer than
    /// five frames the gauge is min(4, N−1) and N₀ = min(5, N).
    ///
    /// # Panics
    /// If there is no frame.
    pub fn paper(frames: usize) -> Regularisation {
        Regularisation {
            mu_1: MU_1,
            mu_2: MU_2,
            gauge: GAUGE_FRAME.min(frames - 1),
            reference_frames: REFERENCE_FRAMES.min(frames),
        }
    }
}

/// Adds MᵀD²M to `normal`, D the diagonal matrix of `factors` (one per row of M).
pub(super) fn add_normal(normal: &mut [Vec<Wide>], matrix: &[Vec<f64>], factors: &[f64]) {
    assert_eq!(matrix.len(), factors.len(), "one factor per row");
    for (row, &factor) in matrix.iter().zip(factors) {
        let squared = Wide::product(factor, factor);
        for (i, &left) in row.iter().enumerate().filter(|(_, entry)| **entry != 0.0) {
            for (j, &right) in row.iter().enumerate().filter(|(_, entry)| **entry != 0.0) {
                normal[i][j] = normal[i][j] + squared * Wide::from(left * right);
            }
        }
    }
}

/// The phase of every frame, by least squares (lines 854–918):
///
/// φ = (SᵀW²S + μ₁²Γ₁ᵀΓ₁ + μ₂²Γ₂ᵀΓ₂)⁻¹ SᵀW²c, then less its mean over the first N₀ frames, of which
/// only valid ones count (line 946; [`valid_frames`]). If none of them is valid nothing is
/// subtracted.
///
/// `unwrapped` is c (rad) and `weights` the diagonal of W, both in the order of [`pair_list`]. The
/// products are summed entry by entry, which is the same as multiplying the matrices, and solved
/// in double-double. Returns φ, rad, one per frame.
///
/// # Panics
/// If the lengths do not fit, or if the matrix is singular (only with μ₁ or μ₂ zero).
pub fn solve(
    frames: usize,
    max_lag: usize,
    unwrapped: &[f64],
    weights: &[f64],
    regularisation: &Regularisation,
) -> Vec<f64> {
    let s = difference_matrix(frames, max_lag);
    assert_eq!(unwrapped.len(), s.len(), "one phase per pair");
    let Regularisation { mu_1, mu_2, gauge, reference_frames } = *regularisation;

    let mut normal = vec![vec![Wide::ZERO; frames]; frames];
    add_normal(&mut normal, &s, weights);
    add_normal(&mut normal, &gamma_1(frames, gauge), &vec![mu_1; frames]);
    add_normal(&mut normal, &gamma_2(frames), &vec![mu_2; frames]);

    let mut right = vec![vec![Wide::ZERO]; frames];
    for ((row, &weight), &c) in s.iter().zip(weights).zip(unwrapped) {
        let weighted = Wide::product(weight, weight) * Wide::from(c);
        for (i, &entry) in row.iter().enumerate().filter(|(_, entry)| **entry != 0.0) {
            right[i][0] = right[i][0] + weighted * Wide::from(entry);
        }
    }

    let solution = wide::solve(normal, right).expect("the normal matrix is singular");
    let phase: Vec<Wide> = solution.iter().map(|row| row[0]).collect();

    let valid = valid_frames(frames, max_lag, weights);
    let reference: Vec<usize> = (0..reference_frames).filter(|&frame| valid[frame]).collect();
    let mut mean = Wide::ZERO;
    for &frame in &reference {
        mean = mean + phase[frame] / Wide::from(reference.len() as f64);
    }
    phase.iter().map(|&phase| (phase - mean).to_f64()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::oracle::ensemble::mask_mean;
    use crate::oracle::fixtures::{Random, ramp, walking, worst};
    use crate::oracle::unwrap::{UNWRAP_DEPTH, unwrap_pairs};
    use crate::oracle::weights::{Weighting, weights};

    #[test]
    fn solve_is_the_formula() {
        // Line 918 with every matrix written out, W as a P × P diagonal, in plain f64.
        type Matrix = Vec<Vec<f64>>;
        fn transpose(a: &Matrix) -> Matrix {
            (0..a[0].len()).map(|j| a.iter().map(|row| row[j]).collect()).collect()
        }
        fn multiply(a: &Matrix, b: &Matrix) -> Matrix {
            let columns = transpose(b);
            let dot = |x: &[f64], y: &[f64]| x.iter().zip(y).map(|(x, y)| x * y).sum();
            a.iter().map(|row| columns.iter().map(|column| dot(row, column)).collect()).collect()
        }
        let mut random = Random(3);
        let (n, lags) = (7, 5);
        let s = difference_matrix(n, lags);
        let p = s.len();
        assert_eq!(p, 6 + 5 + 4 + 3 + 2);
        let w: Vec<f64> = (0..p).map(|_| random.uniform()).collect();
        let c: Vec<f64> = (0..p).map(|_| 6.0 * random.uniform() - 3.0).collect();
        let diagonal: Matrix =
            (0..p).map(|i| (0..p).map(|j| if i == j { w[i] } else { 0.0 }).collect()).collect();
        let stw2 = multiply(&transpose(&s), &multiply(&diagonal, &diagonal));
        let data = multiply(&stw2, &s);
        let (g1, g2) = (gamma_1(n, 4), gamma_2(n));
        let (g1, g2) = (multiply(&transpose(&g1), &g1), multiply(&transpose(&g2), &g2));
        let right = multiply(&stw2, &c.iter().map(|&c| vec![c]).collect());
        let phase = solve(n, lags, &c, &w, &Regularisation::paper(n));
        // Undo the reference: Γ₁ puts the gauge frame within rounding of 0, as SᵀW²c sums to 0.
        let phase: Matrix = phase.iter().map(|value| vec![value - phase[4]]).collect();
        for i in 0..n {
            let left: f64 = (0..n)
                .map(|j| (data[i][j] + 4e-4 * g1[i][j] + 1e-6 * g2[i][j]) * phase[j][0])
                .sum();
            assert!((left - right[i][0]).abs() < 1e-12, "{i}: {left} {}", right[i][0]);
        }
    }

    #[test]
    fn gauge_does_not_matter() {
        let series = walking(6, 6, &ramp(24, 0.15), 0.9, 11);
        let pairs = mask_mean(&series, &[true; 36]);
        let c = unwrap_pairs(&pairs, UNWRAP_DEPTH).phase;
        for weighting in [Weighting::Paper, Weighting::Fisher] {
            let w = weights(&pairs, weighting, 36.0);
            let usual = Regularisation::paper(24);
            let phase = solve(24, 23, &c, &w, &usual);
            for other in [
                Regularisation { mu_1: 20.0, ..usual },
                Regularisation { mu_1: 1e-6, ..usual },
                Regularisation { gauge: 17, ..usual },
            ] {
                assert!(worst(&solve(24, 23, &c, &w, &other), &phase) < 1e-9);
            }
        }
        // Weights of 1e4 on either side of a gap that only Γ₂ (μ₂² = 1e−6) bridges.
        let c: Vec<f64> = pair_list(8, 7).iter().map(|&(_, lag)| -0.1 * lag as f64).collect();
        let joined = |&(t, lag): &(usize, usize)| (t < 5) == (t + lag < 5);
        let strong = |pair: &(usize, usize)| if joined(pair) { 1e4 } else { 0.0 };
        let w: Vec<f64> = pair_list(8, 7).iter().map(strong).collect();
        let phase = solve(8, 7, &c, &w, &Regularisation::paper(8));
        // Γ₂ makes the step across the gap 0.
        let expected = [-0.2, -0.1, 0.0, 0.1, 0.2, 0.2, 0.3, 0.4];
        assert!(worst(&phase, &expected) < 1e-9);
    }
}
