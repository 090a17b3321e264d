//! Maximum-likelihood phases of one region, with what was found out about its coherence.

use super::layers::Neighbours;
use super::region::{Region, WindowedPair};
use crate::allocate::{filled, zeros};
use crate::error::Result;
use crate::io::CurveRow;
use crate::method::Plan;
use crate::progress::Progress;
use num_complex::Complex64;
use phasewalk_core::chain::least_sure_gap;
use phasewalk_core::closure::Closure;
use phasewalk_core::coherence::{Lag, Mixture};
use phasewalk_core::lags::Lags;
use phasewalk_core::linking::{Buffers, Results, Settings, link_series};
use rayon::prelude::*;

/// Looks of the sub-windows over which each layer's cross-spectrum is averaged before the two are multiplied, in a mask of
/// so many looks: few enough that a bulk tilt across the mask cancels within each, many enough that the product of two
/// noises stays small. A larger mask is flatter within a window: 3/4 of the root, 16 at least and 24 at most.
#[must_use]
pub fn window_looks(looks: f64) -> f64 {
    (0.75 * looks.sqrt()).clamp(16.0, 24.0)
}

/// What the memory of an estimate is called when it is short.
pub(super) const MATRICES: &str = "the matrices of all pairs of frames";

/// Linked phases of a region.
#[derive(Clone, Debug)]
pub struct Linked {
    /// Phase, standard deviation and quality of each frame.
    pub rows: Vec<CurveRow>,
    /// Fitted coherence between the frames, N x N.
    pub gamma: Vec<f64>,
    /// h(tau), without a periodic part.
    pub mixture: Mixture<f64>,
    /// Does Gamma have a periodic part?
    pub periodic: bool,
    /// Rms misfit of the mean coherences to `mixture`.
    pub misfit: f64,
    /// Does the model hold? None for two layers, whose product has another noise than the test expects.
    pub closure: Option<Closure>,
    /// The gap in the times across which whole turns are least sure: the frame before it, and how well the velocity around
    /// it predicts the change, radians.
    pub least_sure_gap: Option<(usize, f64)>,
}

/// Link all frames of the region; `looks` are the independent ones behind its averages.
///
/// # Errors
/// Not enough memory, or the user's interruption.
pub fn link_region(
    region: &Region,
    plan: &Plan,
    looks: f64,
    progress: &Progress,
) -> Result<Linked> {
    let frames = plan.frames();
    let two = if plan.depths.has_two_layers() { region.window() } else { None };
    let mut neighbours = Neighbours::default();
    let mut cross: Vec<Complex64> = zeros(frames * frames, MATRICES)?;
    for i in 0..frames {
        let row: Vec<WindowedPair> =
            (0..=i).into_par_iter().map(|j| region.windowed_pair(i, j)).collect();
        for (j, pair) in row.iter().enumerate() {
            cross[i * frames + j] = pair.mean;
            cross[j * frames + i] = pair.mean.conj();
            if two.is_some() && j + 1 == i {
                neighbours.add(region, j, pair);
            }
        }
        progress.advance(1)?;
    }
    let mut linked = link(&mut cross, plan, looks)?;
    // A prior makes phases more certain than their averages are.
    if let (Some(window), None) = (two, plan.acceleration) {
        let sigmas: Vec<f64> = linked.rows.iter().map(|row| row.sigma_rad).collect();
        let honest = neighbours.sigmas(window, plan, looks, &mut linked.gamma, &sigmas);
        for (row, sigma) in linked.rows.iter_mut().zip(honest) {
            row.sigma_rad = sigma;
        }
    }
    Ok(linked)
}

/// Link the frames of averages ⟨U_i conj U_j⟩, N x N, of so many independent looks; they come back normalised.
///
/// # Errors
/// Not enough memory.
pub(crate) fn link(cross: &mut [Complex64], plan: &Plan, looks: f64) -> Result<Linked> {
    let n = plan.frames();
    let none = Lag { tau: 0.0, mean: 0.0, pairs: 0.0 };
    let (mut reals, mut phasors) =
        (zeros(Buffers::<f64>::reals(n), MATRICES)?, zeros(n, MATRICES)?);
    let (mut lags, mut indices) =
        (filled(none, n * n / 2 + 1, MATRICES)?, zeros(Lags::indices(n), MATRICES)?);
    let buffers = Buffers {
        reals: &mut reals,
        phasors: &mut phasors,
        lags: &mut lags,
        indices: &mut indices,
    };
    let [mut phases, mut sigmas, mut quality] = [0; 3].map(|_| vec![0.0; n]);
    let mut gamma = zeros(n * n, MATRICES)?;
    let results = Results {
        phases: &mut phases,
        sigmas: &mut sigmas,
        quality: &mut quality,
        gamma: &mut gamma,
    };
    let settings = Settings {
        looks,
        reference_frames: plan.params.reference_frames,
        acceleration: plan.acceleration,
    };
    let summary = link_series(cross, &plan.times_s, &settings, buffers, results);
    let row = |frame: usize| CurveRow {
        frame,
        time_s: plan.times_s[frame],
        phase_rad: phases[frame],
        sigma_rad: sigmas[frame],
        quality: quality[frame],
    };
    let least_sure_gap = least_sure_gap(&phases, &plan.times_s, &quality);
    Ok(Linked {
        rows: (0..n).map(row).collect(),
        gamma,
        mixture: summary.mixture,
        periodic: summary.periodic,
        misfit: summary.misfit,
        closure: (!plan.depths.has_two_layers()).then_some(summary.closure),
        least_sure_gap,
    })
}
