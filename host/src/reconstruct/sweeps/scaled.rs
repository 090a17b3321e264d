//! The trace in units of its noise, so that every group counts by what it can tell.

use super::trace::Trace;

/// Lanes of a vector register: the groups are padded to a multiple.
pub(super) const LANES: usize = 8;
/// Median of χ² with one degree of freedom.
const CHI2_MEDIAN: f64 = 0.4549;
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

    /// Mean square difference of two images, 2 where only noise differs.
    pub fn distance(&self, a: usize, b: usize) -> f32 {
        self.image(a).iter().zip(self.image(b)).map(|(a, b)| (a - b) * (a - b)).sum()
    }
}

/// Noise of each group in DN, from images one period apart: the median is not moved by bad sweeps.
pub(super) fn noise_of_repeat(trace: &Trace, period: usize) -> Vec<f64> {
    let pairs = trace.images().saturating_sub(period);
    let square = |channel: usize, image: usize| {
        let difference = trace.image(image + period)[channel] - trace.image(image)[channel];
        f64::from(difference).powi(2)
    };
    (0..trace.channels())
        .map(|channel| {
            let median = quantile((0..pairs).map(|image| square(channel, image)), 0.5);
            (median / (2.0 * CHI2_MEDIAN)).sqrt()
        })
        .collect()
}

/// The value below which `share` of the values lie; 0 of none.
pub(in crate::reconstruct) fn quantile(values: impl Iterator<Item = f64>, share: f64) -> f64 {
    let mut values: Vec<f64> = values.collect();
    if values.is_empty() {
        return 0.0;
    }
    let index = ((values.len() - 1) as f64 * share).round() as usize;
    *values.select_nth_unstable_by(index, f64::total_cmp).1
}
