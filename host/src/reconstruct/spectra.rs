//! A volume of recorded spectra to complex depth: background, equal steps of k, dispersion, FFT.
//!
//! The background is the mean spectrum of a B-scan or of the volume. It holds the light of the
//! reference arm and the dark level as they were during the recording, so neither is subtracted
//! from another file.

use super::dispersion::{self, Dispersion, Estimate, band_coordinate, check_depths};
use super::linearise::Resampler;
use super::window::Window;
use crate::error::{Error, Result};
use crate::io::npy::SpectraFile;
use num_complex::Complex32;
use rayon::prelude::*;
use rustfft::{Fft, FftPlanner};
use std::ops::Range;
use std::sync::Arc;

/// B-scans over which sharpness is measured.
const MEASURED_BSCANS: usize = 128;
/// A-lines from which dispersion is found.
const SAMPLED_LINES: usize = 400;
/// B-scans from which they are taken.
const SAMPLED_BSCANS: usize = 16;
/// Fewest A-lines whose mean is background rather than signal.
const FEWEST_LINES: usize = 16;

/// Which mean is taken for the background.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum Background {
    /// Of the whole volume
    #[default]
    Volume,
    /// Of each B-scan: follows a drifting source, but a bright reflection in one A-line leaves a
    /// faint line across the B-scan
    Bscan,
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

/// How sharp the volume is after a step.
#[derive(Clone, Copy, Debug)]
pub struct Sharpness {
    /// The step.
    pub stage: Stage,
    /// N sum I^2 / (sum I)^2 over the N pixels of all B-scans; the brightest ones decide.
    pub value: f64,
    /// Its ratio to that of the recording.
    pub gain: f64,
    /// Median over B-scans of the same ratio in each.
    pub median_gain: f64,
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
    /// What the steps achieved, one after the other.
    pub sharpness: Vec<Sharpness>,
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
            sharpness: Vec::new(),
            file,
        };
        let depths = settings.depths.clone().unwrap_or(images / 64..images / 2);
        check_depths(&depths, images)?;
        volume.find_dispersion(settings.compensation, &depths)?;
        volume.sharpness = volume.sharpness_of_steps(&depths)?;
        Ok(volume)
    }

    /// Lengths of the axes (z, y, x): all positive depths.
    #[must_use]
    pub fn shape(&self) -> [usize; 3] {
        [self.file.images / 2, self.file.bscans, self.file.lines]
    }

    /// The steps that this volume takes.
    #[must_use]
    pub fn stages(&self) -> Vec<Stage> {
        let linear = self.resampler.is_some().then_some(Stage::Linear);
        [Stage::Recorded].into_iter().chain(linear).chain([Stage::Compensated]).collect()
    }

    fn find_dispersion(&mut self, how: Compensation, depths: &Range<usize>) -> Result<()> {
        if let Compensation::Known(dispersion) = how {
            self.dispersion = dispersion;
            return Ok(());
        }
        let recorded = self.sampled_lines()?;
        let spectra = self.resampler.as_ref().map_or(recorded.clone(), |r| r.apply(&recorded));
        let images = self.file.images;
        let found = dispersion::estimate(&spectra, images, &self.window, depths.clone(), None)?;
        if found.is_reliable() {
            self.dispersion = found.dispersion;
        }
        self.estimate = Some(found);
        Ok(())
    }

    fn sharpness_of_steps(&self, depths: &Range<usize>) -> Result<Vec<Sharpness>> {
        let chosen = evenly(self.file.bscans, MEASURED_BSCANS);
        let of_stage = |&stage: &Stage| -> Result<Vec<Moments>> {
            let of_bscan = |&y: &usize| Ok(self.moments(&self.bscan(y, stage)?, depths));
            chosen.par_iter().map(of_bscan).collect()
        };
        let stages = self.stages();
        let moments: Vec<Vec<Moments>> = stages.iter().map(of_stage).collect::<Result<_>>()?;
        let value = |bscans: &[Moments]| {
            bscans.iter().fold(Moments::default(), |sum, &bscan| sum + bscan).sharpness()
        };
        let step = |(&stage, bscans): (&Stage, &Vec<Moments>)| Sharpness {
            stage,
            value: value(bscans),
            gain: value(bscans) / value(&moments[0]),
            median_gain: median_gain(bscans, &moments[0]),
        };
        Ok(stages.iter().zip(&moments).map(step).collect())
    }

    fn moments(&self, bscan: &[Complex32], depths: &Range<usize>) -> Moments {
        let lines = bscan.chunks_exact(self.file.images / 2);
        let pixels = lines.flat_map(|line| &line[depths.clone()]);
        pixels.fold(Moments::default(), |sum, value| {
            let intensity = f64::from(value.norm_sqr());
            sum + Moments { pixels: 1.0, sum: intensity, squares: intensity * intensity }
        })
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

/// Sums over pixels.
#[derive(Clone, Copy, Debug, Default)]
struct Moments {
    pixels: f64,
    /// Sum of I.
    sum: f64,
    /// Sum of I^2.
    squares: f64,
}

impl Moments {
    fn sharpness(self) -> f64 {
        self.pixels * self.squares / (self.sum * self.sum)
    }
}

impl std::ops::Add for Moments {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            pixels: self.pixels + other.pixels,
            sum: self.sum + other.sum,
            squares: self.squares + other.squares,
        }
    }
}

fn median_gain(bscans: &[Moments], recorded: &[Moments]) -> f64 {
    let ratio = |(after, before): (&Moments, &Moments)| after.sharpness() / before.sharpness();
    let mut gains: Vec<f64> = bscans.iter().zip(recorded).map(ratio).collect();
    gains.sort_by(f64::total_cmp);
    0.5 * (gains[(gains.len() - 1) / 2] + gains[gains.len() / 2])
}

/// The mean of the volume where that is asked for.
fn background(file: &SpectraFile, background: Background) -> Result<Option<Vec<f64>>> {
    let (lines, all) = match background {
        Background::Bscan => (file.lines, "take --background volume"),
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
