//! Between the passes: motions, camera starts, dispersion at the IS/OS, surfaces.

use super::dispersion::{self, Dispersion};
use super::first_pass::State;
use super::jitter;
use super::preparation::Preparation;
use super::register::{self, Motion};
use super::resample::origin;
use super::second_pass::interpolate;
use super::segment::{self, Hints, Surfaces};
use super::settings::Settings;
use super::spectra::Compensation;
use super::window::Window;
use crate::error::{Error, Result};
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// Where the flattened IS/OS lies along z: far enough from zero that what is left of the source
/// stays away.
const FLAT: usize = 16;
/// Depths kept before the IS/OS and behind the tips.
const MARGIN: usize = 4;
/// A layer's depths: its own and so many on either side.
const HALF_LAYER: usize = 1;
/// Depths around the IS/OS that its dispersion is taken from.
const HALF_WINDOW: usize = 3;

/// What the second pass needs, and what is told of the first.
#[derive(Clone, Serialize, Deserialize)]
pub struct Analysis {
    /// Motion of each sweep against the first good one; none for a bad one.
    pub motions: Vec<Option<Motion>>,
    /// S(m) of each sweep.
    pub sources: Vec<Vec<f32>>,
    /// Fixed fringes on the grid, smoothed.
    pub fixed: Vec<f32>,
    /// By what part of an image each sweep began late; 0 where that cannot be told.
    pub jitter: Vec<f64>,
    /// Standard deviation of it.
    pub jitter_sigma: f64,
    /// At the IS/OS.
    pub dispersion: Dispersion,
    /// Depth of the IS/OS (y, x), pixels of the first volume.
    pub isos: Vec<f32>,
    /// Depth of the outer-segment tips.
    pub ost: Vec<f32>,
    /// Depth at which the IS/OS is put.
    pub flat: usize,
    /// Depths that are written.
    pub depths: Range<usize>,
    /// Depths of Z1 (tips) and Z2 (IS/OS) in what is written, both ends included.
    pub layers: [[usize; 2]; 2],
    /// Best quality of each sweep's pairs.
    pub quality: Vec<f64>,
}

/// Draw the conclusions of the first pass.
///
/// # Errors
/// When fewer than two sweeps match, or no layers are found.
pub fn analyse(
    plan: &Preparation,
    state: &State,
    fixed: Vec<f32>,
    settings: &Settings,
    [height, width]: [usize; 2],
) -> Result<(Analysis, Surfaces)> {
    let motions = motions(plan, state)?;
    let surfaces = surfaces(plan, state, settings, [height, width])?;
    let dispersion = match settings.compensation {
        Compensation::Known(dispersion) => dispersion,
        Compensation::Estimated => {
            dispersion_at_isos(plan, &motions, &surfaces.isos, [height, width])?
        }
    };
    let (jitter, jitter_sigma) = starts(plan, state, &motions);
    let apart = mean_distance(&surfaces);
    let behind = apart.round() as usize;
    let (flat, depths) = if settings.full {
        (centre(&surfaces.isos), 0..plan.images / 2)
    } else {
        (FLAT, FLAT - MARGIN..FLAT + behind + MARGIN + 1)
    };
    let isos = flat - depths.start;
    let layer = |z: usize| [z - HALF_LAYER, z + HALF_LAYER];
    let analysis = Analysis {
        motions,
        sources: state.sources.clone(),
        fixed,
        jitter,
        jitter_sigma,
        dispersion,
        isos: surfaces.isos.clone(),
        ost: surfaces.ost.clone(),
        flat,
        depths,
        layers: [layer(isos + behind), layer(isos)],
        quality: state.matches.quality.clone(),
    };
    Ok((analysis, surfaces))
}

fn motions(plan: &Preparation, state: &State) -> Result<Vec<Option<Motion>>> {
    let members: Vec<usize> = state.matches.members.iter().map(|member| member.0).collect();
    if members.len() < 2 {
        return Err(Error::failed(format!(
            "only {} of {} sweeps show the retina: nothing to compare",
            members.len(),
            plan.sweeps.len()
        )));
    }
    let mut motions = register::solve(plan.sweeps.len(), &state.matches.pairs);
    for (sweep, motion) in motions.iter_mut().enumerate() {
        if !members.contains(&sweep) {
            *motion = None;
        }
    }
    Ok(motions)
}

/// Surfaces of the averaged volume, in depth pixels of the whole range.
fn surfaces(
    plan: &Preparation,
    state: &State,
    settings: &Settings,
    [height, width]: [usize; 2],
) -> Result<Surfaces> {
    let from = plan.depths.start as f64;
    let hints = Hints {
        isos_px: settings.isos_px.map(|px| px - from),
        outer_segment_um: settings.outer_segment_um,
    };
    let size = [plan.depths.len(), height, width];
    let intensity = state.mean.intensity();
    let mut surfaces = segment::segment(&intensity, size, settings.depth_px_um(), &hints)?;
    let moved = (from - state.mean.depth_bias()) as f32;
    surfaces.isos.iter_mut().chain(&mut surfaces.ost).for_each(|z| *z += moved);
    Ok(surfaces)
}

/// A nonlinear sweep adds a phase that grows with depth: the dispersion is taken at the IS/OS.
fn dispersion_at_isos(
    plan: &Preparation,
    motions: &[Option<Motion>],
    isos: &[f32],
    size: [usize; 2],
) -> Result<Dispersion> {
    let centres: Vec<f64> = plan
        .lines
        .places
        .iter()
        .map(|&(sweep, y, x)| {
            motions[sweep].map_or(f64::NAN, |motion| {
                let pixel = origin(&motion, size, [y as f64, x as f64]);
                interpolate(isos, size, pixel) + motion.shift[0]
            })
        })
        .collect();
    let (images, window) = (plan.images, Window::Hann.weights(plan.images));
    let spectra = &plan.lines.spectra;
    let found =
        dispersion::estimate_at(spectra, images, &window, &centres, HALF_WINDOW, plan.dispersion)?;
    Ok(if found.is_reliable() { found.dispersion } else { plan.dispersion })
}

/// Late starts of the camera, where the fixed fringes tell them.
fn starts(plan: &Preparation, state: &State, motions: &[Option<Motion>]) -> (Vec<f64>, f64) {
    let good: Vec<usize> = (0..motions.len()).filter(|&i| motions[i].is_some()).collect();
    let traces: Vec<&[f32]> = good.iter().map(|&i| state.traces[i].as_slice()).collect();
    let found = jitter::estimate(&traces, plan.images);
    let mut starts = vec![0.0; motions.len()];
    if found.is_significant() {
        for (&sweep, late) in good.iter().zip(&found.images) {
            starts[sweep] = *late;
        }
    }
    (starts, found.sigma)
}

fn mean_distance(surfaces: &Surfaces) -> f64 {
    let apart = surfaces.ost.iter().zip(&surfaces.isos).map(|(tips, isos)| f64::from(tips - isos));
    apart.sum::<f64>() / surfaces.isos.len().max(1) as f64
}

/// Mean depth of a surface, as a depth pixel.
fn centre(surface: &[f32]) -> usize {
    let sum: f64 = surface.iter().map(|&z| f64::from(z)).sum();
    (sum / surface.len().max(1) as f64).round() as usize
}
