//! Sweep after sweep: each is compared with the last good ones.

use super::feature::Feature;
use super::motion::Motion;
use super::pair::PairMotion;
use super::{MATCHED, Registration};

/// Sweeps that a new one is compared with.
const PREDECESSORS: usize = 6;
/// Full searches for one sweep: past a saccade the first may mislead, in a blink none succeeds.
const SEARCHES: usize = 3;

/// The pairs of a recording so far and the features that the next sweep needs.
#[derive(Default)]
pub struct Sequence {
    held: Vec<(usize, Feature)>,
    pairs: Vec<(usize, usize, PairMotion)>,
}

impl Sequence {
    /// Continues after `pairs`; [`Sequence::hold`] brings back the features of [`Sequence::held`].
    #[must_use]
    pub fn resumed(pairs: Vec<(usize, usize, PairMotion)>) -> Self {
        Self { held: Vec::new(), pairs }
    }

    /// Adds a sweep's feature without comparing it.
    pub fn hold(&mut self, sweep: usize, feature: Feature) {
        self.held.push((sweep, feature));
    }

    /// Sweeps whose features are held, oldest first.
    #[must_use]
    pub fn held(&self) -> Vec<usize> {
        self.held.iter().map(|(sweep, _)| *sweep).collect()
    }

    /// All pairs (earlier, later, motion), for `judge` and `solve`.
    #[must_use]
    pub fn pairs(&self) -> &[(usize, usize, PairMotion)] {
        &self.pairs
    }

    /// Compares `sweep` with the held ones, newest first, and holds it.
    pub fn push(&mut self, registration: &Registration, sweep: usize, feature: Feature) {
        let mut best: Option<(usize, PairMotion)> = None;
        let mut searches = SEARCHES;
        for (earlier, held) in self.held.iter().rev() {
            let guess = best.and_then(|(through, pair)| self.guess(*earlier, through, pair));
            let near = guess.map(|guess| registration.pair(held, &feature, Some(guess)));
            let pair = match near {
                Some(pair) if pair.quality >= MATCHED || searches == 0 => pair,
                None if searches == 0 => continue,
                _ => {
                    searches -= 1;
                    registration.pair(held, &feature, None)
                }
            };
            if pair.quality >= MATCHED.max(best.map_or(0.0, |b| b.1.quality)) {
                best = Some((*earlier, pair));
            }
            self.pairs.push((*earlier, sweep, pair));
        }
        self.hold(sweep, feature);
        self.forget();
    }

    /// Motion of the newest sweep relative to `earlier` by way of the sweep `through`.
    fn guess(&self, earlier: usize, through: usize, pair: PairMotion) -> Option<Motion> {
        let known = |p: &&(usize, usize, PairMotion)| p.0 == earlier && p.1 == through;
        let first = self.pairs.iter().rev().find(known)?;
        (first.2.quality >= MATCHED).then(|| first.2.motion.then(pair.motion))
    }

    /// Drops the oldest sweep that matched none, or else the oldest; the newest stays.
    fn forget(&mut self) {
        while self.held.len() > PREDECESSORS {
            let older = &self.held[..self.held.len() - 1];
            let unmatched = older.iter().position(|(sweep, _)| !self.matched(*sweep));
            self.held.remove(unmatched.unwrap_or(0));
        }
    }

    fn matched(&self, sweep: usize) -> bool {
        self.pairs.iter().any(|p| (p.0 == sweep || p.1 == sweep) && p.2.quality >= MATCHED)
    }
}
