//! A total loss of coherence, and the new start after it.

use super::{Tracker, start};
use crate::chain::wrap;
use crate::quality::USABLE;
use crate::scalar::Real;
use crate::storage::Matrix;

/// Standard deviation of the phase across a new lock, rad.
const LOCK_SIGMA: f64 = 1.0;

/// Share of the expected squared coherence with which two frames agree.
const AGREEMENT: f64 = 0.35;

/// Squared coherence, times L, below which two frames agree by chance.
const CHANCE: f64 = 5.0;

impl<T: Real, const NODES: usize, const M: usize> Tracker<T, NODES, M> {
    /// Have the two newest frames nothing to do with those before, but with each other?
    pub(super) fn is_lock_lost(&self, newest: usize) -> bool {
        let [_, _, _, .., before, last] = self.nodes.window() else { return false };
        if before.weight().max(last.weight()) >= T::from_f64(USABLE) {
            return false;
        }
        let chance = 1.0 / self.settings.looks;
        let square =
            self.nodes.coherence_squared(newest, newest.saturating_sub(1)) - T::from_f64(chance);
        let expected = self.memory.coherence.at(self.lag_of_newest());
        let agreement = T::from_f64(AGREEMENT) * expected * expected;
        square > agreement.max(T::from_f64(CHANCE * chance))
    }

    /// A new start with the two newest frames. All that was known stays as it is; what chance seemed to tell of
    /// the first of both is forgotten, and it is taken to be where it was expected.
    pub(super) fn lock_again(&mut self, newest: usize) {
        let mut data = Matrix::<T, NODES, NODES>::filled(T::zero());
        let gamma = self.model(&mut data);
        let first = newest.saturating_sub(1);
        self.filter.eliminate(first);
        self.filter.add_node();
        self.filter.freeze(|_| true, &gamma, &self.nodes.aligned());
        let [before @ .., one, _] = self.nodes.window() else { return };
        let strength = 0.5 / (self.settings.looks * LOCK_SIGMA * LOCK_SIGMA);
        let known = self.nodes.oldest() + start::predicts(before);
        self.filter.tie(first, known, T::from_f64(strength));
        let phase = start::predict(before, one.time);
        let turn = self.nodes.aligned().suggestion(newest, first);
        let step = turn.im.atan2(turn.re) - one.phase();
        for (i, node) in self.nodes.all_mut().iter_mut().enumerate() {
            node.lost = i < first;
            if i >= first {
                node.quality = T::one();
                node.set_phase(if i == first { phase } else { phase + wrap(step) });
            }
        }
        self.anchor.forget();
    }

    /// Time between the two newest frames, by the clock of the decorrelation.
    pub(super) fn lag_of_newest(&self) -> T {
        match self.nodes.window() {
            [.., before, newest] => T::from_f64(newest.clock - before.clock),
            _ => T::zero(),
        }
    }
}
