//! The phase between two layers, which the whole sample's motion and tilt leave alone.
//!
//! Each layer is a square of independent speckles; both decorrelate alike, one carries the phase, and both the same bulk
//! phase, new in every frame, with the same tilt across the square. They go the way of a recording: looks from the
//! frames, sub-windows, products, linking. The bound of the difference is that of two independent layers,
//! sqrt(2) times that of one.

use super::estimators::plan;
use super::sample::Draw;
use super::{Scenario, Score, Scores};
use crate::curve::{Region, Selection, link_region, window_looks};
use crate::error::Result;
use crate::io::{Series, Shape};
use crate::looks::SpatialCoherence;
use crate::method::{Depths, Method};
use crate::progress::Progress;
use crate::series::{HeldSeries, survey};
use crate::simulate::philox::{key, philox4x32};
use num_complex::Complex32;
use rayon::prelude::*;
use std::f64::consts::TAU;

/// Word of the random counter that keeps the tilts apart from the speckle.
const TILTS: u32 = 1;

/// Tilt of the whole sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tilt {
    /// Phase from edge to edge of the square, radians, in a direction that is new in every frame.
    pub across_rad: f64,
}

/// Link the difference of two layers of side x side speckles, `trials` times; one step of progress each.
///
/// # Errors
/// Not enough memory, or the user's interruption.
pub fn run_layers(
    scenario: &Scenario,
    side: usize,
    tilt: Tilt,
    trials: usize,
    seed: u64,
    progress: &Progress,
) -> Result<Score> {
    let root = scenario.root();
    let trial = |number: usize| -> Result<Scores> {
        let frames = scenario.phase.len();
        let shape = Shape { frames, depth: 2, height: side, width: side };
        let volume = volume(scenario, &root, shape, tilt, [seed, number as u64])?;
        let (phases, sigmas) = estimate(scenario, &HeldSeries::new(shape, volume)?)?;
        progress.advance(1)?;
        Ok(Scores::of(&phases, &sigmas, &scenario.phase))
    };
    let all: Result<Vec<Scores>> = (0..trials).into_par_iter().map(trial).collect();
    let bound = std::f64::consts::SQRT_2 * scenario.bound((side * side) as f64);
    Ok(Score::new(all?.iter(), bound))
}

/// The fields of both layers, (time, z, y, x).
fn volume(
    scenario: &Scenario,
    root: &[f64],
    shape: Shape,
    tilt: Tilt,
    [seed, trial]: [u64; 2],
) -> Result<Vec<Complex32>> {
    let pixels = shape.height * shape.width;
    let still = vec![0.0; shape.frames];
    let draw =
        Draw { root, phase: &still, looks: shape.depth * pixels, seed, trial: trial as usize };
    let mut field = draw.looks()?;
    for (t, frame) in field.chunks_exact_mut(shape.depth * pixels).enumerate() {
        let words = philox4x32([0, t as u32, trial as u32, TILTS], key(seed));
        let [bulk, direction] = [words[0], words[1]].map(|word| f64::from(word) / 2_f64.powi(32));
        let (sine, cosine) = (TAU * direction).sin_cos();
        for (place, u) in frame.iter_mut().enumerate() {
            let (layer, place) = (place / pixels, place % pixels);
            let from_middle = |i: usize| (i as f64 + 0.5) / shape.width as f64 - 0.5;
            let (y, x) = (from_middle(place / shape.width), from_middle(place % shape.width));
            let own = if layer == 0 { scenario.phase[t] } else { 0.0 };
            let phase = own + TAU * bulk + tilt.across_rad * (cosine * x + sine * y);
            *u *= Complex32::from_polar(1.0, phase as f32);
        }
    }
    Ok(field)
}

/// Phases and standard deviations, as `phasewalk phase --layers 0..0,1..1` has them.
fn estimate(scenario: &Scenario, series: &HeldSeries) -> Result<(Vec<f64>, Vec<f64>)> {
    let mut plan = plan(&scenario.times, Method::Linked)?;
    plan.depths = Depths { first: 0..=0, second: Some(1..=1) }.into();
    let survey = survey(series, &plan.depths.all())?;
    let coherence = SpatialCoherence::estimate(series, &survey, &[0])?;
    let side = series.shape().width;
    let mask = vec![true; side * side];
    let looks = coherence.looks_of_mask(&mask, side);
    let window = coherence.block_of_looks(window_looks(looks), 1.0, series.shape());
    let silent = Progress::hidden();
    let selection = Selection::new(&survey.valid, &mask, side, Some(window))?;
    let region = Region::read(series, survey.scale, selection, &plan, &silent)?;
    let rows = link_region(&region, &plan, looks, &silent)?.rows;
    Ok(rows.iter().map(|row| (row.phase_rad, row.sigma_rad)).unzip())
}
