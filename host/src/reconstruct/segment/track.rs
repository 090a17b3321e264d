//! Where a layer lies in every A-line: the most likely shift of the mean A-line.
//!
//! Speckle intensities I of mean μ scatter like exp(−I/μ)/μ, so a shift s has the log-likelihood
//! −Σ_z [ln μ(z − s) + I(z)/μ(z − s)] (per speckle), which weights every depth as it deserves. The
//! likelihoods are smoothed over the field along the surface known so far, then the shifts follow
//! from cheapest paths in four directions (semi-global matching: Hirschmüller, PAMI 30, 328 (2008)).

use super::flatten::vertex;
use super::lateral;
use super::profile::Profile;
use super::volume::Band;
use rayon::prelude::*;

/// Shifts per depth pixel.
const STEPS_PER_PX: usize = 4;
/// Entries per depth pixel of the tables of ln μ and 1/μ.
const TABLE: usize = 16;
/// Brightness classes per factor of two, and their number to either side of 1.
const CLASSES_PER_OCTAVE: f32 = 2.0;
const CLASSES: i32 = 8;
/// Intensities above this multiple of the highest mean are cut off.
const BRIGHTEST: f32 = 5.0;
/// Costs of a path: one step, and any larger one, in units of the likelihood's spread.
const ONE_STEP: f32 = 0.1;
const ANY_STEP: f32 = 0.5;

/// How a layer is followed.
pub(super) struct Search {
    /// Distances from the surface between which intensities count, pixels.
    pub window_px: [f64; 2],
    /// Largest shift, pixels.
    pub range_px: f64,
    /// Smoothing of the likelihoods, pixels.
    pub sigma_px: f64,
    /// Smoothing of the shifts, pixels.
    pub smooth_px: f64,
}

/// ln μ and 1/μ of every brightness class on a fine grid of distances.
struct Tables {
    first: f32,
    length: usize,
    values: Vec<[f32; 2]>,
    brightest: f32,
}

impl Tables {
    fn new(profile: &Profile, from_px: f64, to_px: f64) -> Self {
        let length = ((to_px - from_px) * TABLE as f64).ceil() as usize + 1;
        let mean = |at: usize| profile.at(from_px + at as f64 / TABLE as f64);
        let top = (0..length).map(mean).fold(0.0, f64::max);
        let values = (-CLASSES..=CLASSES)
            .flat_map(|class| {
                let factor = (f64::from(class) / f64::from(CLASSES_PER_OCTAVE)).exp2();
                (0..length).map(move |at| {
                    let level = profile.floor + factor * (mean(at) - profile.floor);
                    let level = level.max(1e-3 * top).max(f64::MIN_POSITIVE);
                    [level.ln() as f32, (1.0 / level) as f32]
                })
            })
            .collect();
        Self { first: from_px as f32, length, values, brightest: BRIGHTEST * top as f32 }
    }

    /// Table of an A-line's brightness, and where its intensities are cut off.
    fn class(&self, brightness: f32) -> (&[[f32; 2]], f32) {
        let class = (brightness.max(1e-6).log2() * CLASSES_PER_OCTAVE).round() as i32;
        let class = (class.clamp(-CLASSES, CLASSES) + CLASSES) as usize;
        let limit = self.brightest * brightness.max(1.0);
        (&self.values[class * self.length..][..self.length], limit)
    }
}

/// Shift of the layer from `surface` in every A-line, pixels.
pub(super) fn shifts(
    band: &Band,
    surface: &[f32],
    brightness: &[f32],
    profile: &Profile,
    search: &Search,
) -> Vec<f32> {
    let steps = 2 * (search.range_px * STEPS_PER_PX as f64).round() as usize + 1;
    let mut likelihood = likelihoods(band, surface, brightness, profile, search, steps);
    lateral::smooth(&mut likelihood, band.rows, band.columns, search.sigma_px);
    let paths = cheapest_steps(&likelihood, band.rows, band.columns, steps);
    let (mut shift, mut weight) = (Vec::new(), Vec::new());
    for (curve, &step) in likelihood.chunks_exact(steps).zip(&paths) {
        let best = (step.saturating_sub(2)..(step + 3).min(steps))
            .max_by(|&a, &b| curve[a].total_cmp(&curve[b]))
            .unwrap_or(step);
        let place = best as f64 + vertex(curve, best) - (steps / 2) as f64;
        shift.push((place / STEPS_PER_PX as f64) as f32);
        weight.push(bend(curve, best));
    }
    let floor = 1e-3 * weight.iter().sum::<f32>() / weight.len().max(1) as f32;
    weight.iter_mut().for_each(|weight| *weight += floor + f32::MIN_POSITIVE);
    lateral::smooth_weighted(&shift, &weight, band.rows, band.columns, search.smooth_px)
}

/// Curvature of a likelihood: the information on the shift.
fn bend(curve: &[f32], at: usize) -> f32 {
    if at == 0 || at + 1 >= curve.len() {
        return 0.0;
    }
    (2.0 * curve[at] - curve[at - 1] - curve[at + 1]).max(0.0)
}

/// Log-likelihood of every shift in every A-line, shape (y, x, shift).
fn likelihoods(
    band: &Band,
    surface: &[f32],
    brightness: &[f32],
    profile: &Profile,
    search: &Search,
    steps: usize,
) -> Vec<f32> {
    let [from, to] = search.window_px;
    let margin = search.range_px + 1.0;
    let tables = Tables::new(profile, from - margin, to + margin);
    let (from, to) = (from as f32, to as f32);
    let reach = (steps / 2 * (TABLE / STEPS_PER_PX)) as i64;
    let mut all = vec![0.0_f32; surface.len() * steps];
    all.par_chunks_mut(steps).with_min_len(64).enumerate().for_each(|(at, curve)| {
        let (line, depth) = band.a_line(at);
        let (table, limit) = tables.class(brightness[at]);
        let start = depth - surface[at];
        let low = (from - start).ceil().max(0.0) as usize;
        let high = ((to - start).floor().max(-1.0) + 1.0) as usize;
        for (i, &value) in line.iter().enumerate().take(high).skip(low) {
            if !value.is_finite() {
                continue;
            }
            let value = value.clamp(0.0, limit);
            let place = ((start + i as f32 - tables.first) * TABLE as f32 + 0.5) as i64 + reach;
            for (step, sum) in curve.iter_mut().enumerate() {
                let entry = place - (step * (TABLE / STEPS_PER_PX)) as i64;
                let entry = entry.clamp(0, tables.length as i64 - 1) as usize;
                let [log, inverse] = table[entry];
                *sum -= log + value * inverse;
            }
        }
    });
    all
}

/// For every A-line the step of least cost over paths from left, right, above and below.
fn cheapest_steps(likelihood: &[f32], rows: usize, columns: usize, steps: usize) -> Vec<usize> {
    let spread = spread(likelihood, steps);
    let penalty = [ONE_STEP * spread, ANY_STEP * spread];
    let width = columns * steps;
    let mut total = vec![0.0_f32; likelihood.len()];
    total.par_chunks_mut(width).zip(likelihood.par_chunks(width)).for_each(|(sum, row)| {
        let cells = || (0..columns).map(|x| x * steps..(x + 1) * steps);
        add_path(sum, row, cells(), penalty);
        add_path(sum, row, cells().rev(), penalty);
    });
    // A column is copied first: in place, every step would touch another page.
    let vertical: Vec<Vec<f32>> = (0..columns)
        .into_par_iter()
        .map(|x| {
            let column: Vec<f32> = (0..rows)
                .flat_map(|y| likelihood[(y * columns + x) * steps..][..steps].iter().copied())
                .collect();
            let mut sum = vec![0.0; column.len()];
            let cells = || (0..rows).map(|y| y * steps..(y + 1) * steps);
            add_path(&mut sum, &column, cells(), penalty);
            add_path(&mut sum, &column, cells().rev(), penalty);
            sum
        })
        .collect();
    (0..rows * columns)
        .into_par_iter()
        .map(|at| {
            let (y, x) = (at / columns, at % columns);
            let across = &total[at * steps..][..steps];
            let along = &vertical[x][y * steps..][..steps];
            let cost = |step: usize| across[step] + along[step];
            (0..steps).min_by(|&a, &b| cost(a).total_cmp(&cost(b))).unwrap_or(steps / 2)
        })
        .collect()
}

/// Adds to `sum` the least costs of paths that arrive along `cells`.
fn add_path(
    sum: &mut [f32],
    likelihood: &[f32],
    cells: impl Iterator<Item = std::ops::Range<usize>>,
    penalty: [f32; 2],
) {
    let mut before: Vec<f32> = Vec::new();
    for cell in cells {
        let own = &likelihood[cell.clone()];
        let mut here: Vec<f32> = own.iter().map(|value| -value).collect();
        if !before.is_empty() {
            let least = before.iter().copied().fold(f32::INFINITY, f32::min);
            for (step, cost) in here.iter_mut().enumerate() {
                let near = |step: usize| before.get(step).map_or(f32::INFINITY, |&cost| cost);
                let beside = near(step.wrapping_sub(1)).min(near(step + 1)) + penalty[0];
                *cost += before[step].min(beside).min(least + penalty[1]) - least;
            }
        }
        for (sum, cost) in sum[cell].iter_mut().zip(&here) {
            *sum += cost;
        }
        before = here;
    }
}

/// Typical difference between the best and the mean likelihood.
fn spread(likelihood: &[f32], steps: usize) -> f32 {
    let sum: f64 = likelihood
        .chunks_exact(steps)
        .map(|curve| {
            let best = curve.iter().copied().fold(f32::NEG_INFINITY, f32::max);
            f64::from(best - curve.iter().sum::<f32>() / steps as f32)
        })
        .sum();
    (sum / (likelihood.len() / steps).max(1) as f64) as f32
}
