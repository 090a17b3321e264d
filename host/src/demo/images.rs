//! The phase images of a series that fits into memory.

use crate::error::{Error, Result};
use crate::image::{ImageJob, Kernel};
use crate::io::Series;
use crate::lanes::Path;
use crate::looks::{Looks, SpatialCoherence};
use crate::method::Plan;
use crate::progress::Progress;
use crate::series::Survey;
use ndarray::{Array3, s};
use std::sync::{Mutex, PoisonError};

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
    /// Phases in radians, axes (time, y, x); NaN where a pixel is not usable. The progress bar is
    /// called `label`.
    ///
    /// # Errors
    /// What [`ImageJob::run`] reports.
    pub fn phases(&self, plan: &Plan, label: &str) -> Result<Array3<f32>> {
        let shape = self.series.shape();
        let kernel = Kernel::new(self.sigma_px, shape.height, shape.width, false)?;
        let effective_looks = self.coherence.looks_of_kernel(&kernel);
        let job = ImageJob {
            series: self.series,
            survey: self.survey,
            plan,
            sigma_px: self.sigma_px,
            looks: self.looks.choose(kernel.nominal_looks(), effective_looks),
            effective_looks,
            sigma: false,
            double: false,
            path: Path::best()?,
            threads: self.threads,
            memory: self.memory,
        };
        let images = Mutex::new(Array3::zeros((shape.frames, shape.height, shape.width)));
        let progress = Progress::new(label, job.steps()?);
        job.run(&progress, &|strip| {
            let rows = strip.valid.len() / shape.width;
            let size = (shape.frames, rows, shape.width);
            let phases = ndarray::ArrayView3::from_shape(size, strip.phases)
                .map_err(|what| Error::failed(format!("strip of {rows} rows: {what}")))?;
            let place = s![.., strip.first_row..strip.first_row + rows, ..];
            let mut images = images.lock().unwrap_or_else(PoisonError::into_inner);
            images.slice_mut(place).assign(&phases);
            Ok(())
        })?;
        Ok(images.into_inner().unwrap_or_else(PoisonError::into_inner))
    }
}
