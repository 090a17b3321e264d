//! Second pass over the recording: every matched sweep becomes a volume in the coordinates of the
//! first, flattened on the IS/OS (paper lines 707-711).

use super::analysis::Analysis;
use super::first_pass::PROGRAM;
use super::grid::Grid;
use super::preparation::Preparation;
use super::resample::{place, undo_lateral};
use super::spectrum::{Direction, Input, Transform};
use super::strips::StripCounts;
use super::window::Window;
use crate::allocate::zeros;
use crate::error::Result;
use crate::io::{RawImages, VolumesWriter};
use crate::progress::Progress;
use num_complex::Complex32;
use rayon::prelude::*;
use std::f64::consts::TAU;

/// The pass, with its buffers.
pub struct SecondPass<'a> {
    raw: &'a dyn RawImages,
    plan: &'a Preparation,
    analysis: &'a Analysis,
    grid: Grid,
    transform: Transform,
    counts: StripCounts,
    shifts: Vec<f32>,
    field: Vec<Complex32>,
}

impl<'a> SecondPass<'a> {
    /// Make the buffers.
    ///
    /// # Errors
    /// When the memory is not there.
    pub fn new(
        raw: &'a dyn RawImages,
        plan: &'a Preparation,
        analysis: &'a Analysis,
        direction: Direction,
    ) -> Result<Self> {
        let format = raw.format();
        let (height, width) = (format.height, format.width);
        let grid = Grid::new(height, width);
        Ok(Self {
            raw,
            plan,
            analysis,
            grid,
            transform: Transform::new(
                grid,
                &Window::Hann.weights(plan.images),
                &analysis.dispersion,
                direction,
            )?,
            counts: StripCounts::new(plan.images, grid)?,
            shifts: vec![0.0; height * width],
            field: zeros(analysis.depths.len() * height * width, "one volume")?,
        })
    }

    /// Bytes that [`Self::new`] will take for volumes of `depth`.
    #[must_use]
    pub fn bytes(images: usize, depth: usize, height: usize, width: usize) -> u64 {
        let pixels = height * width;
        let grid = Grid::new(height, width);
        let fixed = 4 * images * grid.blocks();
        (StripCounts::bytes(images, &grid) + 12 * depth * pixels + fixed + 4 * pixels) as u64
            + PROGRAM
    }

    /// Reconstruct and write the sweeps from `first` on; `done` is told after each.
    ///
    /// # Errors
    /// When the recording cannot be read, the disk is full, or the user interrupts.
    pub fn run(
        &mut self,
        first: usize,
        writer: &VolumesWriter,
        progress: &Progress,
        done: impl Fn(usize) -> Result<()>,
    ) -> Result<()> {
        progress.advance(first as u64)?;
        for sweep in first..self.plan.sweeps.len() {
            match self.analysis.motions[sweep].is_some() {
                true => self.volume(sweep)?,
                false => self.field.fill(Complex32::new(f32::NAN, f32::NAN)),
            }
            writer.write(sweep, &self.field)?;
            done(sweep + 1)?;
            progress.advance(1)?;
        }
        Ok(())
    }

    fn volume(&mut self, sweep: usize) -> Result<()> {
        let Analysis { motions, depths, fixed, .. } = self.analysis;
        let Some(motion) = motions[sweep] else { return Ok(()) };
        let first = self.plan.sweeps[sweep].first_image;
        self.counts.load_sweep(self.raw, first, &self.plan.illumination, |_| Ok(()))?;
        self.find_shifts(sweep);
        let input = Input {
            counts: &self.counts,
            source: &self.analysis.sources[sweep],
            illumination: &self.plan.illumination.pixels,
            fixed,
        };
        self.transform.fields(input, depths.clone(), &self.shifts, &mut self.field)?;
        self.undo_late_start(sweep);
        undo_lateral(&mut self.field, self.grid.height, self.grid.width, &motion);
        Ok(())
    }

    /// How far every camera pixel is moved up: its surface in this sweep less where that shall lie.
    fn find_shifts(&mut self, sweep: usize) {
        let Some(motion) = self.analysis.motions[sweep] else { return };
        let Grid { height, width, .. } = self.grid;
        let flat = self.analysis.flat;
        let down = motion.shift[0];
        let (surface, back) = (&self.analysis.isos, motion.inverse());
        self.shifts.par_chunks_exact_mut(width).enumerate().for_each(|(y, row)| {
            // Along a row the place in the first sweep moves on by the same step.
            let at = |x: f64| place(&back, [height, width], [y as f64, x]);
            let (start, next) = (at(0.0), at(1.0));
            for (x, shift) in row.iter_mut().enumerate() {
                let pixel = [0, 1].map(|i| start[i] + x as f64 * (next[i] - start[i]));
                let depth = interpolate(surface, [height, width], pixel);
                *shift = (depth + down - flat as f64) as f32;
            }
        });
    }

    /// A camera that began late has sampled every depth with the phase 2 pi z delta/K.
    fn undo_late_start(&mut self, sweep: usize) {
        let late = self.analysis.jitter[sweep];
        if late == 0.0 {
            return;
        }
        let sign = match self.transform.direction() {
            Direction::Up => -1.0,
            Direction::Down => 1.0,
        };
        let pixels = self.grid.height * self.grid.width;
        let step = sign * TAU * late / self.plan.images as f64;
        let planes = self.field.par_chunks_exact_mut(pixels).zip(self.analysis.depths.clone());
        planes.for_each(|(plane, z)| {
            let turn = Complex32::from_polar(1.0, (step * z as f64) as f32);
            plane.iter_mut().for_each(|u| *u *= turn);
        });
    }
}

/// A smooth surface (y, x) between pixels; beyond the edges that of the edge.
#[must_use]
pub fn interpolate(surface: &[f32], [height, width]: [usize; 2], [y, x]: [f64; 2]) -> f64 {
    let split = |place: f64, length: usize| {
        let place = place.clamp(0.0, (length - 1) as f64);
        let whole = (place as usize).min(length.saturating_sub(2));
        (whole, place - whole as f64)
    };
    let ((row, down), (column, right)) = (split(y, height), split(x, width));
    let at = |dy: usize, dx: usize| {
        let (row, column) = ((row + dy).min(height - 1), (column + dx).min(width - 1));
        f64::from(surface[row * width + column])
    };
    let upper = at(0, 0) + right * (at(0, 1) - at(0, 0));
    let lower = at(1, 0) + right * (at(1, 1) - at(1, 0));
    upper + down * (lower - upper)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn surfaces_are_linear_between_pixels_and_constant_beyond() {
        let surface: Vec<f32> = (0..12).map(|i| (i / 4 * 10 + i % 4) as f32).collect();
        let at = |y, x| interpolate(&surface, [3, 4], [y, x]);
        assert_eq!(at(0.0, 0.0), 0.0);
        assert!((at(1.5, 2.25) - 17.25).abs() < 1e-9);
        assert_eq!(at(2.0, 3.0), 23.0);
        assert_eq!((at(-5.0, 1.0), at(9.0, 9.0)), (1.0, 23.0));
        assert_eq!(interpolate(&[7.0], [1, 1], [0.3, 0.0]), 7.0);
    }
}
