//! One scene of Figure 3: only what is averaged over its x.

use super::methods::{ByMethod, by_method};
use super::settings::{SIGMAS, Settings};
use super::store::Store;
use crate::demo::{Evaluation, Recording};
use crate::error::Result;
use crate::progress::Progress;

/// What one scene contributes to Figure 3, one value per frame each.
#[derive(Clone, Debug, PartialEq)]
pub struct Run {
    /// Phase of the x by each method, radians; the mean of the first five frames is 0.
    pub phases: ByMethod<Vec<f64>>,
    /// Amplitude of the autocorrelation inside the x by lag, 1 at lag 0 (Figure 3, i-k).
    pub autocorrelation: Vec<f64>,
}

impl Run {
    /// Simulate and evaluate; the frames are forgotten. `progress` moves by one per frame.
    ///
    /// # Errors
    /// Those of the simulation, and the user's interruption.
    pub fn compute(
        settings: &Settings,
        sigma: usize,
        number: usize,
        progress: &Progress,
    ) -> Result<Self> {
        let recording = Recording::simulate(settings.scene(sigma, number), progress)?;
        let evaluation = Evaluation::new(&settings.setup, &recording)?;
        let region = evaluation.region()?;
        let curve = |method| evaluation.curve(&region, method, &Progress::hidden());
        let phases = by_method(|method| Ok(curve(method)?.phase_rad))?;
        drop(region);
        drop(evaluation);
        Ok(Self { phases, autocorrelation: recording.autocorrelation })
    }
}

/// Compute the runs that are not there yet. All σ of a run follow one another, so that what is there
/// when the work ends early is of all.
///
/// # Errors
/// What [`Run::compute`] and [`Store::add`] report.
pub fn complete(settings: &Settings, store: &mut Store) -> Result<()> {
    let keys = (0..settings.runs).flat_map(|run| (0..SIGMAS.len()).map(move |sigma| (sigma, run)));
    let missing: Vec<_> = keys.filter(|&key| store.get(key).is_none()).collect();
    let steps = (missing.len() * settings.setup.scene.frames) as u64;
    let bar = Progress::new(&format!("Figure 3: {} scenes", missing.len()), steps);
    for (sigma, run) in missing {
        store.add((sigma, run), Run::compute(settings, sigma, run, &bar)?)?;
    }
    Ok(())
}
