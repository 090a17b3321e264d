//! What every curve of a region can do.

use crate::io::CurveRow;
use num_complex::Complex32;

/// The phase of a region, frame by frame.
pub trait WatchedCurve {
    /// Take the next usable frame, (y, x), which is number `frame` of the source, and say where the phase is now. The
    /// row's time is the number.
    fn push(&mut self, frame: usize, field: &[Complex32]) -> CurveRow;

    /// The smoothed phases of all usable frames so far, where a history is kept; times are numbers.
    fn smoothed(&self) -> Option<Vec<CurveRow>>;

    /// Pixels of the region.
    fn pixels(&self) -> usize;
}
