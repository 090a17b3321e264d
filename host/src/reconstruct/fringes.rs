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

/// `lines` with the depths of fixed fringes replaced by others; none where there are no such
/// fringes.
///
/// The marks are found in `raw`, the same lines before their mean was removed. Depths set to zero
/// would be a sharp feature of their own: they get the light of their surroundings.
pub(crate) fn removed(lines: &Lines, raw: &Lines) -> Option<Lines> {
    let images = lines.images();
    let marked = marked(&raw.uncorrected(), images);
    let sources = sources(&marked)?;
    let mut depths = lines.uncorrected();
    for line in depths.chunks_exact_mut(images) {
        let light: Vec<Complex32> = sources.iter().map(|&source| line[source]).collect();
        for (z, value) in light.into_iter().enumerate().skip(1) {
            line[z] = value;
            line[images - z] = value.conj();
        }
    }
    FftPlanner::new().plan_fft_inverse(images).process(&mut depths);
    let scale = 1.0 / images as f32;
    Some(lines.with_spectra(depths.iter().map(|value| value.re * scale).collect()))
}

/// For every positive depth the one whose light it gets: its own, or the next unmarked one in steps
/// of a fringe's width. None where nothing is marked, or too much.
fn sources(marked: &[bool]) -> Option<Vec<usize>> {
    let half = marked.len() / 2;
    if !marked.contains(&true) {
        return None;
    }
    let next = |z: usize| {
        let behind = (z..half).step_by(2 * LOBE).find(|&z| !marked[z]);
        behind.or_else(|| (0..=z).rev().step_by(2 * LOBE).find(|&z| !marked[z]))
    };
    (0..half).map(next).collect()
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
