//! The newest frame against frames whose phases are held: the least squares of its pairs when nothing but its own
//! phase may move.
//!
//! The sum over dt of w^2 (phi_{n-dt} - phi_n - arg ⟨C(n-dt, dt)⟩)^2 is smallest at
//!
//! phi_n = sum of w^2 e_dt / sum of w^2,   e_dt = phi_{n-dt} - arg ⟨C(n-dt, dt)⟩,
//!
//! which costs one multiply-add per pair and needs no pairs but those of the newest frame. The integers of 2 pi are
//! found among the e_dt themselves: the heaviest of them, next to where the phase is expected, then all others
//! next to it, and all once more next to their mean. So nothing need be free of wrapping but the change from
//! frame to frame, below pi.
//!
//! The newest phase is about as exact as that of [`crate::pair_walk`], where all phases move: what later frames tell of
//! earlier ones hardly helps the newest. Rms errors of the last of 70 frames by both, at 100 looks, pairs up to 16
//! frames apart (`cargo test -p phasewalk-core as_exact_as -- --nocapture`; 200 runs, the same for both, standard
//! error 5 %):
//!
//! | rho per frame, noise over signal | held | all moving |
//! |---|---|---|
//! | 0.926, 0 | 0.269 rad | 0.279 rad |
//! | 0.735, 0 | 0.544 rad | 0.558 rad |
//! | 0.926, 0.5 | 0.327 rad | 0.319 rad |
//! | 0.926, 1 | 0.551 rad | 0.517 rad |

use crate::chain::wrap;
use crate::scalar::Scalar;

/// A pair of the newest frame with one before it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeldPair<T> {
    /// e: where the pair wants the newest phase, radians, but for turns.
    pub wanted: T,
    /// w >= 0.
    pub weight: T,
}

/// What the pairs say of the newest frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Newest<T> {
    /// phi_n, radians; `expected` where no pair has a weight.
    pub phase_rad: T,
    /// Sum of w^2.
    pub weight: T,
}

/// phi_n from its pairs, less than half a turn from `expected` but for what the mean moves it; radians.
#[inline(always)]
#[must_use]
pub fn newest_phase<T: Scalar>(pairs: &[HeldPair<T>], expected: T) -> Newest<T> {
    let (mut heaviest, mut start) = (T::zero(), expected);
    for pair in pairs {
        let heavier = heaviest.lt(pair.weight);
        heaviest = T::select(heavier, pair.weight, heaviest);
        start = T::select(heavier, pair.wanted, start);
    }
    let start = expected + wrap(start - expected);
    let first = mean_next_to(pairs, start);
    mean_next_to(pairs, first.phase_rad)
}

/// The weighted mean, each pair on the branch nearest to `middle`.
#[inline(always)]
fn mean_next_to<T: Scalar>(pairs: &[HeldPair<T>], middle: T) -> Newest<T> {
    let (mut sum, mut weight) = (T::zero(), T::zero());
    for pair in pairs {
        let square = pair.weight * pair.weight;
        sum = square.mul_add(wrap(pair.wanted - middle), sum);
        weight += square;
    }
    let seen = T::zero().lt(weight);
    let mean = sum / T::select(seen, weight, T::one());
    Newest { phase_rad: middle + T::select(seen, mean, T::zero()), weight }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cross_spectrum::CrossSpectrumStream;
    use crate::params::{Params, RANDOM_PROBABILITY};
    use crate::tracker::testing::Speckle;
    use crate::walk::Walk;
    use crate::weights::{Weighting, Weights};
    use core::f64::consts::TAU;
    use heapless::Vec;

    fn pairs<const N: usize>(wanted: [f64; N], weights: [f64; N]) -> [HeldPair<f64>; N] {
        core::array::from_fn(|i| HeldPair { wanted: wanted[i], weight: weights[i] })
    }

    #[test]
    fn it_is_the_mean_with_squared_weights() {
        let newest = newest_phase(&pairs([1.0, 1.5], [2.0, 1.0]), 0.8);
        assert!((newest.phase_rad - 1.1).abs() < 1e-15 && newest.weight == 5.0, "{newest:?}");
    }

    #[test]
    fn turns_do_not_matter() {
        let straight = [41.0, 40.7, 41.4, 41.1];
        let weights = [1.0, 0.5, 0.8, 0.1];
        let plain = newest_phase(&pairs(straight, weights), 40.0);
        let turned =
            [straight[0] - TAU, straight[1], straight[2] + 3.0 * TAU, straight[3] - 9.0 * TAU];
        let wrapped = newest_phase(&pairs(turned, weights), 40.0);
        assert!((plain.phase_rad - wrapped.phase_rad).abs() < 1e-12, "{plain:?} {wrapped:?}");
    }

    #[test]
    fn the_phase_may_move_by_almost_half_a_turn_in_either_direction() {
        for change in [-3.0, -1.0, 2.9] {
            let truth = 7.0 + change;
            let newest = newest_phase(&pairs([truth - TAU, truth + TAU], [0.4, 0.4]), 7.0);
            assert!((newest.phase_rad - truth).abs() < 1e-12, "{change}: {newest:?}");
        }
    }

    #[test]
    fn without_weights_the_phase_stays() {
        for weights in [[0.0, 0.0], [0.0, f64::NAN]] {
            let newest = newest_phase(&pairs([1.0, 2.0], weights), 5.0);
            assert_eq!(newest.phase_rad, 5.0, "{weights:?}");
        }
        assert_eq!(newest_phase::<f32>(&[], 5.0), Newest { phase_rad: 5.0, weight: 0.0 });
    }

    const LOOKS: usize = 100;
    const LAGS: usize = 16;
    const FRAMES: usize = 70;

    fn truth(frame: usize) -> f64 {
        2.0 * libm::sin(0.05 * frame as f64)
    }

    /// Error of the last phase against the mean of the first five: held, and with all phases moving.
    fn errors(seed: u64, rho: f64, noise: f64) -> [f64; 2] {
        let weights = Weights::new(Weighting::Paper, LOOKS as f64, RANDOM_PROBABILITY);
        let mut walk =
            Walk::<f64, LOOKS, LAGS, 17>::new(Params::paper(LAGS), weights, LOOKS as f64).unwrap();
        let mut stream = CrossSpectrumStream::<f64, LOOKS, LAGS>::new();
        let (mut speckle, mut phases) = (Speckle::<LOOKS>::new(seed, rho), [0.0; FRAMES]);
        let mut newest = 0.0;
        for n in 0..FRAMES {
            let frame = speckle.frame(truth(n), noise);
            newest = walk.push(&frame).phase_rad;
            let mut pairs = Vec::<_, LAGS>::new();
            stream.push(&frame, |dt, mean| {
                let wanted = phases[n - dt] - mean.phase();
                pairs.push(HeldPair { wanted, weight: weights.weight(&mean) }).unwrap();
            });
            phases[n] = newest_phase(&pairs, phases[n.saturating_sub(1)]).phase_rad;
        }
        let reference = |phase: &dyn Fn(usize) -> f64| (0..5).map(phase).sum::<f64>() / 5.0;
        let moved = truth(FRAMES - 1) - reference(&truth);
        [phases[FRAMES - 1] - reference(&|n| phases[n]) - moved, newest - moved]
    }

    #[test]
    fn it_is_about_as_exact_as_the_solution_whose_phases_all_move() {
        const RUNS: u64 = 200;
        for (rho, noise) in [(0.926, 0.0), (0.735, 0.0), (0.926, 0.5), (0.926, 1.0)] {
            let mut squares = [0.0; 2];
            for seed in 0..RUNS {
                for (sum, error) in squares.iter_mut().zip(errors(seed, rho, noise)) {
                    *sum += error * error / RUNS as f64;
                }
            }
            let [held, moving] = squares.map(libm::sqrt);
            std::println!("rho {rho}, noise {noise}: held {held:.3} rad, moving {moving:.3} rad");
            assert!(held < 1.15 * moving, "{held} {moving}");
        }
    }
}
