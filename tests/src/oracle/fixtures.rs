//! What the unit tests share: random numbers, series with a known phase, comparison.

use super::series::Series;
use num_complex::Complex;
use std::f64::consts::PI;

/// A plain generator of uniform numbers in 0 … 1 (the high bits of a 64-bit LCG).
pub(super) struct Random(pub(super) u64);

impl Random {
    pub(super) fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Circular complex Gaussian of unit variance.
    pub(super) fn gaussian(&mut self) -> Complex<f64> {
        let radius = (-(1.0 - self.uniform()).ln()).sqrt();
        Complex::from_polar(radius, 2.0 * PI * self.uniform())
    }
}

/// U(t, pixel) = a(pixel) e^{iφ(t)}, a a fixed speckle field.
pub(super) fn rigid(height: usize, width: usize, phase: &[f64]) -> Series {
    let mut random = Random(7);
    let speckle: Vec<_> = (0..height * width).map(|_| random.gaussian()).collect();
    let mut field = Vec::new();
    for &phase in phase {
        field.extend(speckle.iter().map(|a| a * Complex::from_polar(1.0, phase)));
    }
    Series { frames: phase.len(), height, width, field }
}

/// A field that decorrelates: U(t) = e^{iφ(t)} a(t), a(t) = ρ a(t−1) + √(1−ρ²) noise.
pub(super) fn walking(height: usize, width: usize, phase: &[f64], rho: f64, seed: u64) -> Series {
    let mut random = Random(seed);
    let mut speckle: Vec<_> = (0..height * width).map(|_| random.gaussian()).collect();
    let mut field = Vec::new();
    for &phase in phase {
        field.extend(speckle.iter().map(|a| a * Complex::from_polar(1.0, phase)));
        for a in &mut speckle {
            *a = *a * rho + random.gaussian() * (1.0 - rho * rho).sqrt();
        }
    }
    Series { frames: phase.len(), height, width, field }
}

pub(super) fn ramp(frames: usize, step: f64) -> Vec<f64> {
    (0..frames).map(|t| t as f64 * step).collect()
}

pub(super) fn worst(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}
