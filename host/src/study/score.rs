//! How good an estimator was.

/// The errors of one trial.
pub struct Scores {
    /// Error of phi_{N-1} - phi_0, radians.
    end: f64,
    /// Sum of the squared standard scores of all frames but the first, and their number.
    squares: f64,
    frames: usize,
}

impl Scores {
    /// Phases against the first frame, their standard deviations (infinite: not measured, NaN: not told), and the
    /// truth. Where the first frame has no phase the others have one against another frame, which does not count.
    #[must_use]
    pub fn of(phases: &[f64], sigmas: &[f64], truth: &[f64]) -> Self {
        let mut scores = Self { end: f64::NAN, squares: 0.0, frames: 0 };
        if phases.first().is_none_or(|phase| phase.is_nan()) {
            return scores;
        }
        for (i, (&phase, &sigma)) in phases.iter().zip(sigmas).enumerate().skip(1) {
            let error = phase - (truth[i] - truth[0]);
            if !error.is_finite() || sigma.is_infinite() {
                continue;
            }
            if !sigma.is_nan() {
                scores.squares += (error / sigma).powi(2);
                scores.frames += 1;
            }
            if i + 1 == truth.len() {
                scores.end = error;
            }
        }
        scores
    }
}

/// All trials of an estimator.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Score {
    /// Rms error of the end phase over the Cramer-Rao bound.
    pub over_bound: f64,
    /// Its standard error: over_bound / sqrt(2 trials).
    pub standard_error: f64,
    /// Root mean square of error / sigma over all frames; NaN where the estimator tells no standard
    /// deviation.
    pub z: f64,
    /// Trials without an end phase, which do not count.
    pub lost: usize,
}

impl Score {
    pub(super) fn new<'a>(trials: impl Iterator<Item = &'a Scores>, bound: f64) -> Self {
        let (mut square, mut count, mut lost) = (0.0, 0, 0);
        let (mut z, mut frames) = (0.0, 0);
        for trial in trials {
            z += trial.squares;
            frames += trial.frames;
            if trial.end.is_nan() {
                lost += 1;
            } else {
                square += trial.end * trial.end;
                count += 1;
            }
        }
        let rms = (square / f64::from(count)).sqrt();
        let over_bound = rms / bound;
        Self {
            over_bound,
            standard_error: over_bound / (2.0 * f64::from(count)).sqrt(),
            z: (z / frames as f64).sqrt(),
            lost,
        }
    }
}

/// Over the bound ± standard error, root mean square of the scores if there are any, trials lost if there are any.
impl std::fmt::Display for Score {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:.3} ± {:.3}", self.over_bound, self.standard_error)?;
        if !self.z.is_nan() {
            write!(f, ", z {:.2}", self.z)?;
        }
        if self.lost > 0 {
            write!(f, ", {} lost", self.lost)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_taken_over_sigma_and_over_the_bound() {
        let trials = [
            Scores::of(&[0.0, 1.3, 2.5], &[0.0, 0.1, 0.5], &[0.0, 1.0, 2.0]),
            Scores::of(&[0.0, 1.1, 1.5], &[0.0, 0.1, 0.5], &[0.0, 1.0, 2.0]),
        ];
        let score = Score::new(trials.iter(), 0.25);
        assert!((score.over_bound - 2.0).abs() < 1e-12 && score.lost == 0, "{score}");
        assert!((score.z - (12.0_f64 / 4.0).sqrt()).abs() < 1e-9, "{score}");
    }

    /// Frames that are not measured have no score; a series without its first or last frame has no end.
    #[test]
    fn what_is_not_measured_does_not_count() {
        let truth = [0.0, 1.0, 2.0];
        let trials = [
            Scores::of(&[0.0, f64::NAN, 2.5], &[0.0, f64::INFINITY, 0.5], &truth),
            Scores::of(&[f64::NAN, 0.0, 1.0], &[f64::INFINITY, 0.0, 0.1], &truth),
            Scores::of(&[0.0, 1.5, f64::NAN], &[0.0, 0.5, f64::INFINITY], &truth),
        ];
        let score = Score::new(trials.iter(), 0.5);
        assert_eq!((score.over_bound, score.z, score.lost), (1.0, 1.0, 2));
    }
}
