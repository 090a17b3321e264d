//! First pass over the recording: what every sweep is, and where the retina lies in it.
//!
//! Sweep by sweep: source term, fixed fringes (summed up for the second pass), |U| of the retina's
//! depths, its motion against up to six sweeps before it, and its part of the averaged volume. The
//! state after each sweep is all that the pass needs to go on, but for the features of the last
//! members, which are made again from the recording.

use super::background::{BLOCK, Background, Grid};
use super::counts::SweepCounts;
use super::mean::MeanVolume;
use super::preparation::Preparation;
use super::register::{Feature, MATCHED, Motion, PairMotion, Registration};
use super::spectrum::{Direction, Input, Transform};
use super::window::Window;
use crate::allocate::zeros;
use crate::error::Result;
use crate::io::RawImages;
use crate::progress::Progress;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

/// Sweeps that a new one is compared with.
const NEIGHBOURS: usize = 6;
/// Share of the usual quality of a match below which a sweep is taken for smeared.
const LEAST_SHARE: f64 = 0.3;
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
    /// Motions between sweeps.
    pub pairs: Vec<(usize, usize, PairMotion)>,
    /// Best quality of a sweep's pairs.
    pub quality: Vec<f64>,
    /// Motion against the first member, for the members so far.
    pub members: Vec<(usize, Motion)>,
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
    transform: Transform,
    registration: Registration,
    counts: SweepCounts,
    amplitude: Vec<f32>,
    features: VecDeque<(usize, Feature)>,
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
            transform,
            registration: Registration::new(depth, height, width),
            counts: SweepCounts::new(plan.images, height, width)?,
            amplitude: zeros(depth * height * width, "amplitudes of one sweep")?,
            features: VecDeque::new(),
            state,
        };
        let last = pass.state.members.len().saturating_sub(NEIGHBOURS);
        let members: Vec<usize> = pass.state.members[last..].iter().map(|m| m.0).collect();
        for sweep in members {
            let background = pass.look_at(sweep)?;
            pass.amplitudes(background)?;
            pass.remember(sweep, pass.registration.feature(&pass.amplitude));
        }
        Ok(pass)
    }

    /// Bytes that [`Self::new`] will take beside the recording's pages.
    #[must_use]
    pub fn bytes(plan: &Preparation, height: usize, width: usize) -> u64 {
        let (pixels, grid) = (height * width, Grid::new(height, width));
        let counts = 2 * plan.images * pixels;
        // Amplitudes and their mean; while the surfaces are found, copies of it instead of the counts.
        let volumes = 3 * 4 * plan.depths.len() * pixels;
        let residuals = 4 * 4 * plan.images * grid.blocks();
        let registration = Registration::new(plan.depths.len(), height, width);
        let features = (NEIGHBOURS as u64 + 2) * registration.bytes_per_feature();
        (counts + volumes + residuals) as u64 + features + PROGRAM
    }

    /// All sweeps that are left. On interruption the state is that of the last finished sweep.
    ///
    /// # Errors
    /// When the recording cannot be read, or the user interrupts.
    pub fn run(&mut self, progress: &Progress) -> Result<()> {
        progress.advance(self.state.next as u64)?;
        while self.state.next < self.plan.sweeps.len() {
            self.sweep()?;
            progress.advance(1)?;
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
            self.state.quality.push(0.0);
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
        self.place(sweep);
        self.state.sources.push(source);
        self.state.traces.push(trace);
        self.state.next += 1;
        Ok(())
    }

    /// Load a sweep and fit its source.
    fn look_at(&mut self, sweep: usize) -> Result<Background> {
        let first = self.plan.sweeps[sweep].first_image;
        self.counts.load(self.raw, first, &self.plan.illumination)?;
        self.grid.measure(&self.counts, &self.plan.illumination)
    }

    /// |U| of the loaded sweep. The sweep's own residual, smoothed, stands for the fixed fringes: their
    /// mean over the sweeps is known after the pass only.
    fn amplitudes(&mut self, background: Background) -> Result<()> {
        let Background { source, residual: mut fixed } = background;
        self.grid.smooth(&mut fixed);
        let input = Input {
            counts: &self.counts.counts,
            source: &source,
            illumination: &self.plan.illumination.pixels,
            fixed: &fixed,
        };
        self.transform.amplitudes(input, self.plan.depths.clone(), &mut self.amplitude)
    }

    /// Compare with the members before, and join them if it matches as they do.
    fn place(&mut self, sweep: usize) {
        let feature = self.registration.feature(&self.amplitude);
        let found = self.compare(&feature);
        let best = found.iter().map(|(_, pair)| pair.quality).fold(0.0, f64::max);
        self.state.quality.push(best);
        let matched = best >= self.enough();
        if !matched && self.state.members.len() > 1 {
            return;
        }
        let mut motions = vec![(Motion::default(), 1.0)];
        if matched {
            let pairs = found.into_iter().filter(|(_, pair)| pair.quality >= MATCHED);
            let pairs: Vec<(usize, PairMotion)> = pairs.collect();
            let whole = |(earlier, pair): &(usize, PairMotion)| {
                Some((self.motion_of(*earlier)?.then(pair.motion), pair.quality))
            };
            motions = pairs.iter().filter_map(whole).collect();
            self.state
                .pairs
                .extend(pairs.into_iter().map(|(earlier, pair)| (earlier, sweep, pair)));
        } else {
            // Nothing to compare with, or the first member was no picture of the retina.
            self.state.members.clear();
            self.features.clear();
            self.state.mean.clear();
        }
        let motion = average(&motions);
        self.state.members.push((sweep, motion));
        self.state.mean.add(&self.amplitude, &motion);
        self.remember(sweep, feature);
    }

    /// Motion against each of the last members, the latest first. Where the motion that is known
    /// from a later one leads nowhere, all shifts are searched.
    fn compare(&self, feature: &Feature) -> Vec<(usize, PairMotion)> {
        let enough = self.enough();
        let mut guess: Option<Motion> = None;
        let mut found = Vec::new();
        for (earlier, other) in self.features.iter().rev() {
            let Some(known) = self.motion_of(*earlier) else { continue };
            let near = guess.map(|whole| known.to(whole));
            let mut pair = self.registration.pair(other, feature, near);
            if near.is_some() && pair.quality < MATCHED {
                pair = self.registration.pair(other, feature, None);
            }
            if pair.quality >= enough {
                guess.get_or_insert(known.then(pair.motion));
            }
            found.push((*earlier, pair));
        }
        found
    }

    /// Quality of a match: above chance, and not far below what is usual here. A sweep that is
    /// smeared by a saccade matches a little.
    fn enough(&self) -> f64 {
        let of = |&(sweep, _): &(usize, Motion)| self.state.quality[sweep];
        let mut usual: Vec<f64> = self.state.members.iter().skip(1).map(of).collect();
        usual.sort_by(f64::total_cmp);
        usual.get(usual.len() / 2).map_or(MATCHED, |usual| MATCHED.max(LEAST_SHARE * usual))
    }

    fn motion_of(&self, sweep: usize) -> Option<Motion> {
        self.state.members.iter().find(|(member, _)| *member == sweep).map(|(_, motion)| *motion)
    }

    fn remember(&mut self, sweep: usize, feature: Feature) {
        self.features.push_back((sweep, feature));
        if self.features.len() > NEIGHBOURS {
            self.features.pop_front();
        }
    }

    /// Mean residual in 4 x 4 parts of the image, (part, m).
    fn trace(&self, background: &Background) -> Vec<f32> {
        let Grid { rows, columns, .. } = self.grid;
        let part = |i: usize| {
            let rows = i / PARTS * rows / PARTS..(i / PARTS + 1) * rows / PARTS;
            let columns = i % PARTS * columns / PARTS..(i % PARTS + 1) * columns / PARTS;
            (rows, columns)
        };
        let images = background.residual.chunks_exact(self.grid.blocks());
        let mean = |i: usize| {
            let (rows, across) = part(i);
            let count = (rows.len() * across.len()).max(1) as f32;
            let line = move |image: &[f32]| {
                let lines = rows.clone().map(|row| &image[row * columns..][across.clone()]);
                lines.flatten().sum::<f32>() / count
            };
            images.clone().map(line).collect::<Vec<f32>>()
        };
        (0..PARTS * PARTS).flat_map(mean).collect()
    }
}

impl State {
    fn new(plan: &Preparation, grid: &Grid, size: [usize; 3]) -> Result<Self> {
        let residual = zeros(plan.images * grid.blocks(), "the fixed fringes")?;
        Ok(Self {
            next: 0,
            sources: Vec::new(),
            traces: Vec::new(),
            pairs: Vec::new(),
            quality: Vec::new(),
            members: Vec::new(),
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

/// Mean of motions that say the same, weighted by their quality squared.
fn average(motions: &[(Motion, f64)]) -> Motion {
    let total: f64 = motions.iter().map(|(_, quality)| quality * quality).sum();
    let mut mean = Motion::default();
    for (motion, quality) in motions {
        let share = quality * quality / total;
        mean.rotation_rad += share * motion.rotation_rad;
        mean.shift.iter_mut().zip(motion.shift).for_each(|(mean, shift)| *mean += share * shift);
    }
    mean
}

/// The program itself with its transforms and the buffers of its threads, bytes.
pub const PROGRAM: u64 = 40_000_000;

/// Smallest side of an image that can be registered and segmented.
pub const LEAST_SIDE: usize = 4 * BLOCK;
