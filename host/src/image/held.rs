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

/// The images of some frames, filled strip by strip while a job runs.
pub struct HeldImages {
    frames: Vec<usize>,
    /// (frame, y, x), radians.
    images: Mutex<Array3<f32>>,
}

impl HeldImages {
    /// Room for the images of the given frames, each `height` x `width` pixels.
    #[must_use]
    pub fn new(frames: Vec<usize>, height: usize, width: usize) -> Self {
        let images = Mutex::new(Array3::zeros((frames.len(), height, width)));
        Self { frames, images }
    }

    /// Take from a strip what belongs to the frames.
    ///
    /// # Errors
    /// When the strip is no whole number of rows, or lacks a frame.
    pub fn keep(&self, strip: &StripResult<'_>) -> Result<()> {
        let mut images = self.images.lock().unwrap_or_else(PoisonError::into_inner);
        let width = images.dim().2.max(1);
        let rows = strip.valid.len() / width;
        let misfit = || Error::failed(format!("a strip of {rows} rows does not fit"));
        let size = (strip.phases.len() / (rows * width).max(1), rows, width);
        let phases = ArrayView3::from_shape(size, strip.phases).map_err(|_| misfit())?;
        let mut place = images.slice_mut(s![.., strip.first_row..strip.first_row + rows, ..]);
        for (&frame, mut image) in self.frames.iter().zip(place.outer_iter_mut()) {
            if frame >= size.0 {
                return Err(misfit());
            }
            image.assign(&phases.index_axis(Axis(0), frame));
        }
        Ok(())
    }

    /// The images, (frame, y, x), in the order of the frames.
    #[must_use]
    pub fn into_images(self) -> Array3<f32> {
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
    /// Phases in radians, axes (time, y, x); NaN where a pixel is not usable; linked phases are
    /// those of a single depth and recording. The progress bar is called `label`.
    ///
    /// # Errors
    /// What [`ImageJob::run`] reports.
    pub fn phases(&self, plan: &Plan, label: &str) -> Result<Array3<f32>> {
        let shape = self.series.shape();
        let kernel = Kernel::new(self.sigma_px, shape.height, shape.width, false)?;
        let effective_looks = self.coherence.looks_of_kernel(&kernel);
        let looks = self.looks.choose(kernel.nominal_looks(), effective_looks);
        let path = Path::best()?;
        let fit = Fit {
            series: self.series,
            survey: self.survey,
            plan,
            coherence: self.coherence,
            looks_of_layers: 1.0,
            looks_of_recordings: 1.0,
            looks,
            window_looks: looks,
            closure: false,
            path,
        };
        let tiles = (plan.method == Method::Linked)
            .then(|| fit.tiles(&Progress::new(label, fit.steps())))
            .transpose()?;
        let job = ImageJob {
            series: self.series,
            survey: self.survey,
            plan,
            sigma_px: self.sigma_px,
            looks,
            effective_looks,
            tiles: tiles.as_ref(),
            sigma: false,
            double: false,
            path,
            threads: self.threads,
            memory: self.memory,
        };
        let held = HeldImages::new((0..shape.frames).collect(), shape.height, shape.width);
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
        let held = HeldImages::new(vec![2, 0], 3, 2);
        let strip = |first_row, phases: &[f32], valid: &[bool]| {
            held.keep(&StripResult { first_row, phases, sigmas: None, closure: None, valid })
        };
        let ramp: Vec<f32> = (0..12).map(|n| n as f32).collect();
        strip(0, &ramp, &[true; 4]).unwrap();
        strip(2, &ramp[..6], &[true; 2]).unwrap();
        assert!(strip(2, &ramp[..4], &[true; 2]).is_err(), "two frames only");
        let images = held.into_images();
        let frame = |n: usize| images.index_axis(Axis(0), n).iter().copied().collect::<Vec<_>>();
        assert_eq!(frame(0), [8.0, 9.0, 10.0, 11.0, 4.0, 5.0]);
        assert_eq!(frame(1), [0.0, 1.0, 2.0, 3.0, 0.0, 1.0]);
    }
}
