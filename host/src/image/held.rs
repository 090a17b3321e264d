//! Phase images that are held in memory: all of a small series, or some frames of a large one.

use super::{Fit, ImageJob, Kernel, StripResult};
use crate::error::{Error, Result};
use crate::io::Series;
use crate::lanes::Path;
use crate::looks::{Looks, SpatialCoherence};
use crate::method::{Method, Plan};
use crate::progress::Progress;
use crate::series::Survey;
use ndarray::{Array3, ArrayView3, Axis, s};
use std::sync::{Mutex, PoisonError};

/// Images of some frames, axes (frame, y, x), radians.
#[derive(Clone, Debug)]
pub struct Images {
    /// The phases; NaN where there is none.
    pub phases: Array3<f32>,
    /// Their standard deviations, of a job that computes them.
    pub sigmas: Option<Array3<f32>>,
}

/// The images of some frames, filled strip by strip while a job runs.
pub struct HeldImages {
    frames: Vec<usize>,
    images: Mutex<Images>,
}

impl HeldImages {
    /// Room for the images of the given frames, each `height` x `width` pixels, with their standard deviations if
    /// `sigma` asks for them.
    #[must_use]
    pub fn new(frames: Vec<usize>, height: usize, width: usize, sigma: bool) -> Self {
        let room = || Array3::zeros((frames.len(), height, width));
        let images = Mutex::new(Images { phases: room(), sigmas: sigma.then(room) });
        Self { frames, images }
    }

    /// Take from a strip what belongs to the frames.
    ///
    /// # Errors
    /// When the strip is no whole number of rows, or lacks a frame or the standard deviations asked for.
    pub fn keep(&self, strip: &StripResult<'_>) -> Result<()> {
        let mut images = self.images.lock().unwrap_or_else(PoisonError::into_inner);
        self.place(strip.phases, strip, &mut images.phases)?;
        match &mut images.sigmas {
            Some(sigmas) => self.place(strip.sigmas.unwrap_or_default(), strip, sigmas),
            None => Ok(()),
        }
    }

    /// The frames' rows of `values`, (time, rows, x), into their place.
    fn place(
        &self,
        values: &[f32],
        strip: &StripResult<'_>,
        images: &mut Array3<f32>,
    ) -> Result<()> {
        let width = images.dim().2.max(1);
        let rows = strip.valid.len() / width;
        let misfit = || Error::failed(format!("a strip of {rows} rows does not fit"));
        let size = (values.len() / (rows * width).max(1), rows, width);
        let values = ArrayView3::from_shape(size, values).map_err(|_| misfit())?;
        let mut place = images.slice_mut(s![.., strip.first_row..strip.first_row + rows, ..]);
        for (&frame, mut image) in self.frames.iter().zip(place.outer_iter_mut()) {
            if frame >= size.0 {
                return Err(misfit());
            }
            image.assign(&values.index_axis(Axis(0), frame));
        }
        Ok(())
    }

    /// The images, in the order of the frames.
    #[must_use]
    pub fn into_images(self) -> Images {
        self.images.into_inner().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A series and how its phases are averaged in space.
pub struct Imaging<'a> {
    /// The frames.
    pub series: &'a dyn Series,
    /// Their usable pixels and scale.
    pub survey: &'a Survey,
    /// How far a speckle reaches.
    pub coherence: &'a SpatialCoherence,
    /// σ_Gauss, pixels.
    pub sigma_px: f64,
    /// What the weights' threshold counts.
    pub looks: Looks,
    /// Number of threads.
    pub threads: usize,
    /// Bytes that the strips of all threads may take together.
    pub memory: u64,
}

impl Imaging<'_> {
    /// Images of all frames, NaN where a pixel is not usable; linked phases are those of a single depth and
    /// recording, and have standard deviations. The progress bar is called `label`.
    ///
    /// # Errors
    /// What [`ImageJob::run`] reports.
    pub fn images(&self, plan: &Plan, label: &str) -> Result<Images> {
        let shape = self.series.shape();
        let kernel = Kernel::new(self.sigma_px, shape.height, shape.width, false)?;
        let effective_looks = self.coherence.looks_of_kernel(&kernel);
        let looks = self.looks.choose(kernel.nominal_looks(), effective_looks);
        let path = Path::best()?;
        let fit = Fit::of_one_plane(self.series, self.survey, plan, self.coherence, looks, path);
        let linked = plan.method == Method::Linked;
        let tiles = linked.then(|| fit.tiles(&Progress::new(label, fit.steps()))).transpose()?;
        let job = ImageJob {
            series: self.series,
            survey: self.survey,
            plan,
            sigma_px: self.sigma_px,
            looks,
            effective_looks,
            tiles: tiles.as_ref(),
            sigma: linked,
            double: false,
            path,
            threads: self.threads,
            memory: self.memory,
        };
        let held = HeldImages::new((0..shape.frames).collect(), shape.height, shape.width, linked);
        let progress = Progress::new(label, job.steps()?);
        job.run(&progress, &|strip| held.keep(&strip))?;
        Ok(held.into_images())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chosen_frames_are_kept_row_by_row() {
        let held = HeldImages::new(vec![2, 0], 3, 2, true);
        let strip = |first_row, phases: &[f32], sigmas: Option<&[f32]>, valid: &[bool]| {
            held.keep(&StripResult { first_row, phases, sigmas, closure: None, valid })
        };
        let ramp: Vec<f32> = (0..12).map(|n| n as f32).collect();
        let double: Vec<f32> = ramp.iter().map(|value| 2.0 * value).collect();
        strip(0, &ramp, Some(&double), &[true; 4]).unwrap();
        strip(2, &ramp[..6], Some(&double[..6]), &[true; 2]).unwrap();
        assert!(strip(2, &ramp[..4], Some(&double[..4]), &[true; 2]).is_err(), "two frames only");
        assert!(strip(2, &ramp[..6], None, &[true; 2]).is_err(), "no standard deviations");
        let Images { phases, sigmas } = held.into_images();
        let frame = |n: usize| phases.index_axis(Axis(0), n).iter().copied().collect::<Vec<_>>();
        assert_eq!(frame(0), [8.0, 9.0, 10.0, 11.0, 4.0, 5.0]);
        assert_eq!(frame(1), [0.0, 1.0, 2.0, 3.0, 0.0, 1.0]);
        assert_eq!(sigmas.unwrap(), &phases * 2.0);
    }
}
