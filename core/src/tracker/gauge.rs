//! The reference phase: the mean of the first N_0 frames is held at 0.
//!
//! Differences of phases do not depend on what is held, so the filter may hold what the phases are reported
//! against: its variances are then those of the reported phases. While the reference frames arrive, the mean of the
//! usable ones so far is held instead, and released again before the next.

use super::Tracker;
use crate::coherence::sum;
use crate::quality::USABLE;
use crate::scalar::Real;

/// Strength with which the mean is held, in units of 2 L.
const HOLD: f64 = 1e4;

impl<T: Real, const NODES: usize, const M: usize> Tracker<T, NODES, M> {
    /// Before a reference frame: hold the mean of those before no longer.
    pub(super) fn release_references(&mut self) {
        if self.frames > 0 && self.frames < self.settings.reference_frames {
            let (shares, mean) = self.reference_mean();
            let strength = T::from_f64(HOLD);
            self.filter.hold_mean(&shares, -strength, strength * mean);
        }
    }

    /// With a reference frame: shift all phases so that the mean so far is 0, and hold it there.
    pub(super) fn hold_references(&mut self) {
        if self.frames <= self.settings.reference_frames {
            let (shares, mean) = self.reference_mean();
            self.referred = self.nodes.all().iter().any(|node| node.quality > T::from_f64(USABLE));
            for node in self.nodes.all_mut() {
                node.set_phase(node.phase() - mean);
            }
            self.filter.hold_mean(&shares, T::from_f64(HOLD), T::zero());
        }
    }

    /// Shares of the nodes in the mean of the reference frames, and that mean. All frames so far are reference frames, and
    /// in the window; if none is usable, the first is the reference.
    fn reference_mean(&self) -> ([T; NODES], T) {
        let mut shares = [T::zero(); NODES];
        for (share, node) in shares.iter_mut().zip(self.nodes.all()) {
            let usable = node.quality > T::from_f64(USABLE);
            *share = if usable { T::one() } else { T::zero() };
        }
        let count = sum(&shares);
        if count <= T::zero() {
            shares.iter_mut().take(1).for_each(|share| *share = T::one());
        }
        let scale = T::one() / count.max(T::one());
        let mut mean = T::zero();
        for (share, node) in shares.iter_mut().zip(self.nodes.all()) {
            *share = *share * scale;
            mean += *share * node.phase();
        }
        (shares, mean)
    }
}
