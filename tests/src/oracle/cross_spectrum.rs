//! The cross-spectrum.

use super::series::Series;
use num_complex::Complex;

/// C_U(y,x; t,Δt) = U(y,x; t) U*(y,x; t+Δt), of shape (y, x) (line 720).
///
/// Its phase is φ(t) − φ(t+Δt).
///
/// # Panics
/// If `t + lag` is beyond the last frame.
pub fn cross_spectrum(series: &Series, t: usize, lag: usize) -> Vec<Complex<f64>> {
    let (now, later) = (series.frame(t), series.frame(t + lag));
    now.iter().zip(later).map(|(u, v)| u * v.conj()).collect()
}

/// The phase difference cross-spectrum of two ranges of layers, of shape (y, x) (lines 727–735):
///
/// C^{Z₁−Z₂}(y,x; t,Δt) = (Σ_{z∈Z₁} C(y,x,z; t,Δt)) (Σ_{z∈Z₂} C(y,x,z; t,Δt))*.
///
/// `layers[z]` is the series of layer z, all of one shape; `z1` and `z2` list the layers of Z₁ and
/// Z₂. With Δφ = φ_{Z₁} − φ_{Z₂} its phase is Δφ(t) − Δφ(t+Δt).
///
/// # Panics
/// If a listed layer does not exist or `t + lag` is beyond the last frame.
pub fn layer_difference(
    layers: &[Series],
    z1: &[usize],
    z2: &[usize],
    t: usize,
    lag: usize,
) -> Vec<Complex<f64>> {
    let sum_over = |chosen: &[usize]| {
        let pixels = layers[0].height * layers[0].width;
        let mut sum = vec![Complex::new(0.0, 0.0); pixels];
        for &z in chosen {
            for (sum, c) in sum.iter_mut().zip(cross_spectrum(&layers[z], t, lag)) {
                *sum += c;
            }
        }
        sum
    };
    sum_over(z1).iter().zip(sum_over(z2)).map(|(first, second)| first * second.conj()).collect()
}

/// C/|C|, and 0 where C = 0.
pub(super) fn phasor(c: Complex<f64>) -> Complex<f64> {
    let modulus = c.norm();
    if modulus > 0.0 { c / modulus } else { Complex::new(0.0, 0.0) }
}

/// arg z, and 0 where z = 0 (whatever the signs of its zeros).
pub(super) fn arg(z: Complex<f64>) -> f64 {
    if z.norm() > 0.0 { z.arg() } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::layer_difference;
    use crate::oracle::ensemble::{gaussian_mean_of, mask_mean, mask_mean_of};
    use crate::oracle::fixtures::{ramp, rigid, walking, worst};
    use crate::oracle::paper::phase_from_pairs;
    use crate::oracle::walks::less_reference_mean;
    use crate::oracle::weights::Weighting;

    #[test]
    fn sign_of_the_cross_spectrum() {
        let series = rigid(2, 2, &[0.0, 0.3, 0.5]);
        let pairs = mask_mean(&series, &[true; 4]);
        assert!(worst(&pairs.phase, &[-0.3, -0.5, -0.2]) < 1e-14);
        assert_eq!(pairs.index(1, 1), Some(2));
        assert!(worst(&pairs.phasor, &[1.0; 3]) < 1e-14);
        assert!(worst(&pairs.coherence, &[1.0; 3]) < 1e-14);
    }

    #[test]
    fn layers_are_compared() {
        // Two pairs of layers sharing a motion of 1 rad per frame; theirs differ by a ramp.
        let bulk = ramp(10, 1.0);
        let truth = ramp(10, 0.2);
        let moved: Vec<f64> = bulk.iter().zip(&truth).map(|(bulk, own)| bulk + own).collect();
        let layers = [
            rigid(8, 8, &moved),
            walking(8, 8, &bulk, 1.0, 2),
            rigid(8, 8, &moved),
            walking(8, 8, &bulk, 1.0, 3),
        ];
        let spectrum = |t, lag| layer_difference(&layers, &[0, 2], &[1, 3], t, lag);
        let pairs = mask_mean_of(10, &[true; 64], spectrum);
        let phase = phase_from_pairs(&pairs, 9, Weighting::Fisher, 64.0).phase;
        assert!(worst(&phase, &less_reference_mean(&truth)) < 1e-9);
        let pixels = gaussian_mean_of(10, 8, 8, 2.0, spectrum);
        let phase = phase_from_pairs(&pixels[9], 9, Weighting::Fisher, 64.0).phase;
        assert!(worst(&phase, &less_reference_mean(&truth)) < 1e-9);
    }
}
