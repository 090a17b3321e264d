//! The compressed anchor: all frames older than the window as one field, which keeps coherence over long times.
//!
//! ```text
//! A  =  sum over absorbed frames j of s_j exp(-i phi_j) U_j          (times lambda for each that joins later)
//! ⟨U_t conj A⟩ aligned  =  s_t sum over k of c_k exp(-r_k (t - t_A)) S_k
//! S_k  =  sum over j of s_j^2 exp(-r_k (t_A - t_j)),   ⟨|A|²⟩ = E_A
//! ```
//! for frames of unit power and the coherence h(tau) = sum over k of c_k exp(-r_k tau); times t by the clock of the
//! decorrelation ([`super::clock`]), t_A that of the frame that joined last. Coherence with a sum of decays stays a sum of the same decays: K numbers stand for all absorbed frames.

use crate::coherence::Mixture;
use crate::scalar::Real;

/// Sums and powers below this are nothing.
const NOTHING: f64 = 1e-9;

#[derive(Clone, Copy, Debug)]
pub(super) struct Anchor<T, const K: usize> {
    /// S_k.
    sums: [T; K],
    /// E_A.
    power: T,
    /// Sum of s_j^2, as which the anchor's phase counts.
    weight: T,
    /// t_A.
    time: f64,
    /// What the field holds has nothing to do with the frames since.
    stale: bool,
}

impl<T: Real, const K: usize> Anchor<T, K> {
    pub(super) fn new() -> Self {
        let zero = T::zero();
        Self { sums: [zero; K], power: zero, weight: zero, time: 0.0, stale: false }
    }

    /// The first frame becomes the anchor, with its full field whatever its quality.
    pub(super) fn found(&mut self, quality: T, time: f64) {
        (self.sums, self.power, self.weight) = ([quality; K], T::one(), quality);
        self.time = time;
    }

    /// A frame joins. Returns beta, its share of the phase: phi_A <- (1 - beta) phi_A + beta phi.
    pub(super) fn join(&mut self, mixture: &Mixture<T, K>, memory: T, quality: T, time: f64) -> T {
        let square = quality * quality;
        let common = square * self.expected(mixture, time);
        self.power = memory * (memory * self.power + common + common) + square;
        let decays = self.decays(mixture, time);
        for (sum, &decay) in self.sums.iter_mut().zip(&decays) {
            *sum = memory * decay * *sum + square;
        }
        self.time = time;
        let before = memory * self.weight;
        self.weight = before + square;
        if square > T::zero() { square / self.weight } else { T::zero() }
    }

    /// No frame to come is coherent with the absorbed ones.
    pub(super) fn forget(&mut self) {
        (self.sums, self.power, self.weight) = ([T::zero(); K], T::zero(), T::zero());
        self.stale = true;
    }

    /// Is what the field holds to be left out when the next frame joins? Asked once.
    pub(super) fn take_stale(&mut self) -> bool {
        core::mem::replace(&mut self.stale, false)
    }

    /// exp(-r_k (t - t_A)).
    fn decays(&self, mixture: &Mixture<T, K>, time: f64) -> [T; K] {
        mixture.decays(T::from_f64(time - self.time))
    }

    /// Factors of the c_k in the coherence of a frame of quality 1 with the anchor: exp(-r_k (t - t_A)) S_k / sqrt(E_A).
    pub(super) fn factors(&self, mixture: &Mixture<T, K>, time: f64) -> [T; K] {
        let scale = self.power.max(T::from_f64(NOTHING)).inverse_sqrt();
        let mut factors = self.decays(mixture, time);
        for (factor, &sum) in factors.iter_mut().zip(&self.sums) {
            *factor = *factor * sum * scale;
        }
        factors
    }

    /// ⟨U_t conj A⟩ for a frame of quality 1.
    fn expected(&self, mixture: &Mixture<T, K>, time: f64) -> T {
        let decays = self.decays(mixture, time);
        let terms = mixture.shares.iter().zip(&decays).zip(&self.sums);
        terms.fold(T::zero(), |total, ((&c, &decay), &sum)| total + c * decay * sum)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::square::dot;

    /// Against the sum over all pairs of absorbed frames.
    #[test]
    fn a_few_numbers_stand_for_all_frames() {
        let mut mixture = Mixture::<f64, 4>::new(1.0, 30.0);
        mixture.shares = [0.1, 0.2, 0.3, 0.25];
        let frames = [(0.0, 1.0), (1.0, 0.8), (2.5, 0.0), (4.0, 1.0), (5.0, 0.6)];
        let mut anchor = Anchor::new();
        anchor.found(frames[0].1, frames[0].0);
        for &(time, s) in &frames[1..] {
            anchor.join(&mixture, 1.0, s, time);
        }
        let h = |t: f64, u: f64| if t == u { 1.0 } else { mixture.at((t - u).abs()) };
        let pair = |&(t, s): &(f64, f64), &(u, r): &(f64, f64)| s * r * s * r * h(t, u);
        // A frame of quality s has the power 1, of which s^2 follows the model.
        let own: f64 = frames.iter().map(|&(_, s)| s * s - s * s * s * s).sum();
        let power: f64 = frames.iter().flat_map(|f| frames.iter().map(move |g| pair(f, g))).sum();
        assert!((anchor.power - power - own).abs() < 1e-12, "{} {power}", anchor.power);
        let expected: f64 = frames.iter().map(|&(t, s)| s * s * h(7.0, t)).sum();
        let got = dot(&mixture.shares, &anchor.factors(&mixture, 7.0)) * libm::sqrt(anchor.power);
        assert!((got - expected).abs() < 1e-12, "{got} {expected}");
        assert!((anchor.weight - 3.0).abs() < 1e-12, "1 + 0.64 + 1 + 0.36");
        anchor.forget();
        assert_eq!(anchor.factors(&mixture, 8.0), [0.0; 4]);
        assert!(anchor.take_stale() && !anchor.take_stale());
    }
}
