//! Simulated speckle, the same on every run.

use crate::scalar::Real;
use num_complex::Complex;

/// Circular Gaussian speckle of `P` independent pixels that falls apart by a factor `rho` per frame.
pub(crate) struct Speckle<const P: usize> {
    state: u64,
    rho: f64,
    pattern: [Complex<f64>; P],
}

impl<const P: usize> Speckle<P> {
    pub(crate) fn new(seed: u64, rho: f64) -> Self {
        let zero = Complex::new(0.0, 0.0);
        let state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) + 1;
        let mut speckle = Self { state, rho, pattern: [zero; P] };
        speckle.pattern = speckle.noise();
        speckle
    }

    /// The next pattern, turned by `phase`, and additive noise of the power `noise`.
    pub(crate) fn frame<T: Real>(&mut self, phase: f64, noise: f64) -> [Complex<T>; P] {
        let fresh = self.noise();
        let (old, new) = (self.rho, libm::sqrt(1.0 - self.rho * self.rho));
        for (u, fresh) in self.pattern.iter_mut().zip(fresh) {
            *u = *u * old + fresh * new;
        }
        let (turn, added) = (Complex::from_polar(1.0, phase), self.noise());
        core::array::from_fn(|p| {
            let u = self.pattern[p] * turn + added[p] * libm::sqrt(noise);
            Complex { re: T::from_f64(u.re), im: T::from_f64(u.im) }
        })
    }

    /// From now on the pattern falls apart by a factor `rho` per frame.
    pub(crate) fn decay(&mut self, rho: f64) {
        self.rho = rho;
    }

    /// A pattern that has nothing to do with the one before.
    pub(crate) fn replace(&mut self) {
        self.pattern = self.noise();
    }

    fn noise(&mut self) -> [Complex<f64>; P] {
        core::array::from_fn(|_| {
            let radius = libm::sqrt(-libm::log(1.0 - self.uniform()));
            Complex::from_polar(radius, core::f64::consts::TAU * self.uniform())
        })
    }

    /// 0..1, xorshift.
    fn uniform(&mut self) -> f64 {
        self.state ^= self.state << 13;
        self.state ^= self.state >> 7;
        self.state ^= self.state << 17;
        (self.state >> 11) as f64 / (1_u64 << 53) as f64
    }
}
