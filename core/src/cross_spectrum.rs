//! The cross-spectrum C(t,dt) = U(t) * conj U(t+dt), of two fields and as a stream of frames.

use crate::ensemble::{Ensemble, PairMean};
use crate::scalar::{Scalar, is_number};
use heapless::{Deque, Vec};
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

/// The last `LAGS` frames of up to `PIXELS` pixels, and with each new frame the cross-spectra that end
/// at it, averaged over the pixels.
#[derive(Clone, Debug)]
pub struct CrossSpectrumStream<T, const PIXELS: usize, const LAGS: usize> {
    /// Newest first.
    past: Deque<Frame<T, PIXELS>, LAGS>,
}

#[derive(Clone, Debug)]
struct Frame<T, const PIXELS: usize> {
    field: Vec<Complex<T>, PIXELS>,
    /// ⟨|U|²⟩ over the pixels.
    power: T,
}

impl<T: Scalar, const PIXELS: usize> Frame<T, PIXELS> {
    fn new(pixels: &[Complex<T>]) -> Self {
        let mut field = Vec::new();
        for &pixel in pixels.iter().take(PIXELS) {
            // Cannot fail: there are not more.
            let _ = field.push(dark_if_not_finite(pixel));
        }
        let power = mean_power(&field);
        Self { field, power }
    }

    /// ⟨|U|²⟩ over the first `pixels` pixels.
    fn power_of(&self, pixels: usize) -> T {
        if pixels >= self.field.len() {
            return self.power;
        }
        mean_power(self.field.get(..pixels).unwrap_or(&[]))
    }
}

impl<T: Scalar, const PIXELS: usize, const LAGS: usize> CrossSpectrumStream<T, PIXELS, LAGS> {
    /// No frames yet.
    #[must_use]
    pub const fn new() -> Self {
        Self { past: Deque::new() }
    }

    /// Take frame n and give `each(dt, ⟨C(n-dt, dt)⟩)` for dt = 1, 2, ... up to `LAGS` or the first
    /// frame, whichever is nearer.
    ///
    /// A mean is over the pixels that both frames have; those beyond `PIXELS` are left out.
    pub fn push(&mut self, field: &[Complex<T>], mut each: impl FnMut(usize, PairMean<T>)) {
        let frame = Frame::new(field);
        for (age, past) in self.past.iter().enumerate() {
            each(age + 1, mean_over_pixels(past, &frame));
        }
        if self.past.is_full() {
            self.past.pop_back();
        }
        // Cannot fail: one place has just been made.
        let _ = self.past.push_front(frame);
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
pub(crate) fn dark_if_not_finite<T: Scalar>(u: Complex<T>) -> Complex<T> {
    let finite = is_number(u.re.abs() + u.im.abs());
    let keep = |x: T| T::select(finite, x, T::zero());
    Complex { re: keep(u.re), im: keep(u.im) }
}

/// Ensemble mean of the pair (`earlier`, `later`) over the pixels that both have.
fn mean_over_pixels<T: Scalar, const PIXELS: usize>(
    earlier: &Frame<T, PIXELS>,
    later: &Frame<T, PIXELS>,
) -> PairMean<T> {
    let pixels = earlier.field.len().min(later.field.len());
    let cross = sum_over_pixels(&earlier.field, &later.field);
    cross.mean(earlier.power_of(pixels), later.power_of(pixels))
}

/// ⟨|U|²⟩.
fn mean_power<T: Scalar>(field: &[Complex<T>]) -> T {
    sum_over_pixels(field, field).mean(T::one(), T::one()).cross.re
}

fn sum_over_pixels<T: Scalar>(earlier: &[Complex<T>], later: &[Complex<T>]) -> Ensemble<T> {
    let mut ensemble = Ensemble::new();
    for (&u, &v) in earlier.iter().zip(later) {
        ensemble.add(cross_spectrum(u, v));
    }
    ensemble
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

    #[test]
    fn frames_of_other_lengths_count_what_both_have() {
        let field = |t: usize, pixels: usize| {
            core::array::from_fn::<_, 4, _>(|i| {
                let lit = if i < pixels { 1.0 + i as f64 } else { 0.0 };
                Complex::from_polar(lit, 0.1 * t as f64)
            })
        };
        let mut stream = CrossSpectrumStream::<f64, 4, 2>::new();
        stream.push(&field(0, 4), |_, _| {});
        stream.push(&field(1, 2)[..2], |_, mean| {
            assert!((mean.coherence_squared() - 1.0).abs() < 1e-14);
            assert!((mean.cross.norm() - 2.5).abs() < 1e-14, "(1 + 4) / 2");
        });
        let six = [Complex::new(1.0, 0.0); 6];
        stream.push(&six, |dt, mean| {
            assert!((mean.cross.arg() + 0.1 * (dt as f64 - 2.0)).abs() < 1e-14);
        });
        stream.push(&[], |_, mean| assert_eq!(mean.coherence_squared(), 0.0));
    }
}
