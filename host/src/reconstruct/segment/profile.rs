//! The mean A-line along a surface, finer than the pixels, and sharpened.
//!
//! A tilted surface crosses the pixels at every fraction: each intensity goes to the bin of its own
//! distance z − s(y, x), without interpolation, and so the mean is not blurred.

use super::volume::{Band, Volume};
use crate::reconstruct::quantile::quantile;
use rayon::prelude::*;
use std::f64::consts::PI;

/// Bins per depth pixel.
pub(super) const FINE: usize = 4;
/// A bin counts from this share of the fullest on, and the profile where this share of the field is.
const LEAST_SHARE: f64 = 0.05;
const LEAST_COVER: f64 = 0.3;
/// Rows that go to one half, the next to the other: more than a speckle.
const HALF_ROWS: usize = 4;
/// Share of the bins that are taken for noise.
const FLOOR_SHARE: f64 = 0.05;
/// Iterations of the sharpening: enough to part layers 2.5 px apart.
const SHARPENING: usize = 40;
/// Reach of the axial point spread in pixels.
const SPREAD_PX: usize = 3;
/// Smoothing of the sharpened profile in pixels.
const SHARP_SIGMA_PX: f64 = 0.3;

/// A mean A-line: `values[i]` at distance `first + i / FINE` from the surface.
pub(super) struct Profile {
    pub first: f64,
    pub values: Vec<f64>,
    /// 1 where there are intensities, 0 where `values` are filled in.
    known: Vec<f64>,
    /// Level without layers.
    pub floor: f64,
    /// Relative rms noise, from two halves of the field.
    pub noise: f64,
}

/// Sums of the intensities and their number per bin.
struct Bins {
    first: i64,
    sums: Vec<[f64; 2]>,
}

impl Bins {
    fn new(first: i64, count: usize) -> Self {
        Self { first, sums: vec![[0.0; 2]; count] }
    }

    fn add(&mut self, distance_px: f32, value: f32) {
        // A cast rounds towards 0, and in far less time than a call of `round`.
        let place = distance_px * FINE as f32 - self.first as f32 + 0.5;
        if place < 0.0 {
            return;
        }
        if let Some(sum) = self.sums.get_mut(place as usize) {
            sum[0] += f64::from(value);
            sum[1] += 1.0;
        }
    }

    fn merge(&mut self, other: &Self) {
        for (sum, other) in self.sums.iter_mut().zip(&other.sums) {
            sum[0] += other[0];
            sum[1] += other[1];
        }
    }

    /// Means of the bins, neighbours with half the weight, and where there are any.
    fn means(&self) -> (Vec<f64>, Vec<f64>) {
        let count = self.sums.len();
        let blended: Vec<[f64; 2]> = (0..count)
            .map(|at| {
                let near = |at: usize| self.sums.get(at).copied().unwrap_or([0.0; 2]);
                let (before, here, after) = (near(at.wrapping_sub(1)), near(at), near(at + 1));
                [0, 1].map(|part| here[part] + 0.5 * (before[part] + after[part]))
            })
            .collect();
        let fullest = blended.iter().map(|bin| bin[1]).fold(0.0, f64::max);
        let least = (LEAST_SHARE * fullest).max(0.5);
        let known = blended.iter().map(|bin| f64::from(u8::from(bin[1] > least))).collect();
        let values = blended.iter().map(|bin| bin[0] / bin[1].max(0.5)).collect();
        (values, known)
    }
}

/// The profile of a whole volume along `surface`, where a third of the field has it.
pub(super) fn of_volume(volume: Volume, surface: &[f32]) -> Profile {
    let low = quantile(surface.iter().map(|&depth| f64::from(depth)), 1.0 - LEAST_COVER);
    let high = quantile(surface.iter().map(|&depth| f64::from(depth)), LEAST_COVER);
    let first = (-low).ceil() as i64 * FINE as i64;
    let last = (volume.depths as f64 - 1.0 - high).floor() as i64 * FINE as i64;
    let count = (last - first + 1).max(1) as usize;
    of_rows(volume.rows, first, count, |bins, y| {
        let surface = &surface[y * volume.columns..][..volume.columns];
        for z in 0..volume.depths {
            for (value, depth) in volume.row(z, y).iter().zip(surface) {
                bins.add(z as f32 - depth, *value);
            }
        }
    })
}

/// The profile of a band along `surface` between two distances in pixels.
pub(super) fn of_band(band: &Band, surface: &[f32], from_px: f64, to_px: f64) -> Profile {
    let first = (from_px * FINE as f64).floor() as i64;
    let count = ((to_px - from_px) * FINE as f64).ceil() as usize + 1;
    of_rows(band.rows, first, count, |bins, y| {
        let from = y * band.columns;
        for (x, place) in surface[from..from + band.columns].iter().enumerate() {
            let (line, depth) = band.a_line(from + x);
            for (i, value) in line.iter().enumerate().filter(|(_, value)| value.is_finite()) {
                bins.add(depth + i as f32 - place, *value);
            }
        }
    })
}

/// Fills bins row by row: each group of rows by itself, so that threads do not matter.
fn of_rows(
    rows: usize,
    first: i64,
    count: usize,
    fill: impl Fn(&mut Bins, usize) + Sync,
) -> Profile {
    let groups: Vec<Bins> = (0..rows.div_ceil(HALF_ROWS))
        .into_par_iter()
        .map(|group| {
            let mut bins = Bins::new(first, count);
            let end = rows.min((group + 1) * HALF_ROWS);
            (group * HALF_ROWS..end).for_each(|y| fill(&mut bins, y));
            bins
        })
        .collect();
    let mut halves = [Bins::new(first, count), Bins::new(first, count)];
    for (group, bins) in groups.iter().enumerate() {
        halves[group % 2].merge(bins);
    }
    let noise = difference(&halves);
    let [mut all, other] = halves;
    all.merge(&other);
    let (values, known) = all.means();
    let seen = values.iter().zip(&known).filter(|(_, known)| **known > 0.0);
    let floor = quantile(seen.map(|(value, _)| *value), FLOOR_SHARE);
    let mut profile = Profile { first: first as f64 / FINE as f64, values, known, floor, noise };
    profile.fill();
    profile
}

/// rms of the relative half difference of two profiles, from its median.
fn difference(halves: &[Bins; 2]) -> f64 {
    let [(a, a_known), (b, b_known)] = [halves[0].means(), halves[1].means()];
    let known = a_known.iter().zip(&b_known).map(|(a, b)| a * b > 0.0);
    let relative = a.iter().zip(&b).zip(known).filter(|(_, known)| *known);
    let relative = relative.map(|((a, b), _)| ((a - b) / (a + b).max(f64::MIN_POSITIVE)).abs());
    quantile(relative, 0.5) / 0.6745
}

impl Profile {
    /// Distance from the surface of a (fractional) bin, pixels.
    pub fn distance(&self, bin: f64) -> f64 {
        self.first + bin / FINE as f64
    }

    /// Value at a distance from the surface, linear between the bins, constant outside.
    pub fn at(&self, distance_px: f64) -> f64 {
        let place =
            ((distance_px - self.first) * FINE as f64).clamp(0.0, (self.values.len() - 1) as f64);
        let low = (place as usize).min(self.values.len().saturating_sub(2));
        let part = place - low as f64;
        let high = (low + 1).min(self.values.len() - 1);
        (1.0 - part) * self.values[low] + part * self.values[high]
    }

    /// The layers without the axial point spread, floor removed.
    pub fn sharpened(&self) -> Vec<f64> {
        convolve(&self.layers(), &gaussian(SHARP_SIGMA_PX))
    }

    /// Fills the bins without intensities, as along a flat surface, with what the layers give there.
    fn fill(&mut self) {
        if self.known.iter().all(|&known| known > 0.0) {
            return;
        }
        let seen = convolve(&self.layers(), &axial_spread());
        for ((value, known), seen) in self.values.iter_mut().zip(&self.known).zip(seen) {
            if *known == 0.0 {
                *value = seen + self.floor;
            }
        }
    }

    /// Richardson–Lucy: x ← x · Sᵀ(w d / S x) / Sᵀw, with the point spread S and the known bins w.
    fn layers(&self) -> Vec<f64> {
        let spread = axial_spread();
        let data: Vec<f64> =
            self.values.iter().map(|value| (value - self.floor).max(0.0)).collect();
        let weighted = data.iter().zip(&self.known).map(|(data, known)| data * known);
        let mean = weighted.sum::<f64>() / self.known.iter().sum::<f64>().max(1.0);
        let norm = convolve(&self.known, &spread);
        let mut layers = vec![mean; data.len()];
        for _ in 0..SHARPENING {
            let seen = convolve(&layers, &spread);
            let ratio = data.iter().zip(&seen).zip(&self.known);
            let ratio: Vec<f64> =
                ratio.map(|((data, seen), known)| known * data / seen.max(1e-6 * mean)).collect();
            for ((value, factor), norm) in
                layers.iter_mut().zip(convolve(&ratio, &spread)).zip(&norm)
            {
                *value *= factor / norm.max(0.01);
            }
        }
        layers
    }
}

/// |Hann window in depth|² with the bins' own width, on the fine grid, sum 1.
fn axial_spread() -> Vec<f64> {
    let reach = (SPREAD_PX * FINE) as i64;
    let hann = |bin: i64| -> f64 {
        let u = bin as f64 / FINE as f64;
        if u == 0.0 {
            1.0
        } else if (u.abs() - 1.0).abs() < 1e-9 {
            0.5
        } else {
            (PI * u).sin() / (PI * u) / (1.0 - u * u)
        }
    };
    let square: Vec<f64> = (-reach..=reach).map(|bin| hann(bin).powi(2)).collect();
    normalised(convolve(&square, &[0.25, 0.5, 0.25]))
}

fn gaussian(sigma_px: f64) -> Vec<f64> {
    let sigma = sigma_px * FINE as f64;
    let reach = (3.0 * sigma).ceil() as i64;
    normalised((-reach..=reach).map(|at| (-0.5 * (at as f64 / sigma).powi(2)).exp()).collect())
}

fn normalised(kernel: Vec<f64>) -> Vec<f64> {
    let sum: f64 = kernel.iter().sum();
    kernel.into_iter().map(|value| value / sum).collect()
}

/// Convolution with a symmetric kernel; the ends are continued.
fn convolve(values: &[f64], kernel: &[f64]) -> Vec<f64> {
    let reach = kernel.len() as i64 / 2;
    let last = values.len() as i64 - 1;
    (0..=last)
        .map(|at| {
            let near = |offset: usize| (at + offset as i64 - reach).clamp(0, last) as usize;
            kernel.iter().enumerate().map(|(i, weight)| weight * values[near(i)]).sum()
        })
        .collect()
}
