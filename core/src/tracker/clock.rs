//! The clock of the decorrelation, which runs ahead of the time where the speckle moves on by more.
//!
//! A frame that has less in common with those before it than expected is bad itself, s < 1, or the pattern has moved
//! on by more than the time since says. For that frame alone both are the same; the next one tells them apart: it
//! agrees with a frame after a jump, with a bad one it does not.
//!
//! ```text
//! Gamma_ij = s_i s_j h(|u_i - u_j|),   u_i = t_i + all jumps so far
//! jump     x of frame i of quality s:   h(u_i - u_(i-1) + x) = s h(u_i - u_(i-1)),   and s = 1 from then on
//! gain     sum over j of (L/2) (w(m_j) (R_j - m_j)^2 - w(n_j) (R_j - n_j)^2)
//! ```
//! with R_j the aligned coherences of the newest frame with those of the window, m_j the model's without and n_j with the
//! jump, and w(h) = 1 / ((1 - h^2)^2 / 2 + 0.02) (`coherence::information`). As pairs are not independent, the gain only
//! orders both; a jump is taken from a gain of 4 on.
//!
//! A rate that grows makes a series of jumps; to one that falls the fitted decays adapt.

use super::Tracker;
use super::terms::Coherence;
use crate::coherence::information;
use crate::quality::USABLE;
use crate::scalar::Real;

/// Gain in log likelihood from which on a jump is taken.
const GAIN: f64 = 4.0;

impl<T: Real, const NODES: usize, const M: usize> Tracker<T, NODES, M> {
    /// With the newest frame: was the one before it bad, or did the pattern jump before it?
    ///
    /// A frame that is not usable stays as it is, and so does one with which the newest has nothing in common: of two
    /// outliers in a row the second would make a jump of the first, if that was taken for usable by chance.
    pub(super) fn reconsider(&mut self, newest: usize) {
        let Some(jump) = self.jump() else { return };
        let Some(suspect) = newest.checked_sub(1) else { return };
        let expected = self.memory.coherence.at(self.lag_of_newest());
        let common = self.nodes.aligned().coherence(newest, suspect);
        let agrees = common > T::from_f64(USABLE) * expected;
        if agrees && self.gain(jump, newest) > T::from_f64(GAIN) {
            self.nodes.put_clock_forward(jump.to_f64());
            if let Some(node) = self.nodes.all_mut().get_mut(suspect) {
                node.quality = T::one();
            }
            self.judge(newest);
        }
    }

    /// The jump that explains the quality of the last frame but one, if there is anything to explain and h falls so far. An h
    /// that comes back has no lag of its own for each value.
    fn jump(&self) -> Option<T> {
        let [.., before, suspect, _] = self.nodes.window() else { return None };
        if suspect.weight() <= T::from_f64(USABLE) || suspect.weight() >= T::one() {
            return None;
        }
        let Coherence { mixture, periodic: false, .. } = &self.memory.coherence else {
            return None;
        };
        let step = T::from_f64(suspect.clock - before.clock);
        let longest = T::from_f64(self.settings.longest_for(Self::WINDOW));
        let left = suspect.weight() * mixture.at(step);
        if step >= longest || mixture.at(longest) > left {
            return None;
        }
        let (slow, fast) = (T::one() / longest, T::one() / step);
        Some((T::one() / mixture.rate_to(left, slow, fast) - step).max(T::zero()))
    }

    /// Log likelihood of the newest frame's coherences with a jump before the last frame, minus that without.
    fn gain(&self, jump: T, newest: usize) -> T {
        let (first, aligned) = (self.nodes.oldest(), self.nodes.aligned());
        let [before @ .., node] = self.nodes.window() else { return T::zero() };
        let misfit = |seen: T, model: T| information(model) * (seen - model) * (seen - model);
        let mut gain = T::zero();
        for (j, other) in before.iter().enumerate() {
            let lag = T::from_f64(node.clock - other.clock);
            let h = self.memory.coherence.at(lag);
            let with_jump = if j + 1 == before.len() {
                h
            } else {
                self.memory.coherence.at(lag + jump) * other.weight()
            };
            let seen = aligned.coherence(newest, first + j);
            gain += misfit(seen, h * other.weight()) - misfit(seen, with_jump);
        }
        gain * T::from_f64(0.5 * self.settings.looks)
    }
}

#[cfg(test)]
mod tests {
    use crate::tracker::testing::{self, FRAMES, Speckle, truth};
    use crate::tracker::{FieldTracker, NODES, TrackerSettings};

    const LOOKS: usize = 100;
    /// The defaults, or without jumps and cosines, as the trigger board has them.
    fn settings(jumps: bool) -> TrackerSettings {
        let settings = TrackerSettings::for_looks(LOOKS as f64, 1.0);
        TrackerSettings { reference_frames: 1, jumps, periodic: jumps, ..settings }
    }

    /// Rms error of the newest phase over the bound, and of all phases over what is said of them; `rho` is the coherence
    /// of a frame with the one before it. Scatterers walk, so the bound is the sum over the steps,
    /// (1 - rho^2) / (2 L rho^2).
    fn errors(name: &str, rho: impl Fn(usize) -> f64, jumps: bool) -> (f64, f64) {
        let step = |frame: usize| (rho(frame).powi(-2) - 1.0) / (2.0 * LOOKS as f64);
        let bound: f64 = (1..FRAMES).map(step).sum();
        let (error, z) = testing::errors(settings(jumps), 100, |seed| {
            let (mut speckle, rho) = (Speckle::<LOOKS>::new(seed, 1.0), &rho);
            move |frame| {
                speckle.decay(rho(frame));
                speckle.frame(truth(frame), 0.0)
            }
        });
        let error = error / libm::sqrt(bound);
        std::println!("{name:12} jumps {jumps:5}: {error:.2} of the bound, z {z:.2}");
        (error, z)
    }

    /// The standard error of an rms over 100 runs is 7 %; what a bad frame costs is far above.
    #[test]
    fn rates_that_grow_and_jumps_cost_little() {
        let walk = |rate: f64| libm::exp(-0.0771 * rate);
        let faster = |frame: usize| walk(if frame < 35 { 0.316 } else { 3.16 });
        let swings = |frame: usize| walk(libm::pow(10.0, -0.5 * libm::sin(0.1795 * frame as f64)));
        let broken = |frame: usize| walk(1.0) * if frame == 23 || frame == 47 { 0.5 } else { 1.0 };
        let cases: [(_, &dyn Fn(usize) -> f64); 3] =
            [("faster", &faster), ("swings", &swings), ("broken", &broken)];
        for (name, rho) in cases {
            let (without, with) = (errors(name, rho, false), errors(name, rho, true));
            assert!(with.0 < 1.15 && with.1 < 1.2, "{with:?}");
            assert!(with.0 < without.0 && with.1 < 0.95 * without.1, "{with:?} {without:?}");
        }
    }

    /// Outliers, single and in pairs, and noise: no jumps are seen, so nothing changes.
    #[test]
    fn bad_frames_stay_bad() {
        let bad = |frame: usize| matches!(frame, 11 | 30 | 31 | 52);
        for seed in 0..200 {
            let run = |jumps| {
                let mut speckle = Speckle::<LOOKS>::new(seed, 0.92);
                let mut tracker = FieldTracker::<f32, LOOKS, NODES>::new(settings(jumps)).unwrap();
                core::array::from_fn::<_, FRAMES, _>(|frame| {
                    let noise = if bad(frame) { 1e6 } else { 0.2 };
                    tracker.push(&speckle.frame(truth(frame), noise), frame as f64, |_| ()).unwrap()
                })
            };
            let (without, with) = (run(false), run(true));
            assert_eq!(without, with, "seed {seed}");
            // Two of a hundred speckles' outliers may agree by chance: up to 0.5 then.
            assert!(with.iter().all(|newest| (newest.quality < 0.5) == bad(newest.frame)));
        }
    }

    /// Noise of its own in every seventh frame: less in common with all, also with the next.
    #[test]
    fn noisy_frames_are_not_taken_for_jumps() {
        let mut speckle = Speckle::<LOOKS>::new(3, 0.92);
        let mut tracker = FieldTracker::<f64, LOOKS, NODES>::new(settings(true)).unwrap();
        for frame in 0..FRAMES {
            let noise = if frame % 7 == 6 { 2.0 } else { 0.0 };
            let field = speckle.frame(truth(frame), noise);
            let newest = tracker.push(&field, frame as f64, |_| ()).unwrap();
            assert_eq!(newest.quality < 0.8, frame % 7 == 6, "{newest:?}");
        }
        assert_eq!(tracker.tracker().nodes.window()[15].clock, 69.0);
    }
}
