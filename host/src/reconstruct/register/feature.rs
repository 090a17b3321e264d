//! What is compared of a volume: the soft logarithm of its amplitude, half-whitened.

use super::kernel::Noise;
use super::plan::Plan;
use super::whiten::Whiten;
use crate::simulate::vector_math::ln;
use rayon::prelude::*;

/// Intensity, relative to the mean one, below which the logarithm levels off: empty depths are
/// quiet.
const SOFT: f32 = 0.1;
/// Step of the columns and rows that decide on depths and levels.
const SPARSE: usize = 4;
/// Root mean square of the stored numbers.
pub const SCALE: f32 = 256.0;
/// Largest stored number, 8 sigma: a row's sum of products stays within 32 bits.
const LIMIT: f32 = 2047.0;

/// The kept depths of all blocks of one sweep, as numbers of unit variance times `SCALE`.
pub struct Feature {
    /// First depth kept.
    pub(super) first: usize,
    /// A block after the other, each (z, y, x).
    pub(super) blocks: Vec<Vec<i16>>,
    /// Mean square over all blocks of every depth kept.
    pub(super) energy: Vec<f64>,
    /// What its own correlation tells about noise and gain.
    pub(super) noise: Noise,
}

impl Feature {
    /// From |U| (z, y, x).
    pub(super) fn of(plan: &Plan, whiten: &Whiten, amplitude: &[f32]) -> Self {
        let intensity = depth_profile(plan, amplitude, |a| a * a);
        let mean = intensity.iter().sum::<f64>() / intensity.len() as f64;
        let floor = (SOFT * mean as f32).max(f32::MIN_POSITIVE);
        let soft = |a: f32| ln(a * a + floor);
        let first = brightest(&depth_profile(plan, amplitude, soft), plan.kept);
        let logarithms: Vec<Vec<f32>> = plan
            .blocks
            .iter()
            .map(|&corner| {
                without_column_means(plan, gathered(plan, amplitude, first, corner, soft))
            })
            .collect();
        let filter = whiten.filter(&logarithms);
        let blocks: Vec<Vec<i16>> =
            logarithms.into_iter().map(|block| stored(whiten, &filter, block)).collect();
        let energy = energy(plan, &blocks);
        let noise = Noise::of(plan, &blocks, &energy);
        Self { first, blocks, energy, noise }
    }
}

/// Mean of `value` over a sparse grid of columns, for every depth.
fn depth_profile(plan: &Plan, amplitude: &[f32], value: impl Fn(f32) -> f32 + Sync) -> Vec<f64> {
    let [_, height, width] = plan.size;
    amplitude
        .par_chunks(height * width)
        .map(|plane| {
            let rows = plane.chunks(width).skip(SPARSE / 2).step_by(SPARSE);
            let (sum, count) = rows
                .flat_map(|row| row.iter().skip(SPARSE / 2).step_by(SPARSE))
                .fold((0.0, 0u32), |(sum, n), &a| (sum + f64::from(value(a)), n + 1));
            sum / f64::from(count.max(1))
        })
        .collect()
}

/// Start of the `kept` neighbouring depths with the largest sum of `profile`.
fn brightest(profile: &[f64], kept: usize) -> usize {
    let mut sum: f64 = profile[..kept].iter().sum();
    let mut best = (sum, 0);
    for start in 1..=profile.len() - kept {
        sum += profile[start + kept - 1] - profile[start - 1];
        if sum > best.0 {
            best = (sum, start);
        }
    }
    best.1
}

/// `value` of the kept depths of the block at `corner`, (z, y, x).
fn gathered(
    plan: &Plan,
    amplitude: &[f32],
    first: usize,
    corner: [usize; 2],
    value: impl Fn(f32) -> f32 + Sync,
) -> Vec<f32> {
    let [_, height, width] = plan.size;
    let [rows, columns] = plan.block;
    let mut block = vec![0.0; plan.kept * rows * columns];
    block.par_chunks_mut(rows * columns).enumerate().for_each(|(z, plane)| {
        let volume = &amplitude[(first + z) * height * width..][..height * width];
        for (y, row) in plane.chunks_mut(columns).enumerate() {
            let from = &volume[(corner[0] + y) * width + corner[1]..][..columns];
            row.iter_mut().zip(from).for_each(|(to, &a)| *to = value(a));
        }
    });
    block
}

/// Takes the mean over depth off every column: vignetting and dead pixels do not move with the eye.
fn without_column_means(plan: &Plan, mut block: Vec<f32>) -> Vec<f32> {
    let [rows, columns] = plan.block;
    let plane = rows * columns;
    let mut mean = vec![0.0f32; plane];
    mean.par_chunks_mut(columns).enumerate().for_each(|(y, mean)| {
        for row in block.chunks(plane).map(|p| &p[y * columns..][..columns]) {
            mean.iter_mut().zip(row).for_each(|(m, v)| *m += v / plan.kept as f32);
        }
    });
    block.par_chunks_mut(plane).for_each(|plane| {
        plane.iter_mut().zip(&mean).for_each(|(v, m)| *v -= m);
    });
    block
}

/// The whitened block in steps of 1 / [`SCALE`].
fn stored(whiten: &Whiten, filter: &[f32], block: Vec<f32>) -> Vec<i16> {
    let mut stored = vec![0i16; block.len()];
    whiten.apply(filter, &block, &mut stored, |v| (v * SCALE).clamp(-LIMIT, LIMIT) as i16);
    stored
}

/// Mean square of every depth over all blocks, in units of the variance.
fn energy(plan: &Plan, blocks: &[Vec<i16>]) -> Vec<f64> {
    let plane = plan.block[0] * plan.block[1];
    let scale = f64::from(SCALE * SCALE) * (plane * blocks.len()) as f64;
    (0..plan.kept)
        .into_par_iter()
        .map(|z| {
            let sum = |block: &Vec<i16>| -> i64 {
                block[z * plane..][..plane].iter().map(|&v| i64::from(v) * i64::from(v)).sum()
            };
            blocks.iter().map(sum).sum::<i64>() as f64 / scale
        })
        .collect()
}
