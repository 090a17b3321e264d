//! Gaussian smoothing over the field.

use rayon::prelude::*;

/// The kernel is cut off at this many standard deviations.
const REACH: f64 = 2.5;

/// Half of a Gaussian kernel, from its centre on, not normalised.
fn half_kernel(sigma_px: f64) -> Vec<f32> {
    let reach = (REACH * sigma_px).ceil() as i32;
    (0..=reach).map(|at| (-0.5 * (f64::from(at) / sigma_px).powi(2)).exp() as f32).collect()
}

/// Smooths `values` of shape (rows, columns, depth) over rows and columns, normalised at the edges.
pub(super) fn smooth(values: &mut [f32], rows: usize, columns: usize, sigma_px: f64) {
    let depth = values.len() / (rows * columns).max(1);
    if depth == 0 || sigma_px <= 0.0 {
        return;
    }
    let kernel = half_kernel(sigma_px);
    values.par_chunks_mut(columns * depth).for_each(|row| {
        let from = row.to_vec();
        for (x, to) in row.chunks_exact_mut(depth).enumerate() {
            blend(to, &kernel, x, columns, |at| &from[at * depth..][..depth]);
        }
    });
    let from = values.to_vec();
    values.par_chunks_mut(columns * depth).enumerate().for_each(|(y, row)| {
        let width = columns * depth;
        blend(row, &kernel, y, rows, |at| &from[at * width..][..width]);
    });
}

/// Weighted mean of the slices within reach of `centre`.
fn blend<'a>(
    to: &mut [f32],
    kernel: &[f32],
    centre: usize,
    count: usize,
    slice: impl Fn(usize) -> &'a [f32],
) {
    let reach = kernel.len() - 1;
    let range = centre.saturating_sub(reach)..(centre + reach + 1).min(count);
    let norm = 1.0 / range.clone().map(|at| kernel[at.abs_diff(centre)]).sum::<f32>();
    to.fill(0.0);
    for at in range {
        let weight = kernel[at.abs_diff(centre)] * norm;
        for (to, from) in to.iter_mut().zip(slice(at)) {
            *to += weight * from;
        }
    }
}

/// Smooths a map by a weighted mean; `weights` say how well each value is known.
pub(super) fn smooth_weighted(
    values: &[f32],
    weights: &[f32],
    rows: usize,
    columns: usize,
    sigma_px: f64,
) -> Vec<f32> {
    let mut pairs: Vec<f32> =
        values.iter().zip(weights).flat_map(|(value, weight)| [value * weight, *weight]).collect();
    smooth(&mut pairs, rows, columns, sigma_px);
    pairs.chunks_exact(2).map(|pair| pair[0] / pair[1].max(f32::MIN_POSITIVE)).collect()
}
