//! How near the estimators come to the Cramér–Rao bound: a seeded Monte Carlo over circular Gaussian speckle of known
//! coherence.
//!
//! | file | what it holds |
//! |---|---|
//! | `scenario` | coherence matrices, phases and times of the series that are tried |
//! | `sample` | one random series of L looks: its mean cross-spectra |
//! | `estimators` | what is tried on it |
//! | `tracked` | the tracker, fed with cross-spectra |
//! | `peers` | estimators of others: EVD, EMI, tapered EMI, banded covariance fitting |
//! | `layers` | the difference of two layers, from fields as a region has them |
//! | `score` | errors of the end phase over the bound, and how true the standard deviations are |

mod estimators;
mod layers;
mod peers;
mod sample;
mod scenario;
mod score;
mod tracked;

pub use estimators::Estimator;
pub use layers::{Tilt, run_layers};
pub use peers::Peer;
pub use scenario::{Kind, Scenario, scenarios};
pub use score::{Score, Scores};

use crate::error::Result;
use crate::progress::Progress;
use rayon::prelude::*;
use sample::{Draw, Sample};

/// Try the estimators on `trials` random series of the scenario; one step of progress each.
///
/// The random numbers depend on `seed` and the trial alone.
///
/// # Errors
/// Not enough memory, or the user's interruption.
pub fn run(
    scenario: &Scenario,
    estimators: &[Estimator],
    looks: usize,
    trials: usize,
    seed: u64,
    progress: &Progress,
) -> Result<Vec<Score>> {
    let root = scenario.root();
    let trial = |number: usize| -> Result<Vec<Scores>> {
        let phase = &scenario.phase;
        let sample = Sample::draw(Draw { root: &root, phase, looks, seed, trial: number })?;
        let mut scores = Vec::new();
        for estimator in estimators {
            let (phases, sigmas) = estimator.estimate(scenario, &sample, looks as f64)?;
            scores.push(Scores::of(&phases, &sigmas, &scenario.phase));
        }
        progress.advance(1)?;
        Ok(scores)
    };
    let all: Result<Vec<Vec<Scores>>> = (0..trials).into_par_iter().map(trial).collect();
    let all = all?;
    let bound = scenario.bound(looks as f64);
    Ok((0..estimators.len())
        .map(|which| Score::new(all.iter().map(|scores| &scores[which]), bound))
        .collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::method::Method;

    /// 60 series: the standard error of an rms is 9 %, of a score's standard deviation less.
    const TRIALS: usize = 60;

    #[test]
    fn linked_and_tracked_phases_are_near_the_bound_and_eigenvectors_are_not() {
        let scenario = &scenarios()[0];
        let estimators =
            [Estimator::Own(Method::Linked), Estimator::Tracker, Estimator::Peer(Peer::Evd)];
        let progress = Progress::hidden();
        let scores = run(scenario, &estimators, 300, TRIALS, 1, &progress).unwrap();
        for score in &scores[..2] {
            assert!((0.75..1.25).contains(&score.over_bound), "{score}");
            assert!((0.85..1.15).contains(&score.z), "{score}");
        }
        assert!(scores[2].over_bound > 2.0 && scores[2].z.is_nan(), "{}", scores[2]);
    }

    #[test]
    fn two_layers_are_near_their_bound_and_a_tilt_does_not_matter() {
        for across_rad in [0.0, 3.0] {
            let progress = Progress::hidden();
            let tilt = Tilt { across_rad };
            let score = run_layers(&scenarios()[1], 20, tilt, TRIALS, 1, &progress).unwrap();
            assert!((0.75..1.3).contains(&score.over_bound), "{score}");
            assert!((0.75..1.15).contains(&score.z), "{score}");
        }
    }
}
