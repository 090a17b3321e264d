//! The quality s_i of single frames: 1 for a frame like its neighbours, 0 for one that has nothing to do
//! with them (a blink, a saturated image, a lost trigger).

use crate::coherence::information;
use crate::lags::Lags;
use crate::scalar::Real;
use crate::square::Square;

/// Neighbours, in frames, that a frame is first compared with.
const NEAR: usize = 8;

/// Share of the usual coherence below which a frame is left out at first.
const CUT: f64 = 0.35;

/// Above this quality a frame carries the unwrapping.
pub const SOUND: f64 = 0.6;

/// Above this quality a frame's phase is reported, where all frames are known.
pub const USABLE: f64 = 0.3;

/// Above this quality a frame's phase is reported when only those before it, or few behind it, are known:
///
/// USABLE + 2 / sqrt(L), at most SOUND,
///
/// L the independent looks. Chance gives a frame that has nothing to do with the others a quality in proportion to
/// 1/sqrt(L), and few frames do not average it away. The 2 is measured: in noise as strong as the signal and with 100
/// looks a third of such frames are above 0.3, a few of a hundred above this (test of `tracker/arrival.rs`), and
/// sound frames stay above it.
#[must_use]
pub fn usable_above(looks: f64) -> f64 {
    (USABLE + 2.0 / libm::sqrt(looks)).min(SOUND)
}

/// First guess: 0 for frames whose squared coherences with their 8 neighbours on each side are, in
/// sum, below 0.35 of the median over pairs of the same lag; 1 for the others.
///
/// `square` holds |gamma_ij|^2, debiased; `scratch` 3 numbers per frame at least, and better one
/// for each pair within reach.
pub fn first_quality<T: Real>(
    square: &Square<'_, T>,
    lags: &Lags<'_>,
    s: &mut [T],
    expected: &mut [T],
    scratch: &mut [T],
) {
    s.fill(T::zero());
    expected.fill(T::zero());
    for group in 0..lags.groups() {
        let near = lags.pairs(group).filter(|&(i, j)| j - i <= NEAR);
        let mut count = 0;
        for (place, (i, j)) in scratch.iter_mut().zip(near.clone()) {
            *place = square.at(i, j);
            count += 1;
        }
        let usual = median(scratch.get_mut(..count).unwrap_or(&mut [])).max(T::from_f64(1e-4));
        for (i, j) in near {
            for frame in [i, j] {
                if let (Some(seen), Some(norm)) = (s.get_mut(frame), expected.get_mut(frame)) {
                    *seen += square.at(i, j);
                    *norm += usual;
                }
            }
        }
    }
    for (s, &expected) in s.iter_mut().zip(expected.iter()) {
        let bad = *s < T::from_f64(CUT) * expected;
        *s = if bad { T::zero() } else { T::one() };
    }
}

/// Qualities from the aligned coherence R_ij = s_i s_j M_ij, by alternating least squares; M is
/// the model without qualities. Deviations from 1 that chance explains (2.5 sigma) are shrunk away.
pub fn frame_quality<T: Real>(
    aligned: &Square<'_, T>,
    model: &Square<'_, T>,
    looks: f64,
    s: &mut [T],
    scratch: &mut [T],
) {
    const ROUNDS: usize = 3;
    for _ in 0..ROUNDS {
        for (i, place) in scratch.iter_mut().enumerate().take(s.len()) {
            let others = s.iter().zip(aligned.row(i)).zip(model.row(i)).enumerate();
            let (mut seen, mut norm) = (T::zero(), T::from_f64(1e-9));
            for (_, ((&s, &r), &m)) in others.filter(|&(j, _)| j != i) {
                let (weight, expected) = (information(m), m * s);
                seen += weight * r * expected;
                norm += weight * expected * expected;
            }
            *place = (seen / norm).max(T::zero()).min(T::from_f64(1.2));
        }
        for (s, &new) in s.iter_mut().zip(scratch.iter()) {
            *s = new;
        }
        let frames = s.len();
        let usual = median(scratch.get_mut(..frames).unwrap_or(&mut [])).max(T::from_f64(0.5));
        for (i, place) in s.iter_mut().enumerate() {
            let row = model.row(i).iter().enumerate().filter(|&(j, _)| j != i);
            let nearest = row.fold(T::zero(), |most, (_, &m)| most.max(m));
            *place = shrink(*place / usual, nearest, looks);
        }
    }
}

/// Quality of one new frame from its aligned coherences with frames of known quality and the model's
/// coherences with them.
pub fn quality_of_one<T: Real>(pairs: impl Iterator<Item = (T, T, T)> + Clone, looks: f64) -> T {
    let (mut seen, mut norm) = (T::zero(), T::from_f64(1e-9));
    let mut nearest = T::zero();
    for (aligned, model, s) in pairs {
        let (weight, expected) = (information(model), model * s);
        seen += weight * aligned * expected;
        norm += weight * expected * expected;
        nearest = nearest.max(model);
    }
    shrink((seen / norm).min(T::one()), nearest, looks)
}

/// A quality whose deviation from 1 is kept only as far as it exceeds what chance gives:
/// s = 1 - d max(0, 1 - (2.5 sigma / d)^2) with d = 1 - s, cut to 0..=1, and
/// sigma = 0.02 + 1.5 sqrt((1 - m^2) / (2 L)), m the coherence with the nearest frame.
fn shrink<T: Real>(s: T, nearest: T, looks: f64) -> T {
    let spread = (T::one() - nearest * nearest).max(T::zero()) * T::from_f64(0.5 / looks);
    let sigma = T::from_f64(1.5).mul_add(spread.sqrt(), T::from_f64(0.02));
    let deviation = T::one() - s;
    let size = deviation.abs().max(T::from_f64(1e-9));
    let ratio = T::from_f64(2.5) * sigma / size;
    let kept = (T::one() - ratio * ratio).max(T::zero());
    (T::one() - deviation * kept).max(T::zero()).min(T::one())
}

/// The median; the mean of the middle two of an even number; 0 of none. Sorts.
pub(crate) fn median<T: Real>(values: &mut [T]) -> T {
    values.sort_unstable_by(|a, b| a.partial_cmp(b).unwrap_or(core::cmp::Ordering::Equal));
    let middle = |i: usize| values.get(i).copied().unwrap_or(T::zero());
    let half = values.len() / 2;
    if values.len() % 2 == 1 {
        middle(half)
    } else {
        (middle(half.saturating_sub(1)) + middle(half)) * T::from_f64(0.5)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_looks_ask_for_more_quality() {
        assert!((usable_above(100.0) - 0.5).abs() < 1e-12);
        assert_eq!((usable_above(10.0), usable_above(f64::INFINITY)), (SOUND, USABLE));
    }

    #[test]
    fn medians() {
        assert_eq!(median(&mut [3.0, 1.0, 2.0]), 2.0);
        assert_eq!(median(&mut [4.0_f32, 1.0, 2.0, 3.0]), 2.5);
        assert_eq!(median::<f64>(&mut []), 0.0);
    }

    #[test]
    fn chance_is_shrunk_away_and_outliers_stay() {
        let of = |s: f64| shrink(s, 0.9, 1000.0);
        assert_eq!((of(1.0), of(0.95), of(1.05)), (1.0, 1.0, 1.0));
        assert!(of(0.0) < 0.02, "{}", of(0.0));
        assert!(of(0.5) < 0.56, "{}", of(0.5));
        assert_eq!(of(1.2), 1.0);
    }

    const N: usize = 20;

    #[test]
    fn an_outlier_and_a_half_good_frame_are_found() {
        let quality: [f64; N] = core::array::from_fn(|i| match i {
            7 => 0.0,
            12 => 0.5,
            _ => 1.0,
        });
        let decay = |i: usize, j: usize| libm::exp(-0.1 * i.abs_diff(j) as f64);
        let (mut x, mut y, mut z) = ([0.0; N * N], [0.0; N * N], [0.0; N * N]);
        let mut aligned = Square::new(&mut x, N);
        aligned.fill_with(|i, j| decay(i, j) * quality[i] * quality[j]);
        let mut model = Square::new(&mut y, N);
        model.fill_with(decay);
        let mut s = [1.0; N];
        frame_quality(&aligned, &model, 1000.0, &mut s, &mut z);
        let (mut first, mut expected) = ([0.0; N], [0.0; N]);
        let times: [f64; N] = core::array::from_fn(|i| i as f64);
        let mut indices = [0; Lags::indices(N)];
        let lags = Lags::new(&times, &mut indices);
        aligned.fill_with(|i, j| libm::pow(decay(i, j) * quality[i] * quality[j], 2.0));
        first_quality(&aligned, &lags, &mut first, &mut expected, &mut z);
        for i in 0..N {
            assert!((s[i] - quality[i]).abs() < 0.06, "{i}: {}", s[i]);
            let sound = if quality[i] > 0.9 { 1.0 } else { 0.0 };
            assert_eq!(first[i], sound, "frame {i}");
        }
    }
}
