//! The phase curve of a region: the ensemble average is the mean over a mask, in `f64`.
//!
//! | file | what it holds |
//! |---|---|
//! | `selection` | the pixels of the mask, in the order of their sub-windows |
//! | `leakage` | light from outside of the mask, and what takes it off |
//! | `region` | the fields of the pixels, and averages over them |
//! | `estimate` | direct difference, one-step walk, the paper's least squares |
//! | `linked` | maximum likelihood with a fitted coherence |
//! | `layers` | how exact that is for the difference of two layers |

mod estimate;
mod layers;
mod leakage;
mod linked;
mod region;
mod selection;

pub(crate) use linked::link;
pub use linked::{Linked, link_region, window_looks};
pub use region::Region;
pub use selection::Selection;

use crate::error::Result;
use crate::io::CurveRow;
use crate::method::{Method, Plan};
use crate::progress::Progress;
use estimate::Estimate;
use phasewalk_core::ensemble::PairMean;
use rayon::prelude::*;

/// Phase and standard deviation of each frame of the region.
///
/// `looks` are those of the weights, `effective_looks` those of the standard deviation.
///
/// # Errors
/// When the user interrupts.
pub fn curve(
    region: &Region,
    plan: &Plan,
    looks: f64,
    effective_looks: f64,
    progress: &Progress,
) -> Result<Vec<CurveRow>> {
    if plan.method == Method::Linked {
        return Ok(link_region(region, plan, effective_looks, progress)?.rows);
    }
    let powers = region.powers();
    let pairs = plan.pairs();
    let mut means = Vec::with_capacity(pairs.len());
    let frames = plan.frames();
    for chunk in pairs.chunks(pairs.len().div_ceil(frames)) {
        let part: Vec<_> =
            chunk.par_iter().map(|&(t, s)| region.pair_mean(t, s, &powers)).collect();
        means.extend(part);
        progress.advance(1)?;
    }
    let (phases, sigmas) = phases_of_means(plan, &pairs, &means, looks, effective_looks);
    let rows = phases.into_iter().zip(sigmas).zip(&plan.times_s).enumerate();
    Ok(rows
        .map(|(frame, ((phase_rad, sigma_rad), &time_s))| CurveRow {
            frame,
            time_s,
            phase_rad,
            sigma_rad,
            quality: f64::NAN,
        })
        .collect())
}

/// Phases and standard deviations from the averages of the plan's pairs; linked phases need
/// [`link_region`] instead.
pub(crate) fn phases_of_means(
    plan: &Plan,
    pairs: &[(usize, usize)],
    means: &[PairMean<f64>],
    looks: f64,
    effective_looks: f64,
) -> (Vec<f64>, Vec<f64>) {
    let estimate = Estimate { plan, pairs, means, looks, effective_looks };
    match plan.method {
        Method::Direct => estimate.direct(),
        Method::OneStep => estimate.one_step(),
        Method::Paper(_) | Method::Linked => estimate.least_squares(),
    }
}

/// What the phase of a region does beyond that of another: phases are subtracted, variances
/// add, and a frame is as good as the worse of the two.
///
/// `control` has a row for each of `rows`.
pub fn subtract(rows: &mut [CurveRow], control: &[CurveRow]) {
    for (row, control) in rows.iter_mut().zip(control) {
        row.phase_rad -= control.phase_rad;
        row.sigma_rad = row.sigma_rad.hypot(control.sigma_rad);
        row.quality = row.quality.min(control.quality);
    }
}
