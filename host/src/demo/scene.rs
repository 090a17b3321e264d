//! One scene evaluated: all that the figures, the table and the page need, and no more, so that
//! the frames themselves can be forgotten.

use super::errors::Errors;
use super::evaluation::{Evaluation, PhaseCurve, Spectra};
use super::recording::Recording;
use super::setup::{Setup, sigma_label};
use crate::error::Result;
use crate::method::Method;
use crate::progress::Progress;
use crate::report::Stack;
use ndarray::{Array2, Array3, ArrayView2, Axis, s};
use phasewalk_core::weights::Weighting;

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
        Self::of(&Evaluation::new(setup, &recording)?, label)
    }

    fn of(evaluation: &Evaluation<'_>, label: String) -> Result<Self> {
        let Evaluation { setup, recording, .. } = evaluation;
        let region = evaluation.region()?;
        let curve = |method| {
            let bar = Progress::new(&format!("{label}: curves"), setup.scene.frames as u64);
            evaluation.curve(&region, method, &bar)
        };
        let curves = ByMethod::compute(curve)?;
        let spectra = evaluation.spectra(&region);
        drop(region);
        let images = ByMethod::compute(|method| Ok(evaluation.images(method, &label)?.phases))?;
        let errors = ByMethod::compute(|method| {
            let (curve, images) = match method {
                Method::Direct => (&curves.direct, &images.direct),
                Method::OneStep => (&curves.one_step, &images.one_step),
                Method::Paper(_) | Method::Linked => (&curves.extended, &images.extended),
            };
            Ok(Errors::of(recording, method, curve, last(images)))
        })?;
        Ok(SceneResult {
            label,
            sigma_wavelengths: recording.scene.sigma_wavelengths,
            truth_rad: recording.truth_rad.clone(),
            autocorrelation: recording.autocorrelation.clone(),
            curves,
            errors,
            spectra,
            snapshots: snapshots(evaluation, &images),
            stacks: stacks(evaluation, &images)?,
        })
    }
}

fn snapshots(evaluation: &Evaluation<'_>, images: &ByMethod<Array3<f32>>) -> Vec<Snapshot> {
    let snapshot = |&frame: &usize| Snapshot {
        frame,
        amplitude: evaluation.amplitude(frame),
        direct: images.direct.index_axis(Axis(0), frame).to_owned(),
        extended: images.extended.index_axis(Axis(0), frame).to_owned(),
    };
    evaluation.setup.shown_frames.iter().map(snapshot).collect()
}

fn stacks(evaluation: &Evaluation<'_>, images: &ByMethod<Array3<f32>>) -> Result<Vec<Stack>> {
    let mut amplitudes = Array3::zeros(images.direct.dim());
    for (frame, mut image) in amplitudes.outer_iter_mut().enumerate() {
        image.assign(&evaluation.amplitude(frame));
    }
    // Speckle does not compress: half the pixels along each axis show it as well.
    let speckle = amplitudes.slice(s![.., ..;2, ..;2]);
    Ok(vec![
        Stack::speckle("speckle amplitude", speckle)?,
        Stack::phase("phase by direct difference", images.direct.view())?,
        Stack::phase("phase by extended walk", images.extended.view())?,
    ])
}

/// The image of the last frame.
fn last(images: &Array3<f32>) -> ArrayView2<'_, f32> {
    images.index_axis(Axis(0), images.dim().0 - 1)
}
