//! The cross-spectrum C(t,dt) = U(t) * conj U(t+dt), of two fields and as a stream of frames.

use crate::ensemble::{Ensemble, PairMean};
use crate::scalar::{Scalar, is_number};
use heapless::Deque;
use num_complex::Complex;

/// C(t,dt) = U(t) * conj U(t+dt) (paper line 720), so arg C = phi(t) - phi(t+dt).
///
/// `earlier` is U(t), `later` is U(t+dt), of one pixel.
#[inline(always)]
#[must_use]
pub fn cross_spectrum<T: Scalar>(earlier: Complex<T>, later: Complex<T>) -> Complex<T> {
    times_conjugate(earlier, later)
}

/// a * conj b.
#[inline(always)]
pub(crate) fn times_conjugate<T: Scalar>(a: Complex<T>, b: Complex<T>) -> Complex<T> {
    Complex { re: a.re.mul_add(b.re, a.im * b.im), im: a.im.mul_add(b.re, -(a.re * b.im)) }
}

/// The last `LAGS` frames of `PIXELS` pixels, and with each new frame the cross-spectra that end
/// at it, averaged over the pixels.
#[derive(Clone, Debug)]
pub struct CrossSpectrumStream<T, const PIXELS: usize, const LAGS: usize> {
    /// Newest first.
    past: Deque<Past<T, PIXELS>, LAGS>,
}

#[derive(Clone, Debug)]
struct Past<T, const PIXELS: usize> {
    field: [Complex<T>; PIXELS],
    /// ⟨|U|²⟩ over the pixels.
    power: T,
}

impl<T: Scalar, const PIXELS: usize, const LAGS: usize> CrossSpectrumStream<T, PIXELS, LAGS> {
    /// No frames yet.
    #[must_use]
    pub const fn new() -> Self {
        Self { past: Deque::new() }
    }

    /// Take frame n and give `each(dt, ⟨C(n-dt, dt)⟩)` for dt = 1, 2, ... up to `LAGS` or the first
    /// frame, whichever is nearer.
    pub fn push(&mut self, field: &[Complex<T>; PIXELS], mut each: impl FnMut(usize, PairMean<T>)) {
        let field = &field.map(dark_if_not_finite);
        let power = mean_over_pixels(field, field, T::one(), T::one()).cross.re;
        for (age, past) in self.past.iter().enumerate() {
            each(age + 1, mean_over_pixels(&past.field, field, past.power, power));
        }
        if self.past.is_full() {
            self.past.pop_back();
        }
        // Cannot fail: one place has just been made.
        let _ = self.past.push_front(Past { field: *field, power });
    }
}

impl<T: Scalar, const PIXELS: usize, const LAGS: usize> Default
    for CrossSpectrumStream<T, PIXELS, LAGS>
{
    fn default() -> Self {
        Self::new()
    }
}

/// The field, or 0 where a part of it is NaN or infinite.
fn dark_if_not_finite<T: Scalar>(u: Complex<T>) -> Complex<T> {
    let finite = is_number(u.re.abs() + u.im.abs());
    let keep = |x: T| T::select(finite, x, T::zero());
    Complex { re: keep(u.re), im: keep(u.im) }
}

/// Ensemble mean of the pair (`earlier`, `later`) over all pixels.
fn mean_over_pixels<T: Scalar>(
    earlier: &[Complex<T>],
    later: &[Complex<T>],
    earlier_power: T,
    later_power: T,
) -> PairMean<T> {
    let mut ensemble = Ensemble::new();
    for (&u, &v) in earlier.iter().zip(later) {
        ensemble.add(cross_spectrum(u, v));
    }
    ensemble.mean(earlier_power, later_power)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn argument_is_earlier_minus_later() {
        let c = cross_spectrum(Complex::from_polar(2.0, 0.9), Complex::from_polar(3.0, 0.4));
        assert!((c - Complex::from_polar(6.0, 0.5)).norm() < 1e-14);
    }

    #[test]
    fn stream_gives_each_pair_once_newest_lag_first() {
        let mut stream = CrossSpectrumStream::<f64, 2, 3>::new();
        let mut pairs = [[0; 3]; 6];
        for (n, seen) in pairs.iter_mut().enumerate() {
            let angle = 0.1 * n as f64;
            let field = [Complex::from_polar(1.0, angle), Complex::from_polar(2.0, angle + 1.0)];
            let mut expected_lag = 1;
            stream.push(&field, |lag, mean| {
                assert_eq!(lag, expected_lag);
                expected_lag += 1;
                seen[lag - 1] += 1;
                assert!((mean.cross.arg() + 0.1 * lag as f64).abs() < 1e-14);
                assert!((mean.cross.norm() - 2.5).abs() < 1e-14, "(1 + 4) / 2");
                assert!((mean.coherence_squared() - 1.0).abs() < 1e-14);
            });
        }
        assert_eq!(pairs, [[0, 0, 0], [1, 0, 0], [1, 1, 0], [1, 1, 1], [1, 1, 1], [1, 1, 1]]);
    }
}
