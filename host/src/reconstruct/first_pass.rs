//! First pass over the recording: what every sweep is, and where the retina lies in it.
//!
//! Sweep by sweep: source term, fixed fringes (summed up for the second pass), |U| of the retina's
//! depths, its motion against up to six sweeps before it, and its part of the averaged volume. The
//! state after each sweep is all that the pass needs to go on, but for the features of the last
//! members, which are made again from the recording.

use super::background::{Background, Fit};
use super::grid::{BLOCK, Grid};
use super::mean::MeanVolume;
use super::preparation::Preparation;
use super::register::{Matches, Motion, NEIGHBOURS, Place, Registration, Sequence};
use super::spectrum::{Direction, Input, Transform};
use super::strips::StripCounts;
use super::window::Window;
use crate::allocate::zeros;
use crate::error::Result;
use crate::io::RawImages;
use crate::progress::Progress;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::time::{Duration, Instant};

/// What an end without warning costs at the most.
const KEPT_EVERY: Duration = Duration::from_secs(30);
/// Parts of the image, along each side, whose mean residual tells the start of the camera.
const PARTS: usize = 4;

/// What is known after some sweeps.
#[derive(Clone, Serialize, Deserialize)]
pub struct State {
    /// The sweep that comes next.
    pub next: usize,
    /// S(m) of each sweep so far; empty for one with a fault.
    pub sources: Vec<Vec<f32>>,
    /// Residual of the source fit in parts of the image, (part, m); empty for one with a fault.
    pub traces: Vec<Vec<f32>>,
    /// How the sweeps match.
    pub matches: Matches,
    /// Sum of the residuals, (m, row of blocks, column of blocks), and how many.
    pub fixed: (Vec<f32>, usize),
    /// The averaged volume.
    pub mean: MeanVolume,
}

/// The pass, with its buffers.
pub struct FirstPass<'a> {
    raw: &'a dyn RawImages,
    plan: &'a Preparation,
    grid: Grid,
    fit: Fit<'a>,
    transform: Transform,
    sequence: Sequence,
    counts: StripCounts,
    amplitude: Vec<f32>,
    state: State,
}

impl<'a> FirstPass<'a> {
    /// Begin, or go on from a `state`.
    ///
    /// # Errors
    /// When the memory is not there, or the recording cannot be read.
    pub fn new(
        raw: &'a dyn RawImages,
        plan: &'a Preparation,
        state: Option<State>,
    ) -> Result<Self> {
        let format = raw.format();
        let (height, width) = (format.height, format.width);
        let grid = Grid::new(height, width);
        let depth = plan.depths.len();
        let transform = Transform::new(
            grid,
            &Window::Hann.weights(plan.images),
            &plan.dispersion,
            Direction::Up,
        )?;
        let state = match state {
            Some(state) => state,
            None => State::new(plan, &grid, [depth, height, width])?,
        };
        let mut pass = Self {
            raw,
            plan,
            grid,
            fit: Fit::new(grid, &plan.illumination.pixels)?,
            transform,
            sequence: Sequence::new(Registration::new(depth, height, width)),
            counts: StripCounts::new(plan.images, grid)?,
            amplitude: zeros(depth * height * width, "amplitudes of one sweep")?,
            state,
        };
        for sweep in pass.state.matches.last_members() {
            let background = pass.look_at(sweep)?;
            pass.amplitudes(background)?;
            pass.sequence.hold(sweep, &pass.amplitude);
        }
        Ok(pass)
    }

    /// Bytes that [`Self::new`] will take beside the recording's pages.
    #[must_use]
    pub fn bytes(plan: &Preparation, height: usize, width: usize) -> u64 {
        let (pixels, grid) = (height * width, Grid::new(height, width));
        let counts = StripCounts::bytes(plan.images, &grid);
        // Amplitudes and their mean; while the surfaces are found, copies of it instead of the counts.
        let volumes = 3 * 4 * plan.depths.len() * pixels;
        let residuals = 4 * 4 * plan.images * grid.blocks();
        let registration = Registration::new(plan.depths.len(), height, width);
        let features = (NEIGHBOURS as u64 + 2) * registration.bytes_per_feature();
        (counts + volumes + residuals) as u64 + features + PROGRAM
    }

    /// All sweeps that are left. On interruption the state is that of the last finished sweep; `keep`
    /// is given it from time to time, for an end without warning.
    ///
    /// # Errors
    /// When the recording cannot be read, or the user interrupts.
    pub fn run(&mut self, progress: &Progress, keep: impl Fn(&State) -> Result<()>) -> Result<()> {
        progress.advance(self.state.next as u64)?;
        let mut kept = Instant::now();
        while self.state.next < self.plan.sweeps.len() {
            self.sweep()?;
            progress.advance(1)?;
            if kept.elapsed() > KEPT_EVERY {
                keep(&self.state)?;
                kept = Instant::now();
            }
        }
        Ok(())
    }

    /// What is known so far; all buffers are given back.
    #[must_use]
    pub fn into_state(self) -> State {
        self.state
    }

    fn sweep(&mut self) -> Result<()> {
        let sweep = self.state.next;
        if !self.plan.sweeps[sweep].is_ok() {
            self.state.sources.push(Vec::new());
            self.state.traces.push(Vec::new());
            self.state.matches.skip();
            self.state.next += 1;
            return Ok(());
        }
        let background = self.look_at(sweep)?;
        let source = background.source.clone();
        let trace = self.trace(&background);
        let (sum, count) = &mut self.state.fixed;
        sum.iter_mut().zip(&background.residual).for_each(|(sum, r)| *sum += r);
        *count += 1;
        self.amplitudes(background)?;
        self.place();
        self.state.sources.push(source);
        self.state.traces.push(trace);
        self.state.next += 1;
        Ok(())
    }

    /// Load a sweep and fit its source.
    fn look_at(&mut self, sweep: usize) -> Result<Background> {
        let (first, light) = (self.plan.sweeps[sweep].first_image, &self.plan.illumination);
        let fit = &self.fit;
        let images = self.counts.load_sweep(self.raw, first, light, |image| fit.image(image))?;
        Ok(Background::of(images))
    }

    /// |U| of the loaded sweep. The sweep's own residual, smoothed, stands for the fixed fringes: their
    /// mean over the sweeps is known after the pass only.
    fn amplitudes(&mut self, background: Background) -> Result<()> {
        let Background { source, residual: mut fixed } = background;
        self.grid.smooth(&mut fixed);
        let input = Input {
            counts: &self.counts,
            source: &source,
            illumination: &self.plan.illumination.pixels,
            fixed: &fixed,
        };
        self.transform.amplitudes(input, self.plan.depths.clone(), &mut self.amplitude)
    }

    /// Compare with the members before, and add to their mean if it matches.
    fn place(&mut self) {
        let motion = match self.sequence.push(&self.amplitude, &mut self.state.matches) {
            Place::Apart => return,
            Place::Member(motion) => motion,
            Place::First => {
                self.state.mean.clear();
                Motion::default()
            }
        };
        self.state.mean.add(&self.amplitude, &motion);
    }

    /// Mean residual in 4 x 4 parts of the image, (part, m).
    fn trace(&self, background: &Background) -> Vec<f32> {
        let Grid { rows, columns, .. } = self.grid;
        let part =
            |number: usize, length: usize| number * length / PARTS..(number + 1) * length / PARTS;
        let mean = |image: &[f32], i: usize| {
            let (rows, across) = (part(i / PARTS, rows), part(i % PARTS, columns));
            let count = (rows.len() * across.len()).max(1) as f32;
            let lines = rows.map(|row| image[row * columns..][across.clone()].iter().sum::<f32>());
            lines.sum::<f32>() / count
        };
        let images = background.residual.par_chunks_exact(self.grid.blocks());
        let means: Vec<[f32; PARTS * PARTS]> =
            images.map(|image| std::array::from_fn(|i| mean(image, i))).collect();
        (0..PARTS * PARTS).flat_map(|i| means.iter().map(move |m| m[i])).collect()
    }
}

impl State {
    fn new(plan: &Preparation, grid: &Grid, size: [usize; 3]) -> Result<Self> {
        let residual = zeros(plan.images * grid.blocks(), "the fixed fringes")?;
        Ok(Self {
            next: 0,
            sources: Vec::new(),
            traces: Vec::new(),
            matches: Matches::default(),
            fixed: (residual, 0),
            mean: MeanVolume::new(size)?,
        })
    }

    /// B(m,y,x) on the grid, smoothed: the mean residual of all sweeps.
    #[must_use]
    pub fn fixed_fringes(&self, grid: &Grid) -> Vec<f32> {
        let (sum, count) = &self.fixed;
        let mut fixed: Vec<f32> = sum.par_iter().map(|s| s / (*count).max(1) as f32).collect();
        grid.smooth(&mut fixed);
        fixed
    }
}

/// The program itself with its transforms and the buffers of its threads, bytes.
pub const PROGRAM: u64 = 40_000_000;

/// Smallest side of an image that can be registered and segmented.
pub const LEAST_SIDE: usize = 4 * BLOCK;
