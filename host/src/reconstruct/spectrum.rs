//! From the counts of a sweep to depth: background off, window and dispersion on, FFT (paper lines
//! 693-699).
//!
//! ```text
//! U(z) = sum over m of [I(m) - S(m) v - B(m)] w(m) exp(-i(a2 q^2 + a3 q^3)) exp(-i pi s q) exp(-2 pi i z (m-c)/K)
//! ```
//! with q = (m - c)/(K/2), c = (K-1)/2: all spectral phases, the axial shift s of the pixel among
//! them, are applied at once and leave the phase at the centre of the band alone. So a shift moves
//! the layers and not their phase, whatever the depth. A down-sweep records the conjugate.
//!
//! Raw spectra lie (m, y, x): pixels are taken in strips of neighbours, so that what is read once from
//! memory is used while it is near.

use super::background::{BLOCK, Grid};
use super::dispersion::{Dispersion, band_coordinate};
use crate::error::Result;
use crate::lanes::{LaneTask, Lanes, Path};
use num_complex::Complex32;
use rayon::prelude::*;
use rustfft::{Fft, FftPlanner};
use std::f64::consts::{PI, TAU};
use std::ops::Range;
use std::sync::Arc;

/// Direction in which the source sweeps.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum, serde::Serialize, serde::Deserialize,
)]
#[serde(rename_all = "lowercase")]
pub enum Direction {
    /// The wavenumber grows with the image index.
    Up,
    /// The wavenumber falls.
    Down,
}

/// Columns of a strip: its K x 64 background-free samples fit the second-level cache.
const STRIP: usize = 64;
/// Pixels that are turned and transformed together.
const GROUP: usize = 16;

/// Counts of a sweep and its background.
#[derive(Clone, Copy)]
pub struct Input<'a> {
    /// Counts (m, y, x).
    pub counts: &'a [u16],
    /// S(m).
    pub source: &'a [f32],
    /// v (y, x).
    pub illumination: &'a [f32],
    /// B on the grid, smoothed, (m, row, column).
    pub fixed: &'a [f32],
}

/// What is the same for all pixels of all sweeps.
pub struct Transform {
    grid: Grid,
    images: usize,
    /// Window times dispersion correction.
    table: Vec<Complex32>,
    /// exp(2 pi i z c/K): phases refer to the centre of the band.
    centering: Vec<Complex32>,
    direction: Direction,
    fft: Arc<dyn Fft<f32>>,
    path: Path,
}

impl Transform {
    /// For K images; `window` has K values.
    ///
    /// # Errors
    /// When `PHASEWALK_SIMD` names what this machine does not have.
    pub fn new(
        grid: Grid,
        window: &[f32],
        dispersion: &Dispersion,
        direction: Direction,
    ) -> Result<Self> {
        let images = window.len();
        let center = (images as f64 - 1.0) / 2.0;
        let unit = |phase: f64| Complex32::new(phase.cos() as f32, phase.sin() as f32);
        let table = window
            .iter()
            .enumerate()
            .map(|(m, &w)| unit(-dispersion.phase(band_coordinate(m, images))) * w);
        let centering = (0..images).map(|z| unit(TAU * z as f64 * center / images as f64));
        Ok(Self {
            grid,
            images,
            table: table.collect(),
            centering: centering.collect(),
            direction,
            fft: FftPlanner::new().plan_fft_forward(images),
            path: Path::best()?,
        })
    }

    /// The direction it was made for.
    #[must_use]
    pub fn direction(&self) -> Direction {
        self.direction
    }

    /// |U| at `depths` of all pixels, (z, y, x).
    ///
    /// # Errors
    /// When the machine lost its vector unit.
    pub fn amplitudes(
        &self,
        input: Input<'_>,
        depths: Range<usize>,
        out: &mut [f32],
    ) -> Result<()> {
        self.rows(input, None, out, |spectrum, line| {
            for (value, u) in line.zip(&spectrum[depths.clone()]) {
                *value = u.norm_sqr().sqrt();
            }
        })
    }

    /// U at `depths`, (z, y, x), every pixel moved up by its entry of `shifts` (y, x), in pixels.
    ///
    /// # Errors
    /// As [`Self::amplitudes`].
    pub fn fields(
        &self,
        input: Input<'_>,
        depths: Range<usize>,
        shifts: &[f32],
        out: &mut [Complex32],
    ) -> Result<()> {
        let conjugate = self.direction == Direction::Down;
        self.rows(input, Some(shifts), out, |spectrum, line| {
            let places = spectrum[depths.clone()].iter().zip(&self.centering[depths.clone()]);
            for (value, (u, centering)) in line.zip(places) {
                let u = u * centering;
                *value = if conjugate { u.conj() } else { u };
            }
        })
    }

    /// Transform all pixels; `take` gets the spectrum of one and its places in `out` (z, y, x).
    fn rows<T: Send>(
        &self,
        input: Input<'_>,
        shifts: Option<&[f32]>,
        out: &mut [T],
        take: impl for<'o> Fn(&[Complex32], PixelMut<'o, '_, T>) + Sync,
    ) -> Result<()> {
        let Grid { height, width, .. } = self.grid;
        let mut rows: Vec<Vec<&mut [T]>> = (0..height).map(|_| Vec::new()).collect();
        for plane in out.chunks_exact_mut(height * width) {
            for (row, line) in rows.iter_mut().zip(plane.chunks_exact_mut(width)) {
                row.push(line);
            }
        }
        rows.par_iter_mut().enumerate().try_for_each_init(
            || Workspace::new(self),
            |workspace, (y, lines)| {
                let shifts = shifts.map(|shifts| &shifts[y * width..][..width]);
                for from in (0..width).step_by(STRIP) {
                    let columns = from..(from + STRIP).min(width);
                    self.strip(input, shifts, y, columns, workspace, lines, &take)?;
                }
                Ok(())
            },
        )
    }

    /// One strip of one row.
    #[expect(clippy::too_many_arguments, reason = "one strip of one row, from input to output")]
    fn strip<T>(
        &self,
        input: Input<'_>,
        shifts: Option<&[f32]>,
        y: usize,
        columns: Range<usize>,
        workspace: &mut Workspace,
        lines: &mut [&mut [T]],
        take: &impl for<'o> Fn(&[Complex32], PixelMut<'o, '_, T>),
    ) -> Result<()> {
        let Workspace { samples, between, row, spectra, scratch } = workspace;
        let remove = Remove { grid: self.grid, input, y, columns: columns.clone() };
        self.path.run(RemoveTask { remove, samples, between, row })?;
        for from in (0..columns.len()).step_by(GROUP) {
            let pixels = GROUP.min(columns.len() - from);
            let mut turns = [0.0; GROUP];
            if let Some(shifts) = shifts {
                let own = &shifts[columns.start + from..][..pixels];
                turns.iter_mut().zip(own).for_each(|(turn, &shift)| *turn = shift);
            }
            self.path.run(TurnTask {
                table: &self.table,
                samples: &samples[from..],
                turns: shifts.is_some().then_some(turns),
                spectra,
            })?;
            let used = &mut spectra[..pixels * self.images];
            self.fft.process_with_scratch(used, scratch);
            for (p, spectrum) in used.chunks_exact(self.images).enumerate() {
                take(spectrum, PixelMut { lines: lines.iter_mut(), x: columns.start + from + p });
            }
        }
        Ok(())
    }
}

/// One pixel of all planes of the output.
struct PixelMut<'o, 'l, T> {
    lines: std::slice::IterMut<'o, &'l mut [T]>,
    x: usize,
}

impl<'o, T> Iterator for PixelMut<'o, '_, T> {
    type Item = &'o mut T;

    fn next(&mut self) -> Option<&'o mut T> {
        self.lines.next()?.get_mut(self.x)
    }
}

/// Buffers of one thread.
struct Workspace {
    /// Background-free samples of a strip, (m, x).
    samples: Vec<f32>,
    between: Vec<f32>,
    row: Vec<f32>,
    /// (pixel, m).
    spectra: Vec<Complex32>,
    scratch: Vec<Complex32>,
}

impl Workspace {
    fn new(transform: &Transform) -> Self {
        let Transform { grid, images, fft, .. } = transform;
        Self {
            samples: vec![0.0; images * STRIP + GROUP],
            between: vec![0.0; grid.columns + 2],
            row: vec![0.0; (grid.columns + 1) * BLOCK],
            spectra: vec![Complex32::default(); GROUP * images],
            scratch: vec![Complex32::default(); fft.get_inplace_scratch_len()],
        }
    }
}

/// Take the background off a strip.
#[derive(Clone)]
struct Remove<'a> {
    grid: Grid,
    input: Input<'a>,
    y: usize,
    columns: Range<usize>,
}

struct RemoveTask<'a, 'b> {
    remove: Remove<'a>,
    samples: &'b mut [f32],
    between: &'b mut [f32],
    row: &'b mut [f32],
}

impl LaneTask for RemoveTask<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes<Element = f32>>(self) {
        let Self { remove: Remove { grid, input, y, columns }, samples, between, row } = self;
        let (pixels, from) = (grid.height * grid.width, y * grid.width + columns.start);
        let light = &input.illumination[from..][..columns.len()];
        let images = input.counts.chunks_exact(pixels).zip(input.fixed.chunks_exact(grid.blocks()));
        let lines = samples.chunks_exact_mut(STRIP).zip(input.source);
        for ((line, &source), (counts, fixed)) in lines.zip(images) {
            grid.interpolate_row(fixed, y, &columns, between, row);
            let counts = &counts[from..][..columns.len()];
            let fixed = &row[grid.offset(&columns)..][..columns.len()];
            for (((sample, &count), &v), &b) in line.iter_mut().zip(counts).zip(light).zip(fixed) {
                *sample = f32::from(count) - source * v - b;
            }
        }
    }
}

/// Window, dispersion and axial shift on a group of pixels, and pixels first.
struct TurnTask<'a, 'b> {
    table: &'a [Complex32],
    /// From the group's first pixel on, (m, x) with stride [`STRIP`].
    samples: &'a [f32],
    /// Axial shift of each pixel, in depth pixels.
    turns: Option<[f32; GROUP]>,
    spectra: &'b mut [Complex32],
}

impl LaneTask for TurnTask<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes<Element = f32>>(self) {
        let Self { table, samples, turns, spectra } = self;
        match turns {
            Some(turns) => turn_with_shifts(table, samples, &turns, spectra),
            None => turn(table, samples, spectra),
        }
    }
}

#[inline(always)]
fn turn(table: &[Complex32], samples: &[f32], spectra: &mut [Complex32]) {
    let images = table.len();
    for (m, factor) in table.iter().enumerate() {
        let Some(group) = samples[m * STRIP..].first_chunk::<GROUP>() else { return };
        for (p, &sample) in group.iter().enumerate() {
            spectra[p * images + m] = factor * sample;
        }
    }
}

/// The ramp exp(-i pi s q(m)) is turned on from image to image: exp(-2 pi i s/K) a step. Over K steps
/// of `f32` it drifts by less than 1e-4.
#[inline(always)]
fn turn_with_shifts(
    table: &[Complex32],
    samples: &[f32],
    shifts: &[f32; GROUP],
    spectra: &mut [Complex32],
) {
    let images = table.len();
    let (mut re, mut im) = ([0.0_f32; GROUP], [0.0_f32; GROUP]);
    let (mut step_re, mut step_im) = ([0.0_f32; GROUP], [0.0_f32; GROUP]);
    for (p, &shift) in shifts.iter().enumerate() {
        let start = -PI * f64::from(shift) * band_coordinate(0, images);
        let step = -TAU * f64::from(shift) / images as f64;
        (re[p], im[p]) = (start.cos() as f32, start.sin() as f32);
        (step_re[p], step_im[p]) = (step.cos() as f32, step.sin() as f32);
    }
    for (m, factor) in table.iter().enumerate() {
        let Some(group) = samples[m * STRIP..].first_chunk::<GROUP>() else { return };
        let (mut out_re, mut out_im) = ([0.0_f32; GROUP], [0.0_f32; GROUP]);
        for p in 0..GROUP {
            out_re[p] = (factor.re * re[p] - factor.im * im[p]) * group[p];
            out_im[p] = (factor.re * im[p] + factor.im * re[p]) * group[p];
            let next = re[p] * step_re[p] - im[p] * step_im[p];
            im[p] = re[p] * step_im[p] + im[p] * step_re[p];
            re[p] = next;
        }
        for p in 0..GROUP {
            spectra[p * images + m] = Complex32::new(out_re[p], out_im[p]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::window::Window;
    use super::*;

    const IMAGES: usize = 128;

    /// One reflector per pixel at depth d0 + x/10 with phase theta, dispersed, on a source with fixed
    /// fringes; background given.
    fn transformed(direction: Direction, shift: impl Fn(usize) -> f32) -> Vec<Complex32> {
        let (height, width) = (3, 70);
        let grid = Grid::new(height, width);
        let dispersion = Dispersion { a2: 9.0, a3: -4.0 };
        let sign = if direction == Direction::Up { 1.0 } else { -1.0 };
        let mut counts = vec![0_u16; IMAGES * height * width];
        for (i, count) in counts.iter_mut().enumerate() {
            let (m, x) = (i / (height * width), i % width);
            let q = band_coordinate(m, IMAGES);
            let theta = 0.4 + 0.01 * x as f64;
            let phase = PI * (30.0 + 0.1 * x as f64) * q + dispersion.phase(q) + sign * theta;
            *count = (20_000.0 + 30.0 * q + 8000.0 * phase.cos()).round() as u16;
        }
        let source: Vec<f32> =
            (0..IMAGES).map(|m| 20_000.0 + 30.0 * band_coordinate(m, IMAGES) as f32).collect();
        let illumination = vec![1.0; height * width];
        let fixed = vec![0.0; IMAGES * grid.blocks()];
        let input =
            Input { counts: &counts, source: &source, illumination: &illumination, fixed: &fixed };
        let transform =
            Transform::new(grid, &Window::Hann.weights(IMAGES), &dispersion, direction).unwrap();
        let shifts: Vec<f32> = (0..height * width).map(|i| shift(i % width)).collect();
        let mut out = vec![Complex32::default(); 64 * height * width];
        transform.fields(input, 0..64, &shifts, &mut out).unwrap();
        let mut amplitudes = vec![0.0; 64 * height * width];
        transform.amplitudes(input, 0..64, &mut amplitudes).unwrap();
        let place = (30 * height + 1) * width;
        assert!(amplitudes[place] > 0.5 * 8000.0 / 2.0 * IMAGES as f32 / 2.0);
        out
    }

    /// Flattened by its own depth each reflector is at 20 with its phase, for both directions.
    #[test]
    fn a_shift_moves_the_reflector_and_not_its_phase() {
        for direction in [Direction::Up, Direction::Down] {
            let out = transformed(direction, |x| 10.0 + 0.1 * x as f32);
            for x in [0, 1, 37, 63, 64, 69] {
                let at = |z: usize| out[(z * 3 + 1) * 70 + x];
                let expected = 8000.0 / 2.0 * IMAGES as f32 / 2.0;
                assert!((at(20).norm() / expected - 1.0).abs() < 0.01, "{x}: {}", at(20).norm());
                let phase = at(20).arg() - (0.4 + 0.01 * x as f32);
                assert!(phase.abs() < 2e-3, "{direction:?} {x}: {phase}");
                assert!((at(19).norm() - at(21).norm()).abs() < 0.01 * expected);
                assert!((at(21).arg() - at(20).arg()).abs() < 0.01, "no carrier");
            }
        }
    }
}
