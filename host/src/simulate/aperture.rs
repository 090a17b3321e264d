//! The limited numerical aperture: a circular low-pass of the complex field (paper, line 625).
//!
//! Rows, then only those columns of the spectrum that cross the aperture, and back. The transforms
//! are rustfft's portable ones: they round alike on every machine.

use crate::allocate::zeros;
use crate::error::Result;
use num_complex::Complex32;
use rayon::prelude::*;
use rustfft::{Fft, FftDirection, FftPlannerScalar};
use std::sync::Arc;

/// Rows or columns that one task transforms at least.
const ROWS_PER_TASK: usize = 8;

/// A circular low-pass for fields of one shape.
pub struct Aperture {
    width: usize,
    height: usize,
    /// Squared cut-off, (cycles per pixel)².
    cutoff2: f64,
    /// The columns kx that hold any frequency inside the aperture.
    columns: Vec<usize>,
    /// Their spectrum, shape (column, ky).
    spectrum: Vec<Complex32>,
    along_x: Transform,
    along_y: Transform,
}

impl Aperture {
    /// For fields (y, x) of `height` · `width` pixels; keeps √(fx² + fy²) ≤ `cutoff`, f in cycles
    /// per pixel.
    ///
    /// # Errors
    /// When there is no memory for the spectrum.
    pub fn new(width: usize, height: usize, cutoff: f64) -> Result<Self> {
        let cutoff2 = cutoff * cutoff;
        let columns: Vec<usize> =
            (0..width).filter(|&kx| frequency(kx, width).powi(2) <= cutoff2).collect();
        let mut planner = FftPlannerScalar::new();
        Ok(Self {
            width,
            height,
            cutoff2,
            spectrum: zeros(columns.len() * height, "the spectra")?,
            columns,
            along_x: Transform::new(&mut planner, width),
            along_y: Transform::new(&mut planner, height),
        })
    }

    /// Filter `field` (y, x) in place; frequencies inside the aperture keep their amplitude.
    pub fn apply(&mut self, field: &mut [Complex32]) {
        let Self { width, height, cutoff2, columns, spectrum, along_x, along_y } = self;
        let (width, height, cutoff2) = (*width, *height, *cutoff2);
        let gain = (1.0 / (width as f64 * height as f64)) as f32;
        along_x.each(field, |_, row, fft| fft.forward(row));
        along_y.each(spectrum, |column, values, fft| {
            let kx = columns[column];
            values.iter_mut().zip(field.chunks_exact(width)).for_each(|(v, row)| *v = row[kx]);
            fft.forward(values);
            let fx2 = frequency(kx, width).powi(2);
            for (ky, value) in values.iter_mut().enumerate() {
                let inside = fx2 + frequency(ky, height).powi(2) <= cutoff2;
                *value *= if inside { gain } else { 0.0 };
            }
            fft.inverse(values);
        });
        along_x.each(field, |y, row, fft| {
            row.fill(Complex32::ZERO);
            columns.iter().enumerate().for_each(|(i, &kx)| row[kx] = spectrum[i * height + y]);
            fft.inverse(row);
        });
    }
}

/// Frequency of bin k of a transform of `len` points, cycles per pixel, −½ … ½.
fn frequency(k: usize, len: usize) -> f64 {
    let signed = if 2 * k > len { k as f64 - len as f64 } else { k as f64 };
    signed / len as f64
}

/// The two transforms of one length.
struct Transform {
    len: usize,
    forward: Arc<dyn Fft<f32>>,
    inverse: Arc<dyn Fft<f32>>,
}

impl Transform {
    fn new(planner: &mut FftPlannerScalar<f32>, len: usize) -> Self {
        let mut plan = |direction| planner.plan_fft(len, direction);
        Self { len, forward: plan(FftDirection::Forward), inverse: plan(FftDirection::Inverse) }
    }

    /// `work(i, row, transform)` for each row of `data`, on all threads.
    fn each(
        &self,
        data: &mut [Complex32],
        work: impl Fn(usize, &mut [Complex32], &mut WithScratch) + Sync,
    ) {
        data.par_chunks_exact_mut(self.len)
            .enumerate()
            .with_min_len(ROWS_PER_TASK)
            .for_each_init(|| WithScratch::new(self), |fft, (i, row)| work(i, row, fft));
    }
}

/// A transform and the scratch space of one task.
struct WithScratch<'a> {
    transform: &'a Transform,
    scratch: Vec<Complex32>,
}

impl<'a> WithScratch<'a> {
    fn new(transform: &'a Transform) -> Self {
        let len = |fft: &Arc<dyn Fft<f32>>| fft.get_inplace_scratch_len();
        let longest = len(&transform.forward).max(len(&transform.inverse));
        Self { transform, scratch: vec![Complex32::ZERO; longest] }
    }

    fn forward(&mut self, row: &mut [Complex32]) {
        self.transform.forward.process_with_scratch(row, &mut self.scratch);
    }

    fn inverse(&mut self, row: &mut [Complex32]) {
        self.transform.inverse.process_with_scratch(row, &mut self.scratch);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    /// A plane wave of whole periods (kx, ky).
    fn wave(width: usize, height: usize, kx: f64, ky: f64) -> Vec<Complex32> {
        let at = |x: usize, y: usize| {
            let phase = TAU * (kx * x as f64 / width as f64 + ky * y as f64 / height as f64);
            Complex32::new(phase.cos() as f32, phase.sin() as f32)
        };
        (0..height).flat_map(|y| (0..width).map(move |x| at(x, y))).collect()
    }

    #[test]
    fn plane_waves_pass_or_vanish() {
        for (width, height) in [(8, 6), (13, 17), (40, 23), (64, 36)] {
            for (kx, ky) in [(0, 0), (1, 0), (0, -1), (-2, 1), (3, 2), (-3, -3)] {
                let mut field = wave(width, height, f64::from(kx), f64::from(ky));
                let expected = field.clone();
                Aperture::new(width, height, 0.24).unwrap().apply(&mut field);
                let (fx, fy) = (f64::from(kx) / width as f64, f64::from(ky) / height as f64);
                let inside = fx * fx + fy * fy <= 0.24 * 0.24;
                for (got, sent) in field.iter().zip(expected) {
                    let want = if inside { sent } else { Complex32::ZERO };
                    assert!((got - want).norm() < 3e-6, "{width}x{height} ({kx}, {ky})");
                }
            }
        }
    }

    #[test]
    fn a_wide_aperture_changes_nothing() {
        for (width, height) in [(1, 1), (1, 9), (5, 1), (12, 7)] {
            let field: Vec<_> = (0..width * height)
                .map(|i| Complex32::new((i as f32 * 0.7).sin(), (i as f32 * 1.3).cos()))
                .collect();
            let mut filtered = field.clone();
            Aperture::new(width, height, 1.0).unwrap().apply(&mut filtered);
            assert!(field.iter().zip(filtered).all(|(a, b)| (a - b).norm() < 1e-6));
        }
    }
}
