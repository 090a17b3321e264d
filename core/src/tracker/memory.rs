//! What the tracker has learnt of the coherence: the shares of decays and cosines, and the normal equations of their fit,
//! which forget slowly.

use super::anchor::Anchor;
use super::equations::Equations;
use super::nodes::{Aligned, Node, Nodes};
use super::terms::{Coherence, Terms};
use crate::coherence::information;
use crate::scalar::Real;
use crate::square::Square;
use heapless::Vec;

/// Shares are held towards 0 as if by so many pairs, until there are pairs.
const HOLD: f64 = 1e-6;

/// Coherence with the anchor is not taken for more: it is nearly that with one frame of the window, and the
/// model must remain invertible.
const LARGEST_WITH_ANCHOR: f64 = 0.98;

#[derive(Clone, Debug)]
pub(super) struct Memory<T, const M: usize> {
    pub(super) coherence: Coherence<T, M>,
    /// Pairs with frames that have left the window, and with the anchor.
    past: Equations<T, M>,
    /// Has there been a first guess?
    known: bool,
}

impl<T: Real, const M: usize> Memory<T, M> {
    /// Terms for lags from `unit` to `longest`.
    pub(super) fn new(unit: f64, longest: f64) -> Self {
        let past = Equations::held(T::from_f64(HOLD));
        Self { coherence: Coherence::new(unit, longest), past, known: false }
    }

    /// Has there been a first guess?
    pub(super) const fn is_known(&self) -> bool {
        self.known
    }

    /// First guess from one coherence `gamma` at the lag `tau`: nearly all of the decay that comes nearest.
    pub(super) fn guess(&mut self, gamma: T, tau: T) {
        self.known = true;
        let gamma = gamma.max(T::from_f64(0.05)).min(T::from_f64(0.95));
        let mut nearest = (0, T::from_f64(f64::INFINITY));
        for (k, &decay) in self.coherence.mixture.decays(tau).iter().enumerate() {
            let distance = (decay - gamma).abs();
            if distance < nearest.1 {
                nearest = (k, distance);
            }
        }
        for (k, share) in self.coherence.mixture.shares.iter_mut().enumerate() {
            *share = T::from_f64(if k == nearest.0 { 0.95 } else { 1e-3 });
        }
        self.coherence.together = self.coherence.mixture.shares;
    }

    /// Fit to the past and all pairs of the window, with cosines if these explain more by a `gain`; before the first guess
    /// there is nothing to fit.
    pub(super) fn fit<const N: usize>(
        &mut self,
        nodes: &Nodes<T, N>,
        aligned: &Aligned<'_, T, N>,
        gain: Option<T>,
    ) {
        if !self.known {
            return;
        }
        let (first, window) = (nodes.oldest(), nodes.window());
        let lags = Lags::<T, N, M>::between(&self.coherence, window);
        let mut equations = Equations::new();
        for i in 0..window.len() {
            lags.each_from(i, |j, terms| {
                let coherence = aligned.coherence(first + i, first + j);
                self.add_pair(&mut equations, terms, both(window, i, j), coherence);
            });
        }
        equations.join(&self.past);
        equations.fit(&mut self.coherence, gain);
    }

    /// Keep the pairs of the oldest frame, which leaves the window; then everything counts `forget` times.
    pub(super) fn keep_oldest<const N: usize>(
        &mut self,
        nodes: &Nodes<T, N>,
        aligned: &Aligned<'_, T, N>,
        forget: T,
    ) {
        let (first, window) = (nodes.oldest(), nodes.window());
        let mut equations = Equations::new();
        Lags::<T, N, M>::between(&self.coherence, window).each_from(0, |j, terms| {
            let coherence = aligned.coherence(first, first + j);
            self.add_pair(&mut equations, terms, both(window, 0, j), coherence);
        });
        self.past.join(&equations);
        self.past.scale(forget);
    }

    /// Keep the coherence of the newest frame with the anchor, the only view of lags beyond the window: it is linear in
    /// the shares as well.
    pub(super) fn keep_anchor(&mut self, factors: &Terms<T, M>, coherence: T, weight: T) {
        let loss = T::one() - coherence * coherence;
        let information = T::one() / (loss * loss * T::from_f64(0.5) + T::from_f64(0.02));
        self.past.add(factors, coherence, weight * information);
    }

    /// One pair at a lag with these terms; its coherence without the qualities, weighted with their square.
    fn add_pair(
        &self,
        equations: &mut Equations<T, M>,
        terms: &Terms<T, M>,
        both: T,
        coherence: T,
    ) {
        let both = both.max(T::from_f64(1e-3));
        let weight = both * both * information(self.coherence.of(terms));
        equations.add(terms, coherence / both, weight);
    }

    /// Gamma_ij = s_i s_j h(|u_i - u_j|) of the window, and the coherences with the anchor; 1 on the diagonal.
    pub(super) fn fill_model<const N: usize>(
        &self,
        nodes: &Nodes<T, N>,
        anchor: &Anchor<T, M>,
        gamma: &mut Square<'_, T>,
    ) {
        let (first, window) = (nodes.oldest(), nodes.window());
        let lags = Lags::<T, N, M>::between(&self.coherence, window);
        for (i, node) in window.iter().enumerate() {
            lags.each_from(i, |j, terms| {
                let h = self.coherence.of(terms);
                gamma.set_both(first + i, first + j, h * both(window, i, j));
            });
            gamma.set(first + i, first + i, T::one());
            if nodes.is_anchored() {
                let factors = anchor.factors(&self.coherence, node.clock);
                let h = self.coherence.of(&factors) * node.weight();
                let h = h.max(T::zero()).min(T::from_f64(LARGEST_WITH_ANCHOR));
                gamma.set_both(0, first + i, h);
            }
        }
        gamma.set(0, 0, T::one());
    }
}

/// s_i s_j.
fn both<T: Real>(window: &[Node<T>], i: usize, j: usize) -> T {
    let weight = |i: usize| window.get(i).map_or(T::zero(), Node::weight);
    weight(i) * weight(j)
}

/// Terms at the lags u_j - u_i of all pairs of frames, as products over the intervals between them: exponentials cost
/// more than the rest of the fit.
struct Lags<T, const N: usize, const M: usize> {
    /// From each frame to the next.
    steps: Vec<Terms<T, M>, N>,
}

impl<T: Real, const N: usize, const M: usize> Lags<T, N, M> {
    fn between(coherence: &Coherence<T, M>, frames: &[Node<T>]) -> Self {
        let mut steps = Vec::new();
        // Most intervals are like the one before: no new exponentials.
        let mut last = (f64::NAN, Terms::filled(T::zero()));
        for pair in frames.windows(2) {
            let &[before, after] = pair else { break };
            let interval = after.clock - before.clock;
            if interval != last.0 {
                last = (interval, coherence.terms(T::from_f64(interval)));
            }
            // Cannot fail: there are fewer intervals than nodes.
            let _ = steps.push(last.1);
        }
        Self { steps }
    }

    /// The later frames j, with the terms from i to j.
    fn each_from(&self, i: usize, mut each: impl FnMut(usize, &Terms<T, M>)) {
        let mut product = Terms::filled(T::one());
        for (j, step) in self.steps.iter().enumerate().skip(i) {
            product.follow(step);
            each(j + 1, &product);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::terms::COSINES;
    use super::*;
    use num_complex::Complex;

    /// Frames whose coherences are h exactly, at uneven times.
    fn nodes(h: impl Fn(f64) -> f64) -> Nodes<f64, 12> {
        let mut nodes = Nodes::new();
        for i in 0..12 {
            let time = |i: usize| (i + 3 * (i / 5)) as f64;
            let cross: [_; 12] = core::array::from_fn(|j| Complex::new(h(time(i) - time(j)), 0.0));
            nodes.push(&cross[..i], 1.0, time(i));
        }
        nodes
    }

    #[test]
    fn exact_coherences_are_learnt() {
        let h = |tau: f64| 0.15 + 0.7 * libm::exp(-0.2 * tau);
        let nodes = nodes(h);
        let mut memory = Memory::<_, 0>::new(1.0, 48.0);
        memory.guess(h(1.0), 1.0);
        for _ in 0..30 {
            memory.fit(&nodes, &nodes.aligned(), None);
        }
        for tau in 1..17 {
            let (tau, got) = (f64::from(tau), memory.coherence.at(f64::from(tau)));
            assert!((got - h(tau)).abs() < 0.02, "{tau}: {got}");
        }
        let mut data = [0.0; 144];
        let mut gamma = Square::new(&mut data, 12);
        memory.fill_model(&nodes, &Anchor::new(), &mut gamma);
        assert!((gamma.at(2, 9) - memory.coherence.at(10.0)).abs() < 1e-12, "2 to 9 + 3");
        assert_eq!((gamma.at(4, 4), gamma.at(9, 2)), (1.0, gamma.at(2, 9)));
    }

    #[test]
    fn coherence_that_comes_back_is_learnt_with_cosines_only() {
        let wave = |tau: f64| libm::cos(core::f64::consts::TAU * tau / 8.0);
        let h = |tau: f64| 0.55 * libm::exp(-0.05 * tau) + 0.4 * wave(tau);
        let nodes = nodes(h);
        let worst = |gain| {
            let mut memory = Memory::<_, COSINES>::new(1.0, 48.0);
            memory.guess(h(1.0), 1.0);
            for _ in 0..30 {
                memory.fit(&nodes, &nodes.aligned(), gain);
            }
            assert_eq!(memory.coherence.periodic, gain.is_some());
            let error = |tau: u8| (memory.coherence.at(tau.into()) - h(tau.into())).abs();
            (1..17).map(error).fold(0.0, f64::max)
        };
        // 8 is one of the periods.
        let (with, without) = (worst(Some(1.0)), worst(None));
        assert!(with < 0.06 && without > 0.3, "{with} {without}");
    }

    #[test]
    fn what_was_kept_stays_known() {
        let h = |tau: f64| libm::exp(-0.1 * tau);
        let known = nodes(h);
        let mut memory = Memory::<_, 0>::new(1.0, 48.0);
        memory.guess(h(1.0), 1.0);
        for _ in 0..30 {
            memory.fit(&known, &known.aligned(), None);
        }
        memory.keep_oldest(&known, &known.aligned(), 0.98);
        let nothing = Nodes::<f64, 12>::new();
        memory.fit(&nothing, &nothing.aligned(), None);
        assert!((memory.coherence.at(5.0) - h(5.0)).abs() < 0.02, "{:?}", memory.coherence);
    }

    #[test]
    fn the_guess_takes_the_nearest_decay() {
        let mut memory = Memory::<f32, 0>::new(1.0, 48.0);
        memory.guess(0.9, 1.0);
        assert!((memory.coherence.at(1.0) - 0.87).abs() < 0.06, "{:?}", memory.coherence);
        memory.guess(f32::NAN, 1.0);
        assert!(memory.coherence.at(1.0).is_finite());
    }
}
