//! Motion between two sweeps, with what is known of its error.

use super::feature::Feature;
use super::fit::{self, Peak};
use super::lags::{self, Cell, Side};
use super::motion::Motion;
use super::plan::Plan;

/// Cells are cut anew around a better motion at most this often.
const ROUNDS: usize = 4;
/// Voxels that give all the precision that is asked for.
const VOXELS: usize = 1_000_000;
/// Displacement beyond a cell's own lag that calls for another round, px.
const FAR: f64 = 1.1;
/// Error of a shift along z, y, x for a quality of 1 between weakly correlated features, px;
/// measured.
const ERROR: [f64; 3] = [1.1, 1.25, 1.25];

/// Motion of a later sweep relative to an earlier one.
#[derive(Clone, Copy, Debug, Default, serde::Serialize, serde::Deserialize)]
pub struct PairMotion {
    /// The motion.
    pub motion: Motion,
    /// Height of the correlation's peak over the noise of unrelated sweeps, in sigmas.
    pub quality: f64,
    /// Correlation of the two features at the peak.
    pub correlation: f64,
    /// Inverse covariance of (dz, dy, dx, angle), per px² and rad².
    pub information: [[f64; 4]; 4],
}

impl Feature {
    fn side(&self) -> Side<'_> {
        Side { first: self.first, blocks: &self.blocks, energy: &self.energy }
    }
}

/// Every how many depths serve: large volumes have speckles to spare.
fn step(plan: &Plan) -> usize {
    (plan.voxels() / VOXELS).max(1)
}

/// The motion next to `start`.
pub fn refine(plan: &Plan, earlier: &Feature, later: &Feature, start: Motion) -> PairMotion {
    let mut motion = start;
    let mut pair = PairMotion::default();
    for _ in 0..ROUNDS {
        let cells = lags::cells(plan, earlier.side(), later.side(), motion, step(plan));
        if cells.is_empty() {
            break;
        }
        let (found, peak) = fit::maximise(&cells, motion);
        pair = rated(earlier, later, &cells, found, &peak);
        motion = found;
        if cells.iter().all(|c| fit::beyond(c, found).iter().all(|u| u.abs() < FAR)) {
            break;
        }
    }
    pair
}

fn rated(
    earlier: &Feature,
    later: &Feature,
    cells: &[Cell],
    motion: Motion,
    peak: &Peak,
) -> PairMotion {
    let sum = |of: fn(&Cell) -> f64| cells.iter().map(of).sum::<f64>();
    let energy = (sum(|c| c.energy[0]) * sum(|c| c.energy[1])).sqrt();
    let gain = (earlier.noise.gain * later.noise.gain).sqrt();
    let noise = (earlier.noise.variance * later.noise.variance).sqrt() * sum(|c| c.product);
    let quality = peak.value / noise.max(f64::MIN_POSITIVE).sqrt();
    let correlation = peak.value / (gain * energy).max(f64::MIN_POSITIVE);
    let information = information(cells, motion, quality, correlation);
    PairMotion { motion, quality, correlation, information }
}

/// Quality² / (1 − correlation²) shared among the cells by their area.
fn information(cells: &[Cell], motion: Motion, quality: f64, correlation: f64) -> [[f64; 4]; 4] {
    let area: f64 = cells.iter().map(|c| c.area).sum();
    let certainty = quality.max(0.0).powi(2) / (1.0 - correlation * correlation).clamp(0.05, 1.0);
    let mut information = [[0.0; 4]; 4];
    for cell in cells {
        let slopes = fit::slopes(cell, motion);
        for (p, q) in (0..16).map(|i| (i / 4, i % 4)) {
            let product: f64 =
                (0..3).map(|i| slopes[i][p] * slopes[i][q] / (ERROR[i] * ERROR[i])).sum();
            information[p][q] += certainty * cell.area / area * product;
        }
    }
    information
}
