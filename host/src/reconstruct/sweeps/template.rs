//! What a sweep looks like, and how well a stretch of images fits its beginning.

use super::scaled::{LANES, Scaled};
use crate::reconstruct::quantile::quantile;

/// Slow change of power that a fit may take up, and its prior.
const LARGEST_GAIN: f64 = 0.25;
/// 1/variance of the gain's prior (10 %).
const GAIN_PRIOR: f64 = 100.0;
/// A free-running camera starts up to one image late: half an image to either side of the middle.
const LARGEST_DELAY: f64 = 0.55;
/// The same while the middle is not known: a few sweeps may all have been late.
const LARGEST_UNCENTRED_DELAY: f64 = 0.8;
/// 1/variance of the delay's prior (half an image).
const DELAY_PRIOR: f64 = 4.0;

/// The median sweep T(m), m = 0 .. K−1.
pub(super) struct Template {
    /// Levels in units of the noise, shape (K, stride).
    level: Vec<f32>,
    /// dT/dm per image, same shape.
    slope: Vec<f32>,
    /// Median brightness in DN, K.
    pub brightness: Vec<f32>,
    /// Running sums over m of |T|², T·T', |T'|²: K + 1.
    moments: Vec<[f64; 3]>,
    stride: usize,
    /// Largest delay that a fit may take up.
    largest_delay: f64,
}

/// How a stretch of images fits the beginning of a sweep.
#[derive(Clone, Copy, Default)]
pub(super) struct Fit {
    /// Sum of squares left: about one per image when it fits.
    pub cost: f64,
    /// Relative excess of power.
    pub gain: f64,
    /// Images the camera started later than in the median sweep.
    pub delay: f64,
}

/// Running sums of the residual r = x − T: |r|², r·T, r·T'.
#[derive(Clone, Copy, Default)]
struct Sums([f64; 3]);

impl Template {
    /// The median over the sweeps that begin at `starts`, of `period` images each.
    pub fn median(data: &Scaled, starts: &[usize], period: usize) -> Self {
        let middle = |value: &dyn Fn(usize) -> f32| {
            let low = quantile(starts.iter().map(|&start| f64::from(value(start))), 0.45);
            let high = quantile(starts.iter().map(|&start| f64::from(value(start))), 0.55);
            (0.5 * (low + high)) as f32
        };
        let level = (0..period * data.stride)
            .map(|at| middle(&|start| data.values[start * data.stride + at]))
            .collect();
        let brightness = (0..period).map(|m| middle(&|start| data.brightness[start + m])).collect();
        Self::new(level, brightness, data.stride)
    }

    fn new(level: Vec<f32>, brightness: Vec<f32>, stride: usize) -> Self {
        let period = brightness.len();
        let slope = (0..period * stride)
            .map(|at| {
                let (m, channel) = (at / stride, at % stride);
                let (before, after) = (m.saturating_sub(1), (m + 1).min(period - 1));
                let rise = level[after * stride + channel] - level[before * stride + channel];
                rise / (after - before).max(1) as f32
            })
            .collect();
        let mut template = Self {
            level,
            slope,
            brightness,
            moments: vec![[0.0; 3]],
            stride,
            largest_delay: LARGEST_UNCENTRED_DELAY,
        };
        for m in 0..period {
            let (level, slope) = template.image(m);
            let dot = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| f64::from(a * b)).sum();
            let here: [f64; 3] = [dot(level, level), dot(level, slope), dot(slope, slope)];
            let sum = template.moments[m];
            template.moments.push([sum[0] + here[0], sum[1] + here[1], sum[2] + here[2]]);
        }
        template
    }

    /// K.
    pub fn period(&self) -> usize {
        self.brightness.len()
    }

    /// The same sweep begun `phase` images later in its cycle.
    pub fn rotated(&self, phase: usize) -> Self {
        let mut level = self.level.clone();
        level.rotate_left(phase * self.stride);
        let mut brightness = self.brightness.clone();
        brightness.rotate_left(phase);
        Self::new(level, brightness, self.stride)
    }

    /// The sweep of a camera that starts `delay` later than this one, the middle of all delays.
    pub fn centred(&self, delay: f64) -> Self {
        let shifted = |(level, slope): (&f32, &f32)| level + delay as f32 * slope;
        let level = self.level.iter().zip(&self.slope).map(shifted).collect();
        let mut centred = Self::new(level, self.brightness.clone(), self.stride);
        centred.largest_delay = LARGEST_DELAY;
        centred
    }

    /// Level and slope of image m.
    fn image(&self, m: usize) -> (&[f32], &[f32]) {
        let range = m * self.stride..(m + 1) * self.stride;
        (&self.level[range.clone()], &self.slope[range])
    }

    /// Mean square over the sweep of the deviation from its mean: what there is to recognise.
    pub fn contrast(&self) -> f64 {
        let period = self.period();
        let variance = |channel: usize| {
            let values = || (0..period).map(|m| f64::from(self.level[m * self.stride + channel]));
            let mean = values().sum::<f64>() / period as f64;
            values().map(|value| (value - mean).powi(2)).sum::<f64>() / period as f64
        };
        (0..self.stride).map(variance).sum()
    }

    /// Mean square difference of image `image` at another `power` and T(m).
    pub fn distance(&self, data: &Scaled, image: usize, m: usize, power: f32) -> f64 {
        let pairs = data.image(image).iter().zip(self.image(m).0);
        f64::from(pairs.map(|(x, level)| (power * x - level).powi(2)).sum::<f32>())
    }

    /// How the `images` from `start` on fit images 0 .. of the sweep.
    pub fn fit(&self, data: &Scaled, start: usize, images: usize) -> Fit {
        let mut sums = Sums::default();
        for m in 0..images {
            self.add(&mut sums, data.image(start + m), m);
        }
        self.solve(&sums, images)
    }

    /// Costs of fits of the 1, 2, .. images from `start` on, one per place of `costs`.
    ///
    /// Costs grow with the length: once above `limit` they are not followed any further.
    pub fn prefix_costs(&self, data: &Scaled, start: usize, limit: f64, costs: &mut [f32]) {
        costs.fill(f32::INFINITY);
        let mut sums = Sums::default();
        for (m, to) in costs.iter_mut().enumerate() {
            self.add(&mut sums, data.image(start + m), m);
            let cost = self.solve(&sums, m + 1).cost;
            if cost > limit {
                return;
            }
            *to = cost as f32;
        }
    }

    fn add(&self, sums: &mut Sums, image: &[f32], m: usize) {
        let (level, slope) = self.image(m);
        let mut lanes = [[0.0_f32; LANES]; 3];
        let level = level.chunks_exact(LANES);
        let slope = slope.chunks_exact(LANES);
        for ((x, t), s) in image.chunks_exact(LANES).zip(level).zip(slope) {
            for lane in 0..LANES {
                let residual = x[lane] - t[lane];
                lanes[0][lane] += residual * residual;
                lanes[1][lane] += residual * t[lane];
                lanes[2][lane] += residual * s[lane];
            }
        }
        for (sum, lanes) in sums.0.iter_mut().zip(lanes) {
            *sum += f64::from(lanes.iter().sum::<f32>());
        }
    }

    /// Least squares of residual = gain·T + delay·T', both bounded.
    fn solve(&self, sums: &Sums, images: usize) -> Fit {
        let [square, by_level, by_slope] = sums.0;
        let [level, cross, slope] = self.moments[images];
        let (level, slope) = (level + GAIN_PRIOR, slope + DELAY_PRIOR);
        let determinant = level * slope - cross * cross;
        let free = (by_slope * level - by_level * cross) / determinant;
        let delay = free.clamp(-self.largest_delay, self.largest_delay);
        let gain = ((by_level - delay * cross) / level).clamp(-LARGEST_GAIN, LARGEST_GAIN);
        let cost = square - 2.0 * (gain * by_level + delay * by_slope)
            + gain * gain * level
            + delay * delay * slope
            + 2.0 * gain * delay * cross;
        Fit { cost: cost.max(0.0), gain, delay }
    }
}
