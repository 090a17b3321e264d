//! What the tracker has learnt of the coherence: the mixture of decays, and the normal equations of its fit,
//! which forget slowly.

use super::anchor::Anchor;
use super::nodes::{Aligned, Node, Nodes};
use crate::coherence::{Mixture, Normal, information, limit_sum};
use crate::scalar::Real;
use crate::square::{Square, dot};
use heapless::Vec;

/// Decays of the model: the static part and 8 rates, fewer than in a batch because a few lags have to fix
/// them.
pub const DECAYS: usize = 9;

/// Passes of the non-negative least squares after each frame; the fit goes on with the next one.
const PASSES: usize = 20;

/// Decays are held towards 0 as if by so many pairs, until there are pairs.
const HOLD: f64 = 1e-6;

/// Coherence with the anchor is not taken for more: it is nearly that with one frame of the window, and the
/// model must remain invertible.
const LARGEST_WITH_ANCHOR: f64 = 0.98;

#[derive(Clone, Debug)]
pub(super) struct Memory<T> {
    pub(super) mixture: Mixture<T, DECAYS>,
    /// Pairs with frames that have left the window, and with the anchor.
    past: Normal<T, DECAYS>,
    /// Has there been a first guess?
    known: bool,
}

impl<T: Real> Memory<T> {
    /// Decay rates for lags from `unit` to `longest`.
    pub(super) fn new(unit: f64, longest: f64) -> Self {
        let past = Normal::held(T::from_f64(HOLD));
        Self { mixture: Mixture::new(unit, longest), past, known: false }
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
        for (k, &decay) in self.mixture.decays(tau).iter().enumerate() {
            let distance = (decay - gamma).abs();
            if distance < nearest.1 {
                nearest = (k, distance);
            }
        }
        for (k, share) in self.mixture.shares.iter_mut().enumerate() {
            *share = T::from_f64(if k == nearest.0 { 0.95 } else { 1e-3 });
        }
    }

    /// Fit to the past and all pairs of the window; before the first guess there is nothing to fit.
    pub(super) fn fit<const N: usize>(&mut self, nodes: &Nodes<T, N>, aligned: &Aligned<'_, T, N>) {
        if !self.known {
            return;
        }
        let (first, window) = (nodes.oldest(), nodes.window());
        let decays = Decays::<T, N>::between(&self.mixture, window);
        let mut normal = Normal::new();
        for i in 0..window.len() {
            decays.each_from(i, |j, e| {
                let coherence = aligned.coherence(first + i, first + j);
                self.add_pair(&mut normal, e, both(window, i, j), coherence);
            });
        }
        normal.join(&self.past);
        normal.scale(T::one() / normal.largest());
        self.mixture.shares = normal.solve(self.mixture.shares, PASSES);
        limit_sum(&mut self.mixture.shares);
    }

    /// Keep the pairs of the oldest frame, which leaves the window; then everything counts `forget` times.
    pub(super) fn keep_oldest<const N: usize>(
        &mut self,
        nodes: &Nodes<T, N>,
        aligned: &Aligned<'_, T, N>,
        forget: T,
    ) {
        let (first, window) = (nodes.oldest(), nodes.window());
        let mut normal = Normal::new();
        Decays::<T, N>::between(&self.mixture, window).each_from(0, |j, e| {
            let coherence = aligned.coherence(first, first + j);
            self.add_pair(&mut normal, e, both(window, 0, j), coherence);
        });
        self.past.join(&normal);
        self.past.scale(forget);
    }

    /// Keep the coherence of the newest frame with the anchor, the only view of lags beyond the window: it is linear in
    /// the shares as well.
    pub(super) fn keep_anchor(&mut self, factors: &[T; DECAYS], coherence: T, weight: T) {
        let loss = T::one() - coherence * coherence;
        let information = T::one() / (loss * loss * T::from_f64(0.5) + T::from_f64(0.02));
        self.past.add(factors, coherence, weight * information);
    }

    /// One pair with the decays `e`; its coherence without the qualities, weighted with their square.
    fn add_pair(&self, normal: &mut Normal<T, DECAYS>, e: &[T; DECAYS], both: T, coherence: T) {
        let both = both.max(T::from_f64(1e-3));
        let weight = both * both * information(dot(&self.mixture.shares, e));
        normal.add(e, coherence / both, weight);
    }

    /// Gamma_ij = s_i s_j h(|u_i - u_j|) of the window, and the coherences with the anchor; 1 on the diagonal.
    pub(super) fn fill_model<const N: usize>(
        &self,
        nodes: &Nodes<T, N>,
        anchor: &Anchor<T, DECAYS>,
        gamma: &mut Square<'_, T>,
    ) {
        let (first, window) = (nodes.oldest(), nodes.window());
        let decays = Decays::<T, N>::between(&self.mixture, window);
        for (i, node) in window.iter().enumerate() {
            decays.each_from(i, |j, e| {
                let h = dot(&self.mixture.shares, e);
                gamma.set_both(first + i, first + j, h * both(window, i, j));
            });
            gamma.set(first + i, first + i, T::one());
            if nodes.is_anchored() {
                let factors = anchor.factors(&self.mixture, node.clock);
                let h = dot(&self.mixture.shares, &factors) * node.weight();
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

/// exp(-r_k (u_j - u_i)) of all pairs of frames, as products over the intervals between them: exponentials cost
/// more than the rest of the fit.
struct Decays<T, const N: usize> {
    /// From each frame to the next.
    steps: Vec<[T; DECAYS], N>,
}

impl<T: Real, const N: usize> Decays<T, N> {
    fn between(mixture: &Mixture<T, DECAYS>, frames: &[Node<T>]) -> Self {
        let mut steps = Vec::new();
        // Most intervals are like the one before: no new exponentials.
        let mut last = (f64::NAN, [T::zero(); DECAYS]);
        for pair in frames.windows(2) {
            let &[before, after] = pair else { break };
            let interval = after.clock - before.clock;
            if interval != last.0 {
                last = (interval, mixture.decays(T::from_f64(interval)));
            }
            // Cannot fail: there are fewer intervals than nodes.
            let _ = steps.push(last.1);
        }
        Self { steps }
    }

    /// The later frames j, with the decays from i to j.
    fn each_from(&self, i: usize, mut each: impl FnMut(usize, &[T; DECAYS])) {
        let mut product = [T::one(); DECAYS];
        for (j, step) in self.steps.iter().enumerate().skip(i) {
            for (e, &factor) in product.iter_mut().zip(step) {
                *e = *e * factor;
            }
            each(j + 1, &product);
        }
    }
}

#[cfg(test)]
mod tests {
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
        let mut memory = Memory::new(1.0, 48.0);
        memory.guess(h(1.0), 1.0);
        for _ in 0..30 {
            memory.fit(&nodes, &nodes.aligned());
        }
        for tau in 1..17 {
            let (tau, got) = (f64::from(tau), memory.mixture.at(f64::from(tau)));
            assert!((got - h(tau)).abs() < 0.02, "{tau}: {got}");
        }
        let mut data = [0.0; 144];
        let mut gamma = Square::new(&mut data, 12);
        memory.fill_model(&nodes, &Anchor::new(), &mut gamma);
        assert!((gamma.at(2, 9) - memory.mixture.at(10.0)).abs() < 1e-12, "2 to 9 + 3");
        assert_eq!((gamma.at(4, 4), gamma.at(9, 2)), (1.0, gamma.at(2, 9)));
    }

    #[test]
    fn what_was_kept_stays_known() {
        let h = |tau: f64| libm::exp(-0.1 * tau);
        let known = nodes(h);
        let mut memory = Memory::new(1.0, 48.0);
        memory.guess(h(1.0), 1.0);
        for _ in 0..30 {
            memory.fit(&known, &known.aligned());
        }
        memory.keep_oldest(&known, &known.aligned(), 0.98);
        let nothing = Nodes::<f64, 12>::new();
        memory.fit(&nothing, &nothing.aligned());
        assert!((memory.mixture.at(5.0) - h(5.0)).abs() < 0.02, "{:?}", memory.mixture);
    }

    #[test]
    fn the_guess_takes_the_nearest_decay() {
        let mut memory = Memory::<f32>::new(1.0, 48.0);
        memory.guess(0.9, 1.0);
        assert!((memory.mixture.at(1.0) - 0.87).abs() < 0.06, "{:?}", memory.mixture);
        memory.guess(f32::NAN, 1.0);
        assert!(memory.mixture.at(1.0).is_finite());
    }
}
