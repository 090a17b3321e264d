//! A volume of recorded spectra to complex depth: background, equal steps of k, dispersion, FFT.
//!
//! The background is the mean spectrum of a B-scan or of the volume. It holds the light of the
//! reference arm and the dark level as they were during the recording, so neither is subtracted
//! from another file.

use super::dispersion::{self, Dispersion, Estimate, band_coordinate};
use super::linearise::Resampler;
use super::window::Window;
use crate::error::{Error, Result};
use crate::io::npy::SpectraFile;
use num_complex::Complex32;
use rayon::prelude::*;
use rustfft::{Fft, FftPlanner};
use std::ops::Range;
use std::sync::Arc;

/// A-lines from which dispersion and sharpness are found.
const SAMPLED_LINES: usize = 400;
/// B-scans from which they are taken.
const SAMPLED_BSCANS: usize = 16;
/// Fewest A-lines whose mean is background rather than signal.
const FEWEST_LINES: usize = 16;

/// Which mean is taken for the background.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum Background {
    /// Of each B-scan: follows a drifting source, takes flat layers for background
    #[default]
    Bscan,
    /// Of the whole volume
    Volume,
}

/// How dispersion is found.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub enum Compensation {
    /// From the sharpness; nothing is corrected where that does not tell it.
    Estimated,
    /// Given.
    Known(Dispersion),
}

/// How spectra are reconstructed.
#[derive(Clone, Debug)]
pub struct Settings {
    /// What is subtracted.
    pub background: Background,
    /// What weighs the spectrum.
    pub window: Window,
    /// k of every sample up to scale and offset, in any direction; none where its steps are equal.
    pub wavenumber: Option<Vec<f64>>,
    /// Dispersion.
    pub compensation: Compensation,
    /// Depths over which sharpness is measured; none stands for all but the nearest 1/32.
    pub depths: Option<Range<usize>>,
    /// k falls from sample to sample: the field is conjugated, so that its phase is + 2 k0 z.
    pub falling: bool,
}

/// How far a B-scan is reconstructed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// As recorded, without its background.
    Recorded,
    /// At equal steps of k.
    Linear,
    /// Without dispersion.
    Compensated,
}

/// Sharpness N sum I^2 / (sum I)^2 of the sampled lines after every step.
#[derive(Clone, Copy, Debug)]
pub struct Sharpness {
    /// As recorded.
    pub recorded: f64,
    /// At equal steps of k, where that was a step.
    pub linear: Option<f64>,
    /// Without dispersion.
    pub compensated: f64,
}

/// A volume that is ready to be reconstructed B-scan by B-scan.
pub struct SpectraVolume {
    file: SpectraFile,
    /// Mean spectrum, where it is that of the volume.
    background: Option<Vec<f64>>,
    window: Vec<f32>,
    resampler: Option<Resampler>,
    falling: bool,
    transform: Arc<dyn Fft<f32>>,
    /// Phase that is taken away.
    pub dispersion: Dispersion,
    /// What the search found, where one was made.
    pub estimate: Option<Estimate>,
    /// What the steps achieved.
    pub sharpness: Sharpness,
}

impl SpectraVolume {
    /// Find the background and the dispersion.
    ///
    /// # Errors
    /// When settings and file do not fit, or the file cannot be read.
    pub fn prepare(file: SpectraFile, settings: &Settings) -> Result<Self> {
        let resampler = settings.wavenumber.as_deref().map(Resampler::new).transpose()?;
        let images = file.images;
        if let Some(found) = resampler.as_ref().map(Resampler::images).filter(|&n| n != images) {
            return Err(Error::usage(format!(
                "wavenumbers of {found} samples for spectra of {images}: mirrors or map of another instrument?"
            )));
        }
        let mut volume = Self {
            background: background(&file, settings.background)?,
            window: settings.window.weights(images),
            resampler,
            falling: settings.falling,
            transform: FftPlanner::new().plan_fft_forward(images),
            dispersion: Dispersion::default(),
            estimate: None,
            sharpness: Sharpness { recorded: 0.0, linear: None, compensated: 0.0 },
            file,
        };
        volume.measure(settings)?;
        Ok(volume)
    }

    /// Lengths of the axes (z, y, x): all positive depths.
    #[must_use]
    pub fn shape(&self) -> [usize; 3] {
        [self.file.images / 2, self.file.bscans, self.file.lines]
    }

    /// Dispersion, and the sharpness of every step.
    fn measure(&mut self, settings: &Settings) -> Result<()> {
        let images = self.file.images;
        let depths = settings.depths.clone().unwrap_or(images / 64..images / 2);
        let sharpness = |spectra: &[f32], dispersion| {
            dispersion::sharpness(spectra, images, &self.window, depths.clone(), dispersion)
        };
        let recorded = self.sampled_lines()?;
        let none = Dispersion::default();
        let before = sharpness(&recorded, none)?;
        let resampled = self.resampler.as_ref().map(|resampler| resampler.apply(&recorded));
        let linear = resampled.as_deref().map(|spectra| sharpness(spectra, none)).transpose()?;
        let spectra = resampled.as_deref().unwrap_or(&recorded);
        let (found, estimate) = match settings.compensation {
            Compensation::Known(dispersion) => (dispersion, None),
            Compensation::Estimated => {
                let window = &self.window;
                let found = dispersion::estimate(spectra, images, window, depths.clone(), None)?;
                let usable = if found.is_reliable() { found.dispersion } else { none };
                (usable, Some(found))
            }
        };
        let compensated = sharpness(spectra, found)?;
        self.sharpness = Sharpness { recorded: before, linear, compensated };
        (self.dispersion, self.estimate) = (found, estimate);
        Ok(())
    }

    /// Lines from all over the volume, without their background.
    fn sampled_lines(&self) -> Result<Vec<f32>> {
        let SpectraFile { bscans, lines, images, .. } = self.file;
        let chosen = evenly(bscans, SAMPLED_BSCANS);
        let of_each = SAMPLED_LINES.div_ceil(chosen.len());
        let mut sampled = Vec::new();
        for y in chosen {
            let bscan = self.without_background(y)?;
            for x in evenly(lines, of_each) {
                sampled.extend_from_slice(&bscan[x * images..][..images]);
            }
        }
        Ok(sampled)
    }

    fn without_background(&self, y: usize) -> Result<Vec<f32>> {
        let images = self.file.images;
        let mut bscan = self.file.read_bscan(y)?;
        let own = self.background.is_none().then(|| mean(&bscan, images));
        let Some(background) = self.background.as_ref().or(own.as_ref()) else {
            return Ok(bscan);
        };
        for line in bscan.chunks_exact_mut(images) {
            let pairs = line.iter_mut().zip(background);
            pairs.for_each(|(value, mean)| *value = (f64::from(*value) - mean) as f32);
        }
        Ok(bscan)
    }

    /// The complex depths (x, z) of B-scan `y` after a step.
    ///
    /// # Errors
    /// When the file cannot be read.
    pub fn bscan(&self, y: usize, stage: Stage) -> Result<Vec<Complex32>> {
        let images = self.file.images;
        let mut spectra = self.without_background(y)?;
        if let Some(resampler) = self.resampler.as_ref().filter(|_| stage != Stage::Recorded) {
            spectra = resampler.apply(&spectra);
        }
        let factors = self.factors(stage);
        let factored =
            |line| std::iter::zip(line, &factors).map(|(&value, &factor)| factor * value);
        let mut depths: Vec<Complex32> = spectra.chunks_exact(images).flat_map(factored).collect();
        self.transform.process(&mut depths);
        let sign = if self.falling { -1.0 } else { 1.0 };
        let oriented = |value: &Complex32| Complex32::new(value.re, sign * value.im);
        let positive = depths.chunks_exact(images).flat_map(|line| &line[..images / 2]);
        Ok(positive.map(oriented).collect())
    }

    /// The depths (z, y, x) of some B-scans.
    ///
    /// # Errors
    /// When the file cannot be read.
    pub fn slab(&self, rows: Range<usize>) -> Result<Vec<Complex32>> {
        let [depths, _, columns] = self.shape();
        let height = rows.len();
        let bscans = rows.into_par_iter().map(|y| self.bscan(y, Stage::Compensated));
        let bscans: Vec<Vec<Complex32>> = bscans.collect::<Result<_>>()?;
        let mut slab = vec![Complex32::default(); depths * height * columns];
        for (index, value) in slab.iter_mut().enumerate() {
            let (z, y, x) = (index / (height * columns), index / columns % height, index % columns);
            *value = bscans[y][x * depths + z];
        }
        Ok(slab)
    }

    /// Window and correction of every sample.
    fn factors(&self, stage: Stage) -> Vec<Complex32> {
        let images = self.file.images;
        let compensated = stage == Stage::Compensated;
        let factor = |(m, &weight): (usize, &f32)| {
            let phase = self.dispersion.phase(band_coordinate(m, images));
            let (sin, cos) = if compensated { (-phase).sin_cos() } else { (0.0, 1.0) };
            Complex32::new(weight * cos as f32, weight * sin as f32)
        };
        self.window.iter().enumerate().map(factor).collect()
    }
}

/// The mean of the volume where that is asked for.
fn background(file: &SpectraFile, background: Background) -> Result<Option<Vec<f64>>> {
    let (lines, all) = match background {
        Background::Bscan => (file.lines, "--background volume takes all B-scans together"),
        Background::Volume => (file.lines * file.bscans, "record more"),
    };
    if lines < FEWEST_LINES {
        return Err(Error::file(
            file.path(),
            format!(
                "the mean of {lines} A-lines is no background, {FEWEST_LINES} are needed: {all}"
            ),
        ));
    }
    if background == Background::Bscan {
        return Ok(None);
    }
    let mut total = vec![0.0; file.images];
    for y in 0..file.bscans {
        let of_bscan = mean(&file.read_bscan(y)?, file.images);
        total.iter_mut().zip(&of_bscan).for_each(|(sum, mean)| *sum += mean / file.bscans as f64);
    }
    Ok(Some(total))
}

/// Mean over lines.
fn mean(spectra: &[f32], images: usize) -> Vec<f64> {
    let lines = (spectra.len() / images) as f64;
    let mut mean = vec![0.0; images];
    for line in spectra.chunks_exact(images) {
        mean.iter_mut().zip(line).for_each(|(mean, &value)| *mean += f64::from(value) / lines);
    }
    mean
}

/// At most `most` of the first `count` numbers, evenly spaced.
fn evenly(count: usize, most: usize) -> Vec<usize> {
    let chosen = count.min(most);
    (0..chosen).map(|n| (2 * n + 1) * count / (2 * chosen)).collect()
}
