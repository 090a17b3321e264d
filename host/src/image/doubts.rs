//! What phase images could not tell, counted over all strips.

use std::f64::consts::PI;
use std::sync::{Mutex, PoisonError};

/// Pixels whose phase is missing or not sure.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Doubts {
    /// Usable pixels without any phase of their own: no pair of frames had a weight (0 stands there, for want of anything
    /// better), or no frame is usable (NaN).
    pub unmeasured: usize,
    /// Whole turns over gaps in the times.
    pub over_gaps: Gaps,
}

/// Of pixels that were asked how well the velocity around gaps predicts the change over the least sure of them
/// (`phasewalk_core::chain::least_sure_gap`); none where there are no gaps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Gaps {
    /// How many were asked.
    pub asked: usize,
    /// Those of which three standard errors of the prediction reach half a turn.
    pub unsure: usize,
}

impl Gaps {
    /// Is a turn over a gap unsure, with this standard error of the predicted change, radians?
    #[must_use]
    pub fn is_unsure(error: f64) -> bool {
        error.is_nan() || 3.0 * error >= PI
    }

    /// A pixel with this standard error.
    pub(super) fn count(&mut self, error: f64) {
        self.asked += 1;
        self.unsure += usize::from(Self::is_unsure(error));
    }

    pub(super) fn add(&mut self, others: Self) {
        self.asked += others.asked;
        self.unsure += others.unsure;
    }

    /// The share that is not sure; none where none was asked.
    #[must_use]
    pub fn share_unsure(self) -> Option<f64> {
        (self.asked > 0).then(|| self.unsure as f64 / self.asked as f64)
    }
}

/// The sum over strips, from all threads.
#[derive(Debug, Default)]
pub(super) struct Tally(Mutex<Doubts>);

impl Tally {
    pub fn add(&self, strip: Doubts) {
        let mut all = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        all.unmeasured += strip.unmeasured;
        all.over_gaps.add(strip.over_gaps);
    }

    pub fn total(self) -> Doubts {
        self.0.into_inner().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn turns_are_unsure_where_three_errors_reach_half_of_one() {
        let mut gaps = Gaps::default();
        assert_eq!(gaps.share_unsure(), None);
        for error in [0.1, 1.04, 1.05, f64::INFINITY, f64::NAN] {
            gaps.count(error);
        }
        assert_eq!(gaps.share_unsure(), Some(0.6));
    }
}
