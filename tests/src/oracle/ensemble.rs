//! The ensemble average, over a mask or over a Gaussian neighbourhood.

use super::cross_spectrum::{cross_spectrum, phasor};
use super::gaussian::gaussian_filter;
use super::pairs::{Pairs, pair_list};
use super::series::Series;
use num_complex::Complex;

/// Averages over a mask, ⟨C(t,Δt)⟩_M = 1/|M| Σ_{(x,y)∈M} C(x,y; t,Δt) and likewise ⟨C/|C|⟩_M, for
/// all t and Δt (line 745).
///
/// `mask` is of shape (y, x), true inside M.
///
/// # Panics
/// If the mask has the wrong size or is empty.
pub fn mask_mean(series: &Series, mask: &[bool]) -> Pairs {
    mask_mean_of(series.frames, mask, |t, lag| cross_spectrum(series, t, lag))
}

/// [`mask_mean`] of any cross-spectrum, such as [`layer_difference`]: `spectrum(t, Δt)` gives C of
/// shape (y, x), and is called with Δt = 0 as well.
///
/// # Panics
/// If the mask has the wrong size or is empty, or if there is no frame.
///
/// [`layer_difference`]: super::layer_difference
pub fn mask_mean_of(
    frames: usize,
    mask: &[bool],
    spectrum: impl Fn(usize, usize) -> Vec<Complex<f64>>,
) -> Pairs {
    let power = (0..frames).map(|t| mean_over(mask, &spectrum(t, 0)).re).collect();
    let mut mean = Vec::new();
    let mut phasors = Vec::new();
    for (t, lag) in pair_list(frames, frames - 1) {
        let c = spectrum(t, lag);
        mean.push(mean_over(mask, &c));
        let unit: Vec<_> = c.into_iter().map(phasor).collect();
        phasors.push(mean_over(mask, &unit));
    }
    Pairs::from_means(power, mean, &phasors)
}

/// 1/|M| Σ_{M} value.
pub(super) fn mean_over(mask: &[bool], values: &[Complex<f64>]) -> Complex<f64> {
    assert_eq!(mask.len(), values.len(), "the mask must have the size of the image");
    let mut sum = Complex::new(0.0, 0.0);
    let mut count = 0;
    for (&inside, value) in mask.iter().zip(values) {
        if inside {
            sum += value;
            count += 1;
        }
    }
    assert!(count > 0, "the mask is empty");
    sum / f64::from(count)
}

/// Averages over a Gaussian neighbourhood, ⟨C⟩ = G ∗ C and ⟨C/|C|⟩ = G ∗ (C/|C|), for all t and Δt
/// and for every pixel (lines 750–756, 776): one [`Pairs`] per pixel, in the order (y, x).
///
/// The convolution is circular; see [`gaussian_filter`]. `sigma_px` is σ_Gauss in pixels.
///
/// # Panics
/// If `sigma_px` is not positive or there is no frame.
pub fn gaussian_mean(series: &Series, sigma_px: f64) -> Vec<Pairs> {
    gaussian_mean_of(series.frames, series.height, series.width, sigma_px, |t, lag| {
        cross_spectrum(series, t, lag)
    })
}

/// [`gaussian_mean`] of any cross-spectrum, such as [`layer_difference`]: `spectrum(t, Δt)` gives
/// C of shape (y, x), and is called with Δt = 0 as well.
///
/// # Panics
/// If `sigma_px` is not positive, a spectrum has the wrong size, or there is no frame.
///
/// [`layer_difference`]: super::layer_difference
pub fn gaussian_mean_of(
    frames: usize,
    height: usize,
    width: usize,
    sigma_px: f64,
    spectrum: impl Fn(usize, usize) -> Vec<Complex<f64>>,
) -> Vec<Pairs> {
    let filter = |image: &[Complex<f64>]| gaussian_filter(image, height, width, sigma_px);
    let power: Vec<_> = (0..frames).map(|t| filter(&spectrum(t, 0))).collect();
    let mut mean = Vec::new();
    let mut phasors = Vec::new();
    for (t, lag) in pair_list(frames, frames - 1) {
        let c = spectrum(t, lag);
        mean.push(filter(&c));
        let unit: Vec<_> = c.into_iter().map(phasor).collect();
        phasors.push(filter(&unit));
    }
    let at = |images: &[Vec<Complex<f64>>], pixel: usize| -> Vec<Complex<f64>> {
        images.iter().map(|image| image[pixel]).collect()
    };
    (0..height * width)
        .map(|pixel| {
            let power = at(&power, pixel).iter().map(|c| c.re).collect();
            Pairs::from_means(power, at(&mean, pixel), &at(&phasors, pixel))
        })
        .collect()
}
