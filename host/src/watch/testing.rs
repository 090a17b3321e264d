//! Simulated frames, the same on every run.

use num_complex::Complex32;

/// Frames of so many pixels whose speckle falls apart by the factor `rho` from one to the next, turned by
/// `phase(frame, pixel)`, rad.
pub(crate) fn frames(
    count: usize,
    pixels: usize,
    rho: f32,
    phase: impl Fn(usize, usize) -> f32,
) -> Vec<Vec<Complex32>> {
    let mut chance = Chance(1);
    let mut pattern: Vec<Complex32> = (0..pixels).map(|_| chance.speckle()).collect();
    let mut all = Vec::new();
    for frame in 0..count {
        let turned = pattern.iter().enumerate();
        all.push(turned.map(|(i, &u)| u * Complex32::from_polar(1.0, phase(frame, i))).collect());
        for u in &mut pattern {
            *u = *u * rho + chance.speckle() * (1.0 - rho * rho).sqrt();
        }
    }
    all
}

/// A linear congruential generator.
struct Chance(u64);

impl Chance {
    fn uniform(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        ((self.0 >> 40) as f32 + 0.5) / (1 << 24) as f32
    }

    /// Circular, of unit variance (Box and Muller).
    fn speckle(&mut self) -> Complex32 {
        let radius = (-self.uniform().ln()).sqrt();
        Complex32::from_polar(radius, std::f32::consts::TAU * self.uniform())
    }
}
