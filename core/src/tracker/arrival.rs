//! How a new frame finds its place: first phase, quality, links to its predecessors.

use super::nodes::{Node, zero};
use super::{Tracker, equations, start};
use crate::quality::{USABLE, quality_of_one};
use crate::scalar::Real;
use crate::square::{Square, dot};
use crate::storage::Matrix;

/// Variance of the regression is not taken for smaller.
const SMALLEST_VARIANCE: f64 = 0.01;

impl<T: Real, const NODES: usize, const M: usize> Tracker<T, NODES, M> {
    /// First phase and quality of the newest node.
    pub(super) fn begin(&mut self, newest: usize) {
        self.guess(newest);
        let mut data = Matrix::<T, NODES, NODES>::filled(T::zero());
        let (a, _) = self.regress(&self.model(&mut data), newest);
        let aligned = self.nodes.aligned();
        let mut sum = zero();
        for (j, &a) in a.iter().enumerate().take(newest) {
            let suggestion = aligned.suggestion(newest, j);
            sum.re += a * suggestion.re;
            sum.im += a * suggestion.im;
        }
        let window = self.nodes.window();
        let [before @ .., node] = window else { return };
        let phase = start::first_phase(sum, start::predict(before, node.time));
        if let Some(node) = self.nodes.all_mut().last_mut() {
            node.set_phase(phase);
        }
        self.judge(newest);
    }

    /// With the first two frames that are not dark: a first idea of the decay.
    fn guess(&mut self, newest: usize) {
        let (first, window) = (self.nodes.oldest(), self.nodes.window());
        let [before @ .., node] = window else { return };
        let lit = |quality: T| quality > T::zero();
        let Some(j) = before.iter().rposition(|other| lit(other.weight())) else { return };
        if self.memory.is_known() || !lit(node.quality) {
            return;
        }
        let tau = before.get(j).map_or(0.0, |other| node.clock - other.clock);
        let coherence = self.nodes.coherence_squared(newest, first + j).sqrt();
        self.memory.guess(coherence, T::from_f64(tau));
    }

    /// Quality of the newest node; without light it is 0 already. The first three frames else pass for good, and those
    /// that there is nothing to judge by.
    ///
    /// Only usable frames bear witness, if there are any: after a total loss of coherence the first new frame has a
    /// small quality, to which the second one's coherence with it is large.
    pub(super) fn judge(&mut self, newest: usize) {
        let (first, aligned) = (self.nodes.oldest(), self.nodes.aligned());
        let [before @ .., node] = self.nodes.window() else { return };
        if before.len() < 3 || node.quality <= T::zero() || !self.memory.is_known() {
            return;
        }
        let is_usable = |other: &Node<T>| other.weight() > T::from_f64(USABLE);
        let any = before.iter().any(is_usable);
        let witnesses = before.iter().enumerate().filter(|(_, other)| !any || is_usable(other));
        let pairs = witnesses.map(|(j, other)| {
            let model = self.memory.coherence.at(T::from_f64(node.clock - other.clock));
            (aligned.coherence(newest, first + j), model, other.weight())
        });
        let quality = quality_of_one(pairs, self.settings.looks);
        if let Some(node) = self.nodes.all_mut().last_mut() {
            node.quality = quality;
        }
    }

    /// a and d of the newest node.
    fn regress(&self, gamma: &Square<'_, T>, newest: usize) -> ([T; NODES], T) {
        let mut known = [T::zero(); NODES];
        for (place, &g) in known.iter_mut().zip(gamma.row(newest)).take(newest) {
            *place = g;
        }
        let mut data = Matrix::<T, NODES, NODES>::filled(T::zero());
        let mut predecessors = Square::with_stride(data.as_mut(), newest, NODES);
        let diagonal = T::from_f64(1.0 + self.settings.ridge / self.settings.looks);
        predecessors.fill_with(|i, j| if i == j { diagonal } else { gamma.at(i, j) });
        predecessors.factor();
        let mut a = known;
        predecessors.solve_factored(&mut a);
        (a, (T::one() - dot(&a, &known)).max(T::from_f64(SMALLEST_VARIANCE)))
    }

    /// Learn, link the newest node to its predecessors and move all phases. Returns 2 L times its variance.
    pub(super) fn link(&mut self, newest: usize) -> T {
        let gain = T::from_f64(equations::gain_for(self.settings.looks));
        let gain = self.settings.periodic.then_some(gain);
        self.memory.fit(&self.nodes, &self.nodes.aligned(), gain);
        let mut data = Matrix::<T, NODES, NODES>::filled(T::zero());
        let gamma = self.model(&mut data);
        let (a, d) = self.regress(&gamma, newest);
        self.filter.add_regression(a.get(..newest).unwrap_or(&[]), d);
        let mut variance = T::zero();
        for _ in 0..self.settings.passes {
            let (steps, of_newest) = self.filter.step(&gamma, &self.nodes.aligned());
            variance = of_newest;
            for (node, &step) in self.nodes.all_mut().iter_mut().zip(&steps) {
                node.set_phase(node.phase() + step);
            }
        }
        variance
    }

    pub(super) fn keep_anchor(&mut self, newest: usize) {
        let Some(node) = self.nodes.window().last() else { return };
        if self.nodes.is_anchored() && node.quality > T::from_f64(USABLE) {
            let factors = self.anchor.factors(&self.memory.coherence, node.clock);
            let coherence = self.nodes.aligned().coherence(0, newest) / node.quality;
            let weight = T::from_f64(self.settings.anchor_weight);
            self.memory.keep_anchor(&factors, coherence, weight);
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::quality::USABLE;
    use crate::tracker::testing::{FRAMES, Speckle, truth};
    use crate::tracker::{FieldTracker, NODES, TrackerSettings};

    /// Every 15th frame holds another pattern, as bright; noise is as strong as the signal.
    #[test]
    fn frames_that_agree_by_chance_are_not_usable() {
        const LOOKS: usize = 100;
        const RUNS: u64 = 40;
        let (mut bad, mut passed, mut above_03, mut good, mut lost) = (0, 0, 0, 0, 0);
        for seed in 0..RUNS {
            let settings = TrackerSettings::for_looks(LOOKS as f64, 1.0);
            let mut tracker = FieldTracker::<f64, LOOKS, NODES>::new(settings).unwrap();
            let mut speckle = Speckle::<LOOKS>::new(seed, 0.9258);
            for frame in 0..FRAMES {
                let is_bad = frame % 15 == 14;
                let noise = if is_bad { 1e6 } else { 1.0 };
                let field = speckle.frame(truth(frame), noise);
                let newest = tracker.push(&field, frame as f64, |_| ()).unwrap();
                let usable = newest.is_usable(LOOKS as f64);
                if is_bad {
                    bad += 1;
                    passed += usize::from(usable);
                    above_03 += usize::from(newest.quality > USABLE);
                } else if frame > 0 {
                    good += 1;
                    lost += usize::from(!usable);
                }
            }
        }
        std::println!(
            "{passed} of {bad} bad frames pass, {above_03} above 0.3; {lost} of {good} good ones lost"
        );
        assert!(passed * 12 < bad && above_03 * 5 > bad, "{passed} {above_03} {bad}");
        assert!(lost * 200 < good, "{lost} {good}");
    }
}
