//! Whether the data repeat every K images, and what to suggest when they do not.

use super::scaled::{Scaled, usual_change};
use super::trace::Trace;
use crate::error::{Error, Result};
use crate::reconstruct::quantile::quantile;
use num_complex::Complex;
use rustfft::FftPlanner;

/// Shortest period looked for.
const SHORTEST: usize = 8;
/// Images and groups that suffice to find a period.
const IMAGES: usize = 1 << 15;
const GROUPS: usize = 16;
/// A peak of the autocorrelation counts from this share of the highest on.
const PEAK_SHARE: f64 = 0.95;
/// So many peaks are looked at, at most.
const PEAKS: usize = 16;
/// Another period is the true one when the images one apart differ this many times less.
const CLEARLY: f64 = 3.0;
/// A period is next to another one within this part of it.
const NEIGHBOURHOOD: usize = 8;
/// Differences at two lags are equal within this factor.
const EQUALLY: f64 = 1.5;

/// Refuses a K that is not the period of the data, or several periods.
pub(super) fn check(trace: &Trace, data: &Scaled, period: usize) -> Result<()> {
    let Some(other) = found(trace, data, 2 * period).filter(|&other| other != period) else {
        return Ok(());
    };
    let (given, better) = (unrest(data, period), unrest(data, other));
    let refuted = if period.is_multiple_of(other) {
        better < EQUALLY * given && unrest(data, other / 2) > CLEARLY * better
    } else {
        CLEARLY * better < given
    };
    if refuted { Err(wrong(other, period)) } else { Ok(()) }
}

/// The error of a recording in which most sweeps fit nothing.
pub(super) fn not_repeating(
    trace: &Trace,
    data: &Scaled,
    period: usize,
    good: usize,
    sweeps: usize,
) -> Error {
    match found(trace, data, 2 * period) {
        Some(other) if other != period && unrest(data, other) < unrest(data, period) => {
            wrong(other, period)
        }
        _ => Error::failed(format!(
            "only {good} of {sweeps} stretches look like a sweep of {period} images: check --images \
             and the recording, or give the run log"
        )),
    }
}

/// Another period next to the given one.
pub(super) fn neighbour(trace: &Trace, data: &Scaled, period: usize) -> Option<usize> {
    let next_to = |other: usize| other != period && other.abs_diff(period) < period / NEIGHBOURHOOD;
    found(trace, data, 2 * period).filter(|&other| next_to(other))
}

/// The error that names the period found.
pub(super) fn wrong(found: usize, period: usize) -> Error {
    Error::failed(format!(
        "the images repeat every {found}, not every {period}: use --images {found}, or check the \
         recording"
    ))
}

/// Usual change of images `lag` apart.
fn unrest(data: &Scaled, lag: usize) -> f64 {
    usual_change(data.images(), lag, |old, now, new| data.bend(old, now, new))
}

/// The shortest period that explains the data, apart from all that is slower than `window` images.
///
/// Of the lags with nearly the highest autocorrelation: at its multiples, too, the images differ
/// hardly more than at the best of these lags.
fn found(trace: &Trace, data: &Scaled, window: usize) -> Option<usize> {
    let peaks: Vec<(usize, f64)> =
        peaks(trace, window)?.into_iter().map(|lag| (lag, unrest(data, lag))).collect();
    let least = peaks.iter().map(|peak| peak.1).fold(f64::INFINITY, f64::min);
    let quiet = || peaks.iter().filter(|peak| peak.1 <= CLEARLY * least);
    let farthest = quiet().next_back()?.0;
    quiet().map(|peak| peak.0).find(|&lag| repeats(data, lag, farthest, least))
}

/// The first peaks of the autocorrelation that are nearly the highest.
fn peaks(trace: &Trace, window: usize) -> Option<Vec<usize>> {
    let images = trace.images().min(IMAGES);
    let longest = images / 2;
    if longest <= SHORTEST {
        return None;
    }
    let correlation = autocorrelation(trace, images, window);
    let unbiased: Vec<f64> =
        (0..longest).map(|lag| correlation[lag] * images as f64 / (images - lag) as f64).collect();
    let rises = (1..longest).find(|&lag| unbiased[lag] > unbiased[lag - 1])?;
    let from = rises.max(SHORTEST);
    let highest = unbiased[from..].iter().copied().fold(0.0, f64::max);
    let peak = |&lag: &usize| {
        let value = unbiased[lag];
        value > PEAK_SHARE * highest && value >= unbiased[lag - 1] && value >= unbiased[lag + 1]
    };
    Some((from..longest - 1).filter(peak).take(PEAKS).collect())
}

/// Whether the images differ little at all multiples of `lag`, up to the quiet peak `farthest`.
///
/// A fixed fringe repeats within a sweep, too, but the source's spectrum does not follow it far.
fn repeats(data: &Scaled, lag: usize, farthest: usize, least: f64) -> bool {
    let limit = CLEARLY * CLEARLY * least;
    (2..=farthest / lag).all(|times| unrest(data, times * lag) <= limit)
}

/// Sum over the groups of the autocorrelation, each group normalised and without outliers.
fn autocorrelation(trace: &Trace, images: usize, window: usize) -> Vec<f64> {
    let length = (2 * images).next_power_of_two();
    let mut planner = FftPlanner::<f32>::new();
    let (forward, inverse) = (planner.plan_fft_forward(length), planner.plan_fft_inverse(length));
    let mut power = vec![Complex::new(0.0, 0.0); length];
    for channel in 0..trace.channels().min(GROUPS) {
        let mut values = vec![Complex::new(0.0, 0.0); length];
        for (to, value) in values.iter_mut().zip(normalised(trace, channel, images, window)) {
            to.re = value;
        }
        forward.process(&mut values);
        for (sum, value) in power.iter_mut().zip(&values) {
            sum.re += value.norm_sqr();
        }
    }
    inverse.process(&mut power);
    power.iter().take(images).map(|value| f64::from(value.re)).collect()
}

/// One group without its slow changes, clipped where the rare bad sweeps are.
fn normalised(trace: &Trace, channel: usize, images: usize, window: usize) -> Vec<f32> {
    let value = |image: usize| f64::from(trace.image(image)[channel]);
    let mut sums = vec![0.0];
    for image in 0..images {
        sums.push(sums[image] + value(image));
    }
    let fast = |image: usize| {
        let (from, to) = (image.saturating_sub(window / 2), (image + window / 2).min(images));
        value(image) - (sums[to] - sums[from]) / (to - from).max(1) as f64
    };
    let fast: Vec<f64> = (0..images).map(fast).collect();
    let [low, high] = [0.1, 0.9].map(|share| quantile(fast.iter().copied(), share));
    let width = (high - low).max(f64::MIN_POSITIVE);
    fast.iter().map(|value| (value / width).clamp(-1.0, 1.0) as f32).collect()
}
