//! The phase of dispersion, estimated from the sharpness of the image.
//!
//! A difference of dispersion between sample and reference bends the phase over the band:
//! a2 q^2 + a3 q^3, orders 2 and 3 of the band coordinate q, in radians at the band's edge. The
//! spectrum is multiplied by the opposite phase and the window, transformed, and the pair (a2, a3)
//! that makes the positive depths sharpest (paper lines 703-707) is taken: a grid first, then Nelder and Mead's simplex.
//! (Wojtkowski et al., Optics Express 12, 2404 (2004).)

use super::fringes;
use super::sharpness::Lines;
use super::simplex::minimise;
use crate::error::{Error, Result};
use std::ops::Range;

/// Phase a2 q^2 + a3 q^3 of positive depths in the recording, in radians at the band's edge.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Dispersion {
    /// Second order, rad.
    pub a2: f64,
    /// Third order, rad.
    pub a3: f64,
}

impl Dispersion {
    /// The phase at the band coordinate `q`, rad.
    #[must_use]
    pub fn phase(&self, q: f64) -> f64 {
        q * q * (self.a2 + q * self.a3)
    }
}

/// q(m) = (m - (K-1)/2) / (K/2) of image `m` of `images`: from nearly -1 to nearly 1.
#[must_use]
pub fn band_coordinate(m: usize, images: usize) -> f64 {
    let images = images as f64;
    (m as f64 - 0.5 * (images - 1.0)) / (0.5 * images)
}

/// What the search found, and how far to trust it.
#[derive(Clone, Copy, Debug)]
pub struct Estimate {
    /// The sharpest correction's phase.
    pub dispersion: Dispersion,
    /// Sharpness `<I^1.5> / <I>^1.5` of the depths looked at without a correction, mean of the lines.
    pub sharpness_before: f64,
    /// The same with the correction.
    pub sharpness_after: f64,
    /// Trial corrections.
    pub evaluations: usize,
    /// Gain in sharpness against a defocus of 15 rad, in standard errors.
    pub significance: f64,
    /// The result is near zero and rests on fixed fringes, not on the sample.
    pub fixed_fringes: bool,
}

impl Estimate {
    /// Whether the sample determines the result; if not, use a known dispersion.
    #[must_use]
    pub fn is_reliable(&self) -> bool {
        self.significance >= SIGNIFICANT && !self.fixed_fringes
    }
}

/// The best of some 200 trials on noise alone stands 3 to 4 standard errors out.
const SIGNIFICANT: f64 = 6.0;
/// Defocus with which the sharpness is compared: it spreads a layer over 20 depths.
const DEFOCUS: f64 = 15.0;
/// Where fixed fringes pull the result to: rad of a2 and of a3.
const NEAR_ZERO: [f64; 2] = [3.0, 6.0];
/// Lines below which their mean spectrum is more signal than background.
const FEWEST_FOR_MEAN: usize = 32;

/// Grid over a2: half range and step in rad. Half a step lowers a peak's height by a third.
const GRID_A2: (f64, f64) = (60.0, 4.0);
/// Grid over a3; q^3 less its shift in depth bends half as much as q^2.
const GRID_A3: (f64, f64) = (15.0, 7.5);
/// First simplex around the best point of the grid, rad.
const STEP: [f64; 2] = [1.5, 3.0];
/// Last simplex, rad.
const TOLERANCE: [f64; 2] = [0.005, 0.01];
/// Trials of one simplex search.
const MOST: usize = 150;

/// Dispersion from background-free real spectra (line, m) of `images` samples each, over the same
/// `depths` (pixels, below `images`/2) of every line.
///
/// About 400 lines suffice. With a `start` only its surroundings are searched, else |a2| <= 60 rad
/// and |a3| <= 15 rad.
///
/// # Errors
/// When lengths or depths do not fit, or the spectra hold nothing or not only finite numbers.
pub fn estimate(
    spectra: &[f32],
    images: usize,
    window: &[f32],
    depths: Range<usize>,
    start: Option<Dispersion>,
) -> Result<Estimate> {
    check(spectra, images, window)?;
    check_depths(&depths, images)?;
    let lines = |spectra: &[f32]| {
        let first = vec![depths.start; spectra.len() / images];
        Lines::new(spectra, window, first, depths.len(), 0.0)
    };
    let bare = lines(&less_mean(spectra, images));
    let found = search(&bare, start)?;
    if !is_near_zero(found.dispersion) {
        return Ok(found);
    }
    let Some(fringeless) = fringes::removed(&bare, &lines(spectra)) else { return Ok(found) };
    let beneath = search(&fringeless, start)?;
    let evaluations = found.evaluations + beneath.evaluations;
    Ok(match (beneath.is_reliable(), is_near_zero(beneath.dispersion)) {
        (true, false) => Estimate { evaluations, ..beneath },
        (true, true) => Estimate { evaluations, ..found },
        (false, _) => Estimate { fixed_fringes: true, evaluations, ..found },
    })
}

/// Dispersion at one layer: as [`estimate`] from `start`, over the depths within `half_width` of
/// each line's centre (pixels, under the correction `start`).
///
/// A sweep that is not linear in k adds a phase that grows with depth: the result then holds at the
/// layer. Lines whose window would leave the positive depths, or whose centre is NaN, are left out.
///
/// # Errors
/// As [`estimate`], and when no line is left.
pub fn estimate_at(
    spectra: &[f32],
    images: usize,
    window: &[f32],
    centres: &[f64],
    half_width: usize,
    start: Dispersion,
) -> Result<Estimate> {
    check(spectra, images, window)?;
    if centres.len() != spectra.len() / images {
        let (lines, found) = (spectra.len() / images, centres.len());
        return Err(Error::usage(format!("{found} centres for {lines} lines: give one for each")));
    }
    let spectra = less_mean(spectra, images);
    let last = images as f64 / 2.0 - half_width as f64 - 1.0;
    let (mut kept, mut first) = (Vec::new(), Vec::new());
    for (line, centre) in spectra.chunks_exact(images).zip(centres) {
        let centre = centre.round();
        if (half_width as f64..=last).contains(&centre) {
            kept.extend_from_slice(line);
            first.push(centre as usize - half_width);
        }
    }
    if first.is_empty() {
        return Err(Error::failed("no A-line has the layer within the positive depths"));
    }
    let lines = Lines::new(&kept, window, first, 2 * half_width + 1, start.a3);
    search(&lines, Some(start))
}

fn check(spectra: &[f32], images: usize, window: &[f32]) -> Result<()> {
    if images < 16 || window.len() != images {
        let found = window.len();
        return Err(Error::usage(format!("a window of {found} for spectra of {images} samples")));
    }
    if spectra.is_empty() || !spectra.len().is_multiple_of(images) {
        let found = spectra.len();
        return Err(Error::usage(format!("{found} samples are no whole spectra of {images}")));
    }
    if !spectra.iter().all(|value| value.is_finite()) {
        return Err(Error::failed("dispersion: the spectra hold NaN or infinity"));
    }
    Ok(())
}

/// Depths to look at lie within the positive ones.
pub(super) fn check_depths(depths: &Range<usize>, images: usize) -> Result<()> {
    if depths.is_empty() || depths.end > images / 2 {
        let half = images / 2;
        return Err(Error::usage(format!("depths {depths:?}: choose some within 0..{half}")));
    }
    Ok(())
}

/// The spectra without their mean, where the fringes that all lines share would remain.
fn less_mean(spectra: &[f32], images: usize) -> Vec<f32> {
    let lines = spectra.len() / images;
    if lines < FEWEST_FOR_MEAN {
        return spectra.to_vec();
    }
    let mut mean = vec![0.0_f64; images];
    for line in spectra.chunks_exact(images) {
        mean.iter_mut().zip(line).for_each(|(m, &v)| *m += f64::from(v) / lines as f64);
    }
    let remainder = |line: &[f32]| -> Vec<f32> {
        line.iter().zip(&mean).map(|(&value, &mean)| (f64::from(value) - mean) as f32).collect()
    };
    spectra.chunks_exact(images).flat_map(remainder).collect()
}

fn is_near_zero(dispersion: Dispersion) -> bool {
    dispersion.a2.abs() < NEAR_ZERO[0] && dispersion.a3.abs() < NEAR_ZERO[1]
}

/// The sharpest dispersion of all, or near `start`.
fn search(lines: &Lines, start: Option<Dispersion>) -> Result<Estimate> {
    let before = lines.sharpness(Dispersion::default());
    if !(before.is_finite() && before > 0.0) {
        return Err(Error::failed("dispersion: no light at these depths, the spectra are empty"));
    }
    let (first, tried) = start.map_or_else(|| best_of_grid(lines), |start| (start, 0));
    let blur = |[a2, a3]: [f64; 2]| -lines.sharpness(Dispersion { a2, a3 });
    let minimum = minimise(blur, [first.a2, first.a3], STEP, TOLERANCE, MOST);
    let [a2, a3] = minimum.point;
    let dispersion = Dispersion { a2, a3 };
    let blurred = [DEFOCUS, -DEFOCUS].map(|defocus| Dispersion { a2: a2 + defocus, a3 });
    let gains = blurred.map(|reference| lines.significance(dispersion, reference));
    Ok(Estimate {
        dispersion,
        sharpness_before: before,
        sharpness_after: lines.sharpness(dispersion),
        evaluations: tried + minimum.evaluations,
        significance: gains[0].min(gains[1]),
        fixed_fringes: false,
    })
}

/// The sharpest point of the grid, and the number of points.
fn best_of_grid(lines: &Lines) -> (Dispersion, usize) {
    let mut best = (f64::NEG_INFINITY, Dispersion::default());
    let mut points = 0;
    for a2 in steps(GRID_A2) {
        for a3 in steps(GRID_A3) {
            let trial = Dispersion { a2, a3 };
            let sharpness = lines.sharpness(trial);
            if sharpness > best.0 {
                best = (sharpness, trial);
            }
            points += 1;
        }
    }
    (best.1, points)
}

/// From -half to half.
fn steps((half, step): (f64, f64)) -> impl Iterator<Item = f64> {
    let count = (half / step) as i32;
    (-count..=count).map(move |n| f64::from(n) * step)
}

#[cfg(test)]
mod tests;
