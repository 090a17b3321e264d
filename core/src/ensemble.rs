//! The ensemble average, approximated by a mean over the pixels of a mask.

use crate::scalar::Scalar;
use crate::weights::unit_phasor;
use num_complex::Complex;

/// What the method needs of one pair of frames (t, t+dt), averaged over the ensemble.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PairMean<T> {
    /// ⟨C⟩: its argument is the phase difference phi(t) - phi(t+dt), in radians.
    pub cross: Complex<T>,
    /// ⟨C/|C|⟩: its modulus, 0..1, tells how far the phase can be trusted.
    pub phasor: Complex<T>,
    /// ⟨C(t,0)⟩ * ⟨C(t+dt,0)⟩: the product of the two mean powers, for the coherence.
    pub power: T,
}

impl<T: Scalar> PairMean<T> {
    /// Wrapped phase difference arg ⟨C⟩, radians in -pi..=pi: that of the systematic phase, because ⟨C_H⟩
    /// is real at small dt (paper lines 955-971).
    #[inline(always)]
    #[must_use]
    pub fn phase(&self) -> T {
        self.cross.im.atan2(self.cross.re)
    }

    /// |gamma|^2, see [`coherence_squared`].
    #[inline(always)]
    #[must_use]
    pub fn coherence_squared(&self) -> T {
        coherence_squared(self.cross, self.power)
    }
}

/// |gamma|^2 = |⟨C⟩|^2 / (⟨C(t,0)⟩ ⟨C(t+dt,0)⟩), 0..1; 0 where there is no light. `power` is the product
/// of the two means.
///
/// With C the plain cross-spectrum, ⟨C(t,0)⟩ is the mean intensity ⟨|U(t)|²⟩; with C the layer
/// difference it is the mean product of the two layers' intensities. By the Cauchy-Schwarz
/// inequality neither exceeds 1 but for rounding, which is cut off.
#[inline(always)]
#[must_use]
pub fn coherence_squared<T: Scalar>(cross: Complex<T>, power: T) -> T {
    let square = cross.re.mul_add(cross.re, cross.im * cross.im);
    let lit = T::zero().lt(power);
    let ratio = square / T::select(lit, power, T::one());
    T::select(lit, ratio.min(T::one()), T::zero())
}

/// Running mean of the cross-spectrum over the pixels of a mask M (paper lines 739-747):
/// ⟨C(t,dt)⟩_M = 1/|M| * sum over (x,y) in M of C(x,y; t,dt), and the same of C/|C| (line 770).
#[derive(Clone, Copy, Debug)]
pub struct Ensemble<T> {
    cross: Complex<T>,
    phasor: Complex<T>,
    pixels: u32,
}

impl<T: Scalar> Ensemble<T> {
    /// No pixels yet.
    #[inline]
    #[must_use]
    pub fn new() -> Self {
        let zero = Complex { re: T::zero(), im: T::zero() };
        Self { cross: zero, phasor: zero, pixels: 0 }
    }

    /// Add one pixel's cross-spectrum.
    #[inline(always)]
    pub fn add(&mut self, c: Complex<T>) {
        let phasor = unit_phasor(c);
        self.cross.re += c.re;
        self.cross.im += c.im;
        self.phasor.re += phasor.re;
        self.phasor.im += phasor.im;
        self.pixels += 1;
    }

    /// The mean over all pixels so far (zero for none). `earlier_power` and `later_power` are
    /// ⟨C(t,0)⟩ and ⟨C(t+dt,0)⟩ over the same pixels.
    #[inline]
    #[must_use]
    pub fn mean(&self, earlier_power: T, later_power: T) -> PairMean<T> {
        let share = T::from_f64(1.0 / f64::from(self.pixels.max(1)));
        let scale = |z: Complex<T>| Complex { re: z.re * share, im: z.im * share };
        PairMean {
            cross: scale(self.cross),
            phasor: scale(self.phasor),
            power: earlier_power * later_power,
        }
    }
}

impl<T: Scalar> Default for Ensemble<T> {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mean_of_values_and_of_phasors() {
        let mut ensemble = Ensemble::<f64>::new();
        ensemble.add(Complex::new(3.0, 0.0));
        ensemble.add(Complex::new(0.0, 1.0));
        let mean = ensemble.mean(2.5, 2.5);
        assert_eq!(mean.cross, Complex::new(1.5, 0.5));
        assert_eq!(mean.phasor, Complex::new(0.5, 0.5));
        assert!((mean.coherence_squared() - 2.5 / 6.25).abs() < 1e-15);
    }

    #[test]
    fn darkness_has_no_coherence() {
        let mut ensemble = Ensemble::<f32>::new();
        assert_eq!(ensemble.mean(0.0, 0.0).coherence_squared(), 0.0);
        ensemble.add(Complex::new(0.0, 0.0));
        let mean = ensemble.mean(0.0, 0.0);
        assert_eq!((mean.phase(), mean.phasor.re, mean.coherence_squared()), (0.0, 0.0, 0.0));
    }
}
