//! Random fields for the tests of the looks.

use num_complex::Complex32;

/// The next of independent complex numbers, Gaussian with mean square 1: splitmix64, then Box and Muller.
pub fn noise(state: &mut u64) -> Complex32 {
    let mut uniform = || {
        *state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = *state;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f32 / (1_u64 << 53) as f32
    };
    let radius = (-(1.0 - uniform()).ln()).sqrt();
    Complex32::from_polar(radius, std::f32::consts::TAU * uniform())
}
