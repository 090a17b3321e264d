//! What the method is compared with: the direct phase difference and the one-step walk.

use crate::scalar::{Mask, Scalar};
use core::f64::consts::{PI, TAU};
use num_complex::Complex;

/// Direct phase difference to the frame t_0, wrapped, radians (paper lines 410 and 975-984, with the
/// sign of C): phi(t) - phi(t_0) = -arg <C(t_0, t - t_0)>.
///
/// `cross` is <U(t_0) conj U(t)>, for t before or after t_0 alike; 0 at t = t_0.
#[inline(always)]
#[must_use]
pub fn direct_difference<T: Scalar>(cross: Complex<T>) -> T {
    (-cross.im).atan2(cross.re)
}

/// One-step Knox-Thompson walk (paper line 421, with the sign of C):
/// phi(t) = phi(t-1) - arg <C(t-1, 1)>, radians; `cross` is <C(t-1, 1)>.
#[inline(always)]
#[must_use]
pub fn one_step<T: Scalar>(previous_phase: T, cross: Complex<T>) -> T {
    previous_phase + direct_difference(cross)
}

/// Unwrap a curve along time: each phase is moved by multiples of 2 pi to within pi of the one
/// before it (paper line 984: for curves of the direct difference).
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
        *phase = *phase + offset;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cross_spectrum::cross_spectrum;

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
