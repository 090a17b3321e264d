//! The compressed anchor: all frames older than the window as one field, which keeps coherence over long times.
//!
//! ```text
//! A  =  sum over absorbed frames j of s_j exp(-i phi_j) U_j          (times lambda for each that joins later)
//! ⟨U_t conj A⟩ aligned  =  s_t sum over k of c_k exp(-r_k (t - t_A)) S_k
//! S_k  =  sum over j of s_j^2 exp(-r_k (t_A - t_j)),   ⟨|A|²⟩ = E_A
//! ```
//! for frames of unit power and the coherence h(tau) = sum over k of c_k exp(-r_k tau); times t by the clock of the
//! decorrelation ([`super::clock`]), t_A that of the frame that joined last. Coherence with a sum of decays stays a sum of
//! the same decays: K numbers stand for all absorbed frames. A cosine is the real part of a decay with the imaginary rate
//! -i w_m, its S_m is complex. Over whole periods that sum averages out: of a pattern that comes back the anchor keeps
//! little.

use super::terms::{Coherence, Terms};
use crate::linking::turn;
use crate::scalar::Real;
use num_complex::Complex;

/// Sums and powers below this are nothing.
const NOTHING: f64 = 1e-9;

#[derive(Clone, Copy, Debug)]
pub(super) struct Anchor<T, const M: usize> {
    /// S_k, and S_m of the cosines.
    sums: Terms<T, M>,
    /// E_A.
    power: T,
    /// Sum of s_j^2, as which the anchor's phase counts.
    weight: T,
    /// t_A.
    time: f64,
    /// What the field holds has nothing to do with the frames since.
    stale: bool,
}

impl<T: Real, const M: usize> Anchor<T, M> {
    pub(super) fn new() -> Self {
        let zero = T::zero();
        Self { sums: Terms::filled(zero), power: zero, weight: zero, time: 0.0, stale: false }
    }

    /// The first frame becomes the anchor, with its full field whatever its quality.
    pub(super) fn found(&mut self, quality: T, time: f64) {
        (self.sums, self.power, self.weight) = (Terms::filled(quality), T::one(), quality);
        self.time = time;
    }

    /// A frame joins. Returns beta, its share of the phase: phi_A <- (1 - beta) phi_A + beta phi.
    pub(super) fn join(
        &mut self,
        coherence: &Coherence<T, M>,
        memory: T,
        quality: T,
        time: f64,
    ) -> T {
        let square = quality * quality;
        let step = self.terms(coherence, time);
        let common = square * self.expected(coherence, &step);
        self.power = memory * (memory * self.power + common + common) + square;
        for (sum, &decay) in self.sums.decays.iter_mut().zip(&step.decays) {
            *sum = memory * decay * *sum + square;
        }
        for (sum, &step) in self.sums.turns.iter_mut().zip(&step.turns) {
            let turned = turn(step, *sum);
            *sum = Complex { re: memory * turned.re + square, im: memory * turned.im };
        }
        self.time = time;
        let before = memory * self.weight;
        self.weight = before + square;
        if square > T::zero() { square / self.weight } else { T::zero() }
    }

    /// No frame to come is coherent with the absorbed ones.
    pub(super) fn forget(&mut self) {
        (self.sums, self.power, self.weight) = (Terms::filled(T::zero()), T::zero(), T::zero());
        self.stale = true;
    }

    /// Is what the field holds to be left out when the next frame joins? Asked once.
    pub(super) fn take_stale(&mut self) -> bool {
        core::mem::replace(&mut self.stale, false)
    }

    /// exp(-r_k (t - t_A)) and exp(i w_m (t - t_A)).
    fn terms(&self, coherence: &Coherence<T, M>, time: f64) -> Terms<T, M> {
        coherence.terms(T::from_f64(time - self.time))
    }

    /// Factors of the shares in the coherence of a frame of quality 1 with the anchor: exp(-r_k (t - t_A)) S_k / sqrt(E_A).
    pub(super) fn factors(&self, coherence: &Coherence<T, M>, time: f64) -> Terms<T, M> {
        let scale = self.power.max(T::from_f64(NOTHING)).inverse_sqrt();
        let mut factors = self.terms(coherence, time);
        factors.follow(&self.sums);
        factors.scale(scale);
        factors
    }

    /// ⟨U_t conj A⟩ for a frame of quality 1, with the terms from t_A to t.
    fn expected(&self, coherence: &Coherence<T, M>, step: &Terms<T, M>) -> T {
        let terms = coherence.shares().iter().zip(&step.decays).zip(&self.sums.decays);
        let decaying = terms.fold(T::zero(), |total, ((&c, &e), &sum)| total + c * e * sum);
        if !coherence.periodic {
            return decaying;
        }
        let mut returning = *step;
        returning.follow(&self.sums);
        decaying + coherence.returning(&returning)
    }
}

#[cfg(test)]
mod tests {
    use super::super::terms::COSINES;
    use super::*;

    /// Against the sum over all pairs of absorbed frames.
    fn stands_for_all_frames(periodic: bool) {
        let mut coherence = Coherence::<f64, COSINES>::new(1.0, 30.0);
        coherence.mixture.shares = [0.1, 0.0, 0.1, 0.0, 0.2, 0.0, 0.1, 0.0, 0.15];
        coherence.together = [0.1, 0.1, 0.0, 0.1, 0.0, 0.2, 0.0, 0.1, 0.0];
        for m in [0, 4, 7] {
            coherence.amplitudes[m] = 0.08;
        }
        coherence.periodic = periodic;
        let frames = [(0.0, 1.0), (1.0, 0.8), (2.5, 0.0), (4.0, 1.0), (5.0, 0.6)];
        let mut anchor = Anchor::new();
        anchor.found(frames[0].1, frames[0].0);
        for &(time, s) in &frames[1..] {
            anchor.join(&coherence, 1.0, s, time);
        }
        let h = |t: f64, u: f64| if t == u { 1.0 } else { coherence.at((t - u).abs()) };
        let pair = |&(t, s): &(f64, f64), &(u, r): &(f64, f64)| s * r * s * r * h(t, u);
        // A frame of quality s has the power 1, of which s^2 follows the model.
        let own: f64 = frames.iter().map(|&(_, s)| s * s - s * s * s * s).sum();
        let power: f64 = frames.iter().flat_map(|f| frames.iter().map(move |g| pair(f, g))).sum();
        assert!((anchor.power - power - own).abs() < 1e-12, "{} {power}", anchor.power);
        let expected: f64 = frames.iter().map(|&(t, s)| s * s * h(7.0, t)).sum();
        let got = coherence.of(&anchor.factors(&coherence, 7.0)) * libm::sqrt(anchor.power);
        assert!((got - expected).abs() < 1e-12, "{got} {expected}");
        assert!((anchor.weight - 3.0).abs() < 1e-12, "1 + 0.64 + 1 + 0.36");
        anchor.forget();
        assert_eq!(coherence.of(&anchor.factors(&coherence, 8.0)), 0.0);
        assert!(anchor.take_stale() && !anchor.take_stale());
    }

    #[test]
    fn a_few_numbers_stand_for_all_frames() {
        stands_for_all_frames(false);
        stands_for_all_frames(true);
    }
}
