//! The on-line solver: the one [`Walk`] that the trigger board runs beside the camera and the host runs
//! to check it. Both take it from here, so that their `f32` results are the same bits.

use crate::error::Error;
use crate::params::{Params, RANDOM_PROBABILITY};
use crate::scalar::Scalar;
use crate::walk::Walk;
use crate::weights::{Weighting, Weights};

/// Speckles of a volume at most.
pub const SPECKLES: usize = 64;

/// Largest lag: pairs of volumes up to so many apart are used.
pub const LAGS: usize = 16;

/// Streaming solution of the on-line solver.
pub type OnlineWalk<T> = Walk<T, SPECKLES, LAGS, { LAGS + 1 }>;

/// The on-line solver before its first volume: the paper's parameters, and [`online_weights`].
///
/// # Errors
/// Those of [`online_weights`].
pub fn online_walk<T: Scalar>(speckles: usize, looks: f64) -> Result<OnlineWalk<T>, Error> {
    Walk::new(Params::paper(LAGS), online_weights(speckles, looks)?, looks)
}

/// The paper's weights for volumes of `speckles` speckles that count as `looks` independent ones, in
/// threshold and standard deviation.
///
/// # Errors
/// Names the number that is out of its range: no mean over fewer than twelve looks can be told from
/// that of random phases, and there are not more looks than speckles.
pub fn online_weights(speckles: usize, looks: f64) -> Result<Weights, Error> {
    if speckles == 0 || speckles > SPECKLES {
        let value = speckles as f64;
        return Err(Error { parameter: "number of speckles", value, allowed: "1 to 64" });
    }
    let fail = |allowed| Err(Error { parameter: "looks", value: looks, allowed });
    if looks.is_nan() || looks > speckles as f64 {
        return fail("at most the number of speckles");
    }
    let weights = Weights::new(Weighting::Paper, looks, RANDOM_PROBABILITY);
    // No mean unit phasor is longer than 1. NaN: below 0 looks.
    if looks > 0.0 && weights.threshold() < 1.0 {
        Ok(weights)
    } else {
        fail("at least 12, or it cannot be told from random phases")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use num_complex::Complex;

    /// A speckle of a volume: a pattern that slowly falls apart, and a phase that grows.
    fn speckle(volume: usize, number: usize) -> Complex<f32> {
        let (t, n) = (volume as f32, number as f32);
        let turn = 0.1 * t + 2.4 * n * n + 0.02 * t * libm::sinf(3.7 * n);
        Complex::from_polar(1.0 + 0.9 * libm::sinf(n + 0.05 * t), turn)
    }

    #[test]
    fn the_numbers_have_ranges() {
        let refused = |speckles, looks, name| {
            let error = online_walk::<f32>(speckles, looks).unwrap_err();
            assert_eq!(error.parameter, name, "{error}");
        };
        refused(0, 12.0, "number of speckles");
        refused(65, 65.0, "number of speckles");
        refused(64, 65.0, "looks");
        refused(64, 11.5, "looks");
        refused(64, -1.0, "looks");
        refused(11, 11.0, "looks");
        refused(64, f64::NAN, "looks");
        assert!(online_walk::<f32>(12, 12.0).is_ok());
        assert!(online_walk::<f64>(64, 64.0).is_ok());
    }

    #[test]
    fn fewer_pixels_than_there_is_room_for_give_the_same_bits_as_a_walk_made_for_them() {
        let weights = Weights::new(Weighting::Paper, 50.0, RANDOM_PROBABILITY);
        let mut exact =
            Walk::<f32, 50, LAGS, { LAGS + 1 }>::new(Params::paper(LAGS), weights, 50.0).unwrap();
        let mut roomy = online_walk::<f32>(50, 50.0).unwrap();
        for volume in 0..70 {
            let field: [Complex<f32>; 50] = core::array::from_fn(|n| speckle(volume, n));
            let (expected, got) = (exact.push(&field), roomy.push(&field));
            assert_eq!(got.phase_rad.to_bits(), expected.phase_rad.to_bits(), "volume {volume}");
            assert_eq!(got.sigma_rad.to_bits(), expected.sigma_rad.to_bits(), "volume {volume}");
        }
        let last = roomy.push(&core::array::from_fn::<_, 50, _>(|n| speckle(70, n)));
        assert!((last.phase_rad - (7.0 - 0.2)).abs() < 0.2, "{last:?}");
    }
}
