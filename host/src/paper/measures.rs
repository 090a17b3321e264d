//! What the eye sees in the figures, as numbers.

use crate::demo::errors::{rms, wrapped};
use ndarray::{Array2, ArrayView2, Zip};
use num_complex::Complex32;
use std::ops::RangeInclusive;

/// How well the x stands out of a phase image, whatever the turns: the mean of cos(φ − Φ) inside the
/// x less that outside, over its value 1 − cos Φ in the ideal image, Φ inside and 0 outside.
///
/// 1 is ideal, 0 is noise. Of n independent patches inside noise has a standard deviation of about
/// 1/(√(2n)(1 − cos Φ)).
#[must_use]
pub fn visibility(image: ArrayView2<'_, f32>, mask: &[bool], phase: f64) -> f64 {
    let mut sums = [(0.0, 0.0); 2];
    for (&value, &inside) in image.iter().zip(mask) {
        let (sum, count) = &mut sums[usize::from(inside)];
        *sum += agreement(f64::from(value) - phase);
        *count += 1.0;
    }
    let [outside, inside] = sums.map(|(sum, count)| sum / count);
    (inside - outside) / (1.0 - phase.cos())
}

/// How alike two phase images are: the mean of cos(φ − ψ). 1 is the same, 0 is unrelated.
#[must_use]
pub fn likeness(a: &Array2<f32>, b: &Array2<f32>) -> f64 {
    let sum = Zip::from(a).and(b).fold(0.0, |sum, &a, &b| sum + agreement(f64::from(a - b)));
    sum / a.len() as f64
}

/// Cosine of a difference; a pixel without a phase agrees no more than noise does, 0.
fn agreement(difference: f64) -> f64 {
    if difference.is_finite() { difference.cos() } else { 0.0 }
}

/// Root mean square of arg C(t, Δt) − (φ(t) − φ(t + Δt)), wrapped, over all t and the given Δt, radians;
/// noise has π/√3 = 1.81. `spectrum` has axes (t, Δt).
#[must_use]
pub fn spectrum_error(
    spectrum: &Array2<Complex32>,
    truth: &[f64],
    lags: RangeInclusive<usize>,
) -> f64 {
    let frames = truth.len();
    let pairs = lags.flat_map(|lag| (0..frames.saturating_sub(lag)).map(move |t| (t, lag)));
    rms(pairs
        .map(|(t, lag)| wrapped(f64::from(spectrum[[t, lag]].arg()) - (truth[t] - truth[t + lag]))))
}

/// Largest difference, modulo 2π, of the sum of single steps arg C(t, 1) and the direct arg C(0, t),
/// radians: what is not averaged in between cannot differ (lines 155-159).
#[must_use]
pub fn sum_of_steps_beside_direct(spectrum: &Array2<Complex32>) -> f64 {
    let mut sum = 0.0;
    let differences = (1..spectrum.nrows()).map(|t| {
        sum += f64::from(spectrum[[t - 1, 1]].arg());
        wrapped(sum - f64::from(spectrum[[0, t]].arg())).abs()
    });
    differences.fold(0.0, f64::max)
}

/// Frames from `start` to where an error first exceeds `limit`; those to the end if it never does.
#[must_use]
pub fn frames_within(errors: &[f64], start: usize, limit: f64) -> usize {
    let late = errors.iter().skip(start).position(|&error| error > limit);
    late.unwrap_or(errors.len().saturating_sub(start + 1))
}

#[cfg(test)]
mod tests {
    use super::*;

    const TRUTH: [f64; 4] = [0.0, 0.5, 1.5, 2.0];

    fn spectrum(noise: f64) -> Array2<Complex32> {
        Array2::from_shape_fn((4, 4), |(t, lag)| match TRUTH.get(t + lag) {
            Some(later) => {
                Complex32::from_polar(1.0, (TRUTH[t] - later + noise * lag as f64) as f32)
            }
            None => Complex32::default(),
        })
    }

    #[test]
    fn an_ideal_image_is_wholly_visible_and_a_flat_one_not_at_all() {
        let mask = [true, true, false, false, false, false];
        let image = Array2::from_shape_fn((2, 3), |(y, x)| if y == 0 && x < 2 { 2.0 } else { 0.0 });
        assert!((visibility(image.view(), &mask, 2.0) - 1.0).abs() < 1e-6);
        let turned = &image + std::f32::consts::TAU;
        assert!((visibility(turned.view(), &mask, 2.0) - 1.0).abs() < 1e-5);
        assert!(visibility(Array2::zeros((2, 3)).view(), &mask, 2.0).abs() < 1e-6);
        assert!((likeness(&image, &turned) - 1.0).abs() < 1e-6);
        let nothing = Array2::from_elem((2, 3), f32::NAN);
        assert_eq!(visibility(nothing.view(), &mask, 2.0), 0.0);
        assert_eq!(likeness(&image, &nothing), 0.0);
    }

    #[test]
    fn errors_of_a_spectrum() {
        assert!(spectrum_error(&spectrum(0.0), &TRUTH, 1..=3) < 1e-6);
        assert!((spectrum_error(&spectrum(0.1), &TRUTH, 1..=1) - 0.1).abs() < 1e-6);
        assert!((spectrum_error(&spectrum(0.1), &TRUTH, 3..=3) - 0.3).abs() < 1e-6);
        assert!(sum_of_steps_beside_direct(&spectrum(0.1)) < 1e-6);
    }

    #[test]
    fn frames_until_an_error() {
        assert_eq!(frames_within(&[9.0, 0.1, 0.2, 0.9], 1, 0.5), 2);
        assert_eq!(frames_within(&[9.0, 0.1, 0.2, 0.3], 1, 0.5), 2);
        assert_eq!(frames_within(&[], 4, 0.5), 0);
    }
}
