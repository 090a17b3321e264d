//! Unwrapping a finished series of phases in time, across gaps and bad frames.

use crate::quality::{SOUND, USABLE};
use crate::scalar::{Real, Scalar};

/// Intervals up to this factor above the shortest count as short: clocks jitter, and what lies between is nearer to one
/// interval than to two.
pub(crate) const SHORT: f64 = 1.5;

/// Short intervals whose velocities predict a gap.
const NEAREST: usize = 6;

/// phi - 2 pi round(phi / 2 pi).
#[inline(always)]
pub(crate) fn wrap<T: Scalar>(phase: T) -> T {
    let turn = T::from_f64(core::f64::consts::TAU);
    phase - turn * (phase / turn).round()
}

/// Unwrap along the chain of sound frames (quality above 0.6), in place.
///
/// Neighbours in the chain at the shortest interval, or up to half more, differ by less than pi. Across a longer gap the
/// phase is predicted by the velocity of the six nearest short intervals, weighted by
/// 1 / (1 + distance / gap); this chooses the integer only and so costs no precision (the paper's
/// outlook, lines 572-584). It needs |velocity| * shortest interval < pi and |velocity error| * gap < pi.
/// Frames that are merely usable (above 0.3) are taken next to the interpolated chain; of the
/// others the interpolation itself is left.
#[inline(always)]
pub fn unwrap_chain<T: Scalar, Q: Real>(phases: &mut [T], times: &[f64], quality: &[Q]) {
    let chain = sound_frames(quality);
    if chain.clone().nth(1).is_none() {
        return;
    }
    let steps = chain.clone().zip(chain.clone().skip(1));
    let interval = |&(i, j): &(usize, usize)| time(times, j) - time(times, i);
    let shortest = steps.clone().fold(f64::INFINITY, |least, step| least.min(interval(&step)));
    for step in steps.clone() {
        let (i, j) = step;
        let mut change = wrap(phase(phases, j) - phase(phases, i));
        if interval(&step) > shortest * SHORT {
            let short = steps.clone().filter(|step| interval(step) <= shortest * SHORT);
            let predicted = predict(phases, times, short, step);
            change = predicted + wrap(change - predicted);
        }
        let next = phase(phases, i) + change;
        if let Some(place) = phases.get_mut(j) {
            *place = next;
        }
    }
    follow_chain(phases, times, quality);
}

fn sound_frames<Q: Real>(quality: &[Q]) -> impl Iterator<Item = usize> + Clone {
    let sound = Q::from_f64(SOUND);
    quality.iter().enumerate().filter(move |&(_, &s)| s > sound).map(|(frame, _)| frame)
}

fn time(times: &[f64], frame: usize) -> f64 {
    times.get(frame).copied().unwrap_or(0.0)
}

#[inline(always)]
fn phase<T: Scalar>(phases: &[T], frame: usize) -> T {
    phases.get(frame).copied().unwrap_or(T::zero())
}

/// The change over a gap that the velocity around it suggests.
#[inline(always)]
fn predict<T: Scalar>(
    phases: &[T],
    times: &[f64],
    short: impl Iterator<Item = (usize, usize)>,
    (before, after): (usize, usize),
) -> T {
    let gap = time(times, after) - time(times, before);
    let middle = (time(times, after) + time(times, before)) / 2.0;
    let mut nearest = [(f64::INFINITY, T::zero()); NEAREST];
    for (i, j) in short {
        let distance = ((time(times, i) + time(times, j)) / 2.0 - middle).abs();
        let interval = T::from_f64(time(times, j) - time(times, i));
        let velocity = wrap(phase(phases, j) - phase(phases, i)) / interval;
        let mut candidate = (distance, velocity);
        for place in &mut nearest {
            if candidate.0 < place.0 {
                core::mem::swap(&mut candidate, place);
            }
        }
    }
    let (mut sum, mut weights) = (T::zero(), 0.0);
    for (distance, velocity) in nearest.into_iter().filter(|(distance, _)| distance.is_finite()) {
        let weight = 1.0 / (1.0 + distance / gap);
        sum += T::from_f64(weight) * velocity;
        weights += weight;
    }
    if weights > 0.0 { sum * T::from_f64(gap / weights) } else { T::zero() }
}

/// Frames outside the chain follow its interpolation in time.
#[inline(always)]
fn follow_chain<T: Scalar, Q: Real>(phases: &mut [T], times: &[f64], quality: &[Q]) {
    for (frame, &s) in quality.iter().enumerate().filter(|&(_, &s)| s <= Q::from_f64(SOUND)) {
        let before = sound_frames(quality).take_while(|&i| i < frame).last();
        let after = sound_frames(quality).find(|&i| i > frame);
        let (Some(i), Some(j)) = (before.or(after), after.or(before)) else { return };
        let span = time(times, j) - time(times, i);
        let along = if span > 0.0 { (time(times, frame) - time(times, i)) / span } else { 0.0 };
        let line = phase(phases, i) + T::from_f64(along) * (phase(phases, j) - phase(phases, i));
        let own =
            if s > Q::from_f64(USABLE) { wrap(phase(phases, frame) - line) } else { T::zero() };
        if let Some(place) = phases.get_mut(frame) {
            *place = line + own;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check<const N: usize>(times: [f64; N], quality: [f64; N], rate: f64) -> [f64; N] {
        let truth = times.map(|t| rate * t);
        let mut phases = truth.map(wrap);
        unwrap_chain(&mut phases, &times, &quality);
        let offset = phases[0] - truth[0];
        core::array::from_fn(|i| phases[i] - offset - truth[i])
    }

    #[test]
    fn even_times_are_unwrapped() {
        let error = check::<50>(core::array::from_fn(|i| i as f64), [1.0; 50], 2.9);
        assert!(error.iter().all(|e| e.abs() < 1e-9), "{error:?}");
    }

    /// A clock that jitters makes no gaps: the velocity may turn round from one frame to the next.
    #[test]
    fn jitter_makes_no_gaps() {
        let times: [f64; 40] =
            core::array::from_fn(|i| i as f64 + 0.01 * libm::sin(7.0 * i as f64));
        let truth = times.map(|t| if t < 20.0 { 2.0 * t } else { 80.0 - 2.0 * t });
        let mut phases = truth.map(wrap);
        unwrap_chain(&mut phases, &times, &[1.0; 40]);
        let offset = phases[0] - truth[0];
        for (phase, truth) in phases.iter().zip(truth) {
            assert!((phase - offset - truth).abs() < 1e-9, "{phase} {truth}");
        }
    }

    #[test]
    fn velocity_bridges_the_gaps_of_bursts() {
        let times: [f64; 24] = core::array::from_fn(|i| (i / 3 * 12 + i % 3) as f64);
        let error = check(times, [1.0; 24], 0.7);
        assert!(error.iter().all(|e| e.abs() < 1e-9), "{error:?}");
    }

    #[test]
    fn bad_frames_lie_on_the_line_between_good_ones() {
        let mut quality = [1.0; 12];
        quality[5] = 0.0;
        quality[6] = 0.5;
        let error = check(core::array::from_fn(|i| i as f64), quality, 1.2);
        assert!(error.iter().all(|e| e.abs() < 1e-9), "{error:?}");
        let mut ends = [1.0; 12];
        (ends[0], ends[11]) = (0.0, 0.0);
        let mut phases: [f64; 12] = core::array::from_fn(|i| if i == 0 { 3.0 } else { 0.1 });
        unwrap_chain(&mut phases, &core::array::from_fn::<_, 12, _>(|i| i as f64), &ends);
        assert_eq!(phases, [0.1; 12]);
    }

    #[test]
    fn one_sound_frame_is_left_alone() {
        let mut phases = [1.0, 9.0, 2.0];
        unwrap_chain(&mut phases, &[0.0, 1.0, 2.0], &[0.0, 1.0, 0.0]);
        assert_eq!(phases, [1.0, 9.0, 2.0]);
    }
}
