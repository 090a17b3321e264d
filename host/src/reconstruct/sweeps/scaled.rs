//! The trace in units of its noise, so that every group counts by what it can tell.

use super::trace::Trace;
use crate::reconstruct::quantile::quantile;

/// Lanes of a vector register: the groups are padded to a multiple.
pub(super) const LANES: usize = 8;
/// The change that this share of the images does not exceed is the usual one: more than half may lie
/// next to a bad sweep.
const QUIET_SHARE: f64 = 1.0 / 3.0;
/// The same share of χ² with one degree of freedom lies below this.
const CHI2_QUIET: f64 = 0.1855;
/// Least noise of a group mean in DN: that of rounding.
const LEAST_NOISE_DN: f64 = 0.02;
/// An image counts as dark below this share of a bright one.
const DARK_SHARE: f32 = 0.25;
/// An image counts as clipped above this share of its pixels.
const CLIPPED_SHARE: f32 = 0.3;

/// Group means over noise: a matching image differs by 1 in the mean square over the groups.
pub(super) struct Scaled {
    /// Groups with padding.
    pub stride: usize,
    /// Means / (σ √P), shape (image, stride).
    pub values: Vec<f32>,
    /// Mean over the groups in DN, one per image.
    pub brightness: Vec<f32>,
    /// Hardly any light, one per image.
    pub dark: Vec<bool>,
    /// Many pixels at full scale, one per image.
    pub clipped: Vec<bool>,
}

impl Scaled {
    /// Scales by `noise_dn`, one standard deviation per group.
    pub fn new(trace: &Trace, noise_dn: &[f64]) -> Self {
        let stride = trace.channels().next_multiple_of(LANES);
        let share = (trace.channels() as f64).sqrt();
        let factor: Vec<f32> = noise_dn
            .iter()
            .map(|noise| (1.0 / (noise.max(LEAST_NOISE_DN) * share)) as f32)
            .collect();
        let mut values = vec![0.0; trace.images() * stride];
        for (image, to) in values.chunks_exact_mut(stride).enumerate() {
            for ((to, from), factor) in to.iter_mut().zip(trace.image(image)).zip(&factor) {
                *to = from * factor;
            }
        }
        let brightness = trace.brightness();
        let bright = quantile(brightness.iter().map(|&value| f64::from(value)), 0.9) as f32;
        let dark = brightness.iter().map(|&value| value < DARK_SHARE * bright).collect();
        let clipped = trace.clipped().iter().map(|&share| share > CLIPPED_SHARE).collect();
        Self { stride, values, brightness, dark, clipped }
    }

    /// Number of images.
    pub fn images(&self) -> usize {
        self.brightness.len()
    }

    /// One image.
    pub fn image(&self, image: usize) -> &[f32] {
        &self.values[image * self.stride..][..self.stride]
    }

    /// Mean square of 2 x(now) − x(old) − x(new), 6 where only noise differs.
    pub fn bend(&self, old: usize, now: usize, new: usize) -> f32 {
        let (old, now, new) = (self.image(old), self.image(now), self.image(new));
        let each = old.iter().zip(now).zip(new);
        each.map(|((old, now), new)| (2.0 * now - old - new).powi(2)).sum()
    }

    /// Mean square difference of two images, 2 where only noise differs.
    pub fn distance(&self, a: usize, b: usize) -> f32 {
        self.image(a).iter().zip(self.image(b)).map(|(a, b)| (a - b) * (a - b)).sum()
    }
}

/// Noise of each group in DN, from images one period apart.
pub(super) fn noise_of_repeat(trace: &Trace, period: usize) -> Vec<f64> {
    (0..trace.channels())
        .map(|channel| {
            let value = |image: usize| trace.image(image)[channel];
            let quiet = usual_change(trace.images(), period, |old, now, new| {
                (2.0 * value(now) - value(old) - value(new)).powi(2)
            });
            (quiet / CHI2_QUIET).sqrt()
        })
        .collect()
}

/// Usual `square` of x(n) − 2 x(n + lag) + x(n + 2 lag) over the recording, per variance of x.
///
/// The second difference leaves out the slow change of power, but a bad sweep spoils three of them;
/// of first differences it spoils two. Either is too large, if anything: the smaller counts.
pub(super) fn usual_change(
    images: usize,
    lag: usize,
    square: impl Fn(usize, usize, usize) -> f32,
) -> f64 {
    // x(n) − 2 x(n) + x(n + lag) is the first difference.
    let first = |image| f64::from(square(image, image, image + lag)) / 2.0;
    let first = quantile((0..images.saturating_sub(lag)).map(first), QUIET_SHARE);
    let triples = images.saturating_sub(2 * lag);
    if triples < lag {
        return first;
    }
    let second = |image| f64::from(square(image, image + lag, image + 2 * lag)) / 6.0;
    first.min(quantile((0..triples).map(second), QUIET_SHARE))
}
