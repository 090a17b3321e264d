//! Fixed fringes: interference of the instrument with itself.
//!
//! They have no dispersion, so they are sharp without a correction and would pass for an undispersed
//! sample where the sample is faint. They stand at the same few depths of every line. Two marks tell
//! them from layers: their intensity is steady from line to line, where speckle's varies as much as
//! its mean; and where a removal of the background has left an uneven remainder of them, they are
//! still as narrow in the mean over lines as in each line, where a tilted or curved layer is not.

use super::sharpness::Lines;
use num_complex::Complex32;
use rustfft::FftPlanner;

/// A fringe is that much brighter than the median depth, a narrow one than its surroundings.
const BRIGHT: f64 = 3.0;
/// Variance over squared mean of the intensity across lines: 1 for speckle and for noise.
const STEADY: f64 = 0.5;
/// Half width of a fringe, pixels: the main lobe of the usual windows.
const LOBE: usize = 3;

/// `lines` without the fixed fringes of `raw`, the same lines before their mean was removed; none
/// where there are no such fringes.
pub(crate) fn removed(lines: &Lines, raw: &Lines) -> Option<Lines> {
    let images = lines.images();
    let marked = marked(&raw.uncorrected(), images);
    if !marked.contains(&true) {
        return None;
    }
    let mut depths = lines.uncorrected();
    for line in depths.chunks_exact_mut(images) {
        let hidden = line.iter_mut().zip(&marked).filter(|(_, marked)| **marked);
        hidden.for_each(|(value, _)| *value = Complex32::default());
    }
    FftPlanner::new().plan_fft_inverse(images).process(&mut depths);
    let scale = 1.0 / images as f32;
    Some(lines.with_spectra(depths.iter().map(|value| value.re * scale).collect()))
}

/// The depths of fringes, positive and negative, with their neighbours.
fn marked(depths: &[Complex32], images: usize) -> Vec<bool> {
    let (means, contrasts) = statistics(depths, images);
    let mut sorted = means.clone();
    sorted.sort_by(f64::total_cmp);
    let median = sorted[images / 2];
    let outstanding = |z: usize, step: usize| means[z] > BRIGHT * means[(z + step) % images];
    let narrow = |z: usize| outstanding(z, LOBE) && outstanding(z, images - LOBE);
    let fringe = |z: usize| means[z] > BRIGHT * median && (contrasts[z] < STEADY || narrow(z));
    let near =
        |z: usize| (images - LOBE + 1..images + LOBE).any(|step| fringe((z + step) % images));
    (0..images).map(near).collect()
}

/// Mean intensity across lines, and its variance over the squared mean, at every depth.
fn statistics(depths: &[Complex32], images: usize) -> (Vec<f64>, Vec<f64>) {
    let lines = (depths.len() / images) as f64;
    let (mut means, mut squares) = (vec![0.0; images], vec![0.0; images]);
    for line in depths.chunks_exact(images) {
        for ((value, mean), square) in line.iter().zip(&mut means).zip(&mut squares) {
            let intensity = f64::from(value.norm_sqr());
            *mean += intensity / lines;
            *square += intensity * intensity / lines;
        }
    }
    let contrast = |(square, mean): (&f64, &f64)| square / (mean * mean) - 1.0;
    let contrasts = squares.iter().zip(&means).map(contrast).collect();
    (means, contrasts)
}
