//! Camera start jitter: by what part of an image each sweep began late.
//!
//! A camera that runs freely takes its m-th image of a sweep at m + delta. A reflector at depth z then has the
//! extra phase 2 pi z delta/K, which differs between two layers: 0.07 rad across an outer segment.
//! The fixed fringes of the optics do not move, so they tell delta: the residual of the source fit,
//! averaged over large parts of the image (which the speckle does not survive), is compared with its
//! mean over the sweeps,
//! ```text
//! delta_t = argmax Re sum over f of conj(T(f)) g_t(f) exp(-2 pi i f delta/K)
//! ```
//! with f the frequency along m. Slow frequencies are left out: there the source's own changes are.

use super::window::Window;
use num_complex::Complex64;
use rayon::prelude::*;
use rustfft::FftPlanner;
use std::f64::consts::TAU;

/// Slower changes along the sweep are the source's.
const LEAST_FREQUENCY: usize = 4;
/// delta is looked for within so many images of the mean.
const REACH: f64 = 1.25;
/// Steps of the search, images.
const STEP: f64 = 0.025;
/// Template and shifts are refined in turn.
const ROUNDS: usize = 4;

/// Start of each sweep against the mean, in images.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Jitter {
    /// delta of each sweep that was given; later is positive.
    pub images: Vec<f64>,
    /// Standard deviation of one of them, from two halves of the image.
    pub sigma: f64,
}

impl Jitter {
    /// Can it be told from no jitter, and well enough to be of use?
    #[must_use]
    pub fn is_significant(&self) -> bool {
        let spread = self.images.iter().map(|d| d * d).sum::<f64>() / self.images.len() as f64;
        self.sigma < 0.05 && spread.sqrt() > 3.0 * self.sigma
    }
}

/// From `traces`: of each sweep the residual (part of the image, m), K samples a part.
#[must_use]
pub fn estimate(traces: &[&[f32]], images: usize) -> Jitter {
    let parts = traces.first().map_or(0, |trace| trace.len() / images);
    if traces.len() < 2 || parts < 2 {
        return Jitter { images: vec![0.0; traces.len()], sigma: f64::INFINITY };
    }
    let spectra: Vec<Vec<Complex64>> =
        traces.par_iter().map(|trace| spectra_of(trace, images)).collect();
    let half = |odd: usize| -> Vec<Vec<Complex64>> {
        let chosen = |all: &Vec<Complex64>| {
            let parts = all.chunks_exact(images).skip(odd).step_by(2);
            parts.flatten().copied().collect()
        };
        spectra.iter().map(chosen).collect()
    };
    let whole = starts(&spectra, images);
    let (even, odd) = (starts(&half(0), images), starts(&half(1), images));
    let squares: f64 = even.iter().zip(&odd).map(|(a, b)| (a - b).powi(2)).sum();
    // Halves have twice the variance of the whole, their difference four times.
    Jitter { images: whole, sigma: (squares / even.len() as f64).sqrt() / 2.0 }
}

/// Windowed spectrum along m of each part.
fn spectra_of(trace: &[f32], images: usize) -> Vec<Complex64> {
    let window = Window::Hann.weights(images);
    let mut spectra: Vec<Complex64> = trace
        .chunks_exact(images)
        .flat_map(|part| part.iter().zip(&window).map(|(&g, &w)| f64::from(g * w).into()))
        .collect();
    FftPlanner::new().plan_fft_forward(images).process(&mut spectra);
    spectra
}

fn starts(spectra: &[Vec<Complex64>], images: usize) -> Vec<f64> {
    let mut starts = vec![0.0; spectra.len()];
    for _ in 0..ROUNDS {
        let template = template(spectra, &starts, images);
        starts = spectra.par_iter().map(|own| best_start(&template, own, images)).collect();
        let mean = starts.iter().sum::<f64>() / starts.len() as f64;
        starts.iter_mut().for_each(|start| *start -= mean);
    }
    starts
}

/// Mean of all sweeps, each put back to its start.
fn template(spectra: &[Vec<Complex64>], starts: &[f64], images: usize) -> Vec<Complex64> {
    let mut sum = vec![Complex64::default(); spectra[0].len()];
    for (own, &start) in spectra.iter().zip(starts) {
        for (i, (sum, g)) in sum.iter_mut().zip(own).enumerate() {
            *sum += g * back(i % images, start, images);
        }
    }
    sum
}

/// exp(-2 pi i f delta/K).
fn back(f: usize, start: f64, images: usize) -> Complex64 {
    Complex64::cis(-TAU * f as f64 * start / images as f64)
}

/// Maximum over the positive frequencies, then a parabola through it.
fn best_start(template: &[Complex64], own: &[Complex64], images: usize) -> f64 {
    let fast = LEAST_FREQUENCY..images / 2;
    let mut cross = vec![Complex64::default(); images];
    for (i, (t, g)) in template.iter().zip(own).enumerate() {
        cross[i % images] += t.conj() * g;
    }
    let agreement =
        |start: f64| -> f64 { fast.clone().map(|f| (cross[f] * back(f, start, images)).re).sum() };
    let steps = (REACH / STEP) as i32;
    let places = -steps..=steps;
    let values: Vec<f64> = places.map(|i| agreement(f64::from(i) * STEP)).collect();
    let highest = (0..values.len()).max_by(|&a, &b| values[a].total_cmp(&values[b])).unwrap_or(0);
    let center = (highest as f64 - f64::from(steps)) * STEP;
    if highest == 0 || highest + 1 == values.len() {
        return center;
    }
    let (before, at, after) = (values[highest - 1], values[highest], values[highest + 1]);
    let curvature = before - 2.0 * at + after;
    if curvature < 0.0 { center + STEP * 0.5 * (before - after) / curvature } else { center }
}

#[cfg(test)]
mod tests {
    use super::*;

    const IMAGES: usize = 128;

    /// Fixed fringes of two depths over six parts, sampled at m + delta, with noise.
    fn traces(starts: &[f64], fringes: f64, noise: f64) -> Vec<Vec<f32>> {
        let mut seed = 12345_u32;
        let mut random = || {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(seed >> 8) / f64::from(1 << 24) - 0.5
        };
        let mut one = |start: f64| -> Vec<f32> {
            let place = |i: usize| ((i / IMAGES) as f64, (i % IMAGES) as f64 + start);
            let values = (0..6 * IMAGES).map(|i| {
                let (part, m) = place(i);
                let fringe = (TAU * 23.4 * m / IMAGES as f64 + part).cos()
                    + 0.5 * (TAU * 41.0 * m / IMAGES as f64 - 2.0 * part).cos();
                (fringes * fringe + noise * random()) as f32
            });
            values.collect()
        };
        starts.iter().map(|&start| one(start)).collect()
    }

    #[test]
    fn late_starts_are_found() {
        let starts = [0.1, -0.4, 0.45, 0.0, 0.3, -0.45];
        let traces = traces(&starts, 10.0, 5.0);
        let views: Vec<&[f32]> = traces.iter().map(Vec::as_slice).collect();
        let jitter = estimate(&views, IMAGES);
        let mean = starts.iter().sum::<f64>() / starts.len() as f64;
        for (found, start) in jitter.images.iter().zip(starts) {
            assert!((found - (start - mean)).abs() < 0.02, "{found} {start}");
        }
        assert!(jitter.is_significant() && jitter.sigma < 0.02, "{jitter:?}");
    }

    #[test]
    fn without_fringes_or_jitter_nothing_is_claimed() {
        let none = traces(&[0.2, -0.2, 0.1, 0.3], 0.0, 5.0);
        let views: Vec<&[f32]> = none.iter().map(Vec::as_slice).collect();
        assert!(!estimate(&views, IMAGES).is_significant());
        let still = traces(&[0.0; 8], 10.0, 5.0);
        let views: Vec<&[f32]> = still.iter().map(Vec::as_slice).collect();
        assert!(!estimate(&views, IMAGES).is_significant());
        assert!(!estimate(&views[..1], IMAGES).is_significant());
    }
}
