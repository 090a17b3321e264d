//! Half-whitening: every lateral spatial frequency divided by the square root of its mean
//! amplitude.
//!
//! Speckle carries its fine detail at low contrast; a correlation of raw amplitudes is broad and
//! its peak uncertain. Two half-whitened volumes give what phase correlation calls a half-whitened
//! cross-spectrum, F₁* F₂ / |F₁ F₂|^½, here with the amplitudes averaged over depths.

use rayon::prelude::*;
use rustfft::num_complex::Complex32;
use rustfft::{Fft, FftPlanner};
use std::sync::Arc;

/// Half side in pixels of the box whose mean is taken off: what is broader is illumination.
const BROAD: usize = 8;
/// Pairs of depths of a block that the mean spectrum is taken from.
const PAIRS: usize = 12;

/// Transforms of blocks of one size.
pub struct Whiten {
    rows: usize,
    columns: usize,
    forward: [Arc<dyn Fft<f32>>; 2],
    inverse: [Arc<dyn Fft<f32>>; 2],
}

/// Buffers of one thread.
struct Desk {
    plane: Vec<Complex32>,
    turned: Vec<Complex32>,
    scratch: Vec<Complex32>,
    smooth: Vec<f32>,
    smoother: Vec<f32>,
}

impl Whiten {
    pub fn new([rows, columns]: [usize; 2]) -> Self {
        let mut planner = FftPlanner::new();
        let forward = [planner.plan_fft_forward(rows), planner.plan_fft_forward(columns)];
        let inverse = [planner.plan_fft_inverse(rows), planner.plan_fft_inverse(columns)];
        Self { rows, columns, forward, inverse }
    }

    /// Filter over (kx, ky) that half-whitens `blocks` (z, y, x) and brings them to unit variance.
    pub fn filter(&self, blocks: &[Vec<f32>]) -> Vec<f32> {
        let size = self.rows * self.columns;
        let pairs: Vec<&[f32]> = blocks
            .iter()
            .flat_map(|block| {
                let pairs = block.len() / (2 * size);
                block.chunks_exact(2 * size).step_by(pairs.div_ceil(PAIRS).max(1))
            })
            .collect();
        let powers: Vec<Vec<f32>> = pairs
            .par_iter()
            .map_init(
                || self.desk(),
                |desk, pair| {
                    self.spectrum(desk, &pair[..size], &pair[size..]);
                    desk.turned.iter().map(|f| f.norm_sqr()).collect()
                },
            )
            .collect();
        let mut power = vec![0.0f32; size];
        for one in &powers {
            power.iter_mut().zip(one).for_each(|(sum, p)| *sum += p / (2 * pairs.len()) as f32);
        }
        self.half_whitening(&power)
    }

    /// Power^-¼, scaled so that the filtered planes have unit variance; 0 for the mean.
    fn half_whitening(&self, power: &[f32]) -> Vec<f32> {
        let size = self.rows * self.columns;
        // Two planes share a spectrum as real and imaginary part: frequencies ±k mix.
        let even = |i: usize| {
            let (kx, ky) = (i / self.rows, i % self.rows);
            let mirrored =
                (self.columns - kx) % self.columns * self.rows + (self.rows - ky) % self.rows;
            0.5 * (power[i] + power[mirrored])
        };
        let even: Vec<f32> = (0..size).map(even).collect();
        let least = even.iter().sum::<f32>() / size as f32 * 1e-4 + f32::MIN_POSITIVE;
        let mut filter: Vec<f32> = even.iter().map(|p| p.max(least).powf(-0.25)).collect();
        filter[0] = 0.0;
        let variance: f64 =
            filter.iter().zip(&even).map(|(f, p)| f64::from(f * f * p)).sum::<f64>()
                / (size * size) as f64;
        // The inverse transform is unscaled.
        let scale = (1.0 / (variance.max(1e-30).sqrt() * size as f64)) as f32;
        filter.iter_mut().for_each(|f| *f *= scale);
        filter
    }

    /// Filters `block` (z, y, x) and writes `store` of every value to `out`.
    pub fn apply<T: Send>(
        &self,
        filter: &[f32],
        block: &[f32],
        out: &mut [T],
        store: impl Fn(f32) -> T + Sync,
    ) {
        let size = self.rows * self.columns;
        let pairs = out.par_chunks_mut(2 * size).zip(block.par_chunks(2 * size));
        pairs.for_each_init(
            || self.desk(),
            |desk, (out, pair)| {
                let (first, second) = pair.split_at(size);
                self.spectrum(desk, first, second);
                desk.turned.iter_mut().zip(filter).for_each(|(v, f)| *v *= f);
                self.back(desk);
                let (real, imaginary) = out.split_at_mut(size);
                real.iter_mut().zip(&desk.plane).for_each(|(o, v)| *o = store(v.re));
                imaginary.iter_mut().zip(&desk.plane).for_each(|(o, v)| *o = store(v.im));
            },
        );
    }

    fn desk(&self) -> Desk {
        let size = self.rows * self.columns;
        let plans = self.forward.iter().chain(&self.inverse);
        let scratch = plans.map(|p| p.get_inplace_scratch_len()).max().unwrap_or(0);
        let zeros = || vec![Complex32::ZERO; size];
        Desk {
            plane: zeros(),
            turned: zeros(),
            scratch: vec![Complex32::ZERO; scratch],
            smooth: vec![0.0; size],
            smoother: vec![0.0; size],
        }
    }

    /// Spectrum (kx, ky) of two planes without what is broad, as real and imaginary part; the
    /// second may be empty.
    fn spectrum(&self, desk: &mut Desk, first: &[f32], second: &[f32]) {
        let Desk { plane, turned, scratch, smooth, smoother } = desk;
        plane.fill(Complex32::ZERO);
        for (part, values) in [first, second].into_iter().enumerate().filter(|(_, v)| !v.is_empty())
        {
            box_mean(values, self.columns, smooth, smoother);
            for (p, (v, s)) in plane.iter_mut().zip(values.iter().zip(smoother.iter())) {
                if part == 0 { p.re = v - s } else { p.im = v - s }
            }
        }
        self.forward[1].process_with_scratch(plane, scratch);
        transpose(plane, turned, self.columns);
        self.forward[0].process_with_scratch(turned, scratch);
    }

    fn back(&self, desk: &mut Desk) {
        self.inverse[0].process_with_scratch(&mut desk.turned, &mut desk.scratch);
        transpose(&desk.turned, &mut desk.plane, self.rows);
        self.inverse[1].process_with_scratch(&mut desk.plane, &mut desk.scratch);
    }
}

/// (rows, columns) to (columns, rows), in squares that stay in the cache.
pub fn transpose(from: &[Complex32], to: &mut [Complex32], columns: usize) {
    const SIDE: usize = 8;
    let rows = from.len() / columns;
    for top in (0..rows).step_by(SIDE) {
        for left in (0..columns).step_by(SIDE) {
            for x in left..(left + SIDE).min(columns) {
                for y in top..(top + SIDE).min(rows) {
                    to[x * rows + y] = from[y * columns + x];
                }
            }
        }
    }
}

/// Mean over the box of (2 BROAD + 1)² pixels around every pixel, as far as it lies in the plane.
fn box_mean(plane: &[f32], columns: usize, along: &mut [f32], mean: &mut [f32]) {
    for (row, out) in plane.chunks(columns).zip(along.chunks_mut(columns)) {
        let mut sum: f32 = row[..BROAD.min(columns)].iter().sum();
        for x in 0..columns {
            sum += if x + BROAD < columns { row[x + BROAD] } else { 0.0 };
            sum -= if x > BROAD { row[x - BROAD - 1] } else { 0.0 };
            let count = (x + BROAD + 1).min(columns) - x.saturating_sub(BROAD);
            out[x] = sum / count as f32;
        }
    }
    let rows = plane.len() / columns;
    let row = |y: usize| y * columns..(y + 1) * columns;
    let mut sum = vec![0.0f32; columns];
    for y in 0..BROAD.min(rows) {
        sum.iter_mut().zip(&along[row(y)]).for_each(|(s, v)| *s += v);
    }
    for y in 0..rows {
        if y + BROAD < rows {
            sum.iter_mut().zip(&along[row(y + BROAD)]).for_each(|(s, v)| *s += v);
        }
        if y > BROAD {
            sum.iter_mut().zip(&along[row(y - BROAD - 1)]).for_each(|(s, v)| *s -= v);
        }
        let count = ((y + BROAD + 1).min(rows) - y.saturating_sub(BROAD)) as f32;
        mean[row(y)].iter_mut().zip(&sum).for_each(|(m, s)| *m = s / count);
    }
}
