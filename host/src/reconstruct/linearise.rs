//! Spectra at equal steps of the wavenumber.
//!
//! Every sample at an equal step is a sum over the 32 nearest recorded ones with a sinc under a
//! Kaiser window (beta 8), worked out once. Fringes up to 0.8 of the largest depth come out with an
//! error below 1e-3 of their amplitude; nearer to it the window lets them fade.

use crate::error::{Error, Result};
use rayon::prelude::*;
use std::f64::consts::PI;

/// Recorded samples in one resampled one.
const TAPS: usize = 32;
/// Shape of the Kaiser window.
const BETA: f64 = 8.0;

/// Brings spectra to equal steps of the wavenumber, in the order of the recording.
#[derive(Clone, Debug)]
pub struct Resampler {
    /// First recorded sample of every sum.
    first: Vec<usize>,
    /// Weights (sample, tap).
    weights: Vec<[f32; TAPS]>,
}

impl Resampler {
    /// For the wavenumbers `k` of the samples, up to scale and offset; all rising or all falling.
    ///
    /// # Errors
    /// When `k` does not rise or fall throughout, or is too short.
    pub fn new(k: &[f64]) -> Result<Self> {
        if k.len() < TAPS {
            let found = k.len();
            return Err(Error::usage(format!(
                "a map of {found} wavenumbers: at least {TAPS} are needed"
            )));
        }
        let steps = || k.windows(2).map(|pair| pair[1] - pair[0]);
        if !(steps().all(|step| step > 0.0) || steps().all(|step| step < 0.0)) {
            return Err(Error::usage(
                "the wavenumbers must rise or fall from sample to sample: smooth the map",
            ));
        }
        let (first, weights) = positions(k).iter().map(|&position| taps(position, k.len())).unzip();
        Ok(Self { first, weights })
    }

    /// Samples of a spectrum.
    #[must_use]
    pub fn images(&self) -> usize {
        self.first.len()
    }

    /// The spectra (line, m) at equal steps of k.
    #[must_use]
    pub fn apply(&self, spectra: &[f32]) -> Vec<f32> {
        let mut resampled = vec![0.0; spectra.len()];
        resampled
            .par_chunks_exact_mut(self.images())
            .zip(spectra.par_chunks_exact(self.images()))
            .for_each(|(out, line)| self.apply_to_line(line, out));
        resampled
    }

    fn apply_to_line(&self, line: &[f32], out: &mut [f32]) {
        for ((value, &first), weights) in out.iter_mut().zip(&self.first).zip(&self.weights) {
            let recorded = line[first..first + TAPS].iter();
            *value = recorded.zip(weights).map(|(sample, weight)| sample * weight).sum();
        }
    }
}

/// Where, in recorded samples, the equal steps from the first to the last wavenumber lie.
fn positions(k: &[f64]) -> Vec<f64> {
    let last = k.len() - 1;
    let span = k[last] - k[0];
    let mut below = 0;
    let position = |step: usize| {
        let wanted = step as f64 / last as f64;
        let share = |m: usize| (k[m] - k[0]) / span;
        while below + 2 < k.len() && share(below + 1) <= wanted {
            below += 1;
        }
        let (low, high) = (share(below), share(below + 1));
        below as f64 + (wanted - low) / (high - low)
    };
    (0..k.len()).map(position).collect()
}

/// First sample and weights of the sum at `position`; they add up to 1, at the ends too.
fn taps(position: f64, images: usize) -> (usize, [f32; TAPS]) {
    let first = (position.floor() as usize + 1).saturating_sub(TAPS / 2).min(images - TAPS);
    let weights: [f64; TAPS] = std::array::from_fn(|tap| kernel((first + tap) as f64 - position));
    let sum: f64 = weights.iter().sum();
    (first, weights.map(|weight| (weight / sum) as f32))
}

/// Windowed sinc at a distance in samples.
fn kernel(distance: f64) -> f64 {
    let edge = distance / (TAPS as f64 / 2.0);
    if edge.abs() >= 1.0 {
        return 0.0;
    }
    let sinc = if distance == 0.0 { 1.0 } else { (PI * distance).sin() / (PI * distance) };
    sinc * bessel_i0(BETA * (1.0 - edge * edge).sqrt()) / bessel_i0(BETA)
}

/// Modified Bessel function of order 0, by its power series.
fn bessel_i0(x: f64) -> f64 {
    let mut term = 1.0;
    (1..40).fold(1.0, |sum, n| {
        term *= (0.5 * x / f64::from(n)).powi(2);
        sum + term
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reconstruct::dispersion::band_coordinate;

    /// Largest error against a fringe at equal steps, away from the ends, for a wave of amplitude 1.
    fn error(images: usize, depth: f64, bend: f64) -> f64 {
        let k = |q: f64| q + bend * (q * q - 1.0);
        let q: Vec<f64> = (0..images).map(|m| band_coordinate(m, images)).collect();
        let map: Vec<f64> = q.iter().map(|&q| k(q)).collect();
        let fringe = |k: f64| (PI * depth * k + 0.3).cos();
        let recorded: Vec<f32> = map.iter().map(|&k| fringe(k) as f32).collect();
        let resampled = Resampler::new(&map).unwrap().apply(&recorded);
        let span = map[images - 1] - map[0];
        let inside = TAPS..images - TAPS;
        let distance = |m: usize| {
            let k = map[0] + span * m as f64 / (images - 1) as f64;
            (f64::from(resampled[m]) - fringe(k)).abs()
        };
        inside.map(distance).fold(0.0, f64::max)
    }

    #[test]
    fn fringes_keep_their_shape() {
        for images in [256, 1024] {
            for share in [0.05, 0.3, 0.6, 0.8] {
                let error = error(images, share * images as f64 / 2.0, 0.0);
                assert!(error < 1e-3, "{images} {share}: {error}");
            }
            // Where a bent sweep runs fast its fringes are up to 1.2 times as dense.
            let error = error(images, 0.6 * images as f64 / 2.0, 0.1);
            assert!(error < 1e-3, "{images}: {error}");
        }
    }

    #[test]
    fn falling_wavenumbers_keep_their_order() {
        let map: Vec<f64> = (0..64).map(|m| -f64::from(m)).collect();
        let line: Vec<f32> = (0..64_u8).map(|m| f32::from(m % 7)).collect();
        let same = Resampler::new(&map).unwrap().apply(&line);
        assert!(same.iter().zip(&line).all(|(a, b)| (a - b).abs() < 1e-5));
    }

    #[test]
    fn a_constant_stays_one_up_to_the_ends() {
        let map: Vec<f64> = (0..100).map(|m| f64::from(m).powf(1.1)).collect();
        let ones = Resampler::new(&map).unwrap().apply(&[1.0; 200]);
        assert!(ones.iter().all(|value| (value - 1.0).abs() < 1e-5), "{ones:?}");
    }

    #[test]
    fn maps_that_turn_are_refused() {
        let mut map: Vec<f64> = (0..64).map(f64::from).collect();
        map[30] = 28.0;
        assert!(Resampler::new(&map).unwrap_err().to_string().contains("rise or fall"));
        map[30] = f64::NAN;
        assert!(Resampler::new(&map).is_err());
        assert!(Resampler::new(&map[..8]).unwrap_err().to_string().contains("8 wavenumbers"));
    }
}
