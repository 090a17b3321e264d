//! Seeded random numbers (SplitMix64): the same series on every machine.

use num_complex::Complex;
use std::f64::consts::{PI, TAU};

/// A stream of random numbers.
#[derive(Clone, Debug)]
pub struct Random(u64);

impl Random {
    /// The stream of this seed.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// 64 random bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Uniform in 0..1.
    pub fn uniform(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Uniform in -pi..pi.
    pub fn phase(&mut self) -> f64 {
        TAU * self.uniform() - PI
    }

    /// Circular complex Gaussian with mean |z|^2 = 1: fully developed speckle.
    pub fn speckle(&mut self) -> Complex<f64> {
        let radius = (-(1.0 - self.uniform()).ln()).sqrt();
        Complex::from_polar(radius, self.phase())
    }
}
