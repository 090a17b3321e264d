//! The wavenumber of every sample, from the fringes of mirrors.
//!
//! A mirror at depth z gives one fringe whose phase is 2 k z + D(k), with the dispersion D of the
//! instrument. The sign of a real fringe's phase is unknown: it is taken to rise with the sample.
//! Two mirrors on the same side of zero delay give 2 k z1 + D and 2 k z2 + D, and the difference is
//! free of D; on opposite sides the second reads 2 k |z2| - D, and the sum is. What the phases have
//! in common but for k is D, smooth or not, so the right combination is the smoother one.

use super::dispersion::{Dispersion, band_coordinate};
use super::smooth::Fit;
use crate::error::{Error, Result};
use num_complex::Complex64;
use rustfft::FftPlanner;
use std::f64::consts::{PI, TAU};

/// Degree of the polynomial that smooths a phase: a spectrometer needs 3, the rest is reserve.
const DEGREE: usize = 5;
/// Fewest fringes over the spectrum: below, the source's own shape is in the way.
const FEWEST_FRINGES: usize = 16;
/// Peak against the median of the depths that a fringe has at least.
const LEAST_PEAK: f64 = 20.0;
/// Peak against the sum over the spectrum, where rounding is all that stands out.
const LEAST_SHARE: f64 = 1e-4;

/// Where two mirrors stood.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sides {
    /// Both on the same side of zero delay.
    Same,
    /// One on each side.
    Opposite,
}

/// The wavenumber over the spectrum.
#[derive(Clone, Debug)]
pub struct Wavenumber {
    /// k of every sample up to a scale and an offset, rising.
    pub k: Vec<f64>,
    /// How two mirrors were combined.
    pub sides: Option<Sides>,
    /// Root mean square of the combined phase about its smooth course, rad.
    pub residual_rad: f64,
    /// Dispersion of the first mirror over equal steps of k; the second's has the opposite sign
    /// where the sides are opposite. None from one mirror, which does not tell it from k.
    pub dispersion: Option<Dispersion>,
}

/// The wavenumber from one mirror, whose dispersion is then taken for part of k, or from two.
///
/// The spectra are better without the light of the arms themselves. `sides` is found in the data
/// where not given.
///
/// # Errors
/// When a spectrum shows no fringe, or the two show the same or differ in length.
pub fn wavenumber(mirrors: &[Vec<f64>], sides: Option<Sides>) -> Result<Wavenumber> {
    let fringes: Vec<Fringe> =
        mirrors.iter().map(|mirror| Fringe::of(mirror)).collect::<Result<_>>()?;
    match &fringes[..] {
        [only] => {
            let fit = smooth(&only.phase, &only.weights);
            let residual_rad = fit.residual;
            rising(Wavenumber { k: fit.values, sides: None, residual_rad, dispersion: None })
        }
        [a, b] if a.phase.len() == b.phase.len() => combine(a, b, sides),
        [_, _] => Err(Error::failed("the two mirror spectra differ in length")),
        _ => Err(Error::usage("give one mirror spectrum or two")),
    }
}

fn combine(a: &Fringe, b: &Fringe, sides: Option<Sides>) -> Result<Wavenumber> {
    let weights: Vec<f64> = a.weights.iter().zip(&b.weights).map(|(a, b)| a.min(*b)).collect();
    let combined = |sides: Sides| {
        let sign = if sides == Sides::Same { -1.0 } else { 1.0 };
        let phase: Vec<f64> = b.phase.iter().zip(&a.phase).map(|(b, a)| b + sign * a).collect();
        (sides, smooth(&phase, &weights))
    };
    let (sides, fit) = match sides {
        Some(sides) => combined(sides),
        None => {
            let (same, opposite) = (combined(Sides::Same), combined(Sides::Opposite));
            if same.1.residual < opposite.1.residual { same } else { opposite }
        }
    };
    let mut k = fit.values;
    let span = k[k.len() - 1] - k[0];
    if sides == Sides::Same && span.abs() < TAU * FEWEST_FRINGES as f64 {
        return Err(Error::failed(
            "the two mirrors stand at nearly the same depth: record them farther apart",
        ));
    }
    if span < 0.0 {
        k.iter_mut().for_each(|k| *k = -*k);
    }
    let dispersion = Some(dispersion_over(&k, a));
    rising(Wavenumber { k, sides: Some(sides), residual_rad: fit.residual, dispersion })
}

/// The bend of a mirror's phase over equal steps of k.
fn dispersion_over(k: &[f64], fringe: &Fringe) -> Dispersion {
    let (first, last) = (k[0], k[k.len() - 1]);
    let edge = band_coordinate(k.len() - 1, k.len());
    let q: Vec<f64> = k.iter().map(|k| edge * (2.0 * (k - first) / (last - first) - 1.0)).collect();
    let fit = Fit::new(&q, &fringe.phase, &fringe.weights, 3);
    let [a2, a3] = fit.square_and_cube().unwrap_or_default();
    Dispersion { a2, a3 }
}

fn smooth(phase: &[f64], weights: &[f64]) -> Fit {
    let q: Vec<f64> = (0..phase.len()).map(|m| band_coordinate(m, phase.len())).collect();
    Fit::new(&q, phase, weights, DEGREE)
}

fn rising(wavenumber: Wavenumber) -> Result<Wavenumber> {
    if wavenumber.k.windows(2).all(|pair| pair[0] < pair[1]) {
        Ok(wavenumber)
    } else {
        Err(Error::failed(
            "the phase of the mirrors does not rise all through the spectrum: record clearer fringes",
        ))
    }
}

/// One fringe.
struct Fringe {
    /// Unwrapped phase, rad, rising.
    phase: Vec<f64>,
    /// Squared amplitude, the weight of the phase.
    weights: Vec<f64>,
}

impl Fringe {
    /// From a spectrum with one dominant fringe: the analytic signal within half of its frequency.
    fn of(spectrum: &[f64]) -> Result<Self> {
        let images = spectrum.len();
        if images < 8 * FEWEST_FRINGES || !spectrum.iter().all(|value| value.is_finite()) {
            return Err(Error::failed(format!(
                "a mirror spectrum of {images} samples: at least {} finite ones are needed",
                8 * FEWEST_FRINGES
            )));
        }
        let peak = peak(spectrum)?;
        let mut planner = FftPlanner::new();
        let mut signal: Vec<Complex64> = spectrum.iter().map(|&v| Complex64::new(v, 0.0)).collect();
        planner.plan_fft_forward(images).process(&mut signal);
        for (z, value) in signal.iter_mut().enumerate() {
            *value *= pass(z as f64 / peak as f64) * f64::from(u8::from(z < images / 2));
        }
        planner.plan_fft_inverse(images).process(&mut signal);
        let weights = signal.iter().map(Complex64::norm_sqr).collect();
        Ok(Self { phase: unwrapped(&signal), weights })
    }
}

/// Number of fringes over the spectrum: the brightest depth.
fn peak(spectrum: &[f64]) -> Result<usize> {
    let images = spectrum.len();
    let hann = |m| 0.5 + 0.5 * (PI * band_coordinate(m, images)).cos();
    let mut depths: Vec<Complex64> =
        spectrum.iter().enumerate().map(|(m, &v)| Complex64::new(v * hann(m), 0.0)).collect();
    FftPlanner::new().plan_fft_forward(images).process(&mut depths);
    let amplitudes: Vec<f64> =
        depths[FEWEST_FRINGES..images / 2].iter().map(|value| value.norm()).collect();
    let mut sorted = amplitudes.clone();
    sorted.sort_by(f64::total_cmp);
    let brightest = sorted[sorted.len() - 1];
    let place = amplitudes.iter().position(|&amplitude| amplitude == brightest);
    let light: f64 = spectrum.iter().map(|value| value.abs()).sum();
    let least = (LEAST_PEAK * sorted[sorted.len() / 2]).max(LEAST_SHARE * light);
    match place {
        Some(place) if brightest > least => Ok(place + FEWEST_FRINGES),
        _ => Err(Error::failed(
            "a mirror spectrum shows no fringe that stands out: is it one, of a mirror in focus?",
        )),
    }
}

/// Passes frequencies near 1, none below 0.5 or above 1.5.
fn pass(frequency: f64) -> f64 {
    let inside = ((0.5 - (frequency - 1.0).abs()) / 0.3).clamp(0.0, 1.0);
    (0.5 * PI * inside).sin().powi(2)
}

fn unwrapped(signal: &[Complex64]) -> Vec<f64> {
    let mut phase = signal.first().map_or(0.0, |value| value.arg());
    let mut phases = vec![phase; signal.len()];
    for (pair, place) in signal.windows(2).zip(&mut phases[1..]) {
        phase += (pair[1] * pair[0].conj()).arg();
        *place = phase;
    }
    phases
}

#[cfg(test)]
mod tests {
    use super::*;

    const IMAGES: usize = 1024;

    /// Mean wavenumber along the samples: q with a bend, as of a spectrometer.
    fn k(q: f64) -> f64 {
        q - 0.12 * (q * q - 1.0) + 0.01 * q.powi(3)
    }

    /// Spectrum of a mirror at `depth` pixels, behind zero delay where negative.
    fn mirror(depth: f64, dispersion: Dispersion) -> Vec<f64> {
        let value = |m| {
            let q = band_coordinate(m, IMAGES);
            let envelope = (-2.0 * q * q).exp();
            let phase = PI * depth * k(q) + dispersion.phase(k(q)) + 0.1 * (9.0 * q).sin();
            envelope * (0.3 + phase.cos())
        };
        (0..IMAGES).map(value).collect()
    }

    /// Largest distance of k from the truth, as a share of the band.
    fn error(found: &Wavenumber) -> f64 {
        let (first, last) = (found.k[0], found.k[IMAGES - 1]);
        let truth: Vec<f64> = (0..IMAGES).map(|m| k(band_coordinate(m, IMAGES))).collect();
        let span = truth[IMAGES - 1] - truth[0];
        let pairs = found.k.iter().zip(&truth);
        let distance =
            pairs.map(|(k, t)| ((k - first) / (last - first) - (t - truth[0]) / span).abs());
        distance.fold(0.0, f64::max)
    }

    #[test]
    fn two_mirrors_on_either_side_give_k_and_dispersion() {
        let dispersion = Dispersion { a2: 5.0, a3: -1.5 };
        for (depths, sides) in [([60.0, 150.0], Sides::Same), ([60.0, -150.0], Sides::Opposite)] {
            let mirrors = depths.map(|depth| mirror(depth, dispersion));
            let found = wavenumber(&mirrors, None).unwrap();
            assert_eq!(found.sides, Some(sides));
            assert!(error(&found) < 5e-4, "{sides:?} {}", error(&found));
            let mirrors_own = found.dispersion.unwrap();
            assert!((mirrors_own.a2 - 5.0).abs() < 0.2, "{mirrors_own:?}");
            assert!((mirrors_own.a3 + 1.5).abs() < 0.4, "{mirrors_own:?}");
            // The wrong combination leaves the dispersion in k.
            let wrong = if sides == Sides::Same { Sides::Opposite } else { Sides::Same };
            let found = wavenumber(&mirrors, Some(wrong)).unwrap();
            assert!(error(&found) > 2e-3, "{sides:?} {}", error(&found));
        }
    }

    #[test]
    fn one_mirror_is_enough_without_dispersion() {
        let found = wavenumber(&[mirror(150.0, Dispersion::default())], None).unwrap();
        assert!(error(&found) < 1e-3, "{}", error(&found));
    }

    #[test]
    fn what_is_no_mirror_is_refused() {
        let none = Dispersion::default();
        let refused =
            |mirrors: &[Vec<f64>], sides| wavenumber(mirrors, sides).unwrap_err().to_string();
        assert!(refused(&[vec![0.0; IMAGES]], None).contains("no fringe"));
        assert!(refused(&[vec![1.0; IMAGES]], None).contains("no fringe"));
        assert!(refused(&[vec![f64::NAN; IMAGES]], None).contains("finite"));
        assert!(refused(&[vec![1.0; 100]], None).contains("100 samples"));
        assert!(refused(&[], None).contains("one mirror spectrum or two"));
        let pair = [mirror(100.0, none), mirror(100.0, none)];
        assert!(refused(&pair, Some(Sides::Same)).contains("same depth"));
        let short = [mirror(100.0, none), mirror(200.0, none)[..1000].to_vec()];
        assert!(refused(&short, None).contains("length"));
    }
}
