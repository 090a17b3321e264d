//! A recording under evaluation: curves of its x, phase images, cross-spectrum, by any method.

use super::recording::Recording;
use super::setup::Setup;
use crate::curve::{Region, Selection, curve};
use crate::error::Result;
use crate::image::{Images, Imaging};
use crate::io::CurveRow;
use crate::looks::{Looks, SpatialCoherence, speckled};
use crate::method::{Depths, Method, Plan};
use crate::progress::Progress;
use crate::series::{Survey, survey};
use ndarray::Array2;
use num_complex::Complex32;
use rayon::prelude::*;

/// Phase of the x over time, radians, one value per frame.
#[derive(Clone, Debug)]
pub struct PhaseCurve {
    /// The phase; the mean of the first five frames is 0.
    pub phase_rad: Vec<f64>,
    /// Its standard deviation, as the coherence of the pairs predicts it.
    pub sigma_rad: Vec<f64>,
}

impl From<Vec<CurveRow>> for PhaseCurve {
    fn from(rows: Vec<CurveRow>) -> Self {
        let (phase_rad, sigma_rad) = rows.iter().map(|row| (row.phase_rad, row.sigma_rad)).unzip();
        Self { phase_rad, sigma_rad }
    }
}

/// The cross-spectrum C(t, Δt) as Figure 1 of the paper has it, axes (t, Δt), 0 where t + Δt lies
/// behind the last frame.
#[derive(Clone, Debug)]
pub struct Spectra {
    /// Of the pixel in the middle of the x.
    pub single: Array2<Complex32>,
    /// Averaged over the x.
    pub averaged: Array2<Complex32>,
}

/// A recording and what every method needs to know of it.
pub struct Evaluation<'a> {
    /// How it is evaluated.
    pub setup: &'a Setup,
    /// The frames and their truth.
    pub recording: &'a Recording,
    survey: Survey,
    /// Of the pixels of the x.
    inside: SpatialCoherence,
    /// Of the image.
    coherence: SpatialCoherence,
}

impl<'a> Evaluation<'a> {
    /// Look the recording over.
    ///
    /// # Errors
    /// The user's interruption.
    pub fn new(setup: &'a Setup, recording: &'a Recording) -> Result<Self> {
        let survey = survey(&recording.series, &[0])?;
        let Recording { series, mask, .. } = recording;
        let of = |survey: &Survey| SpatialCoherence::estimate(series, survey, &[0]);
        let inside = of(&survey.within(mask))?;
        let coherence = of(&speckled(series, &survey, 0)?)?;
        Ok(Self { setup, recording, survey, inside, coherence })
    }

    fn plan(&self, method: Method) -> Result<Plan> {
        Plan::new(method, self.recording.scene.frames, None, None, Depths::single())
    }

    /// The pixels of the x.
    ///
    /// # Errors
    /// The user's interruption.
    pub fn region(&self) -> Result<Region> {
        let Recording { scene, series, mask, .. } = self.recording;
        let Survey { valid, scale, .. } = &self.survey;
        let selection = Selection::new(valid, mask, scene.width, None)?;
        let plan = self.plan(Method::OneStep)?;
        Region::read(series, *scale, selection, &plan, &Progress::hidden())
    }

    /// The phase of the x over time.
    ///
    /// # Errors
    /// The user's interruption.
    pub fn curve(
        &self,
        region: &Region,
        method: Method,
        progress: &Progress,
    ) -> Result<PhaseCurve> {
        let Recording { scene, mask, .. } = self.recording;
        let effective = self.inside.looks_of_mask(mask, scene.width);
        let looks = self.setup.looks.choose(region.pixels() as f64, effective);
        curve(region, &self.plan(method)?, looks, effective, progress).map(PhaseCurve::from)
    }

    /// Phase images of all frames; linked phases always count the independent looks. The progress bar is called
    /// after `label`.
    ///
    /// # Errors
    /// Those of [`Imaging::images`].
    pub fn images(&self, method: Method, label: &str) -> Result<Images> {
        let looks = if method == Method::Linked { Looks::Effective } else { self.setup.looks };
        let imaging = Imaging {
            series: &self.recording.series,
            survey: &self.survey,
            coherence: &self.coherence,
            sigma_px: self.setup.gaussian_px,
            looks,
            threads: self.setup.threads,
            memory: self.setup.image_memory(),
        };
        imaging.images(&self.plan(method)?, &format!("{label}: images"))
    }

    /// The cross-spectrum in the middle of the x and averaged over it.
    #[must_use]
    pub fn spectra(&self, region: &Region) -> Spectra {
        let Recording { scene, series, .. } = self.recording;
        let middle = (scene.height / 2) * scene.width + scene.width / 2;
        let powers = region.powers();
        Spectra {
            single: triangle(scene.frames, |t, s| {
                series.frame(t)[middle] * series.frame(s)[middle].conj()
            }),
            averaged: triangle(scene.frames, |t, s| {
                let cross = region.pair_mean(t, s, &powers).cross;
                Complex32::new(cross.re as f32, cross.im as f32)
            }),
        }
    }

    /// |U| of a frame, any unit, axes (y, x).
    #[must_use]
    pub fn amplitude(&self, frame: usize) -> Array2<f32> {
        let Recording { scene, series, .. } = self.recording;
        let field = series.frame(frame);
        Array2::from_shape_fn((scene.height, scene.width), |(y, x)| {
            field[y * scene.width + x].norm()
        })
    }
}

/// `value(t, t + Δt)` at (t, Δt).
fn triangle(frames: usize, value: impl Fn(usize, usize) -> Complex32 + Sync) -> Array2<Complex32> {
    let row = |t: usize| -> Vec<_> { (t..frames).map(|s| value(t, s)).collect() };
    let rows: Vec<Vec<_>> = (0..frames).into_par_iter().map(row).collect();
    Array2::from_shape_fn((frames, frames), |(t, lag)| {
        rows[t].get(lag).copied().unwrap_or_default()
    })
}
