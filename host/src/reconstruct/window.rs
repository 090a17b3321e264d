//! Windows over the spectrum.

use super::dispersion::band_coordinate;
use std::f64::consts::PI;

/// Share of the band on each side that a Tukey window tapers.
const TAPER: f64 = 0.25;

/// What weighs the spectrum against side lobes in depth.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum Window {
    /// Raised cosine: side lobes below -31 dB
    #[default]
    Hann,
    /// Flat with tapered ends: finer in depth
    Tukey,
    /// None: the source's own shape
    Rectangular,
}

impl Window {
    /// Weights of `images` samples.
    #[must_use]
    pub fn weights(self, images: usize) -> Vec<f32> {
        (0..images).map(|m| self.weight(band_coordinate(m, images)) as f32).collect()
    }

    fn weight(self, q: f64) -> f64 {
        match self {
            Self::Hann => 0.5 + 0.5 * (PI * q).cos(),
            Self::Tukey => {
                let inside = ((1.0 - q.abs()) / (2.0 * TAPER)).min(1.0);
                0.5 - 0.5 * (PI * inside).cos()
            }
            Self::Rectangular => 1.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_are_even_and_reach_one() {
        for window in [Window::Hann, Window::Tukey, Window::Rectangular] {
            let weights = window.weights(64);
            let mirrored: Vec<f32> = weights.iter().rev().copied().collect();
            assert_eq!(weights, mirrored);
            assert!(weights[32] > 0.99 && weights[32] <= 1.0);
        }
        assert!(Window::Hann.weights(64)[0] < 0.01 && Window::Tukey.weights(64)[0] < 0.01);
    }
}
