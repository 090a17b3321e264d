//! What the method is compared with: the direct phase difference and the one-step walk.

use crate::scalar::{Mask, Scalar};
use core::f64::consts::{PI, TAU};
use num_complex::Complex;

/// Direct phase difference to the frame t_0, wrapped, radians (paper lines 410 and 975-984, with the
/// sign of C): phi(t) - phi(t_0) = -arg ⟨C(t_0, t - t_0)⟩.
///
/// `cross` is ⟨U(t_0) conj U(t)⟩, for t before or after t_0 alike; 0 at t = t_0.
#[inline(always)]
#[must_use]
pub fn direct_difference<T: Scalar>(cross: Complex<T>) -> T {
    (-cross.im).atan2(cross.re)
}

/// One-step Knox-Thompson walk (paper line 421, with the sign of C):
/// phi(t) = phi(t-1) - arg ⟨C(t-1, 1)⟩, radians; `cross` is ⟨C(t-1, 1)⟩.
#[inline(always)]
#[must_use]
pub fn one_step<T: Scalar>(previous_phase: T, cross: Complex<T>) -> T {
    previous_phase + direct_difference(cross)
}

/// Unwrap a curve along time: each phase is moved by multiples of 2 pi to within pi of the one
/// before it (paper lines 987-988: for curves of the direct difference).
pub fn unwrap_in_time<T: Scalar>(phases: &mut [T]) {
    let (half, turn) = (T::from_f64(PI), T::from_f64(TAU));
    let mut previous: Option<T> = None;
    let mut offset = T::zero();
    for phase in phases {
        if let Some(before) = previous {
            // Wrapped phases differ by less than 2 pi, so one turn is enough.
            let step = *phase - before;
            let down = half.lt(step);
            let up = step.lt(-half);
            if down.any() || up.any() {
                offset = T::select(down, offset - turn, T::select(up, offset + turn, offset));
            }
        }
        previous = Some(*phase);
        *phase += offset;
    }
}

/// Variance of the direct difference of `frame` against the mean of the reference frames, rad^2.
///
/// `variances` holds that of each frame's pair with t_0 (0 at t_0 itself); pairs are taken as
/// independent: var = sum over j of (delta_{frame,j} - 1{j < N_0} / N_0)^2 v_j.
#[must_use]
pub fn direct_variance(variances: &[f64], frame: usize, reference_frames: usize) -> f64 {
    let references = reference_frames.clamp(1, variances.len().max(1));
    let coefficient = |j: usize| {
        let own = if j == frame { 1.0 } else { 0.0 };
        own - if j < references { 1.0 / references as f64 } else { 0.0 }
    };
    variances.iter().enumerate().map(|(j, v)| coefficient(j) * coefficient(j) * v).sum()
}

/// Variance of the one-step walk at `frame` against the mean of the reference frames, rad^2.
///
/// `variances` holds that of each step (k, k+1), taken as independent, which steps of a random walk
/// are: var = sum over k of (1{k < frame} - share of the reference frames after k)^2 v_k.
#[must_use]
pub fn one_step_variance(variances: &[f64], frame: usize, reference_frames: usize) -> f64 {
    let references = reference_frames.clamp(1, variances.len() + 1);
    let coefficient = |k: usize| {
        let passed = if k < frame { 1.0 } else { 0.0 };
        passed - references.saturating_sub(k + 1) as f64 / references as f64
    };
    variances.iter().enumerate().map(|(k, v)| coefficient(k) * coefficient(k) * v).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cross_spectrum::cross_spectrum;

    #[test]
    fn variances_of_known_cases() {
        // One reference frame: the walk's variance is the number of steps, the direct one's its pair.
        assert_eq!(one_step_variance(&[0.5; 9], 6, 1), 3.0);
        assert_eq!(direct_variance(&[0.0, 1.0, 2.0, 3.0], 3, 1), 3.0);
        // Two: half of the first step comes back with the mean.
        assert_eq!(one_step_variance(&[1.0; 9], 3, 2), 0.25 + 1.0 + 1.0);
        assert_eq!(one_step_variance(&[1.0; 9], 0, 2), 0.25);
        assert_eq!(direct_variance(&[0.0, 1.0, 2.0, 3.0], 3, 2), 3.0 + 0.25);
    }

    fn field(t: usize) -> Complex<f64> {
        Complex::from_polar(1.0, 0.4 * t as f64)
    }

    #[test]
    fn both_follow_a_phase_without_decorrelation() {
        let mut walked = 0.0;
        let mut direct = [0.0; 40];
        for (t, phase) in direct.iter_mut().enumerate() {
            *phase = direct_difference(cross_spectrum(field(0), field(t)));
            if t > 0 {
                walked = one_step(walked, cross_spectrum(field(t - 1), field(t)));
            }
            assert!((walked - 0.4 * t as f64).abs() < 1e-12);
        }
        unwrap_in_time(&mut direct);
        for (t, phase) in direct.iter().enumerate() {
            assert!((phase - 0.4 * t as f64).abs() < 1e-12);
        }
    }
}
