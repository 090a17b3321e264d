//! The board's clock against the host's: a line through the status answers of a run.
//!
//! A status says the board's tick between the request's writing and the answer's reading; the
//! middle of the two is its time on the host. What delays one of the two ways (the computer, USB)
//! lengthens the round trip, so only the quicker half of the samples is used, and of those the ones
//! near the line. A delay that is always the same does not change the slope.

use serde::{Deserialize, Serialize};

/// Fewer samples than this give no line.
const FEWEST: usize = 8;

/// Samples farther from the line than so many robust standard deviations are left out.
const OUTLIER: f64 = 3.5;

/// Standard deviation of a normal distribution in units of its median absolute deviation.
const NORMAL_MAD: f64 = 1.4826;

/// A fitted clock with a larger standard deviation than this is worse than most nominal ones.
pub const USEFUL_PPM: f64 = 100.0;

/// One comparison of the two clocks.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Sample {
    /// Middle of the round trip on the host's monotonic clock, in seconds since the log began.
    pub host_s: f64,
    /// From writing the request to reading the answer, in seconds.
    pub round_trip_s: f64,
    /// The board's clock, in ticks.
    pub tick: u64,
}

/// The board's clock as the host's sees it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Fit {
    /// Ticks per second of the host.
    pub ticks_per_second: f64,
    /// Deviation from the nominal clock, in parts per million; positive: the board is fast.
    pub ppm: f64,
    /// Standard deviation of `ppm` by the scatter of the samples. The error of the host's own clock
    /// (some tens of ppm without a time server) is not in it.
    pub ppm_sigma: f64,
    /// Root mean square of the samples' distance from the line, in seconds.
    pub residual_s: f64,
    /// Samples used.
    pub samples: usize,
    /// Samples taken.
    pub taken: usize,
}

impl Fit {
    /// Fit the samples of a run; `nominal` in ticks per second. `None` if there are too few.
    #[must_use]
    pub fn of(samples: &[Sample], nominal: u32) -> Option<Self> {
        let mut used = quick(samples);
        let mut line = Line::through(&used)?;
        // Leaving out changes the line, which changes what is left out: a few turns settle it.
        for _ in 0..5 {
            let near = line.near(&used);
            if near.len() == used.len() || near.len() < FEWEST {
                break;
            }
            used = near;
            line = Line::through(&used)?;
        }
        let ticks_per_second = 1.0 / line.slope;
        let ratio = ticks_per_second / f64::from(nominal);
        Some(Self {
            ticks_per_second,
            ppm: (ratio - 1.0) * 1e6,
            ppm_sigma: line.slope_sigma / line.slope * 1e6,
            residual_s: line.residual,
            samples: used.len(),
            taken: samples.len(),
        })
    }

    /// Whether times by this clock are to be preferred to those by the nominal one.
    #[must_use]
    pub fn is_useful(&self) -> bool {
        self.ppm_sigma.is_finite() && self.ppm_sigma < USEFUL_PPM
    }
}

/// Ticks since the first sample and host seconds since then, of the quicker half.
fn quick(samples: &[Sample]) -> Vec<(f64, f64)> {
    let mut trips: Vec<f64> = samples.iter().map(|sample| sample.round_trip_s).collect();
    trips.sort_by(f64::total_cmp);
    let limit = trips.get(trips.len() / 2).copied().unwrap_or(0.0);
    let Some(first) = samples.first() else { return Vec::new() };
    let point = |sample: &Sample| {
        (sample.tick.wrapping_sub(first.tick) as f64, sample.host_s - first.host_s)
    };
    samples.iter().filter(|sample| sample.round_trip_s <= limit).map(point).collect()
}

/// Host seconds as a line over ticks.
struct Line {
    slope: f64,
    middle: (f64, f64),
    slope_sigma: f64,
    residual: f64,
}

impl Line {
    fn through(points: &[(f64, f64)]) -> Option<Self> {
        if points.len() < FEWEST {
            return None;
        }
        let count = points.len() as f64;
        let middle = (
            points.iter().map(|(x, _)| x).sum::<f64>() / count,
            points.iter().map(|(_, y)| y).sum::<f64>() / count,
        );
        let (mut xx, mut xy) = (0.0, 0.0);
        for (x, y) in points {
            let (x, y) = (x - middle.0, y - middle.1);
            xx += x * x;
            xy += x * y;
        }
        let mut line = Self { slope: xy / xx, middle, slope_sigma: 0.0, residual: 0.0 };
        let squares: f64 = points.iter().map(|point| line.distance(point).powi(2)).sum();
        line.residual = (squares / count).sqrt();
        line.slope_sigma = (squares / (count - 2.0) / xx).sqrt();
        (line.slope.is_finite() && line.slope > 0.0).then_some(line)
    }

    fn distance(&self, (x, y): &(f64, f64)) -> f64 {
        (y - self.middle.1) - self.slope * (x - self.middle.0)
    }

    /// The points that are not outliers.
    fn near(&self, points: &[(f64, f64)]) -> Vec<(f64, f64)> {
        let mut sizes: Vec<f64> = points.iter().map(|point| self.distance(point).abs()).collect();
        sizes.sort_by(f64::total_cmp);
        let median = sizes.get(sizes.len() / 2).copied().unwrap_or(0.0);
        let limit = OUTLIER * NORMAL_MAD * median;
        points.iter().copied().filter(|point| self.distance(point).abs() <= limit).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Samples every 0.25 s of a board that runs fast by `ppm`, with now and then a late answer.
    fn samples(count: u32, ppm: f64) -> Vec<Sample> {
        let sample = |number: u32| {
            let middle = f64::from(number) * 0.25;
            let jitter = f64::from(number.wrapping_mul(2_654_435_761) >> 16) / 65_536.0 * 1e-4;
            let late = if number % 7 == 3 { 0.04 } else { 0.0 };
            let ticks = 16e6 * (1.0 + ppm * 1e-6) * (middle + 100.0);
            // What comes late comes back late: the middle moves by half of it.
            let host_s = middle + jitter / 2.0 + late / 2.0;
            Sample { host_s, round_trip_s: 0.002 + jitter + late, tick: ticks as u64 }
        };
        (0..count).map(sample).collect()
    }

    #[test]
    fn a_resonator_is_measured_in_spite_of_late_answers() {
        for ppm in [-2021.0, 0.0, 37.0] {
            let fit = Fit::of(&samples(64, ppm), 16_000_000).unwrap();
            assert!((fit.ppm - ppm).abs() < 5.0 * fit.ppm_sigma + 0.5, "{fit:?}");
            assert!(fit.ppm_sigma < 3.0 && fit.residual_s < 1e-4 && fit.is_useful(), "{fit:?}");
        }
    }

    #[test]
    fn too_few_samples_give_nothing() {
        assert_eq!(Fit::of(&samples(6, 0.0), 16_000_000), None);
        assert_eq!(Fit::of(&[], 16_000_000), None);
        let still = vec![Sample { host_s: 1.0, round_trip_s: 0.1, tick: 5 }; 20];
        assert_eq!(Fit::of(&still, 16_000_000), None);
    }
}
