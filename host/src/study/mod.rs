//! How near the estimators come to the Cramér–Rao bound: a seeded Monte Carlo over circular Gaussian speckle of known
//! coherence.
//!
//! | file | what it holds |
//! |---|---|
//! | `scenario` | coherence matrices, phases and times of the series that are tried |
//! | `sample` | one random series of L looks: its mean cross-spectra |
//! | `score` | errors of the end phase over the bound, and how true the standard deviations are |

mod sample;
mod scenario;
mod score;

pub use scenario::{Kind, Scenario, scenarios};
pub use score::{Score, Scores};

use crate::curve::{link, phases_of_means};
use crate::error::Result;
use crate::method::{Depths, Method, Plan};
use crate::progress::Progress;
use phasewalk_core::weights::Weighting;
use rayon::prelude::*;
use sample::Sample;

/// The estimators compared, with their names.
pub const ESTIMATORS: [(&str, Method); 4] = [
    ("one-step", Method::OneStep),
    ("paper", Method::Paper(Weighting::Paper)),
    ("paper, fisher weights", Method::Paper(Weighting::Fisher)),
    ("linked", Method::Linked),
];

/// Frames whose mean is the reference: the first alone, so that the end phase is phi_{N-1} - phi_0.
const REFERENCE_FRAMES: usize = 1;

/// Try every estimator on `trials` random series of the scenario; one step of progress each.
///
/// The random numbers depend on `seed` and the trial alone.
///
/// # Errors
/// Not enough memory, or the user's interruption.
pub fn run(
    scenario: &Scenario,
    looks: usize,
    trials: usize,
    seed: u64,
    progress: &Progress,
) -> Result<Vec<Score>> {
    let plans: Result<Vec<Plan>> =
        ESTIMATORS.iter().map(|&(_, method)| plan(scenario, method)).collect();
    let plans = plans?;
    let root = scenario.root();
    let trial = |number: usize| -> Result<Vec<Scores>> {
        let sample = Sample::draw(&root, &scenario.phase, looks, seed, number)?;
        let mut scores = Vec::new();
        for plan in &plans {
            let (phases, sigmas) = estimate(plan, &sample, looks as f64)?;
            scores.push(Scores::of(&phases, &sigmas, &scenario.phase));
        }
        progress.advance(1)?;
        Ok(scores)
    };
    let all: Result<Vec<Vec<Scores>>> = (0..trials).into_par_iter().map(trial).collect();
    let all = all?;
    let bound = scenario.bound(looks as f64);
    Ok((0..plans.len())
        .map(|which| Score::new(all.iter().map(|scores| &scores[which]), bound))
        .collect())
}

fn plan(scenario: &Scenario, method: Method) -> Result<Plan> {
    let frames = scenario.times.len();
    let mut plan = Plan::new(method, frames, None, None, Depths::single())?;
    plan.params.reference_frames = REFERENCE_FRAMES;
    plan.times_s.clone_from(&scenario.times);
    Ok(plan)
}

/// Phases and standard deviations of one series.
fn estimate(plan: &Plan, sample: &Sample, looks: f64) -> Result<(Vec<f64>, Vec<f64>)> {
    if plan.method == Method::Linked {
        let rows = link(&mut sample.cross(), plan, looks)?.rows;
        return Ok(rows.iter().map(|row| (row.phase_rad, row.sigma_rad)).unzip());
    }
    let pairs = plan.pairs();
    let means: Vec<_> = pairs.iter().map(|&(t, s)| sample.pair_mean(t, s)).collect();
    Ok(phases_of_means(plan, &pairs, &means, looks, looks))
}
