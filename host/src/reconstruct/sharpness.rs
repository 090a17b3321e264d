//! The sharpness of A-lines under a trial correction of dispersion.
//!
//! `S = <I^1.5> / <I>^1.5` with the intensities I at the depths of a line, averaged over lines: 1 for
//! an even line, 1.33 for noise or a thick layer of speckle, more the fewer pixels hold the light.
//! It does not depend on scale, and a line with a bright reflection counts no more than another.
//! Entropy and other powers of I find the same dispersion within 0.05 rad; I^2 scatters more where a
//! few pixels outshine all others.

use super::dispersion::{Dispersion, band_coordinate};
use num_complex::Complex32;
use rayon::prelude::*;
use rustfft::{Fft, FftPlanner};
use std::sync::Arc;

/// Lines of one task: few enough for all cores, many enough for one set of buffers.
const BLOCK: usize = 16;

/// Windowed spectra, and the depths of each that count.
#[derive(Clone)]
pub(crate) struct Lines {
    /// Real spectra (line, m), windowed.
    spectra: Vec<f32>,
    images: usize,
    /// First depth of each line.
    first: Vec<usize>,
    /// Number of depths of every line.
    depths: usize,
    /// The a3 under which the depths were chosen: other values are tried without the shift in
    /// depth that they bring.
    anchor: f64,
    /// Linear part of q^3, the shift in depth: the slope c of c q.
    slope: f64,
    transform: Arc<dyn Fft<f32>>,
}

impl Lines {
    /// From spectra (line, m) of `window.len()` images, the first depth of each line and the number
    /// of depths.
    pub(crate) fn new(
        spectra: &[f32],
        window: &[f32],
        first: Vec<usize>,
        depths: usize,
        anchor: f64,
    ) -> Self {
        let images = window.len();
        let windowed = |line: &[f32]| -> Vec<f32> {
            line.iter().zip(window).map(|(&value, &weight)| value * weight).collect()
        };
        Self {
            spectra: spectra.chunks_exact(images).flat_map(windowed).collect(),
            images,
            first,
            depths,
            anchor,
            slope: slope_of_cube(window),
            transform: FftPlanner::new().plan_fft_forward(images),
        }
    }

    /// The sharpness S, mean of all lines.
    pub(crate) fn sharpness(&self, trial: Dispersion) -> f64 {
        let lines = self.sharpness_of_lines(trial);
        lines.iter().sum::<f64>() / lines.len() as f64
    }

    /// How much sharper the lines are at `best` than at `reference`, in standard errors as the
    /// lines' scatter tells them.
    pub(crate) fn significance(&self, best: Dispersion, reference: Dispersion) -> f64 {
        let (best, reference) = (self.sharpness_of_lines(best), self.sharpness_of_lines(reference));
        let gains: Vec<f64> = best.iter().zip(&reference).map(|(a, b)| a - b).collect();
        let gain: f64 = gains.iter().sum();
        let mean = gain / gains.len() as f64;
        let error = gains.iter().map(|g| (g - mean).powi(2)).sum::<f64>().sqrt();
        if error > 0.0 { gain / error } else { 0.0 }
    }

    /// The sharpness of every line, in order.
    fn sharpness_of_lines(&self, trial: Dispersion) -> Vec<f64> {
        let correction = self.correction(trial);
        let blocks = self.spectra.par_chunks(BLOCK * self.images).zip(self.first.par_chunks(BLOCK));
        let of_block = |(spectra, first): (&[f32], &[usize])| {
            let depths = self.transformed(spectra, &correction);
            let lines = depths.chunks_exact(self.images).zip(first);
            lines.map(|(line, &z)| sharpness_of(&line[z..z + self.depths])).collect::<Vec<_>>()
        };
        blocks.map(of_block).collect::<Vec<_>>().concat()
    }

    /// Depth (line, z) of some spectra, negative depths behind the positive ones.
    fn transformed(&self, spectra: &[f32], correction: &[Complex32]) -> Vec<Complex32> {
        let corrected = |line| std::iter::zip(line, correction).map(|(&value, &c)| c * value);
        let mut depths: Vec<Complex32> =
            spectra.chunks_exact(self.images).flat_map(corrected).collect();
        self.transform.process(&mut depths);
        depths
    }

    /// exp(-i(a2 q^2 + a3 q^3)), less the shift in depth of a3 against the anchor.
    fn correction(&self, trial: Dispersion) -> Vec<Complex32> {
        let shift = (trial.a3 - self.anchor) * self.slope;
        let factor = |m| {
            let q = band_coordinate(m, self.images);
            let (sin, cos) = (shift * q - trial.phase(q)).sin_cos();
            Complex32::new(cos as f32, sin as f32)
        };
        (0..self.images).map(factor).collect()
    }

    /// Complex depth (line, z) of all lines without a correction.
    pub(super) fn uncorrected(&self) -> Vec<Complex32> {
        self.transformed(&self.spectra, &vec![Complex32::new(1.0, 0.0); self.images])
    }

    /// The same lines with other windowed spectra.
    pub(super) fn with_spectra(&self, spectra: Vec<f32>) -> Self {
        Self { spectra, ..self.clone() }
    }

    /// Number of images.
    pub(super) fn images(&self) -> usize {
        self.images
    }
}

/// <I^1.5> / <I>^1.5 over the depths of a line; 0 for one without light.
fn sharpness_of(line: &[Complex32]) -> f64 {
    let (mut powers, mut sum) = (0.0_f32, 0.0_f32);
    for value in line {
        let intensity = value.norm_sqr();
        powers += intensity * intensity.sqrt();
        sum += intensity;
    }
    let (powers, sum) = (f64::from(powers), f64::from(sum));
    if sum > 0.0 { powers * (line.len() as f64).sqrt() / (sum * sum.sqrt()) } else { 0.0 }
}

/// Least-squares slope of q^3 against q under the window's energy.
fn slope_of_cube(window: &[f32]) -> f64 {
    let (mut fourth, mut second) = (0.0, 0.0);
    for (m, &weight) in window.iter().enumerate() {
        let q = band_coordinate(m, window.len());
        let energy = f64::from(weight).powi(2);
        fourth += energy * q.powi(4);
        second += energy * q.powi(2);
    }
    fourth / second
}
