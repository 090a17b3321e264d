//! The estimators against the Cramér–Rao bound, in every scenario of the study.

use super::settings::Settings;
use crate::error::Result;
use crate::progress::Progress;
use crate::report::Table;
use crate::study::{Estimator, Scenario, Score, run, scenarios};

/// Looks behind the averages: a region of a small image, and of a large one.
pub const LOOKS: [usize; 2] = [100, 1000];

/// One line of the table.
#[derive(Clone, Debug)]
pub struct BoundRow {
    /// Name of the scenario.
    pub scenario: &'static str,
    /// Looks.
    pub looks: usize,
    /// Bound of the standard deviation of φ_{N-1} − φ_0, radians.
    pub bound_rad: f64,
    /// By each of [`Estimator::ALL`].
    pub scores: Vec<Score>,
}

/// Try everything; results depend on the settings' seed and trials only.
///
/// # Errors
/// Not enough memory, or the user's interruption.
pub fn compute(settings: &Settings) -> Result<Vec<BoundRow>> {
    let scenarios = scenarios();
    let entries = scenarios.iter().flat_map(|scenario| LOOKS.map(|looks| (scenario, looks)));
    let steps = scenarios.len() * LOOKS.len() * settings.trials;
    let bar = Progress::new("Cramér–Rao bound", steps as u64);
    let seed = settings.setup.scene.seed;
    let row = |(scenario, looks): (&Scenario, usize)| {
        Ok(BoundRow {
            scenario: scenario.name,
            looks,
            bound_rad: scenario.bound(looks as f64),
            scores: run(scenario, &Estimator::ALL, looks, settings.trials, seed, &bar)?,
        })
    };
    entries.map(row).collect()
}

/// The rows as a table: rms error of the end phase over the bound ± its standard error.
#[must_use]
pub fn table(rows: &[BoundRow], trials: usize) -> Table {
    let header = ["scenario", "looks", "bound, rad"].into_iter().map(str::to_owned);
    let names = Estimator::ALL.map(|estimator| estimator.name().to_owned());
    let cells = |row: &BoundRow| {
        let name = row.scenario.to_owned();
        let first = vec![name, row.looks.to_string(), format!("{:.4}", row.bound_rad)];
        first.into_iter().chain(row.scores.iter().map(entry)).collect()
    };
    Table {
        caption: format!(
            "Rms error of the end phase over the Cramér\u{2013}Rao bound, {trials} trials"
        ),
        header: header.chain(names).collect(),
        rows: rows.iter().map(cells).collect(),
    }
}

fn entry(score: &Score) -> String {
    if score.over_bound.is_nan() {
        return "all lost".to_owned();
    }
    let lost = if score.lost > 0 { format!(", {} lost", score.lost) } else { String::new() };
    format!("{:.2} ± {:.2}{lost}", score.over_bound, score.standard_error)
}
