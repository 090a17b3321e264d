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
    let shortest = shortest(steps.clone(), times);
    for step in steps.clone() {
        let (i, j) = step;
        let mut change = wrap(phase(phases, j) - phase(phases, i));
        if interval(times, step) > shortest * SHORT {
            let short = steps.clone().filter(|&step| interval(times, step) <= shortest * SHORT);
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

/// The shortest of the steps.
fn shortest(steps: impl Iterator<Item = (usize, usize)>, times: &[f64]) -> f64 {
    steps.fold(f64::INFINITY, |least, step| least.min(interval(times, step)))
}

/// From one frame to another.
fn interval(times: &[f64], (from, to): (usize, usize)) -> f64 {
    time(times, to) - time(times, from)
}

fn time(times: &[f64], frame: usize) -> f64 {
    times.get(frame).copied().unwrap_or(0.0)
}

#[inline(always)]
fn phase<T: Scalar>(phases: &[T], frame: usize) -> T {
    phases.get(frame).copied().unwrap_or(T::zero())
}

/// The gap across which whole turns are least sure: the frame before it, and the standard error e of the change that the
/// velocity around it suggests, radians,
///
/// e^2 = gap^2 sum of w^2 / (sum of w)^2 * n / (n-1) * sum of w (v - mean)^2 / sum of w,
///
/// of the n velocities v with weights w that predict it ([`unwrap_chain`]); infinite from fewer than two. A turn is wrong
/// where the prediction is off by more than pi. `None` where there is no gap. Phases as they come from [`unwrap_chain`], or before.
pub fn least_sure_gap<Q: Real>(phases: &[Q], times: &[f64], quality: &[Q]) -> Option<(usize, Q)> {
    let chain = sound_frames(quality);
    let steps = chain.clone().zip(chain.skip(1));
    let shortest = shortest(steps.clone(), times);
    let short = steps.clone().filter(|&step| interval(times, step) <= shortest * SHORT);
    let mut least_sure: Option<(usize, Q)> = None;
    for step in steps.filter(|&step| interval(times, step) > shortest * SHORT) {
        let error = standard_error(phases, times, short.clone(), step);
        if least_sure.is_none_or(|(_, largest)| error > largest) {
            least_sure = Some((step.0, error));
        }
    }
    least_sure
}

/// Of the change over a gap.
fn standard_error<Q: Real>(
    phases: &[Q],
    times: &[f64],
    short: impl Iterator<Item = (usize, usize)>,
    step: (usize, usize),
) -> Q {
    let nearest = nearest_velocities(phases, times, short, step);
    let known = || nearest.into_iter().filter(|&(weight, _)| weight > 0.0);
    let (mut weights, mut squares, mut sum, mut count) = (Q::zero(), Q::zero(), Q::zero(), 0.0);
    for (weight, velocity) in known() {
        let weight = Q::from_f64(weight);
        weights += weight;
        squares += weight * weight;
        sum += weight * velocity;
        count += 1.0;
    }
    if count < 2.0 {
        return Q::from_f64(f64::INFINITY);
    }
    let mut scatter = Q::zero();
    for (weight, velocity) in known() {
        let off = velocity - sum / weights;
        scatter += Q::from_f64(weight) * off * off;
    }
    let variance = scatter / weights * Q::from_f64(count / (count - 1.0));
    Q::from_f64(interval(times, step)) * (variance * squares).sqrt() / weights
}

/// The change over a gap that the velocity around it suggests.
#[inline(always)]
fn predict<T: Scalar>(
    phases: &[T],
    times: &[f64],
    short: impl Iterator<Item = (usize, usize)>,
    step: (usize, usize),
) -> T {
    let (mut sum, mut weights) = (T::zero(), 0.0);
    for (weight, velocity) in nearest_velocities(phases, times, short, step) {
        sum += T::from_f64(weight) * velocity;
        weights += weight;
    }
    if weights > 0.0 { sum * T::from_f64(interval(times, step) / weights) } else { T::zero() }
}

/// Weight and velocity of the short intervals nearest to a gap; where there are fewer, weights of 0.
#[inline(always)]
fn nearest_velocities<T: Scalar>(
    phases: &[T],
    times: &[f64],
    short: impl Iterator<Item = (usize, usize)>,
    step: (usize, usize),
) -> [(f64, T); NEAREST] {
    let middle = |(i, j): (usize, usize)| (time(times, i) + time(times, j)) / 2.0;
    let mut nearest = [(f64::INFINITY, T::zero()); NEAREST];
    for (i, j) in short {
        let distance = (middle((i, j)) - middle(step)).abs();
        let change = wrap(phase(phases, j) - phase(phases, i));
        let mut candidate = (distance, change / T::from_f64(interval(times, (i, j))));
        for place in &mut nearest {
            if candidate.0 < place.0 {
                core::mem::swap(&mut candidate, place);
            }
        }
    }
    for (weight, _) in &mut nearest {
        *weight = 1.0 / (1.0 + *weight / interval(times, step));
    }
    nearest
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

    /// Pairs with a known scatter of velocities, +-0.01 in turns: e = 12 * 0.01 sqrt(6/5) / sqrt 6 but for the weights; frames
    /// without gaps have none.
    #[test]
    fn the_error_over_a_gap_is_that_of_the_velocities_times_the_gap() {
        let times: [f64; 24] = core::array::from_fn(|i| (i / 2 * 13 + i % 2) as f64);
        let phases: [f64; 24] = core::array::from_fn(|i| {
            let jitter = if i % 4 == 1 { 0.01 } else { -0.01 };
            0.3 * times[i] + if i % 2 == 1 { jitter } else { 0.0 }
        });
        let (frame, error) = least_sure_gap(&phases, &times, &[1.0; 24]).unwrap();
        let expected = 12.0 * 0.01 / libm::sqrt(5.0);
        assert!(
            frame % 2 == 1 && (error / expected - 1.0).abs() < 0.15,
            "{frame}: {error} {expected}"
        );
        let even: [f64; 24] = core::array::from_fn(|i| i as f64);
        assert_eq!(least_sure_gap(&phases, &even, &[1.0; 24]), None);
        // One interval tells no scatter.
        let few = least_sure_gap(&[0.0, 0.1, 0.7], &[0.0, 1.0, 9.0], &[1.0; 3]);
        assert_eq!(few, Some((1, f64::INFINITY)));
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
