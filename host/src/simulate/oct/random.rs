//! Random numbers of the recording: each a function of seed, purpose and two counters.

use crate::simulate::philox::{key, philox4x32};
use crate::simulate::vector_math::normal_pair;

/// What random words are for; the last word of the counter.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum Purpose {
    /// Where the scatterers are at first.
    Start = 0x100,
    /// Their random step from sweep to sweep.
    Walk,
    /// Shot and read noise.
    Noise,
    /// Gain of the pixels.
    Gain,
    /// Parasitic fringes.
    FixedFringes,
    /// Motion of the eye, sweep by sweep.
    Motion,
    /// Course of drift, torsion and saccades.
    Course,
    /// Power of the source.
    Power,
    /// Which sweeps fail.
    Faults,
    /// Which pixels are dead, and how.
    DeadPixels,
}

/// The random numbers of one purpose.
#[derive(Debug, Clone, Copy)]
pub struct Random {
    key: [u32; 2],
    purpose: Purpose,
}

impl Random {
    /// Those of `purpose` under `seed`.
    pub const fn new(seed: u64, purpose: Purpose) -> Self {
        Self { key: key(seed), purpose }
    }

    /// Four words of the counter (i, j, k).
    #[inline(always)]
    pub fn words(&self, i: u32, j: u32, k: u32) -> [u32; 4] {
        philox4x32([i, j, k, self.purpose as u32], self.key)
    }

    /// Uniform in [0, 1).
    pub fn uniform(&self, i: usize, j: usize) -> f64 {
        f64::from(self.words(i as u32, j as u32, 0)[0]) / 4_294_967_296.0
    }

    /// Uniform in [−1, 1).
    pub fn symmetric(&self, i: usize, j: usize) -> f64 {
        2.0 * self.uniform(i, j) - 1.0
    }

    /// Uniform in [low, high).
    pub fn between(&self, [low, high]: [f64; 2], i: usize, j: usize) -> f64 {
        low + (high - low) * self.uniform(i, j)
    }

    /// Standard normal.
    pub fn normal(&self, i: usize, j: usize) -> f64 {
        let words = self.words(i as u32, j as u32, 0);
        f64::from(normal_pair([words[0], words[1]])[0])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counters_and_purposes_differ() {
        let [a, b] = [Purpose::Motion, Purpose::Power].map(|purpose| Random::new(1, purpose));
        assert_ne!(a.uniform(0, 0), b.uniform(0, 0));
        assert_ne!(a.uniform(0, 1), a.uniform(1, 0));
        assert_ne!(a.uniform(0, 1), Random::new(2, Purpose::Motion).uniform(0, 1));
    }

    #[test]
    fn limits_hold() {
        let random = Random::new(3, Purpose::Course);
        for i in 0..1000 {
            assert!((0.0..1.0).contains(&random.uniform(i, 0)));
            assert!((15.0..40.0).contains(&random.between([15.0, 40.0], i, 1)));
            assert!(random.normal(i, 2).abs() < 6.6);
        }
    }
}
