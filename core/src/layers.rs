//! Phase between two depths: the cross-spectrum of a layer difference.

use crate::cross_spectrum::times_conjugate;
use crate::scalar::Scalar;
use num_complex::Complex;

/// Cross-spectrum of the phase difference between two ranges of layers (paper lines 727-735):
///
/// C^{Z1-Z2}(x,y; t,dt) = (sum over z in Z1 of C(x,y,z; t,dt)) * conj(sum over z in Z2 of C(x,y,z; t,dt))
///
/// `first` and `second` are the two sums. Phases common to both depths (bulk motion) cancel; the
/// argument is the change of phi_{Z1} - phi_{Z2}, with the sign of `cross_spectrum`.
#[inline(always)]
#[must_use]
pub fn layer_difference<T: Scalar>(first: Complex<T>, second: Complex<T>) -> Complex<T> {
    times_conjugate(first, second)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bulk_phase_cancels_and_the_difference_stays() {
        let phasor = |radius: f64, angle: f64| Complex::from_polar(radius, angle);
        for bulk in [0.0, 1.0, -2.5] {
            let c = layer_difference(phasor(2.0, 0.7 + bulk), phasor(3.0, 0.2 + bulk));
            assert!((c - phasor(6.0, 0.5)).norm() < 1e-14);
        }
    }
}
