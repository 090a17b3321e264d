//! From the counts of a sweep to depth: background off, window and dispersion on, FFT (paper lines
//! 701-707).
//!
//! ```text
//! U(z) = sum over m of [I(m) - S(m) v - B(m)] w(m) exp(-i(a2 q^2 + a3 q^3)) exp(-i pi s q) exp(-2 pi i z (m-c)/K)
//! ```
//! with q = (m - c)/(K/2), c = (K-1)/2: all spectral phases, the axial shift s of the pixel among
//! them, are applied at once and leave the phase at the centre of the band alone. So a shift moves
//! the layers and not their phase, whatever the depth. A down-sweep records the conjugate.
//!
//! Pixels are taken in strips of neighbours: background off (`remove`), then phases and transform of 16
//! pixels at a time (`zoom` where few depths are wanted, else `whole`), or pixel by pixel where K is no
//! multiple of 256 (`turn` and rustfft).

use super::dispersion::{Dispersion, band_coordinate};
use super::grid::{BLOCK, Grid, STRIP};
use super::pairs::{GROUP, Group, Line, POINTS, Samples};
use super::remove::{RemoveTask, Strip};
use super::strips::StripCounts;
use super::turn::{PADDING, TurnTask};
use super::whole::{Whole, WholeTask};
use super::zoom::{Zoom, ZoomTask};
use crate::error::Result;
use crate::lanes::Path;
use num_complex::Complex32;
use rayon::prelude::*;
use rustfft::{Fft, FftPlanner};
use std::f64::consts::TAU;
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

/// Counts of a sweep and its background.
#[derive(Clone, Copy)]
pub struct Input<'a> {
    /// Counts.
    pub counts: &'a StripCounts,
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
        self.rows(input, None, depths, out, |_, u| u.norm_sqr().sqrt())
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
        self.rows(input, Some(shifts), depths, out, |z, u| {
            let u = u * self.centering[z];
            if conjugate { u.conj() } else { u }
        })
    }

    /// Transform all pixels; `take` makes of U at depth z what goes into `out` (z, y, x).
    fn rows<T: Send>(
        &self,
        input: Input<'_>,
        shifts: Option<&[f32]>,
        depths: Range<usize>,
        out: &mut [T],
        take: impl Fn(usize, Complex32) -> T + Sync,
    ) -> Result<()> {
        let Grid { height, width, .. } = self.grid;
        let mut rows: Vec<Vec<&mut [T]>> = (0..height).map(|_| Vec::new()).collect();
        for plane in out.chunks_exact_mut(height * width) {
            for (row, line) in rows.iter_mut().zip(plane.chunks_exact_mut(width)) {
                row.push(line);
            }
        }
        let mut rest = rows.as_mut_slice();
        let mut bands = Vec::new();
        for band in self.grid.bands() {
            let (own, others) = rest.split_at_mut(band.len());
            bands.push((band, own));
            rest = others;
        }
        let way = Way::best(self.images, &depths);
        let wanted = Wanted { depths: &depths, way: &way, shifts };
        bands.par_iter_mut().enumerate().try_for_each_init(
            || Workspace::new(self, depths.len()),
            |workspace, (number, (band, lines))| {
                for first in (0..width).step_by(STRIP) {
                    let strip = Strip { band: band.clone(), number, first };
                    let Workspace { samples, .. } = workspace;
                    self.path.run(RemoveTask {
                        grid: &self.grid,
                        input,
                        strip: &strip,
                        samples,
                    })?;
                    self.transform(wanted, &strip, workspace, lines, &take)?;
                }
                Ok(())
            },
        )
    }

    /// All pixels of a strip, whose samples are free of background.
    fn transform<T>(
        &self,
        wanted: Wanted<'_>,
        strip: &Strip,
        workspace: &mut Workspace,
        lines: &mut [Vec<&mut [T]>],
        take: &impl Fn(usize, Complex32) -> T,
    ) -> Result<()> {
        let Wanted { depths, way, shifts } = wanted;
        let Workspace { samples: lines_of_strip, spectra, scratch, middle, groups } = workspace;
        let (path, width, stride) = (self.path, self.grid.width, self.images + PADDING);
        for (group, row) in self.groups(strip) {
            let x = group.start % width;
            let own = shifts.map(|shifts| padded(&shifts[group.clone()]));
            let samples = Samples {
                table: &self.table,
                lines: lines_of_strip,
                row,
                first: x - strip.first,
                shifts: own.as_ref(),
            };
            match way {
                Way::Few(zoom) => path.run(ZoomTask { zoom, samples, depths: groups })?,
                Way::Many(whole) => {
                    path.run(WholeTask { whole, samples, middle, depths: groups })?;
                }
                Way::Any => {
                    path.run(TurnTask { samples, spectra })?;
                    for spectrum in spectra.chunks_exact_mut(stride).take(group.len()) {
                        self.fft.process_with_scratch(&mut spectrum[..self.images], scratch);
                    }
                }
            }
            let columns = x..x + group.len();
            let lines = lines[row].iter_mut().map(|line| &mut line[columns.clone()]);
            match way {
                Way::Any => {
                    store(lines, depths, take, |i, p| spectra[p * stride + depths.start + i])
                }
                _ => store(lines, depths, take, |i, p| groups[i].pixel(p)),
            }
        }
        Ok(())
    }

    /// Pixels (y, x) that are turned together, row after row of a strip, and the row in its band.
    fn groups(&self, strip: &Strip) -> impl Iterator<Item = (Range<usize>, usize)> {
        let (width, first) = (self.grid.width, strip.first);
        let end = (first + STRIP).min(width);
        strip.band.clone().enumerate().flat_map(move |(row, y)| {
            let starts = (first..end).step_by(GROUP);
            starts.map(move |x| (y * width + x..y * width + (x + GROUP).min(end), row))
        })
    }
}

/// How depths are made of samples.
enum Way {
    Few(Zoom),
    Many(Whole),
    /// Pixel by pixel.
    Any,
}

impl Way {
    fn best(images: usize, depths: &Range<usize>) -> Self {
        let few = Zoom::new(images, depths.clone()).map(Self::Few);
        let many = || Whole::new(images, depths.clone()).map(Self::Many);
        few.or_else(many).unwrap_or(Self::Any)
    }
}

/// What is wanted of all pixels.
#[derive(Clone, Copy)]
struct Wanted<'a> {
    depths: &'a Range<usize>,
    way: &'a Way,
    /// Axial shift of every pixel (y, x).
    shifts: Option<&'a [f32]>,
}

/// A group's numbers; it may be short.
fn padded(numbers: &[f32]) -> [f32; GROUP] {
    let mut own = [0.0; GROUP];
    own[..numbers.len()].copy_from_slice(numbers);
    own
}

/// What `take` makes of `u` (i-th depth, p-th pixel) into a group's part of each depth's row.
fn store<'a, T: 'a>(
    lines: impl Iterator<Item = &'a mut [T]>,
    depths: &Range<usize>,
    take: &impl Fn(usize, Complex32) -> T,
    u: impl Fn(usize, usize) -> Complex32,
) {
    for (i, (line, z)) in lines.zip(depths.clone()).enumerate() {
        line.iter_mut().enumerate().for_each(|(p, value)| *value = take(z, u(i, p)));
    }
}

/// Buffers of one thread.
struct Workspace {
    /// Background-free samples of a strip, (m, row).
    samples: Vec<Line>,
    /// (pixel, m), each with its padding.
    spectra: Vec<Complex32>,
    scratch: Vec<Complex32>,
    /// Between the two rounds of `whole`.
    middle: Vec<Group>,
    /// A group of pixels at each depth.
    groups: Vec<Group>,
}

impl Workspace {
    fn new(transform: &Transform, depths: usize) -> Self {
        let Transform { images, fft, .. } = transform;
        Self {
            samples: vec![Line([0.0; STRIP]); images * BLOCK],
            spectra: vec![Complex32::default(); GROUP * (images + PADDING)],
            scratch: vec![Complex32::default(); fft.get_inplace_scratch_len()],
            middle: vec![Group::default(); *images],
            groups: vec![Group::default(); depths.max(POINTS)],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::window::Window;
    use super::*;
    use std::f64::consts::PI;

    /// One reflector per pixel at depth d0 + x/10 with phase theta, dispersed, on a source with fixed
    /// fringes; background given.
    fn transformed(
        images: usize,
        path: Path,
        direction: Direction,
        shift: impl Fn(usize) -> f32,
    ) -> Vec<Complex32> {
        let (height, width) = (3, 70);
        let grid = Grid::new(height, width);
        let dispersion = Dispersion { a2: 9.0, a3: -4.0 };
        let sign = if direction == Direction::Up { 1.0 } else { -1.0 };
        let mut counts = StripCounts::new(images, grid).unwrap();
        let record = |m: usize, image: &mut [u16]| {
            let q = band_coordinate(m, images);
            for (i, count) in image.iter_mut().enumerate() {
                let x = i % width;
                let theta = 0.4 + 0.01 * x as f64;
                let phase = PI * (30.0 + 0.1 * x as f64) * q + dispersion.phase(q) + sign * theta;
                *count = (20_000.0 + 30.0 * q + 8000.0 * phase.cos()).round() as u16;
            }
            Ok(())
        };
        let _ = counts.load(record, |_| Ok(())).unwrap();
        let source: Vec<f32> =
            (0..images).map(|m| 20_000.0 + 30.0 * band_coordinate(m, images) as f32).collect();
        let illumination = vec![1.0; height * width];
        let fixed = vec![0.0; images * grid.blocks()];
        let input =
            Input { counts: &counts, source: &source, illumination: &illumination, fixed: &fixed };
        let window = Window::Hann.weights(images);
        let transform = Transform::new(grid, &window, &dispersion, direction).unwrap();
        let transform = Transform { path, ..transform };
        let shifts: Vec<f32> = (0..height * width).map(|i| shift(i % width)).collect();
        let mut out = vec![Complex32::default(); 64 * height * width];
        transform.fields(input, 0..64, &shifts, &mut out).unwrap();
        let mut amplitudes = vec![0.0; 64 * height * width];
        transform.amplitudes(input, 0..64, &mut amplitudes).unwrap();
        let mut few = vec![Complex32::default(); 16 * height * width];
        transform.fields(input, 13..29, &shifts, &mut few).unwrap();
        let largest = out.iter().map(|u| u.norm()).fold(0.0, f32::max);
        let same = few.iter().zip(&out[13 * height * width..]);
        assert!(same.map(|(a, b)| (a - b).norm()).fold(0.0, f32::max) < 3e-6 * largest);
        let place = (30 * height + 1) * width;
        assert!(amplitudes[place] > 0.5 * 8000.0 / 2.0 * images as f32 / 2.0);
        out
    }

    /// Flattened by its own depth each reflector is at 20 with its phase, for both directions.
    #[test]
    fn a_shift_moves_the_reflector_and_not_its_phase() {
        // Pixel by pixel, and 16 together with one and two terms for each depth.
        let directions = [Direction::Up, Direction::Down];
        let cases =
            [128, 256, 512].iter().flat_map(|k| directions.map(|direction| (*k, direction)));
        for (images, direction) in cases {
            for path in Path::available() {
                let out = transformed(images, path, direction, |x| 10.0 + 0.1 * x as f32);
                for x in [0, 1, 37, 63, 64, 69] {
                    let at = |z: usize| out[(z * 3 + 1) * 70 + x];
                    let expected = 8000.0 / 2.0 * images as f32 / 2.0;
                    assert!(
                        (at(20).norm() / expected - 1.0).abs() < 0.01,
                        "{x}: {}",
                        at(20).norm()
                    );
                    let phase = at(20).arg() - (0.4 + 0.01 * x as f32);
                    assert!(phase.abs() < 2e-3, "{direction:?} {x}: {phase}");
                    assert!((at(19).norm() - at(21).norm()).abs() < 0.01 * expected);
                    assert!((at(21).arg() - at(20).arg()).abs() < 0.01, "no carrier");
                }
            }
        }
    }
}
