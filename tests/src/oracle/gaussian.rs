//! The circular convolution with a Gaussian.

use num_complex::Complex;

/// The kernel exp(−d²/(2σ²)) along one axis of `length` pixels, at d = 0 … `length`−1, wrapped
/// around (the sum over d + every multiple of `length`) and normalised to sum 1 (line 753).
///
/// # Panics
/// If `sigma_px` is not positive or `length` is 0.
pub fn gaussian_kernel(length: usize, sigma_px: f64) -> Vec<f64> {
    assert!(sigma_px > 0.0 && sigma_px.is_finite(), "σ must be positive");
    assert!(length > 0, "an axis must have pixels");
    // exp(−d²/(2σ²)) < 1e−18 for d > 9.2 σ.
    let images = (9.2 * sigma_px / length as f64).ceil() as i64 + 1;
    let mut kernel = vec![0.0; length];
    for (d, value) in kernel.iter_mut().enumerate() {
        for image in -images..=images {
            let distance = d as f64 + (image * length as i64) as f64;
            *value += (-distance * distance / (2.0 * sigma_px * sigma_px)).exp();
        }
    }
    let sum: f64 = kernel.iter().sum();
    kernel.iter().map(|value| value / sum).collect()
}

/// G ∗ image, the circular convolution in x and y with a sampled Gaussian of variance σ² (line
/// 753): result(y,x) = Σ_{y′,x′} g_y(y−y′) g_x(x−x′) image(y′,x′), indices modulo the size, g from
/// [`gaussian_kernel`]. `image` is of shape (y, x), σ in pixels.
///
/// # Panics
/// If `sigma_px` is not positive or the image has the wrong size.
pub fn gaussian_filter(
    image: &[Complex<f64>],
    height: usize,
    width: usize,
    sigma_px: f64,
) -> Vec<Complex<f64>> {
    assert_eq!(image.len(), height * width, "the image must be height × width");
    let circulant = |length: usize| -> Vec<Vec<f64>> {
        let kernel = gaussian_kernel(length, sigma_px);
        let entry = |to: usize, from: usize| kernel[(length + to - from) % length];
        (0..length).map(|to| (0..length).map(|from| entry(to, from)).collect()).collect()
    };
    let (along_y, along_x) = (circulant(height), circulant(width));
    let nought = Complex::new(0.0, 0.0);
    let mut smooth_in_x = vec![nought; height * width];
    for y in 0..height {
        let line = &image[y * width..(y + 1) * width];
        for x in 0..width {
            let products = along_x[x].iter().zip(line).map(|(g, value)| value * g);
            smooth_in_x[y * width + x] = products.sum();
        }
    }
    let mut smooth = vec![nought; height * width];
    for y in 0..height {
        for (from, &g) in along_y[y].iter().enumerate() {
            for x in 0..width {
                smooth[y * width + x] += smooth_in_x[from * width + x] * g;
            }
        }
    }
    smooth
}

#[cfg(test)]
mod tests {
    use super::{gaussian_filter, gaussian_kernel};
    use crate::oracle::fixtures::Random;
    use num_complex::Complex;

    #[test]
    fn gaussian_of_a_constant() {
        let value = Complex::new(0.7, -1.3);
        for (height, width, sigma) in [(5, 8, 0.3), (12, 7, 2.0), (4, 3, 25.0), (1, 6, 1.0)] {
            let smooth = gaussian_filter(&vec![value; height * width], height, width, sigma);
            assert!(smooth.iter().all(|c| (c - value).norm() < 1e-14));
        }
    }

    #[test]
    fn gaussian_is_the_periodic_sum() {
        let (height, width, sigma) = (9, 12, 2.3);
        let mut random = Random(9);
        let image: Vec<_> = (0..height * width).map(|_| random.gaussian()).collect();
        let smooth = gaussian_filter(&image, height, width, sigma);
        // The image repeated endlessly (±4 times is enough), and the plain 2-D kernel.
        let reach = |length: usize| 4 * length as i64;
        for (y, x) in [(0, 0), (4, 11), (8, 6)] {
            let mut sum = Complex::new(0.0, 0.0);
            let mut norm = 0.0;
            for dy in -reach(height)..=reach(height) {
                for dx in -reach(width)..=reach(width) {
                    let g = (-((dy * dy + dx * dx) as f64) / (2.0 * sigma * sigma)).exp();
                    let from_y = (y as i64 - dy).rem_euclid(height as i64) as usize;
                    let from_x = (x as i64 - dx).rem_euclid(width as i64) as usize;
                    sum += image[from_y * width + from_x] * g;
                    norm += g;
                }
            }
            assert!((smooth[y * width + x] - sum / norm).norm() < 1e-13);
        }
        // Variance of the kernel, in a window wide enough: σ².
        let kernel = gaussian_kernel(64, sigma);
        let variance: f64 =
            (-32..32i64).map(|d| (d * d) as f64 * kernel[d.rem_euclid(64) as usize]).sum();
        assert!((variance - sigma * sigma).abs() < 1e-9);
    }
}
