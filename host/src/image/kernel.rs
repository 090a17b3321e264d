//! The Gaussian of the ensemble average, cut where the arithmetic no longer sees it.

use crate::error::{Error, Result};
use phasewalk_core::weights::gaussian_looks;

/// Half of a sampled Gaussian exp(-d^2 / (2 sigma^2)), d = 0, 1, ..., R, whose 2R+1 taps sum to 1
/// (paper line 753; variance sigma_Gauss^2).
#[derive(Clone, Debug)]
pub struct Kernel {
    /// sigma_Gauss in pixels.
    pub sigma_px: f64,
    /// Taps for d = 0 ..= R.
    pub half: Vec<f64>,
    /// Rows of the periodic image.
    pub height: usize,
    /// Its columns.
    pub width: usize,
}

/// R in units of sigma. What is cut off is erfc(R / (sqrt(2) sigma)) of the kernel: 3e-6 for `f32`, where
/// it moves phases by 5e-6 rad, and below the rounding of `f64` (2e-16).
const REACH_SINGLE: f64 = 4.66;
const REACH_DOUBLE: f64 = 8.3;

impl Kernel {
    /// Taps for images of the given size; `double` for `f64` arithmetic.
    ///
    /// # Errors
    /// When sigma is not above 0 or as wide as the image's longer side.
    pub fn new(sigma_px: f64, height: usize, width: usize, double: bool) -> Result<Self> {
        let side = height.max(width);
        if !sigma_px.is_finite() || sigma_px <= 0.0 {
            let what = "must be a number of pixels above 0";
            return Err(Error::usage(format!("--gaussian {sigma_px}: {what}")));
        }
        if sigma_px >= side as f64 {
            return Err(Error::usage(format!(
                "--gaussian {sigma_px:e}: as wide as the image ({width} x {height} pixels) or wider"
            )));
        }
        let reach = if double { REACH_DOUBLE } else { REACH_SINGLE };
        let radius = (reach * sigma_px).ceil().max(1.0) as usize;
        let tap = |d: usize| (-(d as f64).powi(2) / (2.0 * sigma_px * sigma_px)).exp();
        let sum = tap(0) + 2.0 * (1..=radius).map(tap).sum::<f64>();
        let half = (0..=radius).map(|d| tap(d) / sum).collect();
        Ok(Self { sigma_px, half, height, width })
    }

    /// R: taps on each side of the middle.
    #[must_use]
    pub fn radius(&self) -> usize {
        self.half.len() - 1
    }

    /// Nominal looks: 4 pi sigma^2 (paper line 818), and along each axis no more than the image has pixels.
    #[must_use]
    pub fn nominal_looks(&self) -> f64 {
        let looks = gaussian_looks(self.sigma_px);
        let part = |side: usize| (side as f64 / looks.sqrt()).min(1.0);
        looks * part(self.height) * part(self.width)
    }

    /// Correlation of the kernel with itself at distance d along a periodic axis of `side` pixels, for
    /// the effective looks.
    #[must_use]
    pub fn autocorrelation(&self, d: usize, side: usize) -> f64 {
        let mut taps = vec![0.0; side];
        for (i, tap) in self.half.iter().enumerate() {
            taps[i % side] += tap;
            if i > 0 {
                taps[(side - i % side) % side] += tap;
            }
        }
        (0..side).map(|i| taps[i] * taps[(i + d) % side]).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn taps_sum_to_one_and_reach_as_far_as_stated() {
        for (sigma, double, radius) in [(3.0, false, 14), (3.0, true, 25), (0.3, false, 2)] {
            let kernel = Kernel::new(sigma, 64, 64, double).unwrap();
            assert_eq!(kernel.radius(), radius);
            let sum = 2.0 * kernel.half.iter().sum::<f64>() - kernel.half[0];
            assert!((sum - 1.0).abs() < 1e-15);
        }
    }

    #[test]
    fn autocorrelation_gives_the_papers_looks() {
        let kernel = Kernel::new(3.0, 64, 64, true).unwrap();
        let squares = kernel.autocorrelation(0, 64);
        let looks = 1.0 / (squares * squares);
        assert!((looks / gaussian_looks(3.0) - 1.0).abs() < 1e-10);
        let wide = Kernel::new(7.9, 8, 8, true).unwrap().autocorrelation(0, 8);
        assert!((wide - 1.0 / 8.0).abs() < 1e-9, "no more looks than pixels: {wide}");
    }

    #[test]
    fn impossible_widths_are_refused() {
        for sigma in [0.0, -1.0, f64::NAN, f64::INFINITY, 20.0, 100.0] {
            assert_eq!(Kernel::new(sigma, 8, 20, false).unwrap_err().exit_status(), 2);
        }
    }

    #[test]
    fn a_line_has_the_looks_of_one_axis() {
        let wanted = gaussian_looks(2.0).sqrt();
        for (height, width) in [(1, 64), (64, 1)] {
            let kernel = Kernel::new(2.0, height, width, true).unwrap();
            assert!((kernel.nominal_looks() - wanted).abs() < 1e-12);
        }
        assert_eq!(Kernel::new(3.0, 64, 64, true).unwrap().nominal_looks(), gaussian_looks(3.0));
    }
}
