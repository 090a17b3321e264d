//! The paper's estimator, of curves and of images.

use super::ensemble::{gaussian_mean, mask_mean};
use super::least_squares::{Regularisation, solve};
use super::pairs::{Pairs, pair_list};
use super::series::Series;
use super::unwrap::{UNWRAP_DEPTH, unwrap_pairs};
use super::weights::{
    Weighting, fisher_threshold, gaussian_looks, rayleigh_threshold, valid_frames, weights,
};

/// What the paper's estimator makes of one curve or one pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct Solution {
    /// φ, rad, one per frame, zero at the mean of the valid reference frames.
    pub phase: Vec<f64>,
    /// Which frames had at least one pair of weight > 0; the others are bridged.
    pub valid: Vec<bool>,
    /// The weights, in the order of [`pair_list`].
    pub weights: Vec<f64>,
    /// The smallest margin (rad; [`Unwrapped::margin`]) of any choice of branch the phase depends
    /// on: in the row of each t, up to the last Δt of weight > 0. Infinite if there is none.
    ///
    /// [`Unwrapped::margin`]: super::Unwrapped::margin
    pub margin: f64,
    /// The smallest distance of any pair from having its weight switched on or off: of |⟨C/|C|⟩|
    /// from b, or of γ̂ from its threshold. Infinite without pairs.
    pub threshold_distance: f64,
}

/// The paper's estimator: weights, unwrapping with D = 10 and least squares with the paper's
/// regularisation, of lags up to `max_lag`. `looks` is L of the weights.
///
/// # Panics
/// If `pairs` are inconsistent.
pub fn phase_from_pairs(
    pairs: &Pairs,
    max_lag: usize,
    weighting: Weighting,
    looks: f64,
) -> Solution {
    let pairs = pairs.up_to_lag(max_lag);
    let list = pair_list(pairs.frames, pairs.max_lag);
    let weights = weights(&pairs, weighting, looks);
    let unwrapped = unwrap_pairs(&pairs, UNWRAP_DEPTH);
    let regularisation = Regularisation::paper(pairs.frames);
    let phase = solve(pairs.frames, pairs.max_lag, &unwrapped.phase, &weights, &regularisation);

    let mut last_used = vec![0; pairs.frames];
    for (&(t, lag), &weight) in list.iter().zip(&weights) {
        if weight > 0.0 {
            last_used[t] = lag;
        }
    }
    let matters = |&(&(t, lag), _): &(&(usize, usize), &f64)| lag <= last_used[t];
    let margins = list.iter().zip(&unwrapped.margin).filter(matters);
    let (levels, threshold) = match weighting {
        Weighting::Paper => (&pairs.phasor, rayleigh_threshold(looks)),
        Weighting::Fisher => (&pairs.coherence, fisher_threshold(looks)),
    };
    Solution {
        phase,
        valid: valid_frames(pairs.frames, pairs.max_lag, &weights),
        margin: margins.map(|(_, &margin)| margin).fold(f64::INFINITY, f64::min),
        threshold_distance: levels
            .iter()
            .map(|level| (level - threshold).abs())
            .fold(f64::INFINITY, f64::min),
        weights,
    }
}

/// The paper's phase curve of a mask: [`mask_mean`], then [`phase_from_pairs`]. L is |M| unless
/// `looks` is given. Returns φ, rad, one per frame.
///
/// # Panics
/// If the mask has the wrong size or is empty.
pub fn paper_phase_curve(
    series: &Series,
    mask: &[bool],
    max_lag: usize,
    weighting: Weighting,
    looks: Option<f64>,
) -> Vec<f64> {
    let size = mask.iter().filter(|inside| **inside).count() as f64;
    let pairs = mask_mean(series, mask);
    phase_from_pairs(&pairs, max_lag, weighting, looks.unwrap_or(size)).phase
}

/// What the paper's estimator makes of a series of images.
#[derive(Clone, Debug, PartialEq)]
pub struct PhaseImages {
    /// φ, rad, of shape (time, y, x).
    pub phase: Vec<f64>,
    /// [`Solution::valid`], of shape (time, y, x).
    pub valid: Vec<bool>,
    /// [`Solution::margin`] of each pixel, rad, of shape (y, x). Comparisons leave out pixels
    /// below 1e−3.
    pub margin: Vec<f64>,
    /// [`Solution::threshold_distance`] of each pixel, of shape (y, x).
    pub threshold_distance: Vec<f64>,
}

/// The paper's phase images: [`gaussian_mean`], then [`phase_from_pairs`] in every pixel. L is
/// 4πσ_Gauss² ([`gaussian_looks`]) unless `looks` is given.
///
/// # Panics
/// If `sigma_px` is not positive.
pub fn paper_phase_images(
    series: &Series,
    sigma_px: f64,
    max_lag: usize,
    weighting: Weighting,
    looks: Option<f64>,
) -> PhaseImages {
    let looks = looks.unwrap_or(gaussian_looks(sigma_px));
    images_from_pairs(&gaussian_mean(series, sigma_px), max_lag, weighting, looks)
}

/// [`phase_from_pairs`] of every pixel, put together as images.
///
/// # Panics
/// If the pixels do not all have the same number of frames, or if there is no pixel.
pub fn images_from_pairs(
    pixels: &[Pairs],
    max_lag: usize,
    weighting: Weighting,
    looks: f64,
) -> PhaseImages {
    let solutions: Vec<Solution> =
        pixels.iter().map(|pairs| phase_from_pairs(pairs, max_lag, weighting, looks)).collect();
    let mut images = PhaseImages {
        phase: Vec::new(),
        valid: Vec::new(),
        margin: solutions.iter().map(|solution| solution.margin).collect(),
        threshold_distance: solutions.iter().map(|s| s.threshold_distance).collect(),
    };
    for t in 0..pixels[0].frames {
        images.phase.extend(solutions.iter().map(|solution| solution.phase[t]));
        images.valid.extend(solutions.iter().map(|solution| solution.valid[t]));
    }
    images
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::oracle::fixtures::{ramp, rigid, walking, worst};
    use crate::oracle::walks::{
        direct_curve, direct_images, less_reference_mean, one_step_curve, one_step_images,
    };
    use num_complex::Complex;

    #[test]
    fn ramp_is_recovered() {
        // 9 lags of 0.2 rad stay below π, 39 lags go beyond 2π: the rows have to be unwrapped.
        let truth = ramp(40, 0.2);
        let expected = less_reference_mean(&truth);
        let series = rigid(8, 8, &truth);
        let mask = [true; 64];
        let fisher = paper_phase_curve(&series, &mask, 39, Weighting::Fisher, None);
        assert!(worst(&fisher, &expected) < 1e-9);
        let banded = paper_phase_curve(&series, &mask, 12, Weighting::Fisher, None);
        assert!(worst(&banded, &expected) < 1e-9);
        // Γ₂ pulls the ends of the ramp in by about μ₂² 0.2/(N w²): 1.5e−8 with the paper's w.
        let paper = paper_phase_curve(&series, &mask, 39, Weighting::Paper, None);
        assert!(worst(&paper, &expected) < 1e-7);
        let pairs = mask_mean(&series, &mask);
        let w = weights(&pairs, Weighting::Paper, 64.0);
        let c = unwrap_pairs(&pairs, UNWRAP_DEPTH);
        let without = Regularisation { mu_2: 0.0, ..Regularisation::paper(40) };
        assert!(worst(&solve(40, 39, &c.phase, &w, &without), &expected) < 1e-9);
        assert!(worst(&direct_curve(&series, &mask, 4), &expected) < 1e-9);
        assert!(worst(&one_step_curve(&series, &mask), &expected) < 1e-9);
    }

    #[test]
    fn dead_frame_is_bridged() {
        for dead in [2, 4, 9] {
            let truth = ramp(16, 0.1);
            let mut series = rigid(8, 8, &truth);
            series.field[dead * 64..(dead + 1) * 64].fill(Complex::new(0.0, 0.0));
            let pairs = mask_mean(&series, &[true; 64]);
            let solution = phase_from_pairs(&pairs, 15, Weighting::Fisher, 64.0);
            assert!((0..16).all(|t| solution.valid[t] == (t != dead)));
            let reference: Vec<f64> = (0..5).filter(|&t| t != dead).map(|t| truth[t]).collect();
            let mean = reference.iter().sum::<f64>() / reference.len() as f64;
            let expected: Vec<f64> = truth.iter().map(|phase| phase - mean).collect();
            assert!(worst(&solution.phase, &expected) < 1e-9, "{dead}: {solution:?}");
        }
    }

    #[test]
    fn few_frames() {
        for frames in [1, 2, 3, 4] {
            let truth = ramp(frames, 0.3);
            let expected = less_reference_mean(&truth);
            let series = rigid(8, 8, &truth);
            let mask = [true; 64];
            for weighting in [Weighting::Paper, Weighting::Fisher] {
                let phase = paper_phase_curve(&series, &mask, 100, weighting, None);
                assert!(worst(&phase, &expected) < 1e-5, "{phase:?}");
                let images = paper_phase_images(&series, 1.5, 100, weighting, None);
                let first: Vec<f64> = images.phase.iter().step_by(64).copied().collect();
                assert!(worst(&first, &expected) < 1e-5);
            }
            assert!(worst(&direct_curve(&series, &mask, 4), &expected) < 1e-12);
            assert!(worst(&one_step_curve(&series, &mask), &expected) < 1e-12);
            let expected: Vec<f64> = expected.iter().flat_map(|phase| [*phase; 64]).collect();
            assert!(worst(&direct_images(&series, 1.5, 4), &expected) < 1e-12);
            assert!(worst(&one_step_images(&series, 1.5), &expected) < 1e-12);
        }
    }

    #[test]
    fn no_weight_gives_no_phase() {
        // Two pixels: b > 1, all weights 0.
        let series = rigid(1, 2, &ramp(6, 0.3));
        let pairs = mask_mean(&series, &[true; 2]);
        let solution = phase_from_pairs(&pairs, 5, Weighting::Paper, 2.0);
        assert_eq!(solution.phase, vec![0.0; 6]);
        assert_eq!(solution.valid, vec![false; 6]);
        assert_eq!(solution.margin, f64::INFINITY);
    }

    #[test]
    fn images_of_a_wide_filter_are_the_curve() {
        // With σ far beyond the image the Gaussian is flat: every pixel is the mean over all.
        let series = walking(6, 5, &ramp(12, 0.1), 0.95, 21);
        let curve = phase_from_pairs(&mask_mean(&series, &[true; 30]), 11, Weighting::Fisher, 30.0);
        let images = paper_phase_images(&series, 60.0, 11, Weighting::Fisher, Some(30.0));
        for (t, &phase) in curve.phase.iter().enumerate() {
            let image = &images.phase[t * 30..(t + 1) * 30];
            assert!(image.iter().all(|pixel| (pixel - phase).abs() < 1e-9));
        }
        assert!(images.margin.iter().all(|margin| (margin - curve.margin).abs() < 1e-9));
    }
}
