//! One scene as Figures 1 and 2 show it.

use super::methods::{ByMethod, by_method};
use super::settings::{FRAMES, Settings, label};
use crate::demo::{Evaluation, Recording, Spectra};
use crate::error::Result;
use crate::image::Images;
use crate::progress::Progress;
use ndarray::{Array2, Array3, Axis};

/// One frame, axes (y, x).
#[derive(Clone, Debug)]
pub struct Snapshot {
    /// |U|, any unit.
    pub amplitude: Array2<f32>,
    /// Phase by each method, radians.
    pub phases: ByMethod<Array2<f32>>,
    /// Standard deviation of the linked phase, radians.
    pub linked_sigma: Array2<f32>,
}

/// A scene and what can be seen in it.
pub struct Scene {
    /// Its name, such as `σ = λ/32`.
    pub label: String,
    /// The x-shaped region that moves, (y, x).
    pub mask: Vec<bool>,
    /// The phase put in, radians, one per frame.
    pub truth_rad: Vec<f64>,
    /// Amplitude of the autocorrelation inside the x by lag.
    pub autocorrelation: Vec<f64>,
    /// The cross-spectrum.
    pub spectra: Spectra,
    /// The frames [`FRAMES`].
    pub snapshots: [Snapshot; FRAMES.len()],
}

impl Scene {
    /// Simulate run 0 of a σ, an index into [`SIGMAS`](super::settings::SIGMAS), and evaluate it, with
    /// progress bars.
    ///
    /// # Errors
    /// Those of the simulation and of the phase images, and the user's interruption.
    pub fn compute(settings: &Settings, sigma: usize) -> Result<Self> {
        let label = label(sigma);
        let bar = Progress::new(&format!("{label}: simulate"), settings.setup.scene.frames as u64);
        let recording = Recording::simulate(settings.scene(sigma, 0), &bar)?;
        drop(bar);
        let evaluation = Evaluation::new(&settings.setup, &recording)?;
        let spectra = evaluation.spectra(&evaluation.region()?);
        let mut sigmas = None;
        let images = by_method(|method| {
            let Images { phases, sigmas: known } = evaluation.images(method, &label)?;
            sigmas = known.as_ref().map(shown).or(sigmas.take());
            Ok(shown(&phases))
        })?;
        let missing = || Array2::from_elem(images[0][0].dim(), f32::NAN);
        let snapshot = |n: usize| Snapshot {
            amplitude: evaluation.amplitude(FRAMES[n]),
            phases: images.each_ref().map(|frames| frames[n].clone()),
            linked_sigma: sigmas.as_ref().map_or_else(missing, |frames| frames[n].clone()),
        };
        let snapshots = std::array::from_fn(snapshot);
        drop(evaluation);
        let Recording { mask, truth_rad, autocorrelation, .. } = recording;
        Ok(Self { label, mask, truth_rad, autocorrelation, spectra, snapshots })
    }

    /// A frame that was kept.
    ///
    /// # Panics
    /// For a frame that is not one of [`FRAMES`].
    #[must_use]
    pub fn snapshot(&self, frame: usize) -> &Snapshot {
        let place = FRAMES.iter().position(|&kept| kept == frame);
        &self.snapshots[place.expect("only frames that are kept are asked for")]
    }
}

/// The frames [`FRAMES`] of all images.
fn shown(images: &Array3<f32>) -> [Array2<f32>; FRAMES.len()] {
    FRAMES.map(|frame| images.index_axis(Axis(0), frame).to_owned())
}
