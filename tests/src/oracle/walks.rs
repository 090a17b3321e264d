//! The two simple walks: direct differences and single steps.

use super::cross_spectrum::{arg, cross_spectrum};
use super::ensemble::mean_over;
use super::gaussian::gaussian_filter;
use super::least_squares::REFERENCE_FRAMES;
use super::series::Series;
use super::unwrap::unwrap_in_time;
use num_complex::Complex;

/// `phases` less the mean of the first min(5, N) (line 946); here every frame counts as valid.
pub(super) fn less_reference_mean(phases: &[f64]) -> Vec<f64> {
    let reference = &phases[..REFERENCE_FRAMES.min(phases.len())];
    let mean = reference.iter().sum::<f64>() / reference.len() as f64;
    phases.iter().map(|phase| phase - mean).collect()
}

/// C(t₀, t − t₀) for t before t₀ too: C(t₀, −Δt) = U(t₀) U*(t₀−Δt) = C*(t₀−Δt, Δt).
fn spectrum_from(series: &Series, reference_frame: usize, t: usize) -> Vec<Complex<f64>> {
    if t >= reference_frame {
        cross_spectrum(series, reference_frame, t - reference_frame)
    } else {
        let forward = cross_spectrum(series, t, reference_frame - t);
        forward.iter().map(|c| c.conj()).collect()
    }
}

/// Phase differences to one frame, φ(t) = −arg Σ_M C(t₀, t−t₀) (lines 410, 984, with the sign of
/// line 720), for t before t₀ too; then unwrapped in t ([`unwrap_in_time`]), then less the mean of
/// the first min(5, N) frames. t₀ is `reference_frame`, or the last frame if that comes first.
/// Returns φ, rad, one per frame.
///
/// # Panics
/// If the mask has the wrong size or is empty, or if there is no frame.
pub fn direct_curve(series: &Series, mask: &[bool], reference_frame: usize) -> Vec<f64> {
    let start = reference_frame.min(series.frames - 1);
    let wrapped: Vec<f64> = (0..series.frames)
        .map(|t| -arg(mean_over(mask, &spectrum_from(series, start, t))))
        .collect();
    less_reference_mean(&unwrap_in_time(&wrapped))
}

/// Phase differences to one frame in every pixel, φ(t) = −arg(G ∗ C(t₀, t−t₀)) (lines 410, 980,
/// with the sign of line 720): wrapped, then less the mean of the first min(5, N) frames, and not
/// wrapped again. t₀ is `reference_frame`, or the last frame if that comes first. Returns φ, rad,
/// of shape (time, y, x).
///
/// # Panics
/// If `sigma_px` is not positive, or if there is no frame.
pub fn direct_images(series: &Series, sigma_px: f64, reference_frame: usize) -> Vec<f64> {
    let start = reference_frame.min(series.frames - 1);
    let smooth = |t: usize| {
        let c = spectrum_from(series, start, t);
        gaussian_filter(&c, series.height, series.width, sigma_px)
    };
    let images: Vec<Vec<f64>> =
        (0..series.frames).map(|t| smooth(t).into_iter().map(|c| -arg(c)).collect()).collect();
    images_less_reference_mean(&images)
}

/// [`less_reference_mean`] in every pixel of `images[t]`; returns shape (time, y, x).
fn images_less_reference_mean(images: &[Vec<f64>]) -> Vec<f64> {
    let pixels = images[0].len();
    let mut result = vec![0.0; images.len() * pixels];
    for pixel in 0..pixels {
        let curve: Vec<f64> = images.iter().map(|image| image[pixel]).collect();
        for (t, phase) in less_reference_mean(&curve).into_iter().enumerate() {
            result[t * pixels + pixel] = phase;
        }
    }
    result
}

/// Knox and Thompson's walk in single steps, φ_n = φ_{n−1} − arg⟨C(n−1, 1)⟩_M, φ₀ = 0 (line 421,
/// with the sign of line 720), less the mean of the first min(5, N) frames. Returns φ, rad, one
/// per frame.
///
/// # Panics
/// If the mask has the wrong size or is empty, or if there is no frame.
pub fn one_step_curve(series: &Series, mask: &[bool]) -> Vec<f64> {
    let mut phase = vec![0.0];
    for n in 1..series.frames {
        let c = mean_over(mask, &cross_spectrum(series, n - 1, 1));
        phase.push(phase[n - 1] - arg(c));
    }
    less_reference_mean(&phase)
}

/// [`one_step_curve`] in every pixel, with ⟨C⟩ = G ∗ C. Returns φ, rad, of shape (time, y, x).
///
/// # Panics
/// If `sigma_px` is not positive.
pub fn one_step_images(series: &Series, sigma_px: f64) -> Vec<f64> {
    let mut images = vec![vec![0.0; series.height * series.width]];
    for n in 1..series.frames {
        let c = cross_spectrum(series, n - 1, 1);
        let smooth = gaussian_filter(&c, series.height, series.width, sigma_px);
        let before = &images[n - 1];
        images.push(before.iter().zip(smooth).map(|(phase, c)| phase - arg(c)).collect());
    }
    images_less_reference_mean(&images)
}

#[cfg(test)]
mod tests {
    use super::{direct_images, one_step_curve};
    use crate::oracle::fixtures::{ramp, rigid, walking};
    use crate::oracle::paper::paper_phase_curve;
    use crate::oracle::weights::Weighting;
    use std::f64::consts::PI;

    #[test]
    fn direct_images_are_not_wrapped_again() {
        let series = rigid(4, 4, &ramp(12, 0.9));
        let images = direct_images(&series, 1.0, 4);
        // φ(t) − φ(4) wrapped is −2.683 at t = 0, then −2.7, −1.8, −0.9, 0.
        let first = 2.0 * PI - 3.6;
        let mean = (first - 2.7 - 1.8 - 0.9) / 5.0;
        assert!((images[0] - (first - mean)).abs() < 1e-12);
        assert!((images[16] - (-2.7 - mean)).abs() < 1e-12);
        assert!((images[8 * 16] - (3.6 - 2.0 * PI - mean)).abs() < 1e-12);
    }

    #[test]
    fn one_step_reaches_the_bound() {
        // For a random walk the one-step walk is at the bound, the paper's somewhat above it.
        let (n, rho, looks, runs) = (20, 0.9, 144, 150);
        let bound = ((n - 1) as f64 * (1.0 - rho * rho) / (2.0 * looks as f64 * rho * rho)).sqrt();
        let (mut step, mut paper) = (0.0, 0.0);
        for seed in 0..runs {
            let series = walking(12, 12, &ramp(n, 0.05), rho, 1000 + seed);
            let truth = 0.05 * (n - 1) as f64;
            let curve = one_step_curve(&series, &[true; 144]);
            step += (curve[n - 1] - curve[0] - truth).powi(2) / runs as f64;
            let curve = paper_phase_curve(&series, &[true; 144], n - 1, Weighting::Paper, None);
            paper += (curve[n - 1] - curve[0] - truth).powi(2) / runs as f64;
        }
        let (step, paper) = (step.sqrt() / bound, paper.sqrt() / bound);
        assert!((0.85..1.2).contains(&step), "{step}");
        assert!((0.9..1.5).contains(&paper), "{paper}");
    }
}
