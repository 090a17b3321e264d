//! Where the phase of a new frame is expected, and where the search for it begins.

use super::nodes::Node;
use crate::chain::{SHORT, wrap};
use crate::quality::SOUND;
use crate::scalar::Real;
use crate::weights::unit_phasor;
use num_complex::Complex;

/// Short intervals whose mean velocity predicts a gap.
const NEWEST: usize = 4;

/// The phase next to the predicted one that the weighted sum over the predecessors, `sum`, has as its angle; without a
/// sum the predicted one.
pub(super) fn first_phase<T: Real>(sum: Complex<T>, predicted: T) -> T {
    let unit = unit_phasor(sum);
    let angle = unit.im.atan2(unit.re);
    if unit.re.abs() + unit.im.abs() > T::from_f64(0.5) {
        predicted + wrap(angle - predicted)
    } else {
        predicted
    }
}

/// The phase of the last sound frame; over gaps longer than the shortest interval, plus the velocity of the
/// newest short intervals.
///
/// It chooses the integer only, and so costs no precision (paper lines 572-584).
pub(super) fn predict<T: Real>(window: &[Node<T>], time: f64) -> T {
    let sound = || window.iter().filter(|node| is_sound(node));
    let Some(last) = window.get(predicts(window)) else { return T::zero() };
    let steps =
        || sound().zip(sound().skip(1)).map(|(a, b)| (b.time - a.time, b.phase() - a.phase()));
    let shortest = steps().fold(f64::INFINITY, |least, (interval, _)| least.min(interval));
    let gap = time - last.time;
    // False without any interval: the shortest is infinite then.
    if gap > shortest * SHORT {
        last.phase() + velocity(steps, shortest) * T::from_f64(gap)
    } else {
        last.phase()
    }
}

/// Which frame the next one is predicted from: the last sound one, or the last.
pub(super) fn predicts<T: Real>(window: &[Node<T>]) -> usize {
    window.iter().rposition(is_sound).unwrap_or(window.len().saturating_sub(1))
}

fn is_sound<T: Real>(node: &Node<T>) -> bool {
    node.weight() > T::from_f64(SOUND)
}

/// Mean over the newest of the short intervals, per unit of time.
fn velocity<T: Real, I: Iterator<Item = (f64, T)>>(steps: impl Fn() -> I, shortest: f64) -> T {
    let short = || steps().filter(|&(interval, _)| interval <= shortest * SHORT);
    let older = short().count().saturating_sub(NEWEST);
    let (mut span, mut change) = (0.0, T::zero());
    for (interval, step) in short().skip(older) {
        span += interval;
        change += step;
    }
    change / T::from_f64(span)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(time: f64, phase: f64, quality: f64) -> Node<f64> {
        let mut node = Node::new(time, quality);
        node.set_phase(phase);
        node
    }

    #[test]
    fn gaps_are_bridged_by_the_newest_velocity() {
        let mut window: [_; 9] = core::array::from_fn(|i| frame(i as f64, 0.0, 1.0));
        for (i, node) in window.iter_mut().enumerate().skip(4) {
            node.set_phase(0.5 * (i - 4) as f64);
        }
        assert_eq!(predict(&window, 9.0), 2.0);
        assert_eq!(predict(&window, 12.0), 4.0);
        (window[8].quality, window[7].quality) = (0.0, 0.1);
        // From frame 6, over two intervals more; the four newest steps hold two that move.
        assert_eq!(predict(&window, 9.0), 1.0 + 3.0 * 0.25);
    }

    #[test]
    fn little_is_predicted_from_little() {
        assert_eq!(predict::<f64>(&[], 3.0), 0.0);
        assert_eq!(predict(&[frame(0.0, 1.5, 1.0)], 30.0), 1.5);
        assert_eq!(predict(&[frame(0.0, 1.5, 0.0), frame(1.0, 2.0, 0.0)], 30.0), 2.0);
    }

    #[test]
    fn the_angle_next_to_the_prediction_is_taken() {
        let near = first_phase(Complex::from_polar(0.01, 0.4), 20.0);
        assert!((near - (0.4 + 3.0 * core::f64::consts::TAU)).abs() < 1e-12);
        assert_eq!(first_phase(Complex::new(0.0, 0.0), 20.0), 20.0);
    }
}
