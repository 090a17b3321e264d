//! The whole chain frame by frame, in fixed memory: fields in, phase and its standard deviation out;
//! the paper's solution (lines 916-918) for the frames so far.

use crate::cross_spectrum::CrossSpectrumStream;
use crate::error::Error;
use crate::pair_walk::PairWalk;
use crate::params::Params;
use crate::scalar::Scalar;
use crate::weights::Weights;
use heapless::Vec;
use num_complex::Complex;

pub use crate::pair_walk::Estimate;

/// Streaming solution over up to `PIXELS` pixels with pairs up to `LAGS` frames apart and `ROWS` >= `LAGS` + 1
/// frames of history.
///
/// Memory: LAGS complex fields and that of [`PairWalk`].
#[derive(Clone, Debug)]
pub struct Walk<T, const PIXELS: usize, const LAGS: usize, const ROWS: usize> {
    stream: CrossSpectrumStream<T, PIXELS, LAGS>,
    pairs: PairWalk<T, LAGS, ROWS>,
}

impl<T: Scalar, const PIXELS: usize, const LAGS: usize, const ROWS: usize>
    Walk<T, PIXELS, LAGS, ROWS>
{
    /// No frames yet. `looks` are the effective looks of the pixels, for the standard deviation.
    ///
    /// # Errors
    /// Parameters out of range, or a largest lag other than `LAGS`.
    pub fn new(params: Params, weights: Weights, looks: f64) -> Result<Self, Error> {
        if params.max_lag < LAGS {
            let allowed = "the LAGS that the buffers were made for";
            return Err(Error { parameter: "max lag", value: params.max_lag as f64, allowed });
        }
        let pairs = PairWalk::new(params, weights, looks)?;
        Ok(Self { stream: CrossSpectrumStream::new(), pairs })
    }

    /// Take the next frame, evenly spaced in time, and say where the phase is now.
    ///
    /// All frames have the same pixels, at most `PIXELS` of them: what is beyond is left out, and of
    /// frames with different numbers of pixels those count that both have.
    pub fn push(&mut self, field: &[Complex<T>]) -> Estimate<T> {
        let mut means = Vec::<_, LAGS>::new();
        self.stream.push(field, |_, mean| {
            // Cannot fail: there are not more.
            let _ = means.push(mean);
        });
        self.pairs.push(&means)
    }

    /// The smoothed phases of the frames still held, against their gauge; `phases[0]` is frame
    /// `self.first_kept()`.
    pub fn smoothed(&self, phases: &mut [T]) {
        self.pairs.smoothed(phases);
    }

    /// First frame whose smoothed phase is still held.
    #[must_use]
    pub const fn first_kept(&self) -> usize {
        self.pairs.first_kept()
    }
}
