//! How fast the speckle pattern falls apart: the autocorrelation of the field (paper, Fig. 3 i–k).

use crate::error::{Error, Result};
use num_complex::{Complex32, Complex64};
use rayon::prelude::*;

/// Amplitude of the field's autocorrelation at each of `lags`, averaged over t,
///
/// |Σ U_t U*_{t+l}| / √(Σ |U_t|² Σ |U_{t+l}|²), Σ over the pixels.
///
/// `fields` has the shape (time, pixel) with `pixels` per frame. With `Some(mask)` only the pixels
/// that are `true` count: inside a region that moves as a whole the amplitude is the same, but a sum
/// over both regions mixes two phases and is too small. The amplitude of unrelated patterns does
/// not average to 0 but to about √(π/4L), L the number of independent speckles. A pair of frames
/// of which one is dark throughout makes the result `NaN`, as does a mask without a pixel.
///
/// # Errors
/// When the shapes do not agree, or a lag leaves no pair of frames.
pub fn coherence_at_lags(
    fields: &[Complex32],
    pixels: usize,
    lags: &[usize],
    mask: Option<&[bool]>,
) -> Result<Vec<f64>> {
    if pixels == 0 || !fields.len().is_multiple_of(pixels) {
        return Err(Error::failed(format!(
            "autocorrelation: {} values are no whole number of frames of {pixels} pixels",
            fields.len()
        )));
    }
    if let Some(mask) = mask.filter(|mask| mask.len() != pixels) {
        return Err(Error::failed(format!(
            "autocorrelation: the mask has {} pixels, the frames have {pixels}",
            mask.len()
        )));
    }
    // Taken out once: every frame is needed in many pairs.
    let inside = mask.map(|mask| -> Vec<Complex32> {
        let masked = fields.iter().zip(mask.iter().cycle());
        masked.filter(|&(_, &inside)| inside).map(|(&u, _)| u).collect()
    });
    let (fields, pixels) = match (&inside, mask) {
        (Some(inside), Some(mask)) => (inside.as_slice(), mask.iter().filter(|&&m| m).count()),
        _ => (fields, pixels),
    };
    if pixels == 0 {
        return Ok(vec![f64::NAN; lags.len()]);
    }
    let frames: Vec<&[Complex32]> = fields.chunks_exact(pixels).collect();
    lags.iter().map(|&lag| coherence_at_lag(&frames, lag)).collect()
}

/// Mean over t of the coherence of frames t and t + `lag`.
fn coherence_at_lag(frames: &[&[Complex32]], lag: usize) -> Result<f64> {
    let later = frames.get(lag..).filter(|later| !later.is_empty()).ok_or_else(|| {
        Error::usage(format!(
            "autocorrelation at lag {lag}: needs more than {lag} frames, there are {}",
            frames.len()
        ))
    })?;
    let pairs: Vec<f64> = frames.par_iter().zip(later).map(|(a, b)| coherence(a, b)).collect();
    Ok(pairs.iter().sum::<f64>() / pairs.len() as f64)
}

/// |Σ a b*| / √(Σ |a|² Σ |b|²).
fn coherence(a: &[Complex32], b: &[Complex32]) -> f64 {
    let (mut product, mut power_a, mut power_b) = (Complex64::ZERO, 0.0, 0.0);
    for (a, b) in a.iter().zip(b) {
        let [a, b] = [a, b].map(|u| Complex64::new(f64::from(u.re), f64::from(u.im)));
        product += a * b.conj();
        power_a += a.norm_sqr();
        power_b += b.norm_sqr();
    }
    product.norm() / (power_a * power_b).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    const FIELDS: [Complex32; 6] = [
        Complex32::new(1.0, 0.0),
        Complex32::new(0.0, 2.0),
        Complex32::new(0.0, 1.0),
        Complex32::new(-2.0, 0.0),
        Complex32::new(1.0, 0.0),
        Complex32::new(0.0, -2.0),
    ];

    #[test]
    fn a_common_phase_does_not_matter() {
        let got = coherence_at_lags(&FIELDS, 2, &[0, 1, 2], None).unwrap();
        // Frame 1 is i times frame 0; frame 2 has the sign of its second pixel changed.
        let want = [1.0, (1.0 + 0.6) / 2.0, 0.6];
        assert!(got.iter().zip(want).all(|(got, want)| (got - want).abs() < 1e-12), "{got:?}");
    }

    #[test]
    fn the_mask_chooses_pixels() {
        let got = coherence_at_lags(&FIELDS, 2, &[2], Some(&[true, false])).unwrap();
        assert!((got[0] - 1.0).abs() < 1e-12);
        assert!(coherence_at_lags(&FIELDS, 2, &[2], Some(&[false; 2])).unwrap()[0].is_nan());
    }

    #[test]
    fn bad_shapes_are_errors() {
        assert!(coherence_at_lags(&FIELDS, 0, &[0], None).is_err());
        assert!(coherence_at_lags(&FIELDS, 4, &[0], None).is_err());
        assert!(coherence_at_lags(&FIELDS, 2, &[3], None).is_err());
        assert!(coherence_at_lags(&[], 2, &[0], None).is_err());
        assert!(coherence_at_lags(&FIELDS, 2, &[usize::MAX], None).is_err());
        assert!(coherence_at_lags(&FIELDS, 2, &[0], Some(&[true])).is_err());
    }
}
