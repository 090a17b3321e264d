//! Before the first pass: where the sweeps begin, how the light falls, and the dispersion.
//!
//! Only parts of the recording are read: four rows of every image, one image in eight of eight sweeps,
//! eight rows of six sweeps.

use super::counts::SweepCounts;
use super::dispersion::{self, Dispersion, Estimate};
use super::illumination::Illumination;
use super::lines::{self, Lines, spread};
use super::scan;
use super::settings::Settings;
use super::spectra::Compensation;
use super::sweeps::{self, Sweep};
use super::window::Window;
use crate::error::{Error, Result};
use crate::io::RawImages;
use num_complex::Complex32;
use rustfft::FftPlanner;
use std::ops::Range;

/// Sweeps whose images the illumination is measured on; of each every eighth image is taken.
const LIGHT_SWEEPS: usize = 8;
/// Depths nearer to zero hold what is left of the source.
const FIRST_DEPTH: usize = 3;
/// Depths kept on either side of what is bright.
const MARGIN: usize = 10;
/// What counts as bright: share of the brightest depth above the noise floor.
const BRIGHT: f32 = 0.05;

/// What is known before the sweeps are read whole.
pub struct Preparation {
    /// K.
    pub images: usize,
    /// All sweeps, bad ones included.
    pub sweeps: Vec<Sweep>,
    /// The light on the camera.
    pub illumination: Illumination,
    /// Some A-lines.
    pub lines: Lines,
    /// Dispersion for the first pass.
    pub dispersion: Dispersion,
    /// What the search found.
    pub estimate: Estimate,
    /// Depths that the retina occupies, with room for its motion.
    pub depths: Range<usize>,
}

/// Look at a recording.
///
/// # Errors
/// When it cannot be read, holds no usable sweep, or the user interrupts.
pub fn prepare(raw: &dyn RawImages, settings: &Settings) -> Result<Preparation> {
    let images = settings.images;
    let trace = scan::read(raw)?;
    let sweeps = sweeps::find(&trace, images)?;
    let good: Vec<usize> = (0..sweeps.len()).filter(|&i| sweeps[i].is_ok()).collect();
    if good.is_empty() {
        let first = sweeps.first().map_or("nothing".to_owned(), |s| s.verdict.to_string());
        return Err(Error::failed(format!(
            "none of the {} sweeps can be used; the first: {first}",
            sweeps.len()
        )));
    }
    let illumination = illumination(raw, &sweeps, &good, images)?;
    let lines = lines::read(raw, &sweeps, &good, images, &illumination)?;
    let window = Window::Hann.weights(images);
    let searched = FIRST_DEPTH..images / 2;
    let estimate = dispersion::estimate(&lines.spectra, images, &window, searched, None)?;
    let dispersion = match settings.compensation {
        Compensation::Known(dispersion) => dispersion,
        Compensation::Estimated => estimate.dispersion,
    };
    let depths = bright_depths(&lines.spectra, images, &dispersion);
    Ok(Preparation { images, sweeps, illumination, lines, dispersion, estimate, depths })
}

fn illumination(
    raw: &dyn RawImages,
    sweeps: &[Sweep],
    good: &[usize],
    images: usize,
) -> Result<Illumination> {
    let format = raw.format();
    let chosen: Vec<usize> = spread(good.len(), LIGHT_SWEEPS).map(|i| good[i]).collect();
    let count = chosen.len();
    let mut sample = SweepCounts::new(images, format.height, format.width)?;
    sample.read(raw, |m| sweeps[chosen[m % count]].first_image + m)?;
    Illumination::measure(&sample, saturation(format.bits))
}

/// The largest count of so many bits.
#[must_use]
pub fn saturation(bits: u32) -> u16 {
    u16::try_from((1_u32 << bits.min(16)) - 1).unwrap_or(u16::MAX)
}

/// Depths that stand above the noise in the mean over the lines, with a margin.
fn bright_depths(spectra: &[f32], images: usize, dispersion: &Dispersion) -> Range<usize> {
    let fft = FftPlanner::new().plan_fft_forward(images);
    let correction: Vec<Complex32> = Window::Hann
        .weights(images)
        .iter()
        .enumerate()
        .map(|(m, &w)| {
            let phase = dispersion.phase(dispersion::band_coordinate(m, images));
            Complex32::from_polar(w, -phase as f32)
        })
        .collect();
    let mut profile = vec![0.0_f32; images / 2];
    let mut line = vec![Complex32::default(); images];
    for spectrum in spectra.chunks_exact(images) {
        for ((u, &sample), c) in line.iter_mut().zip(spectrum).zip(&correction) {
            *u = c * sample;
        }
        fft.process(&mut line);
        profile.iter_mut().zip(&line).for_each(|(sum, u)| *sum += u.norm_sqr());
    }
    let mut sorted = profile[FIRST_DEPTH..].to_vec();
    sorted.sort_by(f32::total_cmp);
    let floor = sorted[sorted.len() / 10];
    let brightest = sorted[sorted.len() - 1];
    let bright = |z: &usize| profile[*z] - floor > BRIGHT * (brightest - floor);
    let first = (FIRST_DEPTH..images / 2).find(bright).unwrap_or(FIRST_DEPTH);
    let last = (FIRST_DEPTH..images / 2).rev().find(bright).unwrap_or(images / 2 - 1);
    first.saturating_sub(MARGIN).max(FIRST_DEPTH)..(last + MARGIN + 1).min(images / 2)
}
