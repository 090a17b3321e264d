//! The weights that turn a cube of correlations into one value and its noise.

use super::lags::{self, Cube, REACH, SIDE};
use super::plan::Plan;

/// Width (sigma) of the Gaussian weights along z, y, x in pixels.
///
/// Measured: with these a peak between two samples is found within 0.015 px for speckle of 2 to 3 px
/// and within 0.03 px for coarser and finer speckle, although |U| is undersampled in depth; widths of
/// 0.65 push it 0.04 px towards half pixels, wider ones lose detail.
pub const WIDTH: [f64; 3] = [0.72, 0.76, 0.76];
/// Every how many depths serve for the correlation of a feature with itself.
const SPARSE: usize = 4;

/// Weight of lags −2 … 2 for a peak at `u`, its first and second derivative with respect to `u`.
pub fn weights(axis: usize, u: f64) -> [[f64; 3]; SIDE] {
    let variance = WIDTH[axis] * WIDTH[axis];
    let raw: [[f64; 3]; SIDE] = std::array::from_fn(|i| {
        let v = i as f64 - REACH as f64 - u;
        let k = (-0.5 * v * v / variance).exp();
        [k, k * v / variance, k * (v * v / variance - 1.0) / variance]
    });
    normalised(raw)
}

/// The weights over their norm: so the sum is largest where a·K fits best, whatever the samples.
fn normalised(raw: [[f64; 3]; SIDE]) -> [[f64; 3]; SIDE] {
    let sum = |of: fn(&[f64; 3]) -> f64| raw.iter().map(of).sum::<f64>();
    let n = sum(|k| k[0] * k[0]);
    let first = 2.0 * sum(|k| k[0] * k[1]) / n;
    let second = 2.0 * sum(|k| k[1] * k[1] + k[0] * k[2]) / n;
    let bend = 0.75 * first * first - 0.5 * second;
    raw.map(|[k, d, dd]| [k, d - 0.5 * first * k, dd - first * d + bend * k].map(|v| v / n.sqrt()))
}

/// What the correlation of a feature with itself tells of every pair it is part of.
#[derive(Clone, Copy)]
pub struct Noise {
    /// Weighted sum over the cube for a pair of correlation 1.
    pub gain: f64,
    /// Variance of the weighted sum for unrelated features, per product of their energies.
    pub variance: f64,
}

impl Noise {
    /// From a feature's blocks.
    pub fn of(plan: &Plan, blocks: &[Vec<i16>], energy: &[f64]) -> Self {
        let side = lags::Side { first: 0, blocks, energy };
        let cells = lags::cells(plan, side, side, Default::default(), SPARSE);
        let mut own = [0.0; SIDE * SIDE * SIDE];
        for cell in &cells {
            own.iter_mut().zip(&cell.cube).for_each(|(sum, c)| *sum += c);
        }
        let power = own[own.len() / 2].max(1.0);
        own.iter_mut().for_each(|c| *c /= power);
        let weights = centred_weights();
        let gain = own.iter().zip(&weights).map(|(r, k)| r * k).sum();
        Self { gain, variance: variance(&own, &weights) }
    }
}

/// The weights of a peak at 0 without their mean: a pedestal under the peak counts for nothing.
fn centred_weights() -> Cube {
    let [z, y, x] = std::array::from_fn(|axis| weights(axis, 0.0));
    let mut cube: Cube =
        std::array::from_fn(|i| z[i / (SIDE * SIDE)][0] * y[i / SIDE % SIDE][0] * x[i % SIDE][0]);
    let mean = cube.iter().sum::<f64>() / cube.len() as f64;
    cube.iter_mut().for_each(|k| *k -= mean);
    cube
}

/// Σ k(l) k(l') c(l − l') with c = own ⋆ own, the covariance of two unrelated features'
/// correlations.
fn variance(own: &Cube, weights: &Cube) -> f64 {
    // The same as the squared norm of weights ⋆ own, over all places where they overlap.
    const WIDE: usize = 2 * SIDE - 1;
    let place = |i: usize| [i / (SIDE * SIDE), i / SIDE % SIDE, i % SIDE];
    let mut wide = [0.0; WIDE * WIDE * WIDE];
    for (i, k) in weights.iter().enumerate() {
        for (j, r) in own.iter().enumerate() {
            let ([a, b, c], [d, e, f]) = (place(i), place(j));
            wide[((a + d) * WIDE + b + e) * WIDE + c + f] += k * r;
        }
    }
    wide.iter().map(|v| v * v).sum()
}
