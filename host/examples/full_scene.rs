//! The paper's scene at full size against its truth, over several seeds:
//!
//! ```text
//! cargo run --release --example full_scene [-- SEEDS [WIDTH HEIGHT]]
//! ```
//! Prints, for sigma = lambda/32 and lambda/16, the rms error of the curve over the x at the last frame for
//! each method (also without the rim of the x, into which the aperture mixes light from outside: with so many looks
//! that is the larger error; linked phases are those with that light taken off, and with it), the Cramer-Rao bound of
//! a random walk with as many looks, the amplitude of the field's autocorrelation outside the x, and what the
//! simulation took.

use num_complex::Complex32;
use phasewalk::curve::{Region, Selection, curve};
use phasewalk::error::Result;
use phasewalk::io::{Shape, without_rim};
use phasewalk::looks::{PointSpread, SpatialCoherence};
use phasewalk::method::{Depths, Method, Plan};
use phasewalk::progress::Progress;
use phasewalk::series::{HeldSeries, survey};
use phasewalk::simulate::{SpeckleScene, coherence_at_lags};
use phasewalk_core::weights::Weighting;
use std::time::Instant;

const LAGS: [usize; 5] = [1, 2, 5, 10, 20];
/// Pixels taken off the mask's edge, into which the aperture mixes light from outside, for the second error.
const RIM: usize = 4;
/// Name, method, and whether light from outside of the x is taken off.
const METHODS: [(&str, Method, bool); 6] = [
    ("direct", Method::Direct, false),
    ("one-step", Method::OneStep, false),
    ("paper", Method::Paper(Weighting::Paper), false),
    ("paper, fisher weights", Method::Paper(Weighting::Fisher), false),
    ("linked, leakage kept", Method::Linked, false),
    ("linked", Method::Linked, true),
];

fn main() -> Result<()> {
    let argument = |i: usize, default: usize| {
        std::env::args().nth(i).and_then(|text| text.parse().ok()).unwrap_or(default)
    };
    let seeds = argument(1, 5) as u64;
    let paper = SpeckleScene::default();
    let (width, height) = (argument(2, paper.width), argument(3, paper.height));
    for (name, sigma_wavelengths) in [("lambda/32", 1.0 / 32.0), ("lambda/16", 1.0 / 16.0)] {
        let scene = SpeckleScene { width, height, sigma_wavelengths, ..paper.clone() };
        let mut summary = Summary::default();
        for seed in 1..=seeds {
            summary.add(&SpeckleScene { seed, ..scene.clone() })?;
        }
        summary.print(name, &scene, seeds);
    }
    Ok(())
}

/// What all seeds of one scene gave.
#[derive(Default)]
struct Summary {
    /// Sum over the seeds of (error at the last frame)^2, by method, over the whole x and over the x
    /// without its rim.
    squares: [[f64; METHODS.len()]; 2],
    /// Sum of the reported standard deviation at the last frame, by method.
    sigmas: [f64; METHODS.len()],
    coherence: [f64; LAGS.len()],
    effective_looks: f64,
    truth_rad: f64,
    simulation_seconds: f64,
}

impl Summary {
    fn add(&mut self, scene: &SpeckleScene) -> Result<()> {
        let start = Instant::now();
        let series = simulate(scene)?;
        self.simulation_seconds += start.elapsed().as_secs_f64();
        let mask = scene.mask();
        let survey = survey(&series, &[0])?;
        let usable = SpatialCoherence::estimate(&series, &survey, &[0])?;
        let effective_looks = usable.looks_of_mask(&mask, scene.width);
        self.effective_looks += effective_looks;
        let truth = scene.true_phase_rad();
        self.truth_rad = truth[scene.frames - 1];
        let inner = without_rim(&mask, scene.width, RIM);
        let spread = PointSpread::of(&usable);
        let (valid, width) = (&survey.valid, scene.width);
        for (i, &(_, method, take_off)) in METHODS.iter().enumerate() {
            for (region, pixels) in [&mask, &inner].into_iter().enumerate() {
                let all = Selection::new(valid, pixels, width, None)?;
                let selection = if take_off {
                    all.without_leakage(&spread, &usable, &mask, valid)
                } else {
                    all
                };
                let (phase, sigma) = last_frame(&series, survey.scale, selection, method, &usable)?;
                self.squares[region][i] += (phase - self.truth_rad).powi(2);
                self.sigmas[i] += if region == 0 { sigma } else { 0.0 };
            }
        }
        self.add_autocorrelation(&series, scene)
    }

    fn add_autocorrelation(&mut self, series: &HeldSeries, scene: &SpeckleScene) -> Result<()> {
        let outside: Vec<bool> = scene.mask().iter().map(|inside| !inside).collect();
        let fields: Vec<Complex32> =
            (0..scene.frames).flat_map(|t| series.frame(t).to_vec()).collect();
        let lags = coherence_at_lags(&fields, scene.pixels(), &LAGS, Some(&outside))?;
        for (sum, coherence) in self.coherence.iter_mut().zip(lags) {
            *sum += coherence;
        }
        Ok(())
    }

    fn print(&self, name: &str, scene: &SpeckleScene, seeds: u64) {
        let n = seeds as f64;
        let steps = (scene.pixels() * scene.scatterers_per_pixel * scene.frames) as f64;
        let rho =
            (-(2.0 * 2.0 * std::f64::consts::PI * scene.sigma_wavelengths).powi(2) / 2.0).exp();
        let looks = self.effective_looks / n;
        let bound =
            ((scene.frames - 1) as f64 * (1.0 - rho * rho) / (2.0 * looks * rho * rho)).sqrt();
        println!(
            "sigma = {name}, {} x {} pixels, {} frames, {seeds} seeds; truth at the end {:.3} rad",
            scene.width, scene.height, scene.frames, self.truth_rad
        );
        println!("  bound of a random walk with {looks:.0} looks: {bound:.3} rad");
        for (i, (method, ..)) in METHODS.iter().enumerate() {
            let [rms, inner] = self.squares.map(|squares| (squares[i] / n).sqrt());
            let sigma = self.sigmas[i] / n;
            println!(
                "  {method:<22} rms error at the end {rms:6.3} rad, without the rim {inner:6.3} rad, \
                 reported sigma {sigma:.3} rad"
            );
        }
        let lags = LAGS.iter().zip(self.coherence).map(|(l, c)| format!("{l}: {:.3}", c / n));
        println!("  autocorrelation at lag {}", lags.collect::<Vec<_>>().join(", "));
        let nanoseconds = self.simulation_seconds / n / steps * 1e9;
        let seconds = self.simulation_seconds / n;
        println!(
            "  simulation: {seconds:.1} s, {nanoseconds:.2} ns per scatterer and frame (all cores)"
        );
    }
}

fn simulate(scene: &SpeckleScene) -> Result<HeldSeries> {
    let mut field = Vec::with_capacity(scene.pixels() * scene.frames);
    let progress = Progress::new("simulating", scene.frames as u64);
    scene.for_each_frame(&progress, |_, frame| {
        field.extend_from_slice(frame);
        Ok(())
    })?;
    let shape = Shape { frames: scene.frames, depth: 1, height: scene.height, width: scene.width };
    HeldSeries::new(shape, field)
}

/// Phase and standard deviation at the last frame, radians.
fn last_frame(
    series: &HeldSeries,
    scale: f32,
    selection: Selection,
    method: Method,
    coherence: &SpatialCoherence,
) -> Result<(f64, f64)> {
    let frames = phasewalk::io::Series::shape(series).frames;
    let plan = Plan::new(method, frames, None, None, Depths::single())?;
    let progress = Progress::hidden();
    let region = Region::read(series, scale, selection, &plan, &progress)?;
    let effective_looks = region.looks(coherence);
    let looks = match method {
        Method::Paper(Weighting::Fisher) => effective_looks,
        _ => region.pixels() as f64,
    };
    let rows = curve(&region, &plan, looks, effective_looks, &progress)?;
    Ok(rows.last().map_or((f64::NAN, f64::NAN), |row| (row.phase_rad, row.sigma_rad)))
}
