//! What the smoothed curve of all frames needs: the averages of all pairs, N L of them.

use crate::curve::phases_of_means;
use crate::error::Result;
use crate::io::CurveRow;
use crate::method::{Depths, Method, Plan};
use phasewalk_core::ensemble::PairMean;
use phasewalk_core::weights::Weighting;

/// Averages of the pairs of all frames so far.
#[derive(Default)]
pub(super) struct History {
    /// Numbers of the frames in the source.
    numbers: Vec<usize>,
    /// Where the averages of each frame with those before it begin, nearest first.
    starts: Vec<usize>,
    means: Vec<PairMean<f64>>,
}

impl History {
    /// Take the next frame and its averages with the frames before it, nearest first.
    pub fn push(&mut self, number: usize, means: &[PairMean<f64>]) {
        self.numbers.push(number);
        self.starts.push(self.means.len());
        self.means.extend_from_slice(means);
    }

    /// Bytes for each frame.
    #[must_use]
    pub const fn bytes_per_frame(max_lag: usize) -> usize {
        max_lag * size_of::<PairMean<f64>>() + 2 * size_of::<usize>()
    }

    /// The curve of all frames, computed as a whole series is.
    pub fn rows(&self, max_lag: usize, looks: f64, effective: f64) -> Result<Vec<CurveRow>> {
        let frames = self.numbers.len();
        let method = Method::Paper(Weighting::Paper);
        let max_lag = max_lag.min(frames.saturating_sub(1));
        let mut plan = Plan::new(method, frames, Some(max_lag), None, Depths::single())?;
        plan.times_s = self.numbers.iter().map(|&number| number as f64).collect();
        let pairs = plan.pairs();
        let mean = |&(t, s): &(usize, usize)| self.means[self.starts[s] + s - t - 1];
        let means: Vec<PairMean<f64>> = pairs.iter().map(mean).collect();
        let (phases, sigmas) = phases_of_means(&plan, &pairs, &means, looks, effective);
        let row = |(&frame, (phase_rad, sigma_rad)): (&usize, (f64, f64))| CurveRow {
            phase_rad,
            sigma_rad,
            ..CurveRow::missing(frame, frame as f64)
        };
        Ok(self.numbers.iter().zip(phases.into_iter().zip(sigmas)).map(row).collect())
    }
}
