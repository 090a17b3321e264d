//! The curve of a region by the paper's least squares, frame by frame.
//!
//! The last L frames of the region are held; each new one is averaged with them, and the core's incremental solver
//! ([`PairWalk`]) puts it where all pairs so far want it. In a history the averages themselves are kept, and the
//! smoothed curve is that of a series that was there as a whole.

use super::curve::WatchedCurve;
use super::first::{First, scaled};
use super::history::History;
use crate::error::{Error, Result};
use crate::io::CurveRow;
use crate::looks::Looks;
use num_complex::{Complex32, Complex64};
use phasewalk_core::Params;
use phasewalk_core::cross_spectrum::cross_spectrum;
use phasewalk_core::ensemble::{Ensemble, PairMean};
use phasewalk_core::pair_walk::{Estimate, PairWalk};
use phasewalk_core::params::RANDOM_PROBABILITY;
use phasewalk_core::weights::{Weighting, Weights};
use rayon::prelude::*;
use std::collections::VecDeque;

/// The longest lag that there are buffers for.
pub const LARGEST_LAG: usize = 64;

/// Parameters of [`PaperCurve`].
#[derive(Clone, Copy, Debug)]
pub struct PaperSettings {
    /// L: pairs up to so many frames apart, at most [`LARGEST_LAG`].
    pub max_lag: usize,
    /// Looks of the weights.
    pub looks: Looks,
    /// Are the averages of all pairs kept?
    pub history: bool,
}

/// A frame of the region.
struct Past {
    field: Vec<Complex32>,
    /// ⟨|U|²⟩.
    power: f64,
}

/// The curve by the paper's least squares.
pub struct PaperCurve {
    settings: PaperSettings,
    chosen: Vec<usize>,
    scale: f32,
    looks: f64,
    effective_looks: f64,
    /// Newest first.
    past: VecDeque<Past>,
    walk: Box<dyn Stream>,
    history: Option<History>,
}

impl PaperCurve {
    /// A curve of the pixels of the mask (y, x), none of whose frames has been taken.
    ///
    /// # Errors
    /// When no pixel is usable, or a parameter is out of its range.
    pub fn new(first: &First, mask: &[bool], settings: PaperSettings) -> Result<Self> {
        let chosen = chosen(first, mask)?;
        let effective_looks = first.looks_of(mask)?;
        let looks = settings.looks.choose(chosen.len() as f64, effective_looks);
        let weights = Weights::new(Weighting::Paper, looks, RANDOM_PROBABILITY);
        Ok(Self {
            walk: stream(Params::paper(settings.max_lag), weights, effective_looks)?,
            settings,
            scale: first.scale(),
            looks,
            effective_looks,
            past: VecDeque::with_capacity(settings.max_lag + 1),
            history: settings.history.then(History::default),
            chosen,
        })
    }

    /// Looks of the weights.
    #[must_use]
    pub fn looks(&self) -> f64 {
        self.looks
    }

    /// Bytes for a region of so many pixels, and for each frame of a history.
    #[must_use]
    pub fn bytes(pixels: usize, settings: &PaperSettings) -> [u64; 2] {
        let fields = (settings.max_lag + 1) * pixels * size_of::<Complex32>();
        let walk = size_of::<PairWalk<f64, LARGEST_LAG, { LARGEST_LAG + 1 }>>();
        let frame = if settings.history { History::bytes_per_frame(settings.max_lag) } else { 0 };
        [(fields + walk) as u64, frame as u64]
    }
}

impl WatchedCurve for PaperCurve {
    fn push(&mut self, frame: usize, field: &[Complex32]) -> CurveRow {
        let field = self.chosen.iter().map(|&i| scaled(field[i], self.scale)).collect();
        let newest = Past::new(field);
        let means: Vec<PairMean<f64>> =
            self.past.par_iter().map(|past| past.mean_with(&newest)).collect();
        let estimate = self.walk.push(&means);
        if let Some(history) = &mut self.history {
            history.push(frame, &means);
        }
        self.past.truncate(self.settings.max_lag - 1);
        self.past.push_front(newest);
        CurveRow {
            phase_rad: estimate.phase_rad,
            sigma_rad: estimate.sigma_rad,
            ..CurveRow::missing(frame, frame as f64)
        }
    }

    fn smoothed(&self) -> Option<Vec<CurveRow>> {
        let history = self.history.as_ref()?;
        history.rows(self.settings.max_lag, self.looks, self.effective_looks).ok()
    }

    fn pixels(&self) -> usize {
        self.chosen.len()
    }
}

impl Past {
    fn new(field: Vec<Complex32>) -> Self {
        let power: f64 = field.iter().map(|&u| cross(u, u).re).sum();
        Self { power: power / field.len() as f64, field }
    }

    /// Averages of the pair of this frame and a later one.
    fn mean_with(&self, later: &Self) -> PairMean<f64> {
        let mut ensemble = Ensemble::new();
        for (&u, &v) in self.field.iter().zip(&later.field) {
            ensemble.add(cross(u, v));
        }
        ensemble.mean(self.power, later.power)
    }
}

fn cross(u: Complex32, v: Complex32) -> Complex64 {
    let double = |u: Complex32| Complex64::new(f64::from(u.re), f64::from(u.im));
    cross_spectrum(double(u), double(v))
}

/// The pixels of the mask that the first frame has.
pub(super) fn chosen(first: &First, mask: &[bool]) -> Result<Vec<usize>> {
    let chosen = first.chosen(mask);
    if chosen.is_empty() {
        let asked = mask.iter().filter(|&&m| m).count();
        return Err(Error::failed(format!(
            "none of the {asked} pixels of the mask is usable (not finite, or zero in the first frame)"
        )));
    }
    Ok(chosen)
}

/// A [`PairWalk`] of any size.
trait Stream {
    fn push(&mut self, means: &[PairMean<f64>]) -> Estimate<f64>;
}

impl<const LAGS: usize, const ROWS: usize> Stream for PairWalk<f64, LAGS, ROWS> {
    fn push(&mut self, means: &[PairMean<f64>]) -> Estimate<f64> {
        Self::push(self, means)
    }
}

/// The smallest that holds the largest lag.
fn stream(params: Params, weights: Weights, looks: f64) -> Result<Box<dyn Stream>> {
    const SMALL: usize = 16;
    if params.max_lag <= SMALL {
        return Ok(Box::new(PairWalk::<f64, SMALL, { SMALL + 1 }>::new(params, weights, looks)?));
    }
    Ok(Box::new(PairWalk::<f64, LARGEST_LAG, { LARGEST_LAG + 1 }>::new(params, weights, looks)?))
}
