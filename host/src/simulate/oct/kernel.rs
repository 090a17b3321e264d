//! The kernel that spreads a point over a regular grid, and its transform.
//!
//! A sum Σ a exp(2πi f u) over points u between the grid's nodes is the transform of the points
//! spread over the nodes with a compact kernel φ, divided by φ̂(f) (Dutt and Rokhlin 1993; Kaiser
//! and Bessel's window as in Beatty, Nishimura and Pauly 2005). Valid for |f| ≤ ¼ cycle per node.

use std::f64::consts::PI;

/// Nodes that a point reaches.
pub const TAPS: usize = 5;
/// Rows of the table per node.
const STEPS: usize = 1024;
/// Panels of the quadrature of φ̂.
const PANELS: usize = 400;

/// φ tabulated for every offset between point and nodes.
pub struct Kernel {
    table: Vec<[f32; TAPS]>,
}

impl Kernel {
    pub fn new() -> Self {
        let row = |step: usize| {
            let offset = step as f64 / STEPS as f64;
            std::array::from_fn(|tap| window(TAPS as f64 / 2.0 - offset - tap as f64) as f32)
        };
        Self { table: (0..=STEPS).map(row).collect() }
    }

    /// First node that the point `u` reaches, and the weights of that node and the next ones.
    #[inline(always)]
    pub fn spread(&self, u: f32) -> (i32, [f32; TAPS]) {
        let start = u - TAPS as f32 / 2.0;
        let first = start.ceil();
        let position = (first - start) * STEPS as f32;
        let row = (position as usize).min(STEPS - 1);
        let rest = position - row as f32;
        let (low, high) = (&self.table[row], &self.table[row + 1]);
        (first as i32, std::array::from_fn(|tap| low[tap] + rest * (high[tap] - low[tap])))
    }
}

/// φ(u) = I₀(β √(1 − (2u/w)²)) / I₀(β), zero for |u| > w/2.
fn window(u: f64) -> f64 {
    let x = 2.0 * u / TAPS as f64;
    let inside = 1.0 - x * x;
    if inside < 0.0 { 0.0 } else { bessel_i0(shape() * libm::sqrt(inside)) / bessel_i0(shape()) }
}

/// β for twofold oversampling, π √(w²/σ² (σ − ½)² − 0.8), σ = 2 (Beatty 2005, equation 5).
fn shape() -> f64 {
    let half = TAPS as f64 / 2.0;
    PI * libm::sqrt(half * half * 2.25 - 0.8)
}

/// Modified Bessel function of order zero by its power series.
fn bessel_i0(x: f64) -> f64 {
    let quarter = x * x / 4.0;
    let (mut term, mut sum) = (1.0, 1.0);
    for n in 1..60 {
        term *= quarter / f64::from(n * n);
        sum += term;
    }
    sum
}

/// φ̂(f) = ∫ φ(u) cos(2πfu) du, f in cycles per node (Simpson's rule).
pub fn transform(f: f64) -> f64 {
    let step = TAPS as f64 / 2.0 / PANELS as f64;
    let at = |i: usize| {
        let u = i as f64 * step;
        window(u) * libm::cos(2.0 * PI * f * u)
    };
    let weight = |i: usize| if i % 2 == 1 { 4.0 } else { 2.0 };
    let inner: f64 = (1..PANELS).map(|i| weight(i) * at(i)).sum();
    2.0 * step / 3.0 * (at(0) + inner + at(PANELS))
}

#[cfg(test)]
mod tests {
    use super::*;
    use num_complex::Complex64;

    #[test]
    fn the_weights_are_those_of_the_window() {
        let kernel = Kernel::new();
        for i in 0..2000 {
            let u = -3.0 + i as f32 * 0.00731;
            let (first, weights) = kernel.spread(u);
            for (tap, weight) in weights.iter().enumerate() {
                let want = window(f64::from(u) - f64::from(first) - tap as f64);
                assert!((f64::from(*weight) - want).abs() < 1e-5, "{u}: {weight}, {want}");
            }
        }
    }

    /// exp(2πi f u) from its spread-out form, for all positions and |f| ≤ ¼.
    #[test]
    fn a_wave_is_recovered() {
        let kernel = Kernel::new();
        for i in 0..200 {
            let u = 10.0 + f64::from(i) * 0.01371;
            let f = -0.25 + 0.5 * f64::from(i) / 199.0;
            let (first, weights) = kernel.spread(u as f32);
            let wave = |u: f64| Complex64::from_polar(1.0, 2.0 * PI * f * u);
            let sum: Complex64 = (0..TAPS)
                .map(|tap| wave((first + tap as i32).into()) * f64::from(weights[tap]))
                .sum();
            let error = (sum / transform(f) - wave(u)).norm();
            assert!(error < 1e-3, "f {f}, u {u}: {error:e}");
        }
    }
}
