//! One scene evaluated: all that the figures, the table and the page need, and no more, so that
//! the frames themselves can be forgotten.

use super::errors::Errors;
use super::recording::Recording;
use super::setup::{Setup, sigma_label};
use crate::curve::{Region, curve};
use crate::error::Result;
use crate::image::Imaging;
use crate::io::CurveRow;
use crate::looks::SpatialCoherence;
use crate::method::{Depths, Method, Plan};
use crate::progress::Progress;
use crate::report::Stack;
use crate::series::{Survey, survey};
use ndarray::{Array2, Array3, ArrayView2, Axis, s};
use num_complex::Complex32;
use phasewalk_core::weights::Weighting;
use rayon::prelude::*;

/// One value for each of the methods that are compared.
#[derive(Clone, Debug)]
pub struct ByMethod<T> {
    /// Phase difference to one frame.
    pub direct: T,
    /// Knox-Thompson walk in single steps.
    pub one_step: T,
    /// All pairs of frames, weighted least squares.
    pub extended: T,
}

impl<T> ByMethod<T> {
    /// Compute the value of every method.
    ///
    /// # Errors
    /// The first error of `value`.
    pub fn compute(mut value: impl FnMut(Method) -> Result<T>) -> Result<Self> {
        Ok(Self {
            direct: value(Method::Direct)?,
            one_step: value(Method::OneStep)?,
            extended: value(Method::Paper(Weighting::Paper))?,
        })
    }

    /// The values with the names people read.
    pub fn named(&self) -> [(&'static str, &T); 3] {
        [
            ("direct difference", &self.direct),
            ("one-step walk", &self.one_step),
            ("extended walk", &self.extended),
        ]
    }
}

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

/// One frame as Figure 2 shows it, axes (y, x).
#[derive(Clone, Debug)]
pub struct Snapshot {
    /// Which frame.
    pub frame: usize,
    /// |U|, any unit.
    pub amplitude: Array2<f32>,
    /// Phase by direct difference, radians.
    pub direct: Array2<f32>,
    /// Phase by the extended method, radians.
    pub extended: Array2<f32>,
}

/// A scene and its results.
pub struct SceneResult {
    /// Its name, such as `σ = λ/32`.
    pub label: String,
    /// σ of the random motion, wavelengths per frame.
    pub sigma_wavelengths: f64,
    /// The phase put in, radians, one per frame.
    pub truth_rad: Vec<f64>,
    /// Amplitude of the autocorrelation by lag.
    pub autocorrelation: Vec<f64>,
    /// Phase of the x over time.
    pub curves: ByMethod<PhaseCurve>,
    /// How far the results are from the truth.
    pub errors: ByMethod<Errors>,
    /// The cross-spectrum.
    pub spectra: Spectra,
    /// The frames that Figure 2 shows.
    pub snapshots: Vec<Snapshot>,
    /// All frames for the page: speckle, direct, extended.
    pub stacks: Vec<Stack>,
}

impl SceneResult {
    /// Simulate the scene with the given random motion (wavelengths per frame) and evaluate it,
    /// with progress bars.
    ///
    /// # Errors
    /// Those of the simulation and of the phase images, and the user's interruption.
    pub fn compute(setup: &Setup, sigma_wavelengths: f64) -> Result<Self> {
        let label = sigma_label(sigma_wavelengths);
        let bar = Progress::new(&format!("{label}: simulate"), setup.scene.frames as u64);
        let recording = Recording::simulate(setup.scene(sigma_wavelengths), &bar)?;
        drop(bar);
        Work::new(setup, &recording, &label)?.finish()
    }
}

/// A recording under evaluation.
struct Work<'a> {
    setup: &'a Setup,
    recording: &'a Recording,
    label: &'a str,
    survey: Survey,
    coherence: SpatialCoherence,
}

impl<'a> Work<'a> {
    fn new(setup: &'a Setup, recording: &'a Recording, label: &'a str) -> Result<Self> {
        let survey = survey(&recording.series, &[0])?;
        let coherence = SpatialCoherence::estimate(&recording.series, &survey, &[0])?;
        Ok(Self { setup, recording, label, survey, coherence })
    }

    fn finish(&self) -> Result<SceneResult> {
        let Self { recording, .. } = self;
        let region = self.region()?;
        let curves = ByMethod::compute(|method| self.curve(&region, method))?;
        let spectra = self.spectra(&region);
        drop(region);
        let images = ByMethod::compute(|method| self.images(method))?;
        let errors = ByMethod::compute(|method| {
            let (curve, images) = match method {
                Method::Direct => (&curves.direct, &images.direct),
                Method::OneStep => (&curves.one_step, &images.one_step),
                Method::Paper(_) | Method::Linked => (&curves.extended, &images.extended),
            };
            Ok(Errors::of(recording, method, curve, last(images)))
        })?;
        Ok(SceneResult {
            label: self.label.to_owned(),
            sigma_wavelengths: recording.scene.sigma_wavelengths,
            truth_rad: recording.truth_rad.clone(),
            autocorrelation: recording.autocorrelation.clone(),
            curves,
            errors,
            spectra,
            snapshots: self.snapshots(&images),
            stacks: self.stacks(&images)?,
        })
    }

    fn plan(&self, method: Method) -> Result<Plan> {
        Plan::new(method, self.recording.scene.frames, None, None, Depths::single())
    }

    fn region(&self) -> Result<Region> {
        let Recording { series, mask, .. } = self.recording;
        let plan = self.plan(Method::OneStep)?;
        Region::read(series, &self.survey, mask, &plan, None, &Progress::hidden())
    }

    fn curve(&self, region: &Region, method: Method) -> Result<PhaseCurve> {
        let Recording { scene, mask, .. } = self.recording;
        let bar = Progress::new(&format!("{}: curves", self.label), scene.frames as u64);
        let effective = self.coherence.looks_of_mask(mask, scene.width);
        let looks = self.setup.looks.choose(region.pixels() as f64, effective);
        curve(region, &self.plan(method)?, looks, effective, &bar).map(PhaseCurve::from)
    }

    fn images(&self, method: Method) -> Result<Array3<f32>> {
        let imaging = Imaging {
            series: &self.recording.series,
            survey: &self.survey,
            coherence: &self.coherence,
            sigma_px: self.setup.gaussian_px,
            looks: self.setup.looks,
            threads: self.setup.threads,
            memory: self.setup.image_memory(),
        };
        imaging.phases(&self.plan(method)?, &format!("{}: images", self.label))
    }

    fn spectra(&self, region: &Region) -> Spectra {
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

    fn snapshots(&self, images: &ByMethod<Array3<f32>>) -> Vec<Snapshot> {
        let snapshot = |&frame: &usize| Snapshot {
            frame,
            amplitude: self.amplitude(frame),
            direct: images.direct.index_axis(Axis(0), frame).to_owned(),
            extended: images.extended.index_axis(Axis(0), frame).to_owned(),
        };
        self.setup.shown_frames.iter().map(snapshot).collect()
    }

    fn stacks(&self, images: &ByMethod<Array3<f32>>) -> Result<Vec<Stack>> {
        let mut amplitudes = Array3::zeros(images.direct.dim());
        for (frame, mut image) in amplitudes.outer_iter_mut().enumerate() {
            image.assign(&self.amplitude(frame));
        }
        // Speckle does not compress: half the pixels along each axis show it as well.
        let speckle = amplitudes.slice(s![.., ..;2, ..;2]);
        Ok(vec![
            Stack::speckle("speckle amplitude", speckle)?,
            Stack::phase("phase by direct difference", images.direct.view())?,
            Stack::phase("phase by extended walk", images.extended.view())?,
        ])
    }

    fn amplitude(&self, frame: usize) -> Array2<f32> {
        let Recording { scene, series, .. } = self.recording;
        let field = series.frame(frame);
        Array2::from_shape_fn((scene.height, scene.width), |(y, x)| {
            field[y * scene.width + x].norm()
        })
    }
}

/// The image of the last frame.
fn last(images: &Array3<f32>) -> ArrayView2<'_, f32> {
    images.index_axis(Axis(0), images.dim().0 - 1)
}

/// `value(t, t + Δt)` at (t, Δt).
fn triangle(frames: usize, value: impl Fn(usize, usize) -> Complex32 + Sync) -> Array2<Complex32> {
    let row = |t: usize| -> Vec<_> { (t..frames).map(|s| value(t, s)).collect() };
    let rows: Vec<Vec<_>> = (0..frames).into_par_iter().map(row).collect();
    Array2::from_shape_fn((frames, frames), |(t, lag)| {
        rows[t].get(lag).copied().unwrap_or_default()
    })
}
