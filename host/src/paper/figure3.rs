//! Figure 3: the phase of the x over time, mean and standard deviation over all runs, by every method,
//! and the autocorrelation (lines 473-482).

use super::methods::{DIRECT, LINKED, ONE_STEP, PAPER};
use super::statistics::{Spread, Statistics};
use crate::figures::{Canvas, Curve, CurveColumn, Curves};

/// One column for each σ.
#[must_use]
pub fn figure3(statistics: &[Statistics]) -> Canvas {
    Curves { columns: statistics.iter().map(column).collect(), direct_range: None, apart: true }
        .draw()
}

fn column(statistics: &Statistics) -> CurveColumn<'_> {
    let Statistics { label, truth_rad, phases, autocorrelation, .. } = statistics;
    CurveColumn {
        label,
        truth: truth_rad,
        direct: curve(&phases[DIRECT]),
        one_step: Some(curve(&phases[ONE_STEP])),
        extended: curve(&phases[PAPER]),
        linked: Some(curve(&phases[LINKED])),
        autocorrelation: Some(curve(autocorrelation)),
    }
}

fn curve(spread: &Spread) -> Curve<'_> {
    Curve { values: &spread.mean, deviation: Some(&spread.deviation) }
}
