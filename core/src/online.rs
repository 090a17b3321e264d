//! The on-line solver: the one tracker that the trigger board runs beside the camera and the host runs
//! to check it. Both take it from here, so that their `f32` results are the same bits.
//!
//! Volumes are numbered 0, 1, 2, …, and these numbers are their times: phase linking by [`crate::tracker`], with
//! its defaults, a window of 16 volumes and the anchor; without jumps of the pattern and without cosines, which would take
//! time and memory. What it takes of `libm` (e^x, logarithm, sine and cosine, arc tangent, rounding) is the same bits on
//! every machine, as is all other arithmetic of IEEE 754.

use crate::error::Error;
use crate::scalar::Real;
use crate::tracker::{Estimate, FieldTracker, NODES, TrackerSettings};
use num_complex::Complex;

/// Speckles of a volume at most.
pub const SPECKLES: usize = 64;

/// Volumes of the window: pairs of volumes up to so many apart are used one by one, older volumes through the
/// anchor.
pub const LAGS: usize = NODES - 1;

/// Looks of a volume at least. Two patterns that have nothing in common show a coherence of sqrt(pi / (4 L)) in
/// the mean; from nine looks on that is below 0.3, the quality from which a volume counts as usable.
pub const FEWEST_LOOKS: f64 = 9.0;

/// The on-line solver: speckles in, phase out, volume by volume.
#[derive(Clone, Debug)]
pub struct OnlineTracker<T>(FieldTracker<T, SPECKLES, NODES, 0>);

impl<T: Real> OnlineTracker<T> {
    /// Before the first volume.
    ///
    /// # Errors
    /// Those of [`check`].
    pub fn new(speckles: usize, looks: f64) -> Result<Self, Error> {
        check(speckles, looks)?;
        let settings = TrackerSettings::for_looks(looks, 1.0);
        FieldTracker::new(TrackerSettings { jumps: false, periodic: false, ..settings }).map(Self)
    }

    /// Take the next volume and say where the phase is now.
    ///
    /// Speckles beyond [`SPECKLES`] are left out; those that are not finite are dark.
    pub fn push(&mut self, volume: &[Complex<T>]) -> Estimate<T> {
        let frame = self.0.tracker().frames();
        // Cannot fail: their numbers ascend. A phase that is no number would be beyond every limit.
        self.0.push(volume, frame as f64, |_| ()).unwrap_or(Estimate {
            frame,
            phase_rad: T::from_f64(f64::NAN),
            sigma_rad: T::from_f64(f64::INFINITY),
            quality: T::zero(),
        })
    }
}

/// Can volumes of `speckles` speckles that count as `looks` independent ones be solved?
///
/// # Errors
/// Names the number that is out of its range: there are at most [`SPECKLES`] speckles and not more looks than
/// speckles, and with fewer than [`FEWEST_LOOKS`] chance passes for coherence.
pub fn check(speckles: usize, looks: f64) -> Result<(), Error> {
    if speckles == 0 || speckles > SPECKLES {
        let value = speckles as f64;
        return Err(Error { parameter: "number of speckles", value, allowed: "1 to 64" });
    }
    let fail = |allowed| Err(Error { parameter: "looks", value: looks, allowed });
    if looks.is_nan() || looks > speckles as f64 {
        return fail("at most the number of speckles");
    }
    if looks < FEWEST_LOOKS {
        return fail("at least 9, or chance passes for coherence");
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tracker::testing::Speckle;

    /// A speckle of a volume: a pattern that slowly falls apart, and a phase that grows.
    fn speckle<T: Real>(volume: usize, number: usize) -> Complex<T> {
        let (t, n) = (volume as f64, number as f64);
        let turn = 0.1 * t + 2.4 * n * n + 0.02 * t * libm::sin(3.7 * n);
        let size = 1.0 + 0.9 * libm::sin(n + 0.05 * t);
        let part = |x: f64| T::from_f64(size * x);
        Complex { re: part(libm::cos(turn)), im: part(libm::sin(turn)) }
    }

    #[test]
    fn the_numbers_have_ranges() {
        let refused = |speckles, looks, name| {
            let error = OnlineTracker::<f32>::new(speckles, looks).unwrap_err();
            assert_eq!(error.parameter, name, "{error}");
        };
        refused(0, 12.0, "number of speckles");
        refused(65, 65.0, "number of speckles");
        refused(64, 65.0, "looks");
        refused(64, 8.5, "looks");
        refused(64, -1.0, "looks");
        refused(8, 8.0, "looks");
        refused(64, f64::NAN, "looks");
        assert!(OnlineTracker::<f32>::new(9, 9.0).is_ok());
        assert!(OnlineTracker::<f64>::new(64, 64.0).is_ok());
    }

    #[test]
    fn fewer_speckles_than_there_is_room_for_give_the_same_bits_as_a_tracker_made_for_them() {
        let settings = TrackerSettings::for_looks(50.0, 1.0);
        let settings = TrackerSettings { periodic: false, ..settings };
        let mut exact = FieldTracker::<f32, 50, NODES>::new(settings).unwrap();
        let mut roomy = OnlineTracker::<f32>::new(50, 50.0).unwrap();
        for volume in 0..70 {
            let field: [_; 50] = core::array::from_fn(|n| speckle(volume, n));
            let expected = exact.push(&field, volume as f64, |_| ()).unwrap();
            let got = roomy.push(&field);
            assert_eq!(got.phase_rad.to_bits(), expected.phase_rad.to_bits(), "volume {volume}");
            assert_eq!(got.sigma_rad.to_bits(), expected.sigma_rad.to_bits(), "volume {volume}");
        }
        let last = roomy.push(&core::array::from_fn::<_, 50, _>(|n| speckle(70, n)));
        assert!((last.phase_rad - (7.0 - 0.2)).abs() < 0.2, "{last:?}");
    }

    /// Phase of a volume that grows and trembles, rad.
    fn truth(volume: usize) -> f64 {
        let t = volume as f64;
        0.08 * t + 0.4 * libm::sin(0.3 * t)
    }

    /// After 70 volumes of `LOOKS` independent speckles whose patterns are correlated by `rho` from one to the next,
    /// over the bound of the random walk: rms error, rms of the standard deviation said.
    fn errors<const LOOKS: usize>(rho: f64) -> (f64, f64) {
        const RUNS: u64 = 100;
        let reference = (0..5).map(truth).sum::<f64>() / 5.0;
        let (mut error, mut said) = (0.0, 0.0);
        for seed in 0..RUNS {
            let mut speckle = Speckle::<LOOKS>::new(seed, rho);
            let mut tracker = OnlineTracker::<f32>::new(LOOKS, LOOKS as f64).unwrap();
            let estimates = (0..70).map(|t| tracker.push(&speckle.frame(truth(t), 0.0)));
            let last = estimates.last().unwrap();
            error += (f64::from(last.phase_rad) - (truth(69) - reference)).powi(2);
            said += f64::from(last.sigma_rad).powi(2);
        }
        // A step from volume to volume has this variance; those among the five of the reference count in part.
        let step = (1.0 - rho * rho) / (2.0 * rho * rho * LOOKS as f64);
        let bound = 66.2 * step * RUNS as f64;
        let (error, said) = (libm::sqrt(error / bound), libm::sqrt(said / bound));
        std::println!("{LOOKS} looks, {rho}: error {error:.2}, said {said:.2} of the bound");
        (error, said)
    }

    #[test]
    fn errors_are_near_the_bound_with_many_looks_and_with_the_fewest() {
        for (error, said) in [errors::<64>(0.9), errors::<64>(0.7), errors::<9>(0.97)] {
            assert!(error < 1.35, "{error}");
            assert!(said > 0.6 * error && said < 1.1 * error, "{said} {error}");
        }
    }
}
